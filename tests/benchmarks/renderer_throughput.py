"""Rays per second of the shading kernels, beside Embree alone and beside Mitsuba 3.

Beside global lights and multiple importance sampling stand bare loops of Embree's any-hit query on
the very same shadow rays: in packets like the renderer's, and by embreex's own `run`. Where the
package `mitsuba` is installed, its `direct` integrator renders the same meshes, camera and map with
as many emitter and BSDF samples at as many sub-pixels, and is compared by time per image, primary
rays included. All run in interleaved rounds. Rays are counted by the renderer.
"""

import math
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from experiments.maps import places
from experiments.run.bench import LOAD, SPREAD, load_average, noise_sentence
from experiments.run.bench import interleaved as timed
from renderer import scenes
from renderer.area import shade_discs
from renderer.background import background_radiance
from renderer.direct import interleaved, shade_directional
from renderer.monte_carlo import SampleSplit, shade_distribution
from renderer.packet.drawn_samples import BRDF_STREAM, LIGHT_STREAM
from renderer.packet.embree import (
    DIR_X,
    DIR_Y,
    DIR_Z,
    LANES,
    ORG_X,
    ORG_Y,
    ORG_Z,
    T_FAR,
    EmbreeScene,
    new_hit_packet,
    new_valid,
    occluded,
    query_arguments,
)
from renderer.packet.lane_samples import packet_numbers
from renderer.packet.lanes import packets_of
from renderer.packet.reflectance import draw
from renderer.scene import Scene
from renderer.upsampling import guides_of, split_guides_of, upsample
from renderer.view import View, make_view
from samplers import EnvironmentMap, LayeredLights, make_sampler
from samplers.compiled import kernel
from samplers.lighting import SETS, LightDistribution
from samplers.threads import for_blocks, set_thread_count, thread_count
from tests.benchmarks.mitsuba_peer import VARIANTS, Peer, PeerSettings, is_installed

MAP, MAP_HEIGHT = "noon-desert", 512
THREADS = (1, 2)
ROUNDS = 9
MOST_GAIN = 1.1
"""Times the number of threads: what they may gain, and a little for rounding and caches."""
MIS = SampleSplit(1, 1)
RAY_BLOCK, POINT_BLOCK = 1 << 14, 1024
OWN, PACKETS, EMBREEX = "renderer", "packets of 16", "embreex"
KERNEL, SAMPLED, VIEW, DISCS = "global lights", "MIS", "primary", "disc lights"
RAYS, MS = "million rays/s", "ms"


@dataclass(frozen=True)
class Size:
    """lights : directional lights of a global set, and emitter samples of the peers for it"""

    width: int = 800
    height: int = 600
    subpixels: int = 16
    lights: int = 4


@dataclass(frozen=True, eq=False)
class Rays:
    """origin, direction : (n, 3) float32"""

    origin: NDArray[np.float32]
    direction: NDArray[np.float32]

    def __len__(self) -> int:
        return len(self.origin)


def _facing(view: View, point: NDArray, way: NDArray) -> NDArray[np.bool_]:
    """Which directions (n, 3) leave their points on both sides that count."""
    above = (view.normal[point] * way).sum(axis=1) > 0.0
    return above & ((view.geometric[point] * way).sum(axis=1) > 0.0)


def global_rays(view: View, direction: NDArray) -> Rays:
    """Rays towards sets (sets, k, 3) of lights that all carry something, as they are traced."""
    origins, ways = [], []
    for g, cell in enumerate(view.group_cell):
        point = np.arange(view.group[g], view.group[g + 1])
        for light in direction[cell % len(direction)].astype(np.float32):
            way = np.broadcast_to(light, (len(point), 3))
            faces = _facing(view, point, way)
            origins.append(view.position[point[faces]])
            ways.append(way[faces])
    return Rays(np.concatenate(origins), np.ascontiguousarray(np.concatenate(ways)))


