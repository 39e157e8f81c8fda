"""A still place on fire, frame by frame: maps, images, references, and what changes.

Maps add, and with them images: a frame's reference is the still map's, rendered once and shared by
all frames, plus that of the frame's fire alone. The noise of the still part, the larger one, then
cancels in the difference of two frames. Both are references of cases, as a grid has them. From
frame to frame change the lights, the images, and the Q²-tree, which is timed.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from experiments.maps import places
from experiments.maps.sources import EnvironmentSource
from experiments.run.bench import interleaved
from experiments.run.case import Case
from experiments.run.experiment import Row
from experiments.run.identity import digest, source_digest
from experiments.run.judging import scores, truth_in
from experiments.run.rendering import case_view
from experiments.run.sampler_spec import SamplerSpec
from metrics.errors import rmse
from metrics.registry import ranked_metrics
from metrics.transport import transport_distance
from metrics.truth import Image, Truth
from renderer.render import render
from samplers import EnvironmentMap, Lighting
from samplers.conformance.suite import parts_of
from samplers.environment import LUMINANCE_WEIGHTS
from samplers.grids.quad_map import QuadMap
from samplers.q2_tree import Q2Tree
from samplers.sphere import pixel_directions

Frames = Iterator[tuple[int, Lighting]]
Seen = Callable[[int, Lighting, Image], None]
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


def lights_alone(
    sequence: FireSequence, spec: SamplerSpec, count: int, frames: Sequence[int]
) -> Frames:
    """A sampler's lights in each frame, with the same seed."""
    for frame in frames:
        rng = np.random.default_rng(0)
        yield frame, spec.sampler.prepare(sequence.map(frame), count, rng)


def lights_calmed(
    sequence: FireSequence, tolerance: float, count: int, frames: Sequence[int]
) -> Frames:
    """The Q²-tree's: the tree of the frame before, mended until it is nearly in order."""
    tree = None
    for frame in frames:
        map_now = sequence.map(frame)
        tree = tree.update(map_now, tolerance) if tree else Q2Tree.build(map_now, count)
        yield frame, tree.lights()


@dataclass(frozen=True, eq=False)
class _Frame:
    """image : exposed; judged : the columns of the ranked metrics"""

    number: int
    lights: Energies
    image: Image
    judged: Row

    @classmethod
    def of(cls, sequence: FireSequence, number: int, lighting: Lighting) -> "_Frame":
        image, truth = sequence.image(number, lighting), sequence.truth(number)
        names = [metric.name for metric in ranked_metrics()]
        judged = {name: found[name] for name, found in scores(image, truth, names).items()}
        return cls(number, energies(lighting), truth.exposed(image), judged)


def changes(sequence: FireSequence, frames: Frames, seen: Seen) -> dict[int, Row]:
    """A row for each frame but the first. seen : is shown every frame's lights and exposed image"""
    rows: dict[int, Row] = {}
    before: _Frame | None = None
    for number, lighting in frames:
        now = _Frame.of(sequence, number, lighting)
        seen(number, lighting, now.image)
        if before is not None:
            rows[number] = _change(sequence, before, now)
        before = now
    return rows


def _change(sequence: FireSequence, before: _Frame, now: _Frame) -> Row:
    change_of_image = now.image - before.image
    true_change = sequence.truth(now.number).image - sequence.truth(before.number).image
    nothing = np.zeros_like(true_change)
    away = unburnt(before.lights), unburnt(now.lights)
    return {
        "lights": len(now.lights[1]),
        "lights_change": change(before.lights, now.lights),
        "map_change": change(sequence.grid(before.number), sequence.grid(now.number)),
        "unburnt_change": change(*away),
        "unburnt_kept": kept_share(*away),
        "image_change": rmse(change_of_image, nothing),
        "true_change": rmse(true_change, nothing),
        "temporal_noise": rmse(change_of_image, true_change),
        "change_floor": sequence.change_floor(before.number, now.number),
        **now.judged,
    }


def energies(lighting: Lighting) -> Energies:
    """The lights of one or two global sets and their luminous energies."""
    directions, irradiances, _ = zip(*parts_of(lighting), strict=True)
    energy = [irradiance @ LUMINANCE_WEIGHTS for irradiance in irradiances]
    return np.concatenate(directions), np.concatenate(energy)


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


def tree_times(sequence: FireSequence, frame: int, count: int, rounds: int) -> Row:
    """Seconds of the Q²-tree from scratch and from the frame before, and what both share.

    alone, coherent : from the map to its lights; tree_alone, tree_coherent : the tree, on a map
    that was read; reading : the pass over the map
    """
    now, before = sequence.map(frame), Q2Tree.build(sequence.map(frame - 1), count)
    source = QuadMap.of(now)
    tasks: dict[str, Callable[[], object]] = {
        "alone": lambda: Q2Tree.build(now, count).lights(),
        "coherent": lambda: before.update(now).lights(),
        "reading": lambda: QuadMap.of(now),
        "tree_alone": lambda: Q2Tree.grown(source, count),
        "tree_coherent": lambda: before.mended(source),
    }
    columns: Row = {}
    for name, timing in interleaved(tasks, rounds).items():
        columns |= timing.columns(f"seconds_{name}")
    alone, coherent = Q2Tree.build(now, count), before.update(now)
    lights, mended = alone.lights(), coherent.lights()
    same = np.array_equal(lights.direction, mended.direction)
    return {
        **columns,
        "identical": int(same and np.array_equal(lights.irradiance, mended.irradiance)),
        "quads_changed": len(set(alone.leaves) - set(before.leaves)),
    }
