"""Measurements are measured once, failures stay alone, and references that were lost come back."""

import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from experiments.cli.commands import finish
from experiments.run import rendering, runner
from experiments.run.budget import Budget
from experiments.run.grid import case_groups, left_to_do
from experiments.run.kept_images import half_path, reference_path, stored_image
from experiments.run.loaded_run import Run
from experiments.run.machine import record
from experiments.run.measurement import Measurement
from experiments.run.rendering import CaseScene
from experiments.run.sampler_spec import SamplerSpec
from experiments.run.store import IMAGE, Store
from experiments.wu2025.table1 import table1
from samplers import DirectionalLights, LightSampler, register
from samplers.base import REGISTERED
from tests.experiments.stored import (
    alter_result,
    damage,
    forget,
    forget_scores,
    run_measurements,
    run_plan,
    untimed,
)
from tests.robustness.watched_run import write_maps

FINISH = partial(finish, images=False)


def test_what_is_stored_is_not_measured_again(copied, grid):
    with Store.writing(copied) as store:
        before = store.results(IMAGE)
        outcome = run_measurements(store, grid.measurements())
        assert (outcome.measured, outcome.stored, outcome.failures) == (0, 25, [])
        assert store.results(IMAGE) == before


def test_a_run_that_went_on_names_every_commit_that_measured(
    tmp_path, measurements_of, monkeypatch
):
    everything = measurements_of(("noise", "sun"), ("median-cut", "mis"))
    one, few = everything[:1], everything[:3]
    starts = [("A", one), ("A", one), ("A", few), ("B", everything)]
    loads = [0.5, 9.0, 1.75, 0.25]  # the second start measured nothing
    recorded = []
    with Store.writing(tmp_path / "run") as store:
        for place, (commit, measurements) in enumerate(starts):
            fact = {"started": str(place), "command": f"envlight {place}", "commit": commit}
            fact["load_average"] = loads[place]
            monkeypatch.setattr(runner, "record", lambda fact=fact: {**record(), **fact})
            assert run_plan(table1(), store, measurements, FINISH, images=False) == 0
            recorded.append(Run.load(store.run))
    first, idle, longer, last = recorded
    for run in (first, idle):
        machine = run.record["machine"]
        told = machine["started"], machine["command"], machine["commit"]
        assert told == ("0", "envlight 0", "A")
        assert "parts" not in run.record
    assert "load_average_end" not in idle.record["machine"]
    assert [part["rows"] for part in longer.parts] == [3]
    assert longer.record["machine"]["command"] == "envlight 2"
    assert last.record["parts"] == [
        {"rows": 3, "started": "0", "command": "envlight 2", "commit": "A"},
        {"rows": len(everything) - 3, "started": "3", "command": "envlight 3", "commit": "B"},
    ]
    assert (last.record["machine"]["started"], last.record["machine"]["commit"]) == ("0", "B")
    assert [run.record["machine"]["load_average"] for run in recorded] == [0.5, 0.5, 1.75, 1.75]
    report = (tmp_path / "run" / "report.md").read_text(encoding="utf-8")
    for part in last.parts:
        assert f"{part['rows']} row" in report and f"commit {part['commit']};" in report


def test_black_and_constant_maps_have_defined_metrics(finished):
    with Store.reading(finished) as store:
        rows = list(store.rows(store.plan))
    for row in rows:
        numbers = [value for value in row.values() if isinstance(value, float)]
        assert not np.isnan(numbers).any()
        if row["environment"] == "black":
            assert row["rmse"] == row["flip"] == row["relative_rmse"] == 0.0
            assert row["psnr"] == np.inf


@pytest.mark.parametrize("how", ["missing", "cut short", "altered"])
@pytest.mark.parametrize("path_of", [reference_path, half_path])
def test_a_lost_reference_is_rendered_again(copied, finished, measurements_of, path_of, how):
    measurements = measurements_of(("noise",), ("uniform",))
    with Store.writing(copied) as store:
        path = path_of(store.folder, measurements[0].case)
        forget(store, measurements[0].key)
        damage(path, how)
        assert run_measurements(store, measurements).measured == 1
        measured = untimed(store)[measurements[0].key]
    with Store.reading(finished) as store:
        assert path.read_bytes() == path_of(store.folder, measurements[0].case).read_bytes()
        assert measured == untimed(store)[measurements[0].key]


def test_a_lost_reference_that_comes_out_differently_is_refused(copied, measurements_of):
    measurements = measurements_of(("noise",), ("uniform",))
    with Store.writing(copied) as store:
        forget(store, measurements[0].key)
        alter_result(store, measurements[0].case.reference_key, pixels="other")
        outcome = run_measurements(store, measurements)
        assert outcome.measured == 0
        assert len(outcome.failures) == 1
        assert "rendering it again gives another one" in outcome.failures[0]
        assert left_to_do(case_groups(measurements), store).measurements == measurements


