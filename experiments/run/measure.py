"""The tasks of a run: rendering a reference, and measuring; whichever process they are sent to."""

from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from weakref import WeakKeyDictionary

from experiments.run.case import MAP_FEATURES, SCENE_FEATURES, Case
from experiments.run.guard import guarded
from experiments.run.judging import scores, truth_of
from experiments.run.kept_images import Image, keep_image, kept_image, pixel_digest
from experiments.run.measurement import Measurement
from experiments.run.rendering import (
    CaseScene,
    Shot,
    cached_features,
    image_row,
    make_reference,
    rehearse_lights,
    shoot,
)
from experiments.run.sampler_spec import SamplerSpec
from experiments.run.scene_features import cached_scene_features
from experiments.run.store import PIXELS
from metrics.truth import Truth
from renderer.view import View
from samplers import EnvlightError, LayeredLights, PictureDistribution

Row = dict[str, Any]
_filled: WeakKeyDictionary[View, set[SamplerSpec]] = WeakKeyDictionary()


@dataclass(frozen=True)
class ReferenceTask:
    """Render the reference of a case into a store's folder."""

    case: Case
    folder: str


@dataclass(frozen=True)
class MeasurementTask:
    """Render what is missing of a measurement, and judge it.

    noise_floor : of the case's reference, before exposure
    keep_image : whether the image is to be kept
    metrics : names of those whose scores are missing
    rendered : whether nothing is to be rendered, unless the kept image turns out to be damaged
    features : modules of those features, of the map or the scene, that are missing, too
    count, pixels : of an image whose row is there: its count, and its pixels' hash
    timeout : seconds that it may take, 0 for as long as it needs
    """

    measurement: Measurement
    folder: str
    noise_floor: float
    keep_image: bool
    metrics: tuple[str, ...]
    rendered: bool = False
    count: int = 0
    features: tuple[str, ...] = ()
    pixels: str = ""
    timeout: float = 0.0


@dataclass(frozen=True)
class Measured:
    """What a task found.

    image : the row of an image that was rendered now, else None
    scores : by the metric's name; features : of the map and of the scene, by the module that finds
        them, where they were missing
    """

    image: Row | None
    scores: dict[str, Row]
    features: dict[str, Row] = field(default_factory=dict)


def measure_reference(task: ReferenceTask) -> Row:
    """Render a case's reference into the store's folder; returns its row."""
    return make_reference(task.case, Path(task.folder))


def measure(task: MeasurementTask) -> Measured:
    """Render, unless the image is kept, and judge a measurement that is not timed.

    Raises EnvlightError where it takes longer than it may, or its sampler would end the program.
    """
    return guarded(task.timeout, _measure, task)


def _measure(task: MeasurementTask) -> Measured:
    if task.rendered and not task.metrics:
        return Measured(None, {}, _features(task))
    if task.rendered:
        image = kept_image(Path(task.folder), task.measurement.key, task.pixels)
        if image is not None:
            return _judged_again(task, image)
    if task.count:
        scene = CaseScene.of(task.measurement.case)
        return finished(task, scene, scene.shoot(task.measurement, task.count))
    _fill_view(task.measurement)
    scene, shot = shoot(task.measurement)
    return finished(task, scene, shot)


def _fill_view(measurement: Measurement) -> None:
    """Have what is kept with the view, upsampling's smaller picture and guides or the points by
    pixel, found before the clock starts: of a view's many images only the first would pay."""
    scene, sampler = CaseScene.of(measurement.case), measurement.sampler
    filled = _filled.setdefault(scene.view, set())
    if sampler in filled:
        return
    filled.add(sampler)
    # Ignore errors here; the measured image reports them.
    with suppress(Exception):
        lights = rehearse_lights(sampler)
        upsampled = isinstance(lights, LayeredLights) and lights.upsampling > 1
        if upsampled or isinstance(lights, PictureDistribution):
            scene.render(measurement, lights)  # thrown away


def _judged_again(task: MeasurementTask, image: Image) -> Measured:
    """What is missing of a measurement whose image is kept: scores, features."""
    return Measured(None, scores(image, _truth(task), task.metrics), _features(task))


def finished(task: MeasurementTask, scene: CaseScene, shot: Shot, **columns: Any) -> Measured:
    """Keep and judge an image. columns : replace those of its row

    Raises EnvlightError where another image of the measurement is in the run's rows.
    """
    pixels = pixel_digest(shot.rendering.image)
    if task.pixels not in ("", pixels):
        raise EnvlightError(
            "its image was lost, and rendering it again gives another one; restore the folder, or "
            "start in a new one by --output"
        )
    row = image_row(task.measurement, scene, shot)
    if task.keep_image:
        keep_image(Path(task.folder), task.measurement.key, shot.rendering.image)
    judged = scores(shot.rendering.image, _truth(task), task.metrics)
    return Measured({**row, **columns, PIXELS: pixels}, judged, _features(task))


def _features(task: MeasurementTask) -> dict[str, Row]:
    case = task.measurement.case
    find = {
        MAP_FEATURES: lambda: cached_features(case.environment),
        SCENE_FEATURES: lambda: cached_scene_features(case.scene_file or case.scene),
    }
    return {name: find[name]() for name in task.features}


def _truth(task: MeasurementTask) -> Truth:
    return truth_of(task.measurement.case, task.folder, task.noise_floor)