def sampled_rays(view: View, lighting: LightDistribution, split: SampleSplit, seed: int) -> Rays:
    """Rays of light and BRDF samples, in runs of points as the renderer draws them."""
    origins, ways = [], []
    surface = (view.position, view.normal, view.geometric, view.toward_eye, view.material)
    for start in range(0, len(view), POINT_BLOCK):
        points = (start, min(start + POINT_BLOCK, len(view)))
        packets, ward = packets_of(points, *surface, view.materials)
        for count, stream in ((split.light, LIGHT_STREAM), (split.brdf, BRDF_STREAM)):
            rows = len(packets) * count * LANES
            u = np.empty((rows, 3), np.float32)
            where = (points, view.pixel, view.subpixel, view.subpixels)
            packet_numbers(*where, 0, count, seed, stream, False, u)
            if stream == LIGHT_STREAM:
                way, density = lighting.sample(u)
            else:
                way, density = np.empty_like(u), np.ones(rows, np.float32)
                draw(packets, ward, points, view.material, view.materials, u, count, way)
            point = np.tile(start + np.arange(len(packets) * LANES), count)
            used = (point < points[1]) & (density > 0.0)
            point, way = point[used], way[used]
            faces = _facing(view, point, way)
            origins.append(view.position[point[faces]])
            ways.append(way[faces])
    return Rays(np.concatenate(origins), np.concatenate(ways))


@kernel
def _trace_block(scene, origin, direction, start, stop, coherent):
    packet, valid, arguments = new_hit_packet(), new_valid(), query_arguments(coherent)
    hits = 0
    for first in range(start, stop, LANES):
        count = min(LANES, stop - first)
        for k in range(LANES):
            valid[k] = -1 if k < count else 0
        for k in range(count):
            packet[ORG_X, k] = origin[first + k, 0]
            packet[ORG_Y, k] = origin[first + k, 1]
            packet[ORG_Z, k] = origin[first + k, 2]
            packet[DIR_X, k] = direction[first + k, 0]
            packet[DIR_Y, k] = direction[first + k, 1]
            packet[DIR_Z, k] = direction[first + k, 2]
        occluded(scene, valid, packet.reshape(-1), arguments)
        for k in range(count):
            hits += 1 if packet[T_FAR, k] == -math.inf else 0
    return hits


def trace_packets(scene: EmbreeScene, rays: Rays, coherent: bool) -> int:
    """Trace all rays in packets like the renderer's, and nothing else; returns how many hit."""
    hits: list[int] = []
    arrays = (rays.origin, rays.direction)
    for_blocks(
        lambda a, b: hits.append(_trace_block(scene.handle, *arrays, a, b, coherent)),
        len(rays),
        RAY_BLOCK,
    )
    return sum(hits)


class PlainEmbree:
    """The same triangles in embreex's own scene, as robust as the renderer's."""

    def __init__(self, scene: Scene) -> None:
        from embreex.mesh_construction import TriangleMesh
        from embreex.rtcore_scene import EmbreeScene as Embreex

        self._scene = Embreex(robust=True)
        self._meshes = [
            TriangleMesh(self._scene, item.mesh.vertex, item.mesh.triangle)
            for item in scene.objects
        ]

    def trace(self, rays: Rays) -> int:
        """Trace all rays by embreex's `run`; returns how many hit."""
        hits: list[int] = []

        def block(start: int, stop: int) -> None:
            part = (rays.origin[start:stop], rays.direction[start:stop])
            hits.append(int((self._scene.run(*part, query="OCCLUDED") >= 0).sum()))

        for_blocks(block, len(rays), RAY_BLOCK)
        return sum(hits)


@dataclass(frozen=True, eq=False)
class Task:
    """A piece of work on any number of threads. rays : that it traces; 0 where only time counts"""

    work: str
    method: str
    run: Callable[[], Any]
    rays: int = 0


