"""What is published is enough to make its tables, plots and page again, to the byte."""

import csv
import gzip
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from experiments.cli import commands
from experiments.report import figures, publish
from experiments.report.suite import together
from experiments.run.experiment import RunRequest
from experiments.run.loaded_run import (
    PACKED_ROWS,
    RECORD,
    Run,
    found_or_kept,
    read_run,
    write_csv,
    write_run,
)
from experiments.wu2025 import table1
from samplers import EnvlightError

OPTIONS = RunRequest("discrepancy", images=False)
RESULTS = Path(__file__).parents[3] / "results"


@pytest.fixture(scope="session")
def study(tmp_path_factory):
    """The folder of a finished study."""
    folder = tmp_path_factory.mktemp("discrepancy")
    assert commands.run(replace(OPTIONS, output=folder), False) == 0
    return folder


@pytest.mark.parametrize("kind", ["finished", "study"])
def test_tables_come_back_with_the_same_bytes(
    kind, request, tmp_path, monkeypatch, suffixes_of_plots
):
    run: Path = request.getfixturevalue(kind)
    target = tmp_path / "results" / "name"
    publish.publish(run, target)
    before = _contents(target)
    kept = (PACKED_ROWS, RECORD, table1.FILE)  # from images, or the rows
    made = [file for file in before if file.name not in kept]
    assert {file.suffix for file in made} >= {".md", ".csv", ".tex"}
    for file in made:
        file.unlink()
    monkeypatch.setattr(figures, "SUFFIXES", suffixes_of_plots)
    publish.tabulate(target)
    assert _contents(target) == before  # and none of the plots in other formats


def _contents(folder: Path) -> dict[Path, bytes]:
    return {file: file.read_bytes() for file in folder.rglob("*") if file.is_file()}


def test_images_stay_behind(finished, tmp_path):
    files = publish.publish(finished, tmp_path / "p")
    names = {file.relative_to(tmp_path / "p").as_posix() for file in files}
    assert {"measurements.csv.gz", "run.json", "report.md", "summary.csv"} <= names
    assert not any(name.endswith((".exr", ".sqlite")) or "/" in name for name in names)
    drawn = {file.name for file in finished.glob("*.svg")}
    assert drawn and drawn <= names  # as SVG alone
    assert not any(name.endswith((".png", ".pdf")) for name in names)


def test_publishing_again_removes_what_it_published_and_nothing_else(copied, tmp_path):
    (copied / "old_table.csv").write_text("a\n1\n")
    publish.publish(copied, tmp_path / "p", compare=["sun"])
    before = set(_contents(tmp_path / "p"))
    mine = [tmp_path / "p" / name for name in ("notes.md", "compared/notes.md", ".hidden")]
    for file in mine:
        file.write_text("mine")
    (copied / "old_table.csv").unlink()
    publish.publish(copied, tmp_path / "p")
    gone = before - set(_contents(tmp_path / "p"))
    assert {file.name for file in gone} >= {"old_table.csv"} and ".webp" in {f.suffix for f in gone}
    assert {file for file in before if "compared" in file.parts} <= gone
    assert [file.read_text() for file in mine] == ["mine"] * 3


def test_rows_of_a_publication_are_not_lost_without_force(copied, finished, tmp_path):
    target = tmp_path / "p"
    publish.publish(finished, target)
    before = _contents(target)
    rows, record = read_run(copied)
    few = rows[rows["environment"] == "sun"]
    other = rows.assign(environment=rows["environment"] + " at noon")
    for changed, facts, sentence in (
        (few, {}, "20 of the 25 rows there are not in this run, which has 5"),
        (pd.concat([rows[:20], other]), {}, "5 of the 25 rows there are not in this run"),
        (rows, {"experiment": "table2"}, "it holds a run of table1, and this one is of table2"),
    ):
        write_run(copied, changed, {**record, **facts})
        with pytest.raises(EnvlightError, match=sentence):
            publish.publish(copied, target)
        assert _contents(target) == before
    write_run(copied, few, record)
    publish.publish(copied, target, force=True)
    assert len(Run.load(target).rows) == 5
    (target / PACKED_ROWS).write_bytes(b"rmse")
    with pytest.raises(EnvlightError, match=r"do not fit each other.*--force replaces it"):
        publish.publish(finished, target)
    publish.publish(finished, target, force=True)
    assert len(Run.load(target).rows) == 25


def test_the_page_is_not_written_over_another(finished, tmp_path):
    publish.publish(finished, tmp_path / "p")
    (tmp_path / publish.PAGE).write_text("# Ten years of work\n")
    with pytest.raises(EnvlightError, match="not a page of published results"):
        publish.write_results_page(tmp_path)
    (tmp_path / publish.PAGE).unlink()
    for _ in range(2):
        publish.write_results_page(tmp_path)


