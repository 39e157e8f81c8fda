"""Ranks per map: known errors give known ranks, and the report is the same bytes each time."""

import dataclasses
import re

import pandas as pd
import pytest

from experiments.report.write import write_report
from experiments.run.experiment import findings_of
from experiments.wu2025.ranking import ranking
from tests.experiments.grid_rows import contents, grid_run

MAPS = tuple(f"map{k:02d}" for k in range(12))
SAMPLERS = ("ours", "mis", "median-cut")


def errors(scene: str, environment: str, sampler: str, lights: int) -> tuple[float, float]:
    """Ours is first by RMSE but for the last map; by FLIP all are equal to each other's map."""
    place = SAMPLERS.index(sampler)
    if environment == MAPS[-1]:
        place = 2 - place
    level = 1.0 + 0.1 * MAPS.index(environment) + (0.05 if scene == "vase" else 0.0)
    return level * (1.0 + place), level


def test_ranks_are_those_of_the_errors(tmp_path):
    run = grid_run(tmp_path, ("vase", "teapot"), MAPS, SAMPLERS, errors)
    write_report(ranking(), run)
    rows = pd.read_csv(tmp_path / "ranks.csv").set_index(["metric", "environment", "sampler"])
    assert rows.loc[("rmse", MAPS[0], "ours"), "rank"] == 1
    assert rows.loc[("rmse", MAPS[-1], "ours"), "rank"] == 3
    assert (rows.loc["flip"]["rank"] == 1).all()  # ties share the better rank
    # The mean over two scenes: level 1.0 and 1.05.
    assert rows.loc[("rmse", MAPS[0], "mis"), "error"] == pytest.approx(2.0 * 1.025)
    text = (tmp_path / "report.md").read_text()
    # Ranks (11 + 3) / 12; the paper's is 1.16; the worst is that on the last map.
    assert re.search(r"\| Ours \(Wu 2025\) +\| +1\.17 \| +1\.16 \| +11 \| +3 \|", text)
    assert "maps by the error of Ours (Wu 2025), least first" in text
    assert text.split("\n\n")[1].startswith("Fig. 8: yes: 1st by FLIP")
    without = dataclasses.replace(run, rows=run.rows[run.rows["sampler"] != "ours"])
    assert findings_of(ranking(), without) == ()  # the claim is about it


def test_every_ranking_has_its_plots(tmp_path):
    write_report(ranking(), grid_run(tmp_path, ("vase",), MAPS, SAMPLERS, errors))
    plots = {f"{kind}_{error}" for kind in ("rank", "cd") for error in ("rmse", "flip")}
    assert {f"{plot}_lights16.svg" for plot in plots} < set(contents(tmp_path))


def test_a_run_without_a_complete_map_is_told(tmp_path):
    run = grid_run(tmp_path, ("vase",), MAPS[:2], SAMPLERS, errors)
    apart = (run.rows["environment"] == MAPS[0]) == (run.rows["sampler"] == "ours")
    run = dataclasses.replace(run, rows=run.rows[apart])
    report, *_ = write_report(ranking(), run)
    assert "No map is finished by all samplers yet" in report.read_text()
