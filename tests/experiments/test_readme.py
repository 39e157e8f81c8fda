"""What CONTRIBUTING.md shows works as it stands there."""

import re
from pathlib import Path

import pytest

from experiments.cli.commands import finish
from experiments.run import registry
from experiments.run.store import Store
from metrics import registry as metrics
from tests.experiments.stored import run_plan

README = Path(__file__).parents[2] / "CONTRIBUTING.md"
BLOCKS = re.findall(r"```python\n(.*?)```", README.read_text(encoding="utf-8"), re.DOTALL)


def block(word: str) -> str:
    return next(text for text in BLOCKS if word in text)


@pytest.fixture
def shown():
    """The experiment and the metric of the page, for the time of a test."""
    space: dict = {"__name__": "shown"}
    exec(compile(block("@experiment"), str(README), "exec"), space)
    exec(compile(block("register(Metric"), str(README), "exec"), {"__name__": "shown_metric"})
    yield space
    del registry._registry["four-times"]
    del metrics._registry["mean_error"]


def test_the_experiment_and_the_metric_of_the_page_make_a_report(
    grid, tmp_path, shown, monkeypatch
):
    from dataclasses import replace

    from experiments.run.budget import Budget

    # A metric's source counts; that of the page is no module.
    monkeypatch.setattr(metrics.Metric, "module", property(lambda self: "metrics.errors"))
    few = replace(
        grid, environments=grid.environments[2:3], budgets=(Budget(8), Budget(32)),
        samplers=grid.samplers[:2],
    )  # fmt: skip
    experiment = shown["four_times"]()
    assert experiment.summary == "Every sampler with 8 and with 32 lights."

    def finish_all(one, run, outcome):
        assert outcome.failures == []
        finish(one, run, outcome, images=False)

    with Store.writing(tmp_path / "run") as store:
        assert run_plan(experiment, store, few.measurements(), finish_all, images=False) == 0
    report = (tmp_path / "run" / "report.md").read_text(encoding="utf-8")
    assert "Four times the lights" in report and "mean error" in report
    assert (tmp_path / "run" / "gain_mean_error.csv").is_file()