def test_other_folders_are_never_overwritten(finished, tmp_path):
    (tmp_path / "thesis.md").write_text("ten years of work")
    with pytest.raises(EnvlightError, match="no earlier publication"):
        publish.publish(finished, tmp_path)
    with pytest.raises(EnvlightError, match="which this command reads, is there"):
        publish.publish(finished, finished)
    with pytest.raises(EnvlightError, match="it is inside the run"):
        publish.publish(finished, finished / "published")
    assert [file.name for file in tmp_path.iterdir()] == ["thesis.md"]


def test_what_holds_no_run_is_refused(tmp_path, finished):
    with pytest.raises(EnvlightError, match=r"it has no run\.json"):
        publish.tabulate(tmp_path)
    publish.publish(finished, tmp_path / "p")
    measurements = tmp_path / "p" / PACKED_ROWS
    whole = measurements.read_bytes()
    renamed = gzip.compress(gzip.decompress(whole).replace(b"rmse", b"error"))
    turned = bytes([*whole[:200], whole[200] ^ 255, *whole[201:]])
    for bad in (renamed, turned, whole[: len(whole) // 2], b"rmse"):
        measurements.write_bytes(bad)
        with pytest.raises(EnvlightError, match="do not fit each other"):
            publish.tabulate(tmp_path / "p")


def test_rows_are_read_as_they_were_written(tmp_path):
    rows = pd.DataFrame(
        {
            "name": ["001", "nan", "NA", 'a,"b"\n', "=1+1", "'a", "-0.5", "é\nå"],
            "value": [0.1, float("nan"), float("inf"), -1e-300, 1.0, -1.0, 0.0, 2.0],
            "count": range(8), "mark": [True, False] * 4,
        }
    )  # fmt: skip
    write_run(tmp_path, rows, {"experiment": "x"})
    again, record = read_run(tmp_path)
    pd.testing.assert_frame_equal(again, rows, check_exact=True)
    assert record["experiment"] == "x"


TEXTS = ["=1+1", "-a", "@a", "\ta", "'=1", "''@a", "'a", "-0.5", "-inf", "+3", "a=b", "-", "'"]


def test_no_cell_is_a_formula_and_all_texts_come_back(tmp_path):
    """A spreadsheet takes what begins with =, +, - or @ for one; numbers stay as they are."""
    rows = pd.DataFrame({"=name": TEXTS, "value": np.linspace(-1.0, 1.0, len(TEXTS))})
    write_csv(tmp_path / "table.csv", rows)
    with (tmp_path / "table.csv").open(newline="", encoding="utf-8") as file:
        heading, *lines = csv.reader(file)
    assert heading == ["'=name", "value"]
    for cell, _ in lines:
        assert cell[:1] not in ("=", "+", "-", "@", "\t") or cell in ("-0.5", "-inf", "+3")
    assert [float(value) for _, value in lines] == rows["value"].to_list()
    pd.testing.assert_frame_equal(found_or_kept(tmp_path / "table.csv", pd.DataFrame()), rows)
    rows = rows.rename(columns={"=name": "name"})
    write_run(tmp_path, rows, {"experiment": "x"})
    pd.testing.assert_frame_equal(read_run(tmp_path)[0], rows)


def test_the_published_page_is_what_the_command_makes():
    made = (RESULTS / publish.PAGE).read_text(encoding="utf-8")
    assert made == publish.results_page(RESULTS), "make it again: envlight results-page results"


def test_the_page_can_be_read_and_has_a_line_for_every_folder():
    text = (RESULTS / publish.PAGE).read_text(encoding="utf-8")
    _, opening, *_ = text.split("\n## ")
    assert opening.startswith("Which sampler, in which time?")
    assert len(text.splitlines()) <= 150
    for run in publish.published_runs(RESULTS):
        link = f"]({run.folder.relative_to(RESULTS).as_posix()}/report.md)"
        lines = [one for one in text.splitlines() if link in one]
        assert len(lines) >= len(together(run)) and not any(line.endswith(":") for line in lines)


def test_a_run_inside_one_of_its_experiment_is_told_in_its_report(finished, tmp_path):
    whole, part = tmp_path / "group" / "whole", tmp_path / "group" / "whole" / "part"
    publish.publish(finished, whole)
    publish.publish(finished, part)
    assert {file.name for file in part.iterdir()} == {PACKED_ROWS, RECORD}
    (run,) = publish.published_runs(tmp_path)
    assert run.folder == whole and [one.folder for one in together(run)] == [whole, part]
    before = _contents(whole)
    text = (whole / "report.md").read_text(encoding="utf-8")
    assert text.count("25 of 25 measurements") == 2 and "## part" in text
    assert publish.tabulate(part) and _contents(whole) == before
    publish.publish(finished, whole)  # the part stays, and is told again
    assert _contents(whole) == before
    assert publish.results_page(tmp_path).count("([whole](group/whole/report.md)") == 2
