"""Do measurements that were published come out again, by the methods as they are now?

Of every published run over a grid, in the folder `results`, measurements are drawn at random and
made again: the reference, by these methods, the image at the count that the row tells, so that
budgets of seconds can be judged, too, and the scores. What a row says of counts, lights, rays and
errors must be what it said; times, which the machine decides, are left out. Where references are
made otherwise than they were, both are off by noise, and so are errors to them: these may differ by
no more than both noises together, while the image's own values may not. At scale quick runs of
small images are drawn from alone, at paper all.

Maps from files are those of `--environments`; runs on others, or with samplers or scenes from
files, are left out.
"""

import re
import zlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from experiments.maps import places
from experiments.maps.sources import EMBEDDED, find_environments
from experiments.report.compare import CLOSE, relative_difference
from experiments.report.paired_rows import MACHINES_OWN
from experiments.report.parts import Items, Part, Table, Text
from experiments.report.publish import MEASURED_AGAIN, methods_of, published_runs
from experiments.report.sentences import counted
from experiments.run.experiment import (
    GridExperiment,
    Group,
    Job,
    Row,
    Study,
    experiment,
    find_experiment,
)
from experiments.run.loaded_run import Run
from experiments.run.measure import MeasurementTask, ReferenceTask, measure, measure_reference
from experiments.run.measurement import Measurement
from experiments.run.request import RunRequest
from experiments.run.runner import run_folder
from experiments.run.sampler_spec import family_of
from experiments.run.scale import find_scale
from experiments.run.scene_choice import name_and_file
from experiments.run.shared_results import take_reference
from metrics.registry import metrics, ranked_metrics
from renderer import scenes
from samplers import EnvlightError, sampler_names

RESULTS = Path("results")
DRAWN = 2
"""Measurements of each run."""
NOISE = re.compile(r"--reference-noise[ =](\S+)")
SUITE = re.compile(r"--environments[ =](\S+)")
NOT_COMPARED = ("seed", "repaired")
KINDS = SAME, CLOSE_BY, WITHIN_NOISE, DIFFERS = "same", "close", "noise", "differs"
FORMATS = {
    "run": "s", "scene": "s", "environment": "s", "sampler": "s", "budget": "s", "seed": "d",
    "count": "d", "methods": "s", "values": "d", "largest": ".2g", "of": "s", "kind": "s",
}  # fmt: skip


@experiment(MEASURED_AGAIN)
def measured_again() -> Study:
    """Published measurements, drawn at random, made again by the methods as they are now."""
    return Study(
        title="Published measurements made again",
        sections=(every_one,),
        groups=groups,
        sources=(__name__, "experiments.run.measure"),
        timed=False,
        findings=findings,
    )


def groups(request: RunRequest) -> list[Group]:
    """A group per measurement; EnvlightError where nothing can be drawn."""
    folder = run_folder(request.output, MEASURED_AGAIN, request.scale)
    widest = find_scale(request.scale).width
    runs = [
        run
        for run in published_runs(RESULTS)
        if "planned" in run.record and run.record["scale"]["width"] <= widest
    ]
    there = _maps_there(request)
    found = [_group(run, row, request, folder) for run in runs for row in drawn(run, there)]
    if not found:
        raise EnvlightError(
            f"{RESULTS}: no run over a grid on maps that are there; give --environments"
        )
    return found


def _maps_there(request: RunRequest) -> frozenset[str]:
    """Names of the maps that measurements can be made on."""
    if request.environments == EMBEDDED:
        return frozenset(places.names())
    files = find_environments(request.environments, request.maps, 0, request.repair)
    return frozenset({*places.names(), *(source.name for source in files)})


def drawn(run: Run, maps: frozenset[str]) -> list[pd.Series]:
    """Rows at random, the same ones at every start: the run's name is the seed."""
    rows = run.rows
    possible = rows[
        rows["environment"].isin(maps)
        & rows["scene"].isin(scenes_of(_experiment(run)))
        & rows["sampler"].map(family_of).isin(sampler_names())
        & (rows["repaired"] == 0)
    ]
    rng = np.random.default_rng(zlib.crc32(run.folder.name.encode()))
    chosen = rng.permutation(len(possible))[:DRAWN]
    return [possible.iloc[int(place)] for place in sorted(chosen)]


def scenes_of(found: GridExperiment) -> dict[str, str]:
    """Built-in scenes and the experiment's own, by what rows call them."""
    return {name_and_file(scene)[0]: scene for scene in (*scenes.names(), *found.scenes)}


def _experiment(run: Run) -> GridExperiment:
    found = find_experiment(run.record["experiment"])
    assert isinstance(found, GridExperiment), run.folder
    return found


def _group(run: Run, row: pd.Series, request: RunRequest, folder: Path) -> Group:
    one = measurement_of(run, row, request)
    columns = {
        "run": run.folder.name,
        **{name: row[name] for name in ("scene", "environment", "sampler", "budget")},
        "seed": int(row["seed"]),
        "count": int(row["count"]),
        "width": one.case.scale.width,
        "height": one.case.scale.height,
        "methods": methods_of(run),
    }

    def measured(names: Sequence[str]) -> dict[str, Row]:
        made = again(one, int(row["count"]), folder)
        return dict.fromkeys(names, agreement(row, *made, one.case.reference_key))

    depends_on = {"published": row["key"], "image": one.key, "scores": one.score_keys}
    return Group(f"{run.folder.name}: {one}", {str(one): Job(columns, depends_on)}, measured)