def own_tasks(scene: Scene, environment: EnvironmentMap, size: Size) -> list[Task]:
    """What this renderer does, and Embree alone on the same rays."""
    rng = np.random.default_rng(0)
    make = partial(make_view, scene, size.width, size.height)
    view, primary = make(size.subpixels), size.width * size.height * size.subpixels
    lights, two = (
        make_sampler("median-cut").prepare(environment, count, rng) for count in (size.lights, 2)
    )
    sampled = make_sampler("mis").prepare(environment, MIS.light + MIS.brdf, rng)
    discs = make_sampler("center-surround").prepare(environment, size.lights, rng)
    sets = interleaved(lights, SETS, rng)
    shade = {
        KERNEL: lambda seen: shade_directional(seen, *sets),
        SAMPLED: lambda seen: shade_distribution(seen, environment, sampled, 0, MIS),
    }

    def image(work: str) -> NDArray[np.float32]:
        seen = make(size.subpixels)
        return seen.to_image(shade[work](seen)[0], background_radiance(seen, environment))

    plain = PlainEmbree(scene)
    lists = {KERNEL: global_rays(view, sets[0]), SAMPLED: sampled_rays(view, sampled, MIS, 0)}
    tasks = []
    for work, rays in lists.items():
        traced = shade[work](view)[1].traced
        trace = partial(trace_packets, view.embree, rays, work == KERNEL)
        tasks += [
            Task(work, OWN, partial(shade[work], view), traced),
            Task(work, PACKETS, trace, traced),
            Task(work, EMBREEX, partial(plain.trace, rays), traced),
            Task(f"image, {work}", OWN, partial(image, work)),
        ]
    usual = make(4)  # sub-pixels of all experiments' images
    cut = interleaved(two, SETS, rng)
    return [
        *tasks,
        Task(VIEW, OWN, partial(make, size.subpixels), primary),
        Task(DISCS, OWN, partial(shade_discs, view, discs, 0),
             shade_discs(view, discs, 0)[1].shadow),
        Task("upsampling", OWN, _upsampling(usual)),
        Task("upsampling", "two lights", partial(shade_directional, usual, *cut)),
    ]  # fmt: skip


def _upsampling(view: View) -> Callable[[], Any]:
    """Upsampling alone, with the guides there: they are kept with the view."""
    near, far = float(view.depth.min()), float(view.depth.max())
    small = guides_of(view.reduced(LayeredLights.upsampling), (near, far))
    noise = np.random.default_rng(0).random((*small.coverage.shape, 3), np.float32)
    return partial(upsample, noise, small, split_guides_of(view, (near, far)))


def _on_threads(threads: int, work: Callable[[], Any]) -> None:
    before = thread_count()
    set_thread_count(threads)
    try:
        work()
    finally:
        set_thread_count(before)


def rates(scene: str, size: Size = Size(), rounds: int = ROUNDS) -> pd.DataFrame:
    """Measure all; a row for each kind of work, method and number of threads."""
    made, environment = scenes.make(scene), places.make(MAP, MAP_HEIGHT)
    tasks = {
        (task.work, task.method, threads): replace(
            task, run=partial(_on_threads, threads, task.run)
        )
        for task in own_tasks(made, environment, size)
        for threads in THREADS
    }
    with ExitStack() as stack:
        for variant in VARIANTS if is_installed() else ():
            for work, samples in ((SAMPLED, (1, 1)), (KERNEL, (size.lights, 0))):
                for threads in THREADS:
                    settings = PeerSettings(
                        variant, size.width, size.height, size.subpixels, threads, *samples
                    )
                    peer = Peer(made, environment, settings)
                    stack.callback(peer.close)
                    name = (f"image, {work}", f"Mitsuba {variant}", threads)
                    tasks[name] = Task(*name[:2], partial(peer.render, 1))
        timings = timed({key: task.run for key, task in tasks.items()}, rounds)  # type: ignore[misc]
    rows, load = [], load_average()
    for (work, method, threads), task in tasks.items():
        timing = timings[work, method, threads]
        seconds = np.array([timing.median, timing.lower, timing.upper])
        values, unit = (task.rays / seconds / 1e6, RAYS) if task.rays else (1e3 * seconds, MS)
        lower, upper = sorted(values[1:])
        rows.append({
            "scene": scene, "work": work, "method": method, "threads": threads,
            "value": values[0], "lower": lower, "upper": upper, "unit": unit,
            "rounds": timing.rounds, SPREAD: timing.spread, LOAD: load,
        })  # fmt: skip
    return pd.DataFrame(rows)


def told(rows: pd.DataFrame) -> str:
    """How far the figures can be trusted, and where threads gain more than they can."""
    speed = rows["value"].where(rows["unit"] == RAYS, 1.0 / rows["value"])
    by_threads = rows.assign(speed=speed).pivot_table("speed", ["work", "method"], "threads")
    gain = by_threads[max(THREADS)] / by_threads[min(THREADS)]
    most = max(THREADS) / min(THREADS)
    doubtful = [f"{method} at {work}" for work, method in gain.index[gain > MOST_GAIN * most]]
    if not doubtful:
        return noise_sentence(rows)
    return (
        f"{noise_sentence(rows)} Rounds were disturbed: {max(THREADS)} threads gain more than "
        f"{most:g} times over {min(THREADS)} in {', '.join(doubtful)}; measure again."
    )
