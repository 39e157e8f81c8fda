"""What the page says of each table and figure of the papers follows from the rows."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import pandas as pd
import pytest

from experiments.report.across_runs import figures_of_papers
from experiments.report.publish import published_runs
from experiments.run.experiment import ANSWERS
from experiments.run.loaded_run import Run
from experiments.run.registry import find_experiment

RESULTS = Path(__file__).parents[2] / "results"
OWN = {"sampler": "ours"}
Chosen = dict[str, str]


def scaled(rows: pd.DataFrame, chosen: Chosen, factor: float, columns: str) -> pd.DataFrame:
    """The rows with some columns of the chosen ones multiplied."""
    of = pd.Series(True, rows.index)
    for column, value in chosen.items():
        of &= rows[column] == value
    rows = rows.copy()
    for column in columns.split():
        rows[column] = rows[column].where(~of, rows[column] * factor)
    return rows


@cache
def published(folder: str) -> Run:
    return Run.load(next(RESULTS.rglob(f"{folder}/run.json")).parent)


def words(run: Run, number: str) -> tuple[str, str]:
    (figure,) = (
        one for one in find_experiment(run.record["experiment"]).figures if one.number == number
    )
    return figure.verdict(run)


HUGE, TINY = 1e6, 1e-6


@pytest.mark.parametrize(
    ("folder", "number", "chosen", "columns", "yes", "no"),
    [
        ("equal-time", "Fig. 1, 9 and 10", OWN, "rmse flip", TINY, HUGE),
        ("equal-time", "Fig. 14", OWN, "rmse flip", TINY, HUGE),
        ("reuse", "Fig. 13", OWN, "rmse flip", TINY, HUGE),
        ("ranking", "Fig. 8", OWN, "rmse flip", TINY, HUGE),
        ("light-distribution", "Fig. 5", OWN, "energy_on_emissive", None, 0),
        ("kd-tree-fits", "Fig. 1", {"criterion": "sse"}, "unexplained", TINY, HUGE),
        ("kd-tree-fits", "Fig. 2", {"criterion": "sse"}, "variance_law", TINY, HUGE),
        (
            "kd-tree-throughput", "Fig. 3 and 4", {"method": "kd-tree"},
            "seconds seconds_lower seconds_upper", TINY, HUGE,
        ),
        ("kd-tree-quality", "Fig. 7", {"sampler": "filtered-importance-sampling"}, "psnr", 0, 9),
        ("discrepancy", "Fig. 4", {"pattern": "HEALPix"}, "discrepancy", TINY, HUGE),
        ("dynamic-sequence", "Fig. 10", {"method": "q2-tree"}, "temporal_noise", TINY, HUGE),
        ("dynamic-sequence", "§6", {"method": "timing"}, "seconds_alone", HUGE, TINY),
        ("area-lights", "Table 1", {"table": "lights"}, "lights", None, 0),
    ],
)  # fmt: skip
def test_a_claim_holds_where_the_rows_say_so(folder, number, chosen, columns, yes, no):
    run = published(folder)
    for factor, said in ((yes, "yes: "), (no, "no: ")):
        if factor is not None:
            rows = scaled(run.rows, chosen, factor, columns)
            assert words(replace(run, rows=rows), number)[0].startswith(said)


@pytest.mark.parametrize(
    ("folder", "number", "file", "chosen", "column"),
    [
        ("glossy", "Fig. 11", "glossy.csv", OWN, "flip_glossy"),
        ("illumination-cut", "Fig. 6", "false_edges.csv", {}, "false_edges"),
    ],
)
def test_what_was_found_in_images_is_read_from_its_table(
    tmp_path, folder, number, file, chosen, column
):
    run, table = published(folder), pd.read_csv(published(folder).folder / file)
    originals = table["sampler"].str.contains("variance_weight")
    for factor, said in ((TINY, "yes: "), (HUGE, "no: ")):
        found = scaled(table, chosen, factor, column)
        if not chosen:
            found = table.assign(**{column: table[column].where(~originals, 1.0 / factor)})
        found.to_csv(tmp_path / file, index=False)
        assert words(replace(run, folder=tmp_path), number)[0].startswith(said)


@pytest.mark.parametrize(
    ("folder", "number", "metrics"),
    [("table2", "Table 2", ("rmse", "flip")), ("static-sampling", "Fig. 9", ("psnr",))],
)
def test_the_papers_own_values_are_in_its_order(folder, number, metrics):
    run = published(folder)
    values = find_experiment(run.record["experiment"]).published.values
    for sign, said in ((1.0, "yes: "), (-1.0, "no: 0 of")):
        columns = {
            name: run.rows["sampler"]
            .map({label: sign * v[name][0] for label, v in values.items()})
            .fillna(0.0)
            for name in metrics
        }
        # Far from the floor, where everything ties.
        rows = run.rows.assign(**{name: 9.0 + column for name, column in columns.items()})
        assert words(replace(run, rows=rows), number)[0].startswith(said)


def test_times_are_held_to_the_papers_order():
    run = published("light-generation-time")
    slow = scaled(run.rows, {"method": "ours"}, HUGE, "seconds seconds_lower seconds_upper")
    said, _ = words(replace(run, rows=slow), "§4.5")
    assert said.startswith("in part: 12 of 18")  # slower than the two fast ones, and than TMMS


def test_each_line_has_a_short_verdict_and_one_place():
    lines = list(figures_of_papers(published_runs(RESULTS), RESULTS))
    assert len({line.partition(":")[0] for line in lines}) == len(lines) == 27
    for line in lines:
        verdict = line.split("**")[1]
        assert verdict.partition(":")[0] in (*ANSWERS, "not made") and len(verdict.split()) <= 9
        assert ("/report.md)" in line) != (verdict == "not made")
        assert len(line) < 500
