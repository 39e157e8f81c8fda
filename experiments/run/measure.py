"""The tasks of a run: rendering a reference, and measuring; whichever process they are sent to.

What a sampler of anybody's may do to a program is end it, or never end. Neither gets through:
Python code that takes too long is interrupted where it is, and so is waiting where the system has
an alarm for it. Where that has no effect, as in machine code, its process is ended: a run in
processes goes on without that measurement, another keeps what it has stored.
"""

import ctypes
import os
import signal
import sys
import threading
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from traceback import walk_tb
from types import FunctionType
from typing import Any, ParamSpec, TypeVar
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from experiments.run.case import MAP_FEATURES, SCENE_FEATURES, Case
from experiments.run.judging import scores, truth_of
from experiments.run.kept_images import pixel_digest, stored_image, undamaged
from experiments.run.machine import CLEAR, in_fresh_process, peak_memory_mib
from experiments.run.measurement import Measurement
from experiments.run.rendering import (
    SHARED_TABLES,
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
from renderer.image import write_exr
from renderer.view import View
from samplers import EnvironmentMap, EnvlightError, LayeredLights, PictureDistribution
from samplers.conformance.lighting_check import contained

P = ParamSpec("P")
R = TypeVar("R")
GRACE_SECONDS = 10.0
"""What was interrupted must have ended by then."""


class _TimeIsUp(BaseException):
    """No `except Exception` of a sampler's is meant to catch it."""


class _Clock:
    """Interrupts the thread that made it some seconds after it was begun, unless it was stopped."""

    def __init__(self, seconds: float) -> None:
        self._seconds, self._thread = seconds, threading.get_ident()
        main = threading.current_thread() is threading.main_thread()
        self._alarm = getattr(signal, "SIGALRM", None) if main else None
        self._before = self._alarm and signal.signal(self._alarm, self._ring)
        self._lock = threading.Lock()
        self.begun, self._stopped = threading.Event(), threading.Event()
        threading.Thread(target=self._run, daemon=True).start()

    def _run(self) -> None:
        self.begun.wait()
        if self._stopped.wait(self._seconds):
            return
        with self._lock:
            if not self._stopped.is_set():
                self._raise_there(_TimeIsUp)
        if not self._stopped.wait(GRACE_SECONDS):
            print(
                f"envlight: a measurement neither ended within {self._seconds:g} s (--timeout) nor "
                "when it was interrupted; its process ends here, what is stored stays. With "
                "--executor processes the others go on, but for those at budgets of time",
                file=sys.stderr,
                flush=True,
            )
            os._exit(1)

    def stop(self) -> None:
        with self._lock:
            self._stopped.set()
            self._raise_there(None)  # of an interrupt that comes too late

    def _ring(self, *_: object) -> None:
        if not self._stopped.is_set():
            raise _TimeIsUp

    def _raise_there(self, error: type[BaseException] | None) -> None:
        if self._alarm:
            if error:
                signal.pthread_kill(self._thread, self._alarm)
            else:
                signal.signal(self._alarm, self._before or signal.SIG_DFL)
            return
        ctypes.pythonapi.PyThreadState_SetAsyncExc(
            ctypes.c_ulong(self._thread), ctypes.py_object(error) if error else None
        )


def guarded(seconds: float, work: Callable[P, R], *args: P.args, **kwargs: P.kwargs) -> R:
    """The result of a sampler's work, in any thread.

    seconds : that it may take, 0 for as long as it needs

    Raises EnvlightError where it takes longer, or would end the program.
    """
    clock = _Clock(seconds) if seconds else None
    try:
        try:
            if clock:
                clock.begun.set()
            with contained():
                return work(*args, **kwargs)
        finally:
            if clock:
                clock.stop()
    except SystemExit as end:
        raise EnvlightError(
            f"it ended the program, by sys.exit({end.code!r}); let it raise an error instead"
        ) from end
    except _TimeIsUp:
        if clock:
            clock.stop()
        raise EnvlightError(f"it was not finished within {seconds:g} s (--timeout)") from None
    except BaseException as error:  # such as asyncio's cancellation, which would end the run
        hears = threading.current_thread() is threading.main_thread() and _is_users(error)
        if isinstance(error, (Exception, KeyboardInterrupt) if hears else Exception):
            raise
        raise EnvlightError(f"it raised {type(error).__name__}: {error}") from error


def _is_users(error: BaseException) -> bool:
    """Whether the system's interrupt raised this: there its handler's own frame is the last."""
    handler = signal.getsignal(signal.SIGINT)
    *_, (frame, _) = walk_tb(error.__traceback__)
    if isinstance(handler, FunctionType):
        return frame.f_code is handler.__code__
    return handler is not signal.SIG_IGN


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

    @property
    def case(self) -> Case:
        return self.measurement.case


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
        image = undamaged(stored_image(Path(task.folder), task.measurement.key), task.pixels)
        if image is not None:
            return Measured(None, scores(image, _truth(task), task.metrics), _features(task))
    scene = CaseScene.of(task.case)
    if task.count:
        return finished(task, scene, scene.shoot(task.measurement, task.count))
    fill_view(scene, task.measurement)
    return finished(task, *shoot(task.measurement))


def fill_view(scene: CaseScene, measurement: Measurement) -> None:
    """Have what is kept with the view, upsampling's smaller picture and guides or the points by
    pixel, found before the clock starts: of a view's many images only the first would pay.
    """
    filled = _filled.setdefault(scene.view, set())
    if measurement.sampler in filled:
        return
    filled.add(measurement.sampler)
    with suppress(Exception):  # the measured image reports them
        lights = rehearse_lights(measurement.sampler)
        upsampled = isinstance(lights, LayeredLights) and lights.upsampling > 1
        if upsampled or isinstance(lights, PictureDistribution):
            scene.render(measurement, lights)  # thrown away


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
        write_exr(stored_image(Path(task.folder), task.measurement.key), shot.rendering.image)
    judged = scores(shot.rendering.image, _truth(task), task.metrics)
    return Measured({**row, **columns, PIXELS: pixels}, judged, _features(task))


def _features(task: MeasurementTask) -> dict[str, Row]:
    case = task.case
    find = {
        MAP_FEATURES: lambda: cached_features(case.environment),
        SCENE_FEATURES: lambda: cached_scene_features(case.scene_file or case.scene),
    }
    return {name: find[name]() for name in task.features}


def _truth(task: MeasurementTask) -> Truth:
    return truth_of(task.case, task.folder, task.noise_floor)


def peak_of(sampler: SamplerSpec, environment: EnvironmentMap, count: int) -> float:
    """MiB that `prepare` needs at its peak beyond the map and the shared tables.

    A process's peak cannot be attributed to one of several calls, and memory that was freed earlier
    hides what is taken later, so every sampler gets a new process. There the map and the shared
    tables are made and kernels compiled on a tiny map first; then the high-water mark of resident
    memory is set back (Linux), or read before and after (elsewhere, where earlier peaks can hide a
    part).
    """
    return in_fresh_process(_peak, sampler, environment.radiance, count)


def make_tables(environment: EnvironmentMap) -> None:
    """Make the tables that samplers share."""
    for table in SHARED_TABLES:
        getattr(environment, table)


def _peak(sampler: SamplerSpec, radiance: NDArray[np.float32], count: int) -> float:
    environment = EnvironmentMap(radiance)
    make_tables(environment)
    rehearse_lights(sampler)
    with suppress(OSError):
        CLEAR.write_text("5")  # the high-water mark becomes what is resident now
    before = peak_memory_mib()
    lighting = sampler.sampler.prepare(environment, count, np.random.default_rng(0))
    after = peak_memory_mib()
    del lighting
    return after - before
