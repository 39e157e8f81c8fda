"""The page that says what columns are names those that published rows have, and no other."""

import re
from pathlib import Path

import experiments
from experiments.report.summary import rank_column

RESULTS = Path(__file__).parents[3] / "results"


def test_the_page_of_columns_is_that_of_the_rows():
    page = (RESULTS / "columns.md").read_text(encoding="utf-8")
    told = {name for line in page.splitlines() for name in re.findall(r"^\| (`.*?`) \|", line)}
    told = {name for names in told for name in re.findall(r"`(\w+)`", names)}
    runs = [experiments.load_run(file.parent) for file in RESULTS.rglob("run.json")]
    grids = [run for run in runs if "scale" in run.record]
    assert grids
    assert told == {name for run in grids for name in run.rows.columns}


def test_every_csv_file_of_a_run_is_told():
    page = (RESULTS.parent / "experiments" / "README.md").read_text(encoding="utf-8")
    told = set(re.findall(r"`(\w+)`", " ".join(re.findall(r"^\| (`.*?`) \|", page, re.MULTILINE))))
    runs = (file.parent for file in RESULTS.rglob("run.json"))
    made = {file.stem for run in runs for file in run.glob("*.csv")}
    assert made and made == told


def test_a_published_folder_is_a_table_in_python():
    run = experiments.load_run(RESULTS / "table2")
    assert "table2" in repr(run) and "<table" in run._repr_html_()
    table = experiments.summary(run.rows)
    assert set(table["sampler"]) == set(run.rows["sampler"])
    assert table[rank_column("rmse")].between(1.0, len(table)).all()
