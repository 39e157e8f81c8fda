"""Runs of measurements that tests choose, and stored results that they change or damage."""

import json
from collections.abc import Iterable
from concurrent.futures import Executor
from pathlib import Path
from typing import Any

from experiments.cli.commands import finish
from experiments.run import runner
from experiments.run.experiment import Experiment, GridExperiment, RunRequest
from experiments.run.grid import GridPlan, case_groups
from experiments.run.measurement import Measurement
from experiments.run.rendering import MACHINE_COLUMNS
from experiments.run.runner import Finish, Outcome, Runner, left_of
from experiments.run.start import run_experiment
from experiments.run.store import IMAGE, Store, _signed
from renderer.image import write_exr
from samplers.files.image_file import read_radiance


def run_measurements(
    store: Store,
    measurements: Iterable[Measurement],
    executor: Executor | None = None,
    images: bool = True,
    timeout: float = 0.0,
) -> Outcome:
    """Measure what the store has not."""
    groups = case_groups(measurements, images, timeout)
    return Runner(store).run(left_of(groups, store), executor)


def plan_of(
    experiment: GridExperiment, measurements: Iterable[Measurement], images: bool = True
) -> GridPlan:
    """A start that is about these measurements."""
    told: dict[str, dict[str, str]] = {"bad_maps": {}, "repairs": {}, "clipped": {}}
    return GridPlan(experiment, case_groups(measurements, images), told)


def run_plan(
    experiment: GridExperiment, store: Store, measurements: Iterable[Measurement], finish: Finish,
    images: bool = True, executor: Executor | None = None,
) -> int:  # fmt: skip
    """Run such a start."""
    return runner.run_plan(plan_of(experiment, measurements, images), store, finish, executor)


def run_into(folder: Path, experiment: Experiment, **options: Any) -> None:
    """Run an experiment with these options of `RunRequest` into a folder."""
    request = RunRequest(experiment.name, output=folder, **options)
    assert run_experiment(experiment, request, False, finish) == 0


def untimed(store: Store) -> dict[str, dict[str, Any]]:
    """The rows of all images by their keys, without what depends on the machine."""
    return {
        one.key: {name: value for name, value in one.result.items() if name not in MACHINE_COLUMNS}
        for one in store.results(IMAGE)
    }


def forget(store: Store, key: str) -> None:
    """Let a result be missing."""
    store._all("DELETE FROM result WHERE key = ?", key)


def forget_scores(store: Store, key: str, *names: str) -> None:
    """Let scores of an image be missing, those of these keys or all."""
    scores = store.get(key).scores
    left = {name: row for name, row in scores.items() if names and name not in names}
    alter(store, key, scores_text=json.dumps(left))


def alter(store: Store, key: str, new_key: str = "", **fields: str) -> None:
    """Store what stands under a key with other fields, under another key where one is given."""
    stored = store.get(key)
    assert stored is not None
    names = ("key", "kind", "identity_text", "result_text", "scores_text", "start")
    row = {name: getattr(stored, name) for name in names} | fields
    if new_key:
        row["key"] = new_key
    forget(store, key)
    store._all("INSERT INTO result VALUES (?, ?, ?, ?, ?, ?, ?)", *_signed(*row.values()))


def alter_result(store: Store, key: str, **columns: Any) -> None:
    """Store other values in a result."""
    alter(store, key, result_text=json.dumps({**store.get(key).result, **columns}))


def alter_identity(store: Store, key: str, part: str, new_key: str = "", **fields: Any) -> None:
    """Let a result have an identity whose shared part says something else."""
    identity = store.get(key).identity
    other = runner.Shared({**store.shared(identity[part]), **fields})
    store._put_shared(other)
    alter(store, key, new_key, identity_text=json.dumps({**identity, part: other.key}))


def damage(path: Path, how: str) -> None:
    """Remove an image, cut its file short, or alter a pixel of it."""
    if how == "missing":
        path.unlink()
    elif how == "cut short":
        path.write_bytes(path.read_bytes()[:-20])
    else:
        image = read_radiance(path)
        image[3, 4, 1] += 1.0
        write_exr(path, image)
