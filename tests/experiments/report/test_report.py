"""Report, tables and montages of a run agree with each other and with the store."""

import json
import shutil
from dataclasses import replace
from functools import partial

import numpy as np
import pandas as pd
import pytest
from PIL import Image

from experiments.cli.commands import finish, show
from experiments.report.case_figures import MONTAGE_COLUMNS, write_montages
from experiments.report.pages.write import write_report_pages
from experiments.report.parts import Table
from experiments.report.sections.ranks import pairwise
from experiments.report.summary import errors_in, summary
from experiments.report.tables import as_markdown, as_plain, print_summary
from experiments.report.write import sections, tables_of, write_report
from experiments.run.experiment import GridExperiment
from experiments.run.identity import source_digest
from experiments.run.kept_images import image_path, reference_path
from experiments.run.loaded_run import Run, add_to_record
from experiments.run.measurement import Measurement
from experiments.run.runner import write_rows
from experiments.run.sampler_spec import SamplerSpec
from experiments.run.store import IMAGE, Store
from experiments.wu2025.table1 import table1
from metrics import registry
from metrics.registry import Metric, register
from samplers.environment import Repair
from samplers.preview import GAP, LEAST_LABEL, LEAST_WIDTH
from tests.experiments.stored import alter_result, damage, forget, plan_of, run_plan


def test_a_table_without_rows_has_its_headings():
    table = Table("none", pd.DataFrame({"word": [], "number": []}), {"word": "s", "number": "d"})
    assert as_markdown(table).startswith("| word")
    assert "number" in as_plain(table)


def test_summary_csv_is_the_summary_of_measurements_csv(finished):
    again = summary(pd.read_csv(finished / "measurements.csv"))
    written = pd.read_csv(finished / "summary.csv")
    for column in (*errors_in(again), *(f"{name}_rank" for name in errors_in(again)), "rays"):
        np.testing.assert_allclose(written[column], again[column], rtol=1e-14)
    np.testing.assert_allclose(written["render_ms"], 1e3 * again["seconds_render"], rtol=1e-14)
    assert list(written["sampler"]) == list(again["sampler"])


def test_the_printed_table_shows_all_digits_in_80_columns(finished, capsys, monkeypatch):
    table = summary(pd.read_csv(finished / "measurements.csv"))
    table["sampler"] = "variance-minimization"
    table[[f"{name}_rank" for name in errors_in(table)]] = 10.25
    table["seconds_lights"] = table["seconds_render"] = 12.3456
    for terminal in ("", "1"):
        monkeypatch.setenv("FORCE_COLOR", terminal)
        monkeypatch.setenv("COLUMNS", "80")
        print_summary(table, "t")
        printed = capsys.readouterr().out
        assert "…" not in printed
        for name in errors_in(table):
            assert all(f"{value:.4f}" in printed for value in table[name])
        assert "12345.6" in printed
        assert ("variance-minimization" in printed) == bool(terminal)


def test_a_third_metric_is_everywhere(copied, grid, maps_folder, capsys):
    """Registered, it is ranked: in the report, on the terminal, in plots and on pages."""

    def mean(image, truth):
        return float(np.abs(image.astype(np.float64) - truth.image).mean())

    register(Metric("mean_error", "mean error", lambda image, truth: mean(image, truth),
                    ranked=True, error_map=lambda image, truth: np.abs(image - truth.image).mean(
                        axis=2).clip(0, 1)))  # fmt: skip
    try:
        again = [Measurement(m.case, m.sampler, m.budget, m.seed) for m in grid.measurements()]
        with Store.writing(copied) as store:
            assert run_plan(table1(), store, again, partial(finish, images=False)) == 0
        printed = capsys.readouterr().out
        index = write_report_pages(copied).read_text(encoding="utf-8")
        pages = list((copied / "report/runs").rglob("cases/*.html"))
        run = Run.load(copied)
        pairs = tables_of(sections(GridExperiment(title="", sections=(pairwise,)), run))
    finally:
        del registry._registry["mean_error"]
    report = (copied / "report.md").read_text(encoding="utf-8")
    (headings, *_) = [line for line in report.splitlines() if line.startswith("|")]
    assert "mean error" in headings and headings.count("rank") == 3
    assert "by mean error" in report
    assert "mean error" in printed
    assert "<span>mean error</span>" in index
    assert all('"label": "mean error"' in page.read_text(encoding="utf-8") for page in pages)
    kinds = {path.stem.partition("_")[0] for path in copied.glob("*_mean_error*.svg")}
    assert kinds == {"rank", "pairs", "cd"}
    rows = pd.read_csv(copied / "measurements.csv")
    means = rows.groupby(["sampler", "environment"])["mean_error"].mean().unstack("sampler")
    ranks = means.rank(axis=1, method="min").mean()
    table = pd.read_csv(copied / "summary.csv").set_index("sampler")
    assert table["mean_error_rank"].to_dict() == pytest.approx(ranks.to_dict())
    assert {name for one in pairs for name in one.rows["metric"]} >= {"mean_error"}


