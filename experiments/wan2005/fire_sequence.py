"""A still place on fire: maps, images and references, frame by frame.

Maps add, and with them images: a frame's reference is the still map's, rendered once and shared by
all frames, plus that of the frame's fire alone. The noise of the still part, the larger one, then
cancels in the difference of two frames. Both are references of cases, as a grid has them.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from experiments.maps import places
from experiments.maps.sources import EnvironmentSource
from experiments.run.case import Case
from experiments.run.identity import digest, source_digest
from experiments.run.judging import truth_in
from experiments.run.rendering import case_view
from metrics.truth import Image, Truth
from renderer.render import render
from samplers import EnvironmentMap, Lighting
from samplers.sphere import pixel_directions

BRIGHTNESS = 20.0
"""Luminance of the hottest flames over the still map's mean. A full ring holds about twice the
energy of the place; near the horizon as it is, it gives the ground of a lit hall a quarter more."""
GRID_ROWS = 32
"""Rows of the grid on which the change of the maps themselves is measured."""
KEPT_FRAMES = 8
"""Maps and references that stay in memory."""

Energies = tuple[NDArray[np.float64], NDArray[np.float64]]
"""Directions (n, 3) and luminous energies (n,)."""


@dataclass(frozen=True)
class Flames(EnvironmentSource):
    """What burns in a frame, without the place. level : luminance of the hottest flames"""

    frame: int = 0
    level: float = 0.0

    @classmethod
    def of(cls, frame: int, level: float, height: int) -> "Flames":
        """A source whose name tells all that determines it, as the name of a place does."""
        name = f"fire-{frame:03d}-{digest([level, source_digest(places.fire.__module__)])[:8]}"
        return cls(name, height=height, frame=frame, level=level)

    def load(self) -> EnvironmentMap:
        return EnvironmentMap(
            np.float32(self.level) * places.fire(self.frame, self.height), self.name
        )


class FireSequence:
    """A scene in a still place with the fire about it; frames are made on demand.

    still : the case of the place without fire; folder : of the run, which keeps references
    """

    def __init__(self, still: Case, folder: Path) -> None:
        self.still, self.folder = still, folder
        self.map: Callable[[int], EnvironmentMap] = lru_cache(KEPT_FRAMES)(self._map)
        self.truth: Callable[[int], Truth] = lru_cache(KEPT_FRAMES)(self._truth)

    @cached_property
    def place(self) -> EnvironmentMap:
        """The map without fire."""
        return self.still.environment.load()

    @cached_property
    def still_truth(self) -> Truth:
        """The reference without fire; its exposure is that of all frames."""
        return truth_in(self.folder, self.still)

    def flames(self, frame: int) -> Flames:
        """What burns in a frame."""
        level = BRIGHTNESS * self.place.luminous_flux / (4.0 * math.pi)
        return Flames.of(frame, level, self.place.height)

    def _map(self, frame: int) -> EnvironmentMap:
        burning = self.flames(frame).load().radiance
        return EnvironmentMap(self.place.radiance + burning, f"{self.place.name} on fire {frame}")

    def _truth(self, frame: int) -> Truth:
        still = self.still_truth
        case = Case(self.still.scene, self.flames(frame), self.still.scale, self.still.scene_file)
        fire_alone = truth_in(self.folder, case)
        share = still.exposure / fire_alone.exposure

        def both(place: Image, burning: Image) -> Image:
            return (place + share * burning.astype(np.float64)).astype(np.float32)

        assert still.halves is not None and fire_alone.halves is not None
        first, second = map(both, still.halves, fire_alone.halves)
        floor = math.hypot(still.noise_floor, share * fire_alone.noise_floor)
        return Truth(both(still.image, fire_alone.image), still.exposure, floor, (first, second))

    def change_floor(self, before: int, now: int) -> float:
        """RMSE by noise of the change between two references: the still part cancels."""
        still = self.still_truth.noise_floor
        return math.sqrt(
            sum(max(0.0, self.truth(frame).noise_floor ** 2 - still**2) for frame in (before, now))
        )

    def image(self, frame: int, lighting: Lighting) -> Image:
        """A frame by a global set of lights, the same set for all pixels; before exposure."""
        return render(case_view(self.still), lighting, self.map(frame), sets=1).image

    def grid(self, frame: int) -> Energies:
        """The frame's map itself as lights: one per cell of a coarse grid."""
        height = self.place.height
        rows = math.gcd(GRID_ROWS, height)
        cells = self.map(frame).flux.reshape(rows, height // rows, 2 * rows, -1)
        return pixel_directions(rows).reshape(-1, 3), cells.sum(axis=(1, 3)).ravel()