def measurement_of(run: Run, row: pd.Series, request: RunRequest) -> Measurement:
    """What the row is of, set up as its run did."""
    found = _experiment(run)
    command = str(run.parts[0].get("command", ""))
    suite, noise = SUITE.search(command), NOISE.search(command)
    embedded = suite is None or suite.group(1) == EMBEDDED
    asked = RunRequest(
        found.name,
        run.record["scale"]["name"],
        EMBEDDED if embedded else request.environments,
        maps=[row["environment"]],
        scenes=[scenes_of(found)[row["scene"]]],
        samplers=[row["sampler"]],
        budgets=[row["budget"]],
        output=None,
        repair=False,
        images=False,
        threads=request.threads,
        reference_noise=float(noise.group(1)) if noise else 0.0,
        seeds=int(row["seed"]) + 1,
    )
    fitting = [one for one in found.grid(asked).measurements() if one.seed == row["seed"]]
    if len(fitting) != 1:
        raise EnvlightError(
            f"{run.folder}: {row['sampler']} on {row['environment']} with seed {row['seed']} is no "
            "measurement of its experiment any more; measure the run anew"
        )
    return _at_the_size_of(run, fitting[0])


def _at_the_size_of(run: Run, one: Measurement) -> Measurement:
    """The measurement at the run's own size, which may not be what its scale has today."""
    size = {name: run.record["scale"][name] for name in ("width", "height", "subpixels", "sets")}
    return replace(one, case=replace(one.case, scale=replace(one.case.scale, **size)))


def again(one: Measurement, count: int, folder: Path) -> tuple[Row, Row]:
    """The image's values and the scores of the measurement, made anew at a count.

    The case's reference is taken from the run's folder or one beside it where these methods made
    it already; nothing else is taken.
    """
    reference = take_reference(one.case, folder, folder.parent)
    if reference is None:
        reference = measure_reference(ReferenceTask(one.case, str(folder)))
    task = MeasurementTask(
        one, str(folder), reference["noise_floor"], keep_image=False,
        metrics=tuple(metric.name for metric in metrics()), count=count,
    )  # fmt: skip
    made = measure(task)
    assert made.image is not None
    return made.image, {k: v for columns in made.scores.values() for k, v in columns.items()}


def agreement(row: pd.Series, image: Row, scores: Row, reference: str) -> Row:
    """How many values both rows have, by how much the worst differs, of the larger, and its kind.

    image, scores : as `again` makes them
    reference : key of the reference that the scores are to; only where the row's is another one, so
        that both are off by noise, may errors differ by it
    """
    of_image = _differences(row, image)
    differences = {**of_image, **_differences(row, scores)}
    worst = max(differences, key=lambda name: differences[name])
    largest = differences[worst]
    kind = SAME if largest == 0.0 else CLOSE_BY if largest <= CLOSE else DIFFERS
    image_agrees = max(of_image.values()) <= CLOSE
    made_otherwise = row["reference"] != reference
    if kind == DIFFERS and made_otherwise and image_agrees and _within_noise(row, scores):
        kind = WITHIN_NOISE
    return {
        "values": len(differences),
        "largest": largest,
        "of": worst if largest > 0.0 else "",
        "kind": kind,
    }


def _differences(row: pd.Series, made: Mapping[str, Any]) -> dict[str, float]:
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


def _within_noise(row: pd.Series, scores: Mapping[str, Any]) -> bool:
    """Whether the errors that rank differ by no more than what the noise of both references gives.

    RMSE is a distance: those to two references differ by at most theirs. FLIP is taken to be one.
    """
    return all(
        abs(float(row[metric.name]) - float(scores[metric.name]))
        <= float(row[metric.floor_column]) + float(scores[metric.floor_column])
        for metric in ranked_metrics()
    )


def every_one(run: Run) -> Iterator[Part]:
    """What was drawn, and whether it came out again."""
    yield Items(tuple(findings(run)))
    yield Table("measured_again", run.rows, FORMATS)
    yield Text(
        "`values` are numbers of a row that the machine does not decide: count, lights, rays and "
        "what the metrics say; `largest` is the largest relative difference of them, `of` where it "
        "is. `noise`: count, lights and rays are as they were, and RMSE and FLIP differ by no more "
        "than the noise of the two references together, which were not made alike. An image at a "
        "budget of seconds was made at the `count` that its row tells. `methods` is the digest of "
        "samplers, renderer and metrics that the published run was measured by. A ray that meets "
        "the edge of two triangles finds one or the other by which rays are traced beside it: "
        "where methods trace them in another order, single sub-pixels may differ."
    )


def findings(run: Run) -> list[str]:
    """How many came out again, of how many runs, and of which states of the methods."""
    rows = run.rows
    kinds = {kind: int((rows["kind"] == kind).sum()) for kind in KINDS}
    own = methods_of(run)
    others = rows[rows["methods"] != own]
    said = [
        f"{counted(len(rows), 'measurement')} of {counted(rows['run'].nunique(), 'published run')}"
        f", drawn at random and made again: {kinds[SAME]} agree to the last digit, "
        f"{kinds[CLOSE_BY]} within a relative {CLOSE:g}, {kinds[WITHIN_NOISE]} within the noise of "
        f"both references; {kinds[DIFFERS]} differ. {rows['values'].sum()} values were compared."
    ]
    if len(others):
        same = int((others["kind"] == SAME).sum())
        said.append(
            f"{len(others)} of them are of runs by "
            f"{counted(others['methods'].nunique(), 'other state')} of samplers, renderer and "
            f"metrics: {same} of these agree to the last digit."
        )
    if kinds["differs"]:
        worst = rows.iloc[int(rows["largest"].argmax())]
        said.append(
            f"The worst: {worst['sampler']} on {worst['environment']} in {worst['run']}, whose "
            f"{worst['of']} differs by {worst['largest']:.2g} of the larger."
        )
    return said
