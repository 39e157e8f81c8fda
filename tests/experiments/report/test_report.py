"""Report, tables and montages of a run agree with each other and with the store."""

import pandas as pd
import pytest
from experiments.run.grid_experiment import run_plan, write_results
from PIL import Image

from experiments.cli.commands import show
from experiments.report.montage import COLUMNS, LEAST_WIDTH
from experiments.report.preview import GAP, LABEL_HEIGHT
from experiments.report.summary import summary
from experiments.report.tables import print_summary
from experiments.run.store import Store
from experiments.wu2025.table1 import EXPERIMENT
from samplers import EnvlightError


def test_measurements_csv_holds_every_row_with_all_digits(finished):
    table = pd.read_csv(finished / "measurements.csv").set_index("key")
    with Store.reading(finished) as store:
        stored = {key: result for key, _, result in store.rows()}
    assert set(table.index) == set(stored)
    for key, result in stored.items():
        for name, value in result.items():
            if not isinstance(value, list):
                assert table.loc[key, name] == value


def test_summary_csv_is_the_summary_of_measurements_csv(finished):
    again = summary(pd.read_csv(finished / "measurements.csv"))
    written = pd.read_csv(finished / "summary.csv")[list(again)]
    pd.testing.assert_frame_equal(again, written, check_dtype=False, rtol=1e-14)


def test_the_report_prints_the_summary(finished):
    report = (finished / "report.md").read_text(encoding="utf-8")
    table = pd.read_csv(finished / "summary.csv")
    assert "(incomplete)" not in report
    assert "25 of 25 measurements finished" in report
    lines = [line for line in report.splitlines() if line.startswith("| ")][1 : 1 + len(table)]
    for line, row in zip(lines, table.itertuples(), strict=True):
        measurements = [measurement.strip() for measurement in line.strip("|").split("|")]
        assert measurements[0] == row.sampler
        assert measurements[1:3] == [f"{row.rmse:.4f}", f"{row.rmse_rank:.2f}"]
        assert measurements[5:7] == [f"{row.flip:.4f}", f"{row.flip_rank:.2f}"]


def test_the_printed_table_shows_all_digits_in_80_columns(finished, capsys, monkeypatch):
    table = pd.read_csv(finished / "summary.csv")
    table["sampler"] = "variance-minimization"
    table[["rmse_rank", "flip_rank"]] = 10.25
    table["seconds_lights"] = table["seconds_render"] = 12.3456
    for terminal in ("", "1"):
        monkeypatch.setenv("FORCE_COLOR", terminal)
        monkeypatch.setenv("COLUMNS", "80")
        print_summary(table, "t")
        printed = capsys.readouterr().out
        assert "…" not in printed
        for row in table.itertuples():
            assert f"{row.rmse:.4f}" in printed
            assert f"{row.flip:.4f}" in printed
        assert "12345.6" in printed


def test_every_case_has_a_montage_of_the_right_size(finished, environments):
    pictures = 1 + 3
    enlarge = -(-LEAST_WIDTH // 24)
    width, height = 24 * enlarge, 18 * enlarge
    columns = min(COLUMNS, pictures)
    rows = -(-pictures // columns)
    size = (columns * (width + GAP) + GAP, rows * (height + LABEL_HEIGHT + GAP) + GAP)
    for source in environments:
        with Image.open(finished / "montages" / f"three-boxes_{source.name}_lights=4.png") as image:
            assert image.size == size
            assert image.getextrema() != ((24, 24),) * 3  # more than bare paper
    assert len(list((finished / "montages").iterdir())) == len(environments)


def test_an_unfinished_run_names_its_gaps(copied, grid, measurements_of):
    measurements = grid.measurements()
    gone = [measurement.key for measurement in measurements_of(("sun",), ("mis",))]
    with Store.writing(copied) as store:
        store._connection.executemany(
            "DELETE FROM measurement WHERE key = ?", [(key,) for key in gone]
        )
        report, csv, _ = write_results(EXPERIMENT, store, measurements, images=False)
    text = report.read_text(encoding="utf-8")
    assert text.startswith("# Table 1 at scale tiny (incomplete)")
    assert "22 of 25 measurements finished" in text
    assert "- mis: three-boxes · sun\n" in text
    assert "2 finished measurements are therefore left out" in text  # median-cut and uniform on sun
    whole = pd.read_csv(copied / "measurements.csv")
    expected = summary(whole[whole["environment"] != "sun"])
    table = pd.read_csv(csv)[list(expected)]
    assert list(table["maps"]) == [4, 4, 4]
    pd.testing.assert_frame_equal(table, expected, check_dtype=False, rtol=1e-14)


def test_repairs_stand_in_the_report(copied, grid):
    with Store.writing(copied) as store:
        store._connection.execute(
            "UPDATE measurement SET result = replace(result, '\"repaired\": 0', '\"repaired\": 7') "
            "WHERE result LIKE '%\"sun\"%'"
        )
        report, *_ = write_results(EXPERIMENT, store, grid.measurements(), images=False)
    assert "were clamped in: sun (7)." in report.read_text(encoding="utf-8")


def test_other_plans_in_the_folder_do_not_mix(copied, grid, measurements_of, capsys):
    few = measurements_of(("noise",))
    with Store.writing(copied) as store:
        assert run_plan(EXPERIMENT, store, few, images=False) == 0
    assert len(pd.read_csv(copied / "measurements.csv")) == len(few)
    capsys.readouterr()
    show(copied, [])
    shown = capsys.readouterr().out
    assert f"{len(few)} of {len(few)} measurements of the newest start are finished" in shown
    assert f"{25 - len(few)} measurements of other plans; 2 starts" in shown


def test_show_tells_what_determines_a_measurement(finished, grid, capsys):
    measurement = grid.measurements()[0]
    show(finished, [measurement.key[:10]])
    printed = capsys.readouterr().out
    assert '"budget": "lights=4"' in printed
    assert measurement.case.environment.identity["file"] in printed
    for key in ("zzz", "nokey"):
        with pytest.raises(EnvlightError, match="0 measurements have a key"):
            show(finished, [key])