def test_a_measurement_that_fails_leaves_the_others_alone(tmp_path, grid, capsys, broken_sampler):
    environments = [source for source in grid.environments if source.name in ("noise", "sun")]
    some = replace(
        grid, environments=tuple(environments), samplers=(SamplerSpec("uniform"), broken_sampler)
    )
    measurements = some.measurements()
    with Store.writing(tmp_path / "run") as store:
        assert run_plan(table1(), store, measurements, FINISH, images=False) == 1
        left = left_to_do(case_groups(measurements, False), store).measurements
        assert [str(measurement) for measurement in left] == [
            "three-boxes · sun · broken · lights=4 · seed 0"
        ]
        printed = capsys.readouterr()
        told = f"envlight: failed: {left[0]}: ZeroDivisionError: no such luck"
        assert printed.err.splitlines()[0] == told
        assert printed.err.count("failed") == 1
        assert "3 measurements made, 0 were stored already, 1 failed" in printed.out
        assert run_plan(table1(), store, measurements, FINISH, images=False) == 1
        assert "0 measurements made, 3 were stored already, 1 failed" in capsys.readouterr().out
    report = (tmp_path / "run" / "report.md").read_text(encoding="utf-8")
    assert "(incomplete)" in report
    assert "- broken: three-boxes · sun" in report


def test_a_run_in_which_all_fails_says_so(tmp_path, grid, capsys, broken_sampler):
    sun = tuple(source for source in grid.environments if source.name == "sun")
    only = replace(grid, environments=sun, samplers=(broken_sampler,))
    with Store.writing(tmp_path / "run") as store:
        assert run_plan(table1(), store, only.measurements(), FINISH) == 1
    assert "no such luck" in capsys.readouterr().err
    assert not (tmp_path / "run" / "report.md").exists()


@pytest.fixture
def bad_sampler():
    """Exits, takes all memory, or never ends, as its parameter says."""

    @register("bad")
    @dataclass(frozen=True)
    class Bad(LightSampler):
        """Does no good."""

        how: str = "exits"

        def _prepare(self, environment, count, rng):
            if self.how == "exits":
                sys.exit(0)
            if self.how == "takes all memory":
                raise MemoryError("no more")
            while self.how == "never ends":
                pass
            return DirectionalLights.none()

    yield lambda how: SamplerSpec("bad", (("how", how),))
    del REGISTERED["bad"]


@pytest.mark.parametrize(
    ("how", "told"),
    [
        ("exits", "it ended the program, by sys.exit(0)"),
        ("takes all memory", "MemoryError: no more"),
        ("never ends", "it was not finished within 0.2 s (--timeout)"),
    ],
)
@pytest.mark.parametrize("budget", [Budget(4), Budget(0.01, "seconds")])
@pytest.mark.parametrize("executor", [None, ThreadPoolExecutor])
def test_what_a_sampler_does_to_the_program_is_its_own_failure(
    copied, measurements_of, bad_sampler, how, told, budget, executor
):
    case = measurements_of(("noise",))[0].case
    with Store.writing(copied) as store, ExitStack() as stack:
        pool = stack.enter_context(executor(1)) if executor else None
        measurement = Measurement(case, bad_sampler(how), budget, 0)
        outcome = run_measurements(store, [measurement], pool, timeout=0.2)
        assert outcome.measured == 0
        (failure,) = outcome.failures
        assert told in failure


RUINS = """
import ctypes, os
from dataclasses import dataclass
import numpy as np
from samplers import LightSampler

@dataclass(frozen=True)
class Ruins(LightSampler):
    def _prepare(self, environment, count, rng):
        os.chdir(os.path.dirname(__file__))
        np.seterr(all="raise")
        ctypes.memset(environment.radiance.ctypes.data, 64, 12)
        raise ValueError
"""


def test_a_sampler_in_a_file_changes_nothing_for_others(copied, measurements_of, tmp_path):
    (tmp_path / "ruins.py").write_text(RUINS)
    case = measurements_of(("noise",))[0].case
    before = CaseScene.of(case).environment.radiance.copy(), Path.cwd(), np.geterr()
    with Store.writing(copied) as store:
        spec = SamplerSpec(f"{tmp_path}/ruins.py:Ruins")
        (failure,) = run_measurements(store, [Measurement(case, spec, Budget(4), 0)]).failures
    assert "it wrote into the map" in failure
    np.testing.assert_array_equal(CaseScene.of(case).environment.radiance, before[0])
    assert before[1:] == (Path.cwd(), np.geterr())


@pytest.mark.parametrize("word", ["../../../../outside", "a/b", "/", "..", "x" * 300, "a\nb"])
def test_images_stay_in_their_folder_whatever_a_parameter_says(
    tmp_path, measurements_of, bad_sampler, word
):
    case = measurements_of(("noise",))[0].case
    measurement = Measurement(case, bad_sampler(word), Budget(4), 0)
    with Store.writing(tmp_path / "run") as store:
        assert run_plan(table1(), store, [measurement], lambda *_: None) == 0
    (image,) = (tmp_path / "run" / "images" / case.scene / "noise").glob("*.exr")
    assert image.name.endswith(f"_{measurement.key[:8]}.exr")
    assert {path.name for path in tmp_path.iterdir()} == {"run", "store"}


