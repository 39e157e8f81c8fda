"""Do published measurements come out again, by the methods as they are now?

Rows are drawn at random from all published runs over grids, which take turns, and made again: the
reference, the image at the count that the row tells, so that budgets of seconds can be judged,
too, and the scores. What a row says of counts, lights, rays and errors must be what it said; times,
which the machine decides, are left out. Where references are made otherwise than they were, errors
may differ by no more than both noises together, while the image's own values may not.

Rows on maps that are not there, or with samplers or scenes from files, are left out.
"""

import re
import tempfile
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from experiments.maps import places
from experiments.maps.sources import EMBEDDED, find_environments
from experiments.report.compare import CLOSE, MACHINES_OWN, relative_difference
from experiments.report.publish import published_runs
from experiments.report.suite import together
from experiments.run.case import name_and_file
from experiments.run.experiment import GridExperiment, RunRequest
from experiments.run.kept_images import has_reference
from experiments.run.loaded_run import Run
from experiments.run.measure import MeasurementTask, ReferenceTask, measure, measure_reference
from experiments.run.measurement import Measurement
from experiments.run.registry import find_experiment
from experiments.run.sampler_spec import family_of
from experiments.run.store import BESIDE, DATABASE, Store
from metrics.registry import metrics, ranked_metrics
from renderer import scenes
from samplers import EnvlightError, sampler_names

NOISE = re.compile(r"--reference-noise[ =](\S+)")
SUITE = re.compile(r"--environments[ =](\S+)")
NOT_COMPARED = ("seed", "repaired")
KINDS = SAME, CLOSE_BY, WITHIN_NOISE, DIFFERS = "same", "close", "noise", "differs"
Row = Mapping[str, Any]


def drawn(
    results: Path, environments: str, count: int, seed: int = 0, widest: int = 0
) -> list[tuple[Run, pd.Series]]:
    """Draw `count` rows, the same ones for a seed; EnvlightError where there are none.

    widest : largest width of images, in pixels; 0 for any"""
    files = [] if environments == EMBEDDED else find_environments(environments, [], 0)
    from_files = {source.name for source in files}
    rng = np.random.default_rng(seed)
    queues = []
    for run in (one for whole in published_runs(results) for one in together(whole)):
        if "planned" not in run.record or 0 < widest < run.record["scale"]["width"]:
            continue
        maps = set(places.names()) if _is_embedded(run) else from_files
        rows = run.rows[_possible(run, maps)]
        queues.append([(run, rows.iloc[k]) for k in rng.permutation(len(rows))[:count]])
    rng.shuffle(queues)
    turns = (queue[k] for k in range(count) for queue in queues if k < len(queue))
    found = [one for one, _ in zip(turns, range(count), strict=False)]
    if not found:
        raise EnvlightError(
            f"{results}: no run over a grid on maps that are there; give --environments"
        )
    return found


def _is_embedded(run: Run) -> bool:
    suite = SUITE.search(_command(run))
    return suite is None or suite.group(1) == EMBEDDED


def _command(run: Run) -> str:
    return str(run.parts[0].get("command", ""))


def _possible(run: Run, maps: set[str]) -> pd.Series:
    """Which rows of a run can be made again here."""
    rows = run.rows
    return (
        rows["environment"].isin(maps)
        & rows["scene"].isin(scenes_of(_experiment(run)))
        & rows["sampler"].map(family_of).isin(sampler_names())
        & (rows["repaired"] == 0)
    )


def scenes_of(found: GridExperiment) -> dict[str, str]:
    """Built-in scenes and the experiment's own, by what rows call them."""
    return {name_and_file(scene)[0]: scene for scene in (*scenes.names(), *found.scenes)}


def _experiment(run: Run) -> GridExperiment:
    found = find_experiment(run.record["experiment"])
    assert isinstance(found, GridExperiment), run.folder
    return found


def measurement_of(run: Run, row: pd.Series, environments: str) -> Measurement:
    """Set up what the row is of, as its run did, at the size that the run had."""
    found = _experiment(run)
    noise = NOISE.search(_command(run))
    asked = RunRequest(
        found.name, run.record["scale"]["name"], EMBEDDED if _is_embedded(run) else environments,
        maps=[row["environment"]], scenes=[scenes_of(found)[row["scene"]]],
        samplers=[row["sampler"]], budgets=[row["budget"]], output=None, repair=False,
        images=False, threads=0, reference_noise=float(noise.group(1)) if noise else 0.0,
        seeds=int(row["seed"]) + 1,
    )  # fmt: skip
    fitting = [one for one in found.grid(asked).measurements() if one.seed == row["seed"]]
    if len(fitting) != 1:
        raise EnvlightError(
            f"{run.folder}: {row['sampler']} on {row['environment']} with seed {row['seed']} is no "
            "measurement of its experiment any more; measure the run anew"
        )
    size = {name: run.record["scale"][name] for name in ("width", "height", "subpixels", "sets")}
    (one,) = fitting
    return replace(one, case=replace(one.case, scale=replace(one.case.scale, **size)))