def test_every_case_has_a_montage_of_the_right_size(finished, environments):
    pictures = 1 + 3
    enlarge = -(-LEAST_WIDTH // 24)
    width, height = 24 * enlarge, 18 * enlarge
    columns = min(MONTAGE_COLUMNS, pictures)
    rows = -(-pictures // columns)
    size = (columns * (width + GAP) + GAP, rows * (height + LEAST_LABEL * 3 // 2 + GAP) + GAP)
    for source in environments:
        with Image.open(finished / "montages" / f"three-boxes_{source.name}_lights=4.png") as image:
            assert image.size == size
            assert image.getextrema() != ((24, 24),) * 3  # more than bare paper
    assert len(list((finished / "montages").iterdir())) == len(environments)


def test_an_unfinished_run_names_its_gaps(copied, grid, measurements_of):
    measurements = grid.measurements()
    gone = [measurement.key for measurement in measurements_of(("sun",), ("mis",))]
    with Store.writing(copied) as store:
        for key in gone:
            forget(store, key)
        write_rows(plan_of(table1(), measurements), store, {})
    write_report(table1(), Run.load(copied))
    text = (copied / "report.md").read_text(encoding="utf-8")
    assert text.startswith("# Table 1 at scale tiny (incomplete)")
    assert "22 of 25 measurements, 5 maps" in text
    assert "- MIS (Veach 1995): three-boxes · sun\n" in text
    # Those of median-cut and uniform on sun.
    assert "2 finished measurements are therefore left out there" in text
    whole = pd.read_csv(copied / "measurements.csv")
    expected = summary(whole[whole["environment"] != "sun"])
    table = pd.read_csv(copied / "summary.csv")
    assert list(table["maps"]) == [4, 4, 4]
    for name in errors_in(expected):
        np.testing.assert_allclose(table[name], expected[name], rtol=1e-14)


def test_damaged_images_are_left_out_of_pictures_and_told(copied, measurements_of, capsys):
    (lost,) = measurements_of(("noise",), ("uniform",))
    (other,) = measurements_of(("sun",), ("uniform",))
    places = image_path(copied, lost), reference_path(copied, other.case)
    for place in places:
        damage(place, "cut short")
    shutil.rmtree(copied / "montages")
    write_montages(Run.load(copied))
    assert len(list((copied / "montages").iterdir())) == 4  # of five cases
    told = capsys.readouterr().err
    for place in places:
        assert told.count(str(place)) == 1
    assert told.count("it is left out of all pictures") == 2
    assert told.count(f"; without images/{lost.key[:2]}/{lost.key[:8]}*.exr in its store, the") == 1


def test_repairs_stand_in_the_report(copied, grid):
    with Store.writing(copied) as store:
        for one in store.results(IMAGE):
            if one.result["environment"] == "sun":
                alter_result(store, one.key, repaired=7)
        write_rows(plan_of(table1(), grid.measurements()), store, {})
    run = Run.load(copied)
    write_report(table1(), run)
    text = (copied / "report.md").read_text(encoding="utf-8")
    assert "were repaired in: sun (7 values)." in text
    told = str(Repair(0, 7, 0, 65504.0, 0.5))
    write_report(table1(), Run(run.folder, run.rows, {**run.record, "repairs": {"sun": told}}))
    text = (copied / "report.md").read_text(encoding="utf-8")
    assert "sun (7 values changed: 7 infinite became 65504; the flux is +50 % against" in text


FINISH = partial(finish, images=False)


def files_of_report(folder):
    """Tables, plots and report, this without how busy the machine was at the end."""
    return {
        file.name: [
            line for line in file.read_bytes().splitlines() if b"were taken once" not in line
        ]
        for file in folder.iterdir()
        if file.suffix in (".md", ".csv", ".tex", ".svg")
    }


def test_a_narrower_command_changes_no_table(copied, measurements_of, capsys):
    before, record = files_of_report(copied), Run.load(copied).record
    few = measurements_of(("noise",), ("uniform", "mis"))
    for _ in range(2):
        with Store.writing(copied) as store:
            assert run_plan(table1(), store, few, FINISH) == 0
    after, again = files_of_report(copied), Run.load(copied).record
    assert after == before
    for name in ("samplers", "budgets", "planned", "missing", "bad_maps", "report_files"):
        assert again[name] == record[name], name
    capsys.readouterr()
    show(copied)
    shown = capsys.readouterr().out
    assert "25 of 25 measurements of its plan are finished; 25 in the store" in shown


def test_what_else_is_measured_is_added(tmp_path, measurements_of):
    """Maps and samplers one after another; what a sampler has not been measured on is told."""
    plans = [(("noise",), ("uniform",)), (("noise", "sun"), ("mis",)), (("sun",), ("uniform",))]
    missing = [{}, {"uniform": ["three-boxes · sun"]}, {}]
    rows = 0
    for (maps, samplers), gaps in zip(plans, missing, strict=True):
        few = measurements_of(maps, samplers)
        with Store.writing(tmp_path / "run") as store:
            assert run_plan(table1(), store, few, FINISH, images=False) == 0
        rows, run = rows + len(few), Run.load(tmp_path / "run")
        assert len(run.rows) == run.record["planned"] == rows
        assert run.record["missing"] == gaps
    assert run.record["samplers"] == ["uniform", "mis"]


def test_rows_of_other_programs_leave_the_tables_and_say_so(
    copied, measurements_of, monkeypatch, capsys
):
    """Another MIS would measure its rows otherwise: none of the old stands beside the new."""
    few = measurements_of(("noise",), ("median-cut",))
    mis = type(SamplerSpec("mis").sampler).__module__

    def changed(module):
        return "another" if module == mis else source_digest(module)

    monkeypatch.setattr("experiments.run.runner.source_digest", changed)
    with Store.writing(copied) as store:
        assert run_plan(table1(), store, few, FINISH) == 0
    assert "15 rows in" in (told := capsys.readouterr().err) and "not in its tables" in told
    assert set(Run.load(copied).rows["sampler"]) == {"median-cut", "uniform"}
    assert Run.load(copied).record["samplers"] == ["median-cut", "uniform"]
    with Store.reading(copied) as store:
        assert store.count(IMAGE) == 25


def test_a_measurement_that_is_made_anew_stands_once(copied, measurements_of):
    """As one at another map's content does, which has the same name."""
    noise, other = measurements_of(("noise",), ("uniform",)), measurements_of(("other",))
    case = replace(
        noise[0].case, environment=replace(other[0].case.environment, name="noise")
    )  # fmt: skip
    with Store.writing(copied) as store:
        again = [Measurement(case, noise[0].sampler, noise[0].budget, 0)]
        assert run_plan(table1(), store, again, FINISH, images=False) == 0
    rows = Run.load(copied).rows
    assert len(rows) == 25 and not rows.duplicated(["environment", "sampler", "seed"]).any()
    assert again[0].key in set(rows["key"])


def test_stale_files_of_a_report_go_and_others_stay(copied):
    for name in ("stale.csv", "mine.csv", "rows.csv"):
        (copied / name).write_text("a\n1\n")
    listed = Run.load(copied).record["report_files"]
    assert "report.md" in listed and "summary.csv" in listed
    outside = copied.parent / "outside.csv"
    outside.write_text("a")
    add_to_record(copied, {"report_files": [*listed, "stale.csv", "../outside.csv",
                                            "measurements.csv", "run.json"]})  # fmt: skip
    write_report(table1(), Run.load(copied))
    assert not (copied / "stale.csv").exists()
    assert (copied / "mine.csv").exists() and outside.exists()
    assert Run.load(copied).record["report_files"] == listed


def test_a_damaged_record_is_as_none(copied):
    run = Run.load(copied)
    (copied / "run.json").write_text('{"a":')
    assert (copied / "report.md") in write_report(table1(), run)
    assert (copied / "run.json").read_text() == '{"a":'


def test_what_was_in_the_folder_before_its_first_report_stays(copied, capsys):
    run = Run.load(copied)
    for name in run.record["report_files"]:
        (copied / name).unlink()
    record = {name: what for name, what in run.record.items() if name != "report_files"}
    (copied / "run.json").write_text(json.dumps(record), encoding="utf-8")
    for name in ("summary.csv", "cd_flip_lights4.svg"):
        (copied / name).write_text("mine", encoding="utf-8")
    for _ in range(2):
        write_report(table1(), Run.load(copied))
        for name in ("summary.csv", "cd_flip_lights4.svg"):
            assert (copied / name).read_text(encoding="utf-8") == "mine"
            assert name not in Run.load(copied).record["report_files"]
        assert capsys.readouterr().err.count("was not made here") == 2
    assert (copied / "summary.tex").is_file()


def test_a_report_that_was_cut_short_is_written_over(copied, capsys, monkeypatch):
    run = Run.load(copied)
    for name in run.record["report_files"]:
        (copied / name).unlink()
    record = {name: what for name, what in run.record.items() if name != "report_files"}
    (copied / "run.json").write_text(json.dumps(record), encoding="utf-8")

    def cut(*_):
        (copied / "summary.csv").write_text("as it was", encoding="utf-8")
        raise KeyboardInterrupt

    with monkeypatch.context() as patched:
        patched.setattr("experiments.report.write.write_tables", cut)
        with pytest.raises(KeyboardInterrupt):
            write_report(table1(), Run.load(copied))
    write_report(table1(), Run.load(copied))
    assert "not made here" not in capsys.readouterr().err
    assert (copied / "summary.csv").read_text(encoding="utf-8") != "as it was"
    assert Run.load(copied).record["report_files"] == run.record["report_files"]