@dataclass(frozen=True)
class Twice:
    """A uniform density that says twice what it is."""

    count: int

    def sample(self, u):
        z = 1.0 - 2.0 * u[:, 0]
        r, phi = np.sqrt(np.maximum(0.0, 1.0 - z * z)), 2.0 * np.pi * u[:, 1]
        direction = np.stack([r * np.cos(phi), z, r * np.sin(phi)], axis=1)
        return direction.astype(np.float32), self.pdf(direction)

    def pdf(self, direction):
        return np.full(len(direction), 0.5 / np.pi, np.float32)


def test_a_density_that_is_none_fails_its_measurement_instead_of_darkening_the_image(
    tmp_path, grid
):
    @register("twice")
    @dataclass(frozen=True)
    class TwiceSampler(LightSampler):
        """Its density integrates to two."""

        def _prepare(self, environment, count, rng):
            return Twice(count)

    try:
        specs = (SamplerSpec("uniform"), SamplerSpec("twice"))
        measurements = replace(
            grid, environments=grid.environments[:1], samplers=specs
        ).measurements()
        with Store.writing(tmp_path / "run") as store:
            outcome = run_measurements(store, measurements, images=False)
    finally:
        del REGISTERED["twice"]
    assert outcome.measured == len(measurements) - 1
    assert outcome.failures == [
        f"{measurements[-1]}: lighting: the density integrates to 2 instead of 1"
    ]


def test_a_run_measures_nothing_that_another_of_its_working_folder_has(
    copied, measurements_of, monkeypatch
):
    measurements = measurements_of(("noise",), ("uniform", "mis"))
    monkeypatch.setattr(rendering, "render_reference", None)  # would fail where it is called
    monkeypatch.setattr(rendering, "render", None)
    with Store.writing(copied.parent / "mine") as store:
        assert run_plan(table1(), store, measurements, FINISH) == 0
    with Store.reading(copied) as store:
        rows = {row["key"]: row for row in store.rows(store.plan)}
    mine = Run.load(copied.parent / "mine")
    assert set(mine.rows["key"]) == {one.key for one in measurements}
    assert list(mine.rows["rmse"]) == [rows[key]["rmse"] for key in mine.rows["key"]]
    for _, row in mine.rows.iterrows():
        for kept in (Run.kept_image, Run.kept_reference):
            assert kept(mine, row).read_bytes() == kept(Run.load(copied), row).read_bytes()


def counts(measurements, store, images=True):
    left = left_to_do(case_groups(measurements, images), store)
    return len(left.measurements), left.references


def test_what_is_left_is_what_the_store_has_not(grid, copied):
    measurements = grid.measurements()
    one, case = measurements[3], measurements[0].case
    assert counts(measurements, None) == (25, 5)
    with Store.writing(copied) as store:
        assert counts(measurements, store) == (0, 0)
        forget_scores(store, one.key, case.score_keys["flip"])
        assert left_to_do(case_groups(measurements), store).measurements == [one]
        assert counts(measurements, store) == (1, 0)
        stored_image(store.folder, measurements[4].key).unlink()
        assert (counts(measurements, store), counts(measurements, store, False)) == ((2, 0), (1, 0))
        reference_path(store.folder, case).unlink()
        assert counts(measurements, store) == (2, 1)
        timed = replace(grid, budgets=(Budget(0.1, "seconds"),)).measurements()
        assert counts(timed, store) == (25, 1)


def test_an_image_that_was_not_kept_is_rendered_where_it_is_wanted(tmp_path, measurements_of):
    (one,) = measurements_of(("noise",), ("uniform",))
    with Store.writing(tmp_path / "run") as store:
        assert run_measurements(store, [one], images=False).measured == 1
        row = store.get(one.key)
        assert run_measurements(store, [one], images=False).measured == 0
        assert run_measurements(store, [one]).measured == 1
        assert store.get(one.key) == row and stored_image(store.folder, one.key).is_file()


def test_two_runs_in_a_working_folder_at_the_same_time_give_the_same_rows(
    finished, tmp_path, measurements_of
):
    code = (
        "import sys; from pathlib import Path\n"
        "from tests.robustness.watched_run import Marker, run\n"
        "place = Path(sys.argv[1])\n"
        "sys.exit(run(place, place / 'runs' / sys.argv[2], Marker(place / sys.argv[2])))"
    )
    write_maps(tmp_path)
    both = [
        subprocess.Popen([sys.executable, "-c", code, str(tmp_path), name]) for name in ("a", "b")
    ]
    assert [one.wait() for one in both] == [0, 0]
    rows = [Run.load(tmp_path / "runs" / name).rows for name in ("a", "b")]
    assert len(rows[0]) == 30
    pd.testing.assert_frame_equal(*rows)  # whichever measured it, a row stands once
