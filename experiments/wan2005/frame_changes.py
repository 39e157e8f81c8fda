"""What changes from frame to frame: lights, images, and the time of the Q²-tree."""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from experiments.maps import places
from experiments.run.bench import interleaved
from experiments.run.experiment import Row
from experiments.run.judging import scores
from experiments.run.sampler_spec import SamplerSpec
from experiments.wan2005.fire_sequence import Energies, FireSequence
from metrics.errors import rmse
from metrics.registry import ranked_metrics
from metrics.transport import transport_distance
from metrics.truth import Image
from samplers import DirectionalLights, LayeredLights, Lighting
from samplers.environment import LUMINANCE_WEIGHTS
from samplers.grids.quad_map import QuadMap
from samplers.q2_tree import Q2Tree

Frames = Iterator[tuple[int, Lighting]]
Seen = Callable[[int, Lighting, Image], None]


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
    return {
        **columns,
        "identical": int(same_lights(alone.lights(), coherent.lights())),
        "quads_changed": len(set(alone.leaves) - set(before.leaves)),
    }


def same_lights(a: DirectionalLights, b: DirectionalLights) -> bool:
    """Whether two sets agree bit for bit."""
    return np.array_equal(a.direction, b.direction) and np.array_equal(a.irradiance, b.irradiance)
