"""What the order of Table 1 depends on: each way puts its rows in their place, and no others."""

from pathlib import Path

import pandas as pd
import pytest

from experiments.cli.commands import finish_study
from experiments.run.loaded_run import Run
from experiments.run.ray_budget import TOLERANCE
from experiments.run.request import RunRequest
from experiments.run.study_run import run_study
from experiments.wu2025 import table1_order as study
from experiments.wu2025.published import TABLE1
from samplers import EnvlightError

DEFAULT, SHARED, PLAIN, BOTH = study.WAYS


@pytest.fixture
def run(tmp_path) -> Run:
    """The paper's own errors on two maps, but for two methods whose variants alone have them."""
    rows = [
        {"scene": "vase", "environment": name, "sampler": label, "budget": "seconds=1",
         "alike": alike, "seconds_render": 1.0,
         **{metric: k * values[metric][0] for metric in study.METRICS}}
        for name, k in (("dim", 1.0), ("bright", 3.0))
        for alike in (study.TIME, study.RAYS)
        for label, values in TABLE1.values.items()
    ]  # fmt: skip
    wrong = {study.WITHOUT: 9.0, study.FHIS: 0.001}
    variants = {study.WITHOUT: study.SHARED, study.FHIS: study.PLAIN}
    for row in list(rows):
        if row["sampler"] in wrong:
            rows.append({**row, "sampler": variants[row["sampler"]], "seconds_render": 2.5})
            row.update(dict.fromkeys(study.METRICS, wrong[row["sampler"]]))
    return Run(tmp_path, pd.DataFrame(rows), {})


def test_an_order_is_the_papers_where_both_stand_in_their_place(run):
    found = study.agreements(run).set_index(["alike", "way"])
    for alike in (study.TIME, study.RAYS):
        assert found.loc[(alike, BOTH), "rmse"] == pytest.approx(1.0)
        default = found.loc[(alike, DEFAULT)]
        assert default.lt(found.loc[(alike, SHARED)]).all()
        assert default.lt(found.loc[(alike, PLAIN)]).all()
    assert study.per_map(run, "flip", study.TIME, SHARED)[study.FHIS].eq(0.001).all()


def test_sentences_have_the_figures_of_the_rows(run):
    time, rays, cost = study.findings(run)
    assert f"{BOTH} 1.00 by RMSE" in time and "2 maps at seconds=1" in time
    assert "the rays of median-cut at seconds=1" in rays
    assert "takes 2.50 times as long" in cost


def test_budgets_are_one_of_seconds(tmp_path):
    request = asked(tmp_path, ["lights=8"])
    with pytest.raises(EnvlightError, match="seconds=T"):
        study.groups(request)


def asked(folder: Path, budgets: list[str]) -> RunRequest:
    return RunRequest(
        study.NAME, "quick", "embedded", ["constant"], ["three-boxes"], [], budgets, folder,
        False, True, 0,
    )  # fmt: skip


def test_ours_without_upsampling_gets_the_lights_of_ours(tmp_path):
    request = asked(tmp_path, ["seconds=0.01"])
    assert run_study(study.table1_order(), request, False, finish_study) == 0
    rows = Run.load(tmp_path).rows.set_index(["alike", "sampler"])
    assert (rows["rmse"] > 0.0).all() and len(rows) == 2 * (len(study.METHODS) + 1)
    for alike in (study.TIME, study.RAYS):
        assert rows.loc[(alike, study.SHARED), "count"] == rows.loc[(alike, study.FULL), "count"]
    assert rows.loc[(study.RAYS, "median-cut"), "rays"] == pytest.approx(
        rows.loc[(study.TIME, "median-cut"), "rays"], rel=TOLERANCE
    )
    assert study.WITHOUT in (tmp_path / "report.md").read_text()
