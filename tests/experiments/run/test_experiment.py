"""Every experiment is listed, described and can be imported and planned."""

import importlib
import pkgutil

import pytest

from experiments.cli import commands
from experiments.run import grid, registry
from experiments.run.experiment import RunRequest
from experiments.run.registry import (
    experiment_names,
    figures_of,
    find_experiment,
    room_of,
    summary_of,
)
from samplers import EnvlightError
from samplers.threads import core_count, set_thread_count, thread_count


@pytest.mark.parametrize("name", experiment_names())
def test_dry_run_names_what_is_measured_and_the_folder(name, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(grid, "estimate", lambda left, workers: "hours")
    folder = tmp_path / "run"
    request = RunRequest(name, output=folder, images=False)
    assert commands.run(request, True) == 0
    text = capsys.readouterr().out
    assert (
        f"{name}: " in text
        and ("rows in" in text or "measurements:" in text)
        and str(folder) in text
    )
    assert not folder.exists()


@pytest.mark.parametrize(
    ("executor", "cluster", "told"),
    [
        ("serial", "", (1, 2)),
        ("processes", "", (core_count(), 1)),
        ("dask", "tcp://127.0.0.1:1", (1, 2)),
    ],
)
def test_a_dry_run_knows_how_many_work_at_once(executor, cluster, told, tmp_path, monkeypatch):
    seen = []
    monkeypatch.setattr(
        grid, "estimate", lambda left, workers: seen.append((workers, thread_count()))
    )
    request = RunRequest(
        "table1", maps=["constant"], scenes=["vase"], samplers=["mis"], output=tmp_path / "run",
        images=False, executor=executor, workers=999, cluster=cluster,
    )  # fmt: skip
    before = thread_count()
    try:
        set_thread_count(2)
        assert commands.run(request, True) == 0
    finally:
        set_thread_count(before)
    assert seen == [told]


@pytest.mark.parametrize("asked", [0, 1, 5])
def test_stochastic_samplers_have_as_many_seeds_as_are_asked_for(asked, tmp_path):
    found = find_experiment("table1")
    request = RunRequest(
        "table1", maps=["constant"], scenes=["vase"], samplers=["mis", "median-cut"],
        budgets=["lights=4"], output=tmp_path, images=False, seeds=asked,
    )  # fmt: skip
    seeds = {"mis": [], "median-cut": []}
    for one in found.grid(request).measurements():
        seeds[one.sampler.label].append(one.seed)
    assert seeds == {"mis": list(range(asked or found.seeds)), "median-cut": [0]}


def test_what_sources_say_of_experiments_is_what_they_are():
    for room in registry.ROOMS:
        package = importlib.import_module(f"experiments.{room}")
        for module in pkgutil.walk_packages(package.__path__, f"experiments.{room}."):
            importlib.import_module(module.name)
    assert set(experiment_names()) == set(registry._registry)
    for name in experiment_names():
        found = find_experiment(name)
        assert summary_of(name) == found.summary
        assert figures_of(name) == [one.number for one in found.figures]
        assert room_of(name) == registry._registry[name].__module__.split(".")[1]


def test_unknown_name_is_answered_with_the_nearest():
    with pytest.raises(EnvlightError, match=r"did you mean.*skipping"):
        find_experiment("skiping")