def again(one: Measurement, count: int, folder: Path, runs: Path) -> tuple[Row, Row]:
    """Make a measurement anew at a count: the image's values, and the scores.

    The case's reference is taken from a run in `runs` that these methods made, or made in `folder`.
    """
    place, reference = runs / BESIDE, None
    if (place / DATABASE).is_file():
        with Store.reading(folder, place) as store:
            stored = store.get(one.case.reference_key)
        if stored is not None and has_reference(place, one.case, stored.result):
            folder, reference = place, stored.result
    if reference is None:
        reference = measure_reference(ReferenceTask(one.case, str(folder)))
    task = MeasurementTask(
        one, str(folder), reference["noise_floor"], keep_image=False,
        metrics=tuple(metric.name for metric in metrics()), count=count,
    )  # fmt: skip
    made = measure(task)
    assert made.image is not None
    return made.image, {k: v for columns in made.scores.values() for k, v in columns.items()}


def agreement(row: pd.Series, image: Row, scores: Row, reference: str) -> dict[str, Any]:
    """How many values both rows have, by how much the worst differs, of the larger, and its kind.

    image, scores : as `again` makes them
    reference : key of the reference that the scores are to; only where the row's is another one, so
        that both are off by noise, may errors differ by it"""
    of_image = _differences(row, image)
    differences = {**of_image, **_differences(row, scores)}
    worst = max(differences, key=lambda name: differences[name])
    largest = differences[worst]
    kind = SAME if largest == 0.0 else CLOSE_BY if largest <= CLOSE else DIFFERS
    image_agrees = max(of_image.values()) <= CLOSE
    if kind == DIFFERS and row["reference"] != reference and image_agrees:
        kind = WITHIN_NOISE if _within_noise(row, scores) else DIFFERS
    of = worst if largest > 0.0 else ""
    return {"values": len(differences), "largest": largest, "of": of, "kind": kind}


def _differences(row: pd.Series, made: Row) -> dict[str, float]:
    """Relative differences, of the larger, of the numbers that a machine does not decide."""
    names = [
        name
        for name, value in made.items()
        if name in row.index
        and name not in NOT_COMPARED
        and not MACHINES_OWN.match(name)
        and isinstance(value, int | float | np.number)
        and not isinstance(value, bool)
    ]
    before, after = ([float(one[name]) for name in names] for one in (row, made))
    found = relative_difference(np.array(before), np.array(after))
    return dict(zip(names, found.tolist(), strict=True))


def _within_noise(row: pd.Series, scores: Row) -> bool:
    """Whether the errors that rank differ by no more than what the noise of both references gives.

    RMSE is a distance: those to two references differ by at most theirs. FLIP is taken to be one.
    """
    return all(
        abs(float(row[metric.name]) - float(scores[metric.name]))
        <= float(row[metric.floor_column]) + float(scores[metric.floor_column])
        for metric in ranked_metrics()
    )


def made_again(
    rows: list[tuple[Run, pd.Series]], environments: str, runs: Path = Path("runs")
) -> pd.DataFrame:
    """Make all drawn rows again; those that differ are printed."""
    found = []
    for run, row in rows:
        one = measurement_of(run, row, environments)
        with tempfile.TemporaryDirectory() as folder:
            made = again(one, int(row["count"]), Path(folder), runs)
        line = {"run": run.folder.name, **agreement(row, *made, one.case.reference_key)}
        print(
            f"{line['run']}: {one}: {line['kind']} {line['of']} {line['largest']:.2g}", flush=True
        )
        found.append(line)
    return pd.DataFrame(found)


def by_kind(rows: pd.DataFrame) -> pd.DataFrame:
    """How many of how many runs agree and how, in one row; the largest relative difference."""
    line = {
        "runs": rows["run"].nunique(),
        "drawn": len(rows),
        **{kind: int((rows["kind"] == kind).sum()) for kind in KINDS},
        "values": rows["values"].sum(),
        "largest": rows["largest"].max(),
    }
    return pd.DataFrame([line])
