"""A still place on fire: maps, lights, images and references, frame by frame.

Maps add, and with them images: a frame's reference is the still map's, rendered once and shared by
all frames, plus that of the frame's fire alone. The noise of the still part, the larger one, then
cancels in the difference of two frames.
"""

import math
from collections.abc import Callable
from functools import cache, cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from experiments.maps import places
from experiments.maps.sources import EnvironmentSource
from experiments.run.identity import source_digest
from experiments.run.kept_reference import KeptReference, kept_reference
from experiments.run.scale import Scale
from metrics.errors import exposure_scale
from metrics.transport import transport_distance
from renderer import scenes
from renderer.render import render
from renderer.view import View, make_view
from samplers import DirectionalLights, EnvironmentMap, LayeredLights, Lighting
from samplers.environment import LUMINANCE_WEIGHTS
from samplers.sphere import pixel_directions

BRIGHTNESS = 20.0
"""Luminance of the hottest flames over the still map's mean. A full ring holds about twice the
energy of the place; near the horizon as it is, it gives the ground of a lit hall a quarter more."""
GRID_ROWS = 32
"""Rows of the grid on which the change of the maps themselves is measured."""

Image = NDArray[np.float32]
Energies = tuple[NDArray[np.float64], NDArray[np.float64]]
"""Directions (n, 3) and luminous energies (n,)."""


class FireSequence:
    """A scene in a still place with the fire about it; frames are made on demand and kept."""

    def __init__(self, scene: str, still: EnvironmentSource, scale: Scale, folder: Path) -> None:
        self.scene, self.source, self.scale, self.folder = scene, still, scale, folder
        self.map: Callable[[int], EnvironmentMap] = cache(self._map)
        self.reference: Callable[[int], KeptReference] = cache(self._reference)

    @property
    def identity(self) -> dict:
        """All that determines the maps and the references."""
        scale = self.scale
        return {
            "scene": [self.scene, source_digest(f"renderer.scenes.{self.scene.replace('-', '_')}")],
            "still": self.source.identity,
            "view": [scale.width, scale.height, scale.subpixels],
            "quality": [scale.noise_target, scale.max_samples],
            "source": source_digest(__name__),
        }

    @cached_property
    def still(self) -> EnvironmentMap:
        """The place without fire."""
        return self.source.load()

    @cached_property
    def view(self) -> View:
        """The scene, seen once for all frames."""
        scale = self.scale
        return make_view(scenes.make(self.scene), scale.width, scale.height, scale.subpixels)

    def fire_alone(self, frame: int) -> EnvironmentMap:
        """What burns in a frame, without the place."""
        level = BRIGHTNESS * self.still.luminous_flux / (4.0 * math.pi)
        radiance = np.float32(level) * places.fire(frame, self.still.height)
        return EnvironmentMap(radiance, f"fire {frame}")

    def _map(self, frame: int) -> EnvironmentMap:
        burning = self.fire_alone(frame).radiance
        return EnvironmentMap(self.still.radiance + burning, f"{self.still.name} on fire {frame}")

    def _reference(self, frame: int) -> KeptReference:
        burning = self._kept(self.fire_alone(frame))
        return KeptReference(burning.image + self.still_reference, burning.noise_floor)

    @cached_property
    def still_reference(self) -> Image:
        """The scene in the place without fire."""
        return self._kept(self.still).image

    def _kept(self, environment: EnvironmentMap) -> KeptReference:
        return kept_reference(self.folder, self.view, environment, self.scale)

    @cached_property
    def exposure(self) -> float:
        """One factor for all frames: that of the place without fire."""
        return exposure_scale(self.still_reference, self.view.coverage > 0.0)

    def image(self, frame: int, lighting: Lighting) -> Image:
        """A frame lit by a global set of lights, the same set for all pixels."""
        return render(self.view, lighting, self.map(frame), sets=1).image

    def grid(self, frame: int) -> Energies:
        """The frame's map itself as lights: one per cell of a coarse grid."""
        rows = math.gcd(GRID_ROWS, self.still.height)
        cells = self.map(frame).flux.reshape(rows, self.still.height // rows, 2 * rows, -1)
        return pixel_directions(rows).reshape(-1, 3), cells.sum(axis=(1, 3)).ravel()


def energies(lighting: Lighting) -> Energies:
    """The lights of one or two global sets and their luminous energies."""
    assert isinstance(lighting, DirectionalLights | LayeredLights)
    layers = (
        [lighting] if isinstance(lighting, DirectionalLights)
        else [lighting.direct, lighting.indirect]
    )  # fmt: skip
    energy = [layer.irradiance @ LUMINANCE_WEIGHTS for layer in layers]
    return np.concatenate([layer.direction for layer in layers]), np.concatenate(energy)


def change(before: Energies, after: Energies) -> float:
    """How far lights moved between two frames, in degrees per unit of the energy that there is."""
    energy = 0.5 * (before[1].sum() + after[1].sum())
    if not energy > 0.0:
        return 0.0
    return math.degrees(transport_distance(*before, *after) / energy)


def unburnt(lights: Energies) -> Energies:
    """The lights where no flame ever is."""
    direction, energy = lights
    lowest, highest = places.FIRE_SINES
    away = (direction[:, 1] <= lowest) | (direction[:, 1] >= highest)
    return direction[away], energy[away]


def kept_share(before: Energies, after: Energies) -> float:
    """Share of the energy, before and after, of lights that stay as they are, to five digits."""
    total = before[1].sum() + after[1].sum()
    if not total > 0.0:
        return 1.0
    known = set(_names(before))
    kept = [name in known for name in _names(after)]
    return 2.0 * float(after[1][kept].sum()) / float(total)


def _names(lights: Energies) -> list[tuple[str, ...]]:
    return [
        (f"{x:.5f}", f"{y:.5f}", f"{z:.5f}", f"{energy:.5g}")
        for (x, y, z), energy in zip(lights[0].tolist(), lights[1].tolist(), strict=True)
    ]
