"""The paper's budget: sizes, verdicts, and rows that hold what the tables need."""

import pandas as pd
import pytest

from experiments.cli.commands import finish_study
from experiments.questions import paper_budget as experiment
from experiments.run.request import RunRequest
from experiments.run.study_run import run_study
from experiments.run.timed import MOST_LIGHTS
from experiments.wu2025.published import seconds_budget
from samplers import EnvlightError


def request_for(folder, samplers: list[str], budgets: list[str]) -> RunRequest:
    return RunRequest(
        "paper-budget", "quick", "embedded", ["constant"], ["three-boxes"], samplers, budgets,
        folder, False, True, 0,
    )  # fmt: skip


@pytest.mark.parametrize(("name", "seconds"), [("quick", 0.25), ("standard", 1), ("paper", 4)])
def test_all_scales_have_as_many_seconds_per_pixel(name, seconds):
    scale = experiment.budget_scale(name)
    (budget,) = seconds_budget(scale)
    assert budget.amount == seconds and scale.subpixels == 4


@pytest.mark.parametrize(
    ("seconds", "count", "expected"),
    [
        (4.39, 9, "met"),
        (3.61, 9, "met"),
        (7.3, 2, "smallest budget 7.3 s with K=2"),
        (1.2, MOST_LIGHTS, f"largest budget 1.2 s with K={MOST_LIGHTS}"),
        (4.6, 3, "nearest budget 4.6 s with K=3"),
    ],
)
def test_verdict_tells_what_stands_in_the_way(seconds, count, expected):
    row = {
        "budget": "seconds=4", "seconds_render": seconds, "count": count, "least_count": 2,
        "most_count": MOST_LIGHTS,
    }  # fmt: skip
    assert experiment.verdict(pd.Series(row)) == expected


def test_summary_judges_memory_at_the_papers_size_alone():
    rows = pd.DataFrame(
        {
            "sampler": ["a", "a", "b"], "budget": "seconds=4", "ratio": [1.05, 0.5, 1.0],
            "verdict": ["met", "nearest", "met"], "peak_mib": [1000.0, 3072.0, 900.0],
            "seconds_least": 1.0, "seconds_lights": 0.1, "seconds_view": 2.0,
            "width": 1600, "height": 1200,
        }
    )  # fmt: skip
    table = experiment.summary(rows).set_index("sampler")
    assert list(table["met"]) == [1, 1] and table.loc["a", "worst_ratio"] == 0.5
    assert table.loc["a", "memory"] == "missed by a factor of 1.50"
    assert table.loc["b", "memory"] == "met"
    assert "memory" not in experiment.summary(rows.assign(width=400))
    assert experiment.met_sentence(table) == "The budget is met in 2 of 3 rows."


def test_budgets_of_other_kinds_are_refused(tmp_path):
    with pytest.raises(EnvlightError, match=r"lights=4.*write seconds=T"):
        experiment.groups(request_for(tmp_path, ["mis"], ["lights=4"]))


def test_every_sampler_has_a_row_and_a_second_start_measures_none(tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(experiment.SIZES, "quick", (32, 24))
    request = request_for(tmp_path, ["median-cut", "q2-tree"], ["seconds=0.001"])
    assert run_study(experiment.paper_budget(), request, False, finish_study) == 0
    rows = pd.read_csv(tmp_path / "paper_budget.csv").set_index("sampler")
    assert set(rows.index) == {"median-cut", "q2-tree"}
    assert rows.loc["q2-tree", "least_count"] == 12 and (rows["count"] >= rows["least_count"]).all()
    assert (rows[["seconds_least", "seconds_view", "seconds_render"]] > 0.0).all().all()
    # An interpreter with NumPy and Numba alone takes more than 50 MiB.
    assert (rows["peak_mib"] > 50.0).all()
    assert len(pd.read_csv(tmp_path / "paper_budget_summary.csv")) == 2
    assert run_study(experiment.paper_budget(), request, False, finish_study) == 0
    assert "0 rows measured, 2 were stored" in capsys.readouterr().out


def test_sampler_that_fails_is_left_out_with_its_reason(tmp_path, monkeypatch):
    monkeypatch.setitem(experiment.SIZES, "quick", (32, 24))
    shoot = experiment.CaseScene.shoot

    def failing(scene, measurement, count):
        if measurement.sampler.label == "mis":
            raise EnvlightError("no such luck")
        return shoot(scene, measurement, count)

    monkeypatch.setattr(experiment.CaseScene, "shoot", failing)
    request = request_for(tmp_path, ["median-cut", "mis"], ["seconds=0.001"])
    assert run_study(experiment.paper_budget(), request, False, finish_study) == 0
    assert list(pd.read_csv(tmp_path / "paper_budget.csv")["sampler"]) == ["median-cut"]
    assert "no such luck" in (tmp_path / "report.md").read_text(encoding="utf-8")
