"""`envlight advise` and `advice-table` say what the library finds."""

import json
import shlex

import numpy as np
import pytest

from experiments.cli.advice import advice_table, command_for
from experiments.cli.advice import advise as advise_command
from experiments.maps.features import map_features
from experiments.questions import which_sampler
from experiments.questions.advice.expected import Wish, advise
from experiments.questions.advice.measured import load_measured, to_json
from experiments.questions.which_sampler import (
    ALL_BUDGETS,
    REFERENCE,
    findings,
    gathered,
    regret_table,
    what_advice_is_worth,
)
from experiments.report.parts import Table
from experiments.run.loaded_run import write_run
from renderer.image import write_exr
from samplers import EnvironmentMap, EnvlightError
from samplers.conformance.stress_maps import stress_map
from tests.experiments.questions.advice.known_law import SAMPLERS, SIZE, law_run


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    return law_run(tmp_path_factory.mktemp("law"), maps=24, noise=0.15)


@pytest.fixture(scope="module")
def folder(run, tmp_path_factory):
    """A run's folder, a table made from it by the command, and a map."""
    folder = tmp_path_factory.mktemp("files")
    write_run(folder / "run", run.rows, dict(run.record))
    advice_table([folder / "run"], folder / "table.json")
    write_exr(folder / "sky.exr", stress_map("sun-and-sky").radiance)
    return folder


def ask(folder, capsys, environment="sky.exr", **changed):
    given = {
        "lights": 0, "rays": 0.0, "seconds": 0.0, "error": 0.0, "metric": "rmse", "width": 64,
        "height": 48, "subpixels": 1, "table": folder / "table.json",
        "repair": False, "as_json": False,
    }  # fmt: skip
    advise_command(str(folder / environment), **(given | changed))
    return capsys.readouterr().out


def test_the_command_gathers_what_the_library_does(run, folder):
    text = (folder / "table.json").read_text(encoding="utf-8")
    assert text == to_json(gathered([type(run)(folder / "run", run.rows, run.record)]))


def test_the_command_says_all_of_it(folder, capsys):
    told = ask(folder, capsys, lights=16)
    columns = map_features(EnvironmentMap.from_file(folder / "sky.exr"))
    table = load_measured(folder / "table.json")
    wanted = advise(table, columns, Wish("lights", 16, "rmse"))
    for one in wanted.answers:
        assert f"{one.chosen.sampler}, 16 " in told
        assert f"RMSE {one.chosen.error:.4f}, between {one.chosen.low:.4f} and" in told
        assert command_for(str(folder / "sky.exr"), one) in told
    for words in (
        "sky: not measured; expected from the maps like it; 24 maps were measured",
        f"then {wanted.answers[0].runner_up.sampler} with 16: RMSE",
        "at lights=16 on 24 maps kept aside, advice errs",
        *(f"  {one.name} ({100.0 * one.share:.0f} %): " for one in wanted.alike),
        f"beyond all measured maps by {', '.join(wanted.beyond)}:",
        f"scenes rubiks-cube, vase in images of {SIZE[0]}×{SIZE[1]} pixels, mostly 0.80 to 1.20",
    ):
        assert words in told
    found = json.loads(ask(folder, capsys, lights=16, as_json=True))
    assert [one["chosen"]["sampler"] for one in found["answers"]] == [
        one.chosen.sampler for one in wanted.answers
    ]


def test_two_budgets_are_refused(folder, capsys):
    with pytest.raises(EnvlightError, match="--lights and --rays: give one of them"):
        ask(folder, capsys, lights=4, rays=3.0)


def test_the_command_that_is_given_makes_the_lights_or_renders(run):
    table = gathered([run])
    columns = {f"map_{name}": 0.5 for name in json.loads(to_json(table))["features"]}
    fixed, drawn = advise(table, columns, Wish("lights", 8, "rmse")).answers
    assert shlex.split(command_for("my sky.exr", fixed)) == [
        "envlight", "lights", "my sky.exr", "--sampler", fixed.chosen.sampler, "--count", "8",
    ]  # fmt: skip
    assert command_for("a.exr", drawn).startswith("envlight render a.exr --sampler mis")


def test_the_report_tells_what_advice_is_worth(run, tmp_path):
    (table,) = (part for part in what_advice_is_worth(run) if isinstance(part, Table))
    rows = table.rows
    lines = rows[(rows["metric"] == "RMSE") & (rows["league"] == "all")].set_index("budget")
    single = lines.drop(ALL_BUDGETS)["choice"]
    assert len(single) >= 4
    assert lines["choice"][ALL_BUDGETS] == pytest.approx(np.exp(np.log(single).mean()))
    told = next(one for one in findings(run) if one.startswith("By RMSE, league all: "))
    assert f"errs {lines['choice'][ALL_BUDGETS]:.3f} times" in told
    few = law_run(tmp_path, maps=3)
    assert list(what_advice_is_worth(few)) == [] and findings(few) == ()
    assert regret_table(gathered([run])).rows["league"].isin(["all", "fixed"]).all()


def test_the_speed_here_is_that_of_the_probe_over_the_tables(run, monkeypatch):
    monkeypatch.setattr(which_sampler, "probe", lambda: 3e-8)
    table = gathered([run])
    assert REFERENCE in SAMPLERS and table.machine_seconds == pytest.approx(1e-8)
    assert which_sampler.speed_here(table) == pytest.approx(3.0)


def test_a_probe_is_a_time_for_a_ray():
    # Between ten thousand and ten billion rays a second.
    assert 1e-10 < which_sampler.probe() < 1e-4
