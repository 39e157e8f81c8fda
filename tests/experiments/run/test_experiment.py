"""Every experiment is listed, described and can be imported and planned."""

import pytest

from experiments.cli import commands
from experiments.run import grid_run
from experiments.run.experiment import experiment_names, find_experiment
from experiments.run.request import RunRequest
from samplers import EnvlightError


def test_names_are_listed_with_descriptions(capsys):
    commands.list_names("experiments")
    text = capsys.readouterr().out
    for name in experiment_names():
        assert name in text and find_experiment(name).summary in text


@pytest.mark.parametrize("name", experiment_names())
def test_dry_run_names_what_is_measured_and_the_folder(name, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(grid_run, "estimate", lambda grid: "hours")  # the plan is what is tested
    folder = tmp_path / "run"
    request = RunRequest(name, "quick", "embedded", [], [], [], [], folder, False, False, 0)
    assert commands.run(request, True) == 0
    text = capsys.readouterr().out
    assert (
        f"{name}: " in text
        and ("rows in" in text or "measurements:" in text)
        and str(folder) in text
    )
    assert not folder.exists()


def test_unknown_name_is_answered_with_the_nearest():
    with pytest.raises(EnvlightError, match=r"did you mean.*skipping"):
        find_experiment("skiping")
