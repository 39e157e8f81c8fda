"""The shadow rays that the renderer traces, as plain arrays, and bare loops that trace them.

What the shading kernels reach is judged against Embree alone on the same rays: `trace_bare` packs
eight at a time and asks for any hit, nothing else; `trace_packets` does so in packets like the
renderer's; `PlainEmbree` hands the arrays to embreex.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from renderer.monte_carlo import SampleSplit
from renderer.packet.drawn_samples import BRDF_STREAM, LIGHT_STREAM
from renderer.packet.embree import (
    DIR_X,
    DIR_Y,
    DIR_Z,
    LANES,
    MASK,
    ORG_X,
    ORG_Y,
    ORG_Z,
    PLAIN_LANES,
    RAY_ROWS,
    T_FAR,
    EmbreeScene,
    aligned_rows,
    new_ray_packet,
    new_valid,
    occluded,
    plainly_occluded,
    query_arguments,
)
from renderer.packet.lane_samples import packet_numbers
from renderer.packet.lanes import packets_of
from renderer.packet.reflectance import draw
from renderer.scene import Scene
from renderer.view import View
from samplers.compiled import kernel
from samplers.lighting import LightDistribution
from samplers.threads import for_blocks

RAY_BLOCK = 1 << 14
POINT_BLOCK = 1024


@dataclass(frozen=True, eq=False)
class Rays:
    """origin, direction : (n, 3) float32"""

    origin: NDArray[np.float32]
    direction: NDArray[np.float32]

    def __len__(self) -> int:
        return len(self.origin)


@kernel
def _faces(normal, geometric, i, direction):
    cosine = normal[i, 0] * direction[0] + normal[i, 1] * direction[1] + normal[i, 2] * direction[2]
    above = (
        geometric[i, 0] * direction[0]
        + geometric[i, 1] * direction[1]
        + geometric[i, 2] * direction[2]
    )
    return cosine > 0.0 and above > 0.0


@kernel
def _global_pairs(group, cell, normal, geometric, direction, point, way):
    """Pairs of a point and a direction in the renderer's order; without arrays, only counted."""
    count = 0
    for g in range(len(cell)):
        lights = direction[cell[g] % len(direction)]
        for light in range(len(lights)):
            for i in range(group[g], group[g + 1]):
                if _faces(normal, geometric, i, lights[light]):
                    if len(point):
                        point[count] = i
                        way[count] = lights[light]
                    count += 1
    return count


def global_rays(view: View, direction: NDArray) -> Rays:
    """Rays towards sets (sets, k, 3) of lights that all carry something."""
    ways = np.ascontiguousarray(direction, np.float32)
    surface = (view.group, view.group_cell, view.normal, view.geometric, ways)
    empty = np.empty((0, 3), np.float32)
    count = _global_pairs(*surface, np.empty(0, np.int64), empty)
    point, way = np.empty(count, np.int64), np.empty((count, 3), np.float32)
    _global_pairs(*surface, point, way)
    return Rays(view.position[point], way)


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
            facing = (view.normal[point] * way).sum(axis=1) > 0.0
            facing &= (view.geometric[point] * way).sum(axis=1) > 0.0
            origins.append(view.position[point[facing]])
            ways.append(way[facing])
    return Rays(np.concatenate(origins), np.concatenate(ways))


@kernel
def _put(origin, direction, first, count, valid, packet):
    for k in range(len(valid)):
        valid[k] = -1 if k < count else 0
    for k in range(count):
        packet[ORG_X, k] = origin[first + k, 0]
        packet[ORG_Y, k] = origin[first + k, 1]
        packet[ORG_Z, k] = origin[first + k, 2]
        packet[DIR_X, k] = direction[first + k, 0]
        packet[DIR_Y, k] = direction[first + k, 1]
        packet[DIR_Z, k] = direction[first + k, 2]


@kernel
def _hits(packet, count):
    hits = 0
    for k in range(count):
        hits += 1 if packet[T_FAR, k] == -math.inf else 0
    return hits


@kernel
def _trace_eight(scene, origin, direction, start, stop):
    rows = aligned_rows(RAY_ROWS)
    packet = rows.reshape(rows.size)[: RAY_ROWS * PLAIN_LANES].reshape((RAY_ROWS, PLAIN_LANES))
    packet[:] = 0.0
    packet.view(np.uint32)[MASK, :] = np.uint32(0xFFFFFFFF)
    valid = new_valid()[:PLAIN_LANES]
    hits = 0
    for first in range(start, stop, PLAIN_LANES):
        count = min(PLAIN_LANES, stop - first)
        _put(origin, direction, first, count, valid, packet)
        plainly_occluded(scene, valid, packet)
        hits += _hits(packet, count)
    return hits


@kernel
def _trace_sixteen(scene, origin, direction, start, stop, coherent):
    packet, valid, arguments = new_ray_packet(), new_valid(), query_arguments(coherent)
    hits = 0
    for first in range(start, stop, LANES):
        count = min(LANES, stop - first)
        _put(origin, direction, first, count, valid, packet)
        occluded(scene, valid, packet.reshape(-1), arguments)
        hits += _hits(packet, count)
    return hits


def trace_bare(scene: EmbreeScene, rays: Rays) -> int:
    """Trace all rays by `rtcOccluded8`, on the threads that are set; returns how many hit."""
    hits: list[int] = []
    for_blocks(
        lambda a, b: hits.append(_trace_eight(scene.handle, rays.origin, rays.direction, a, b)),
        len(rays),
        RAY_BLOCK,
    )
    return sum(hits)


def trace_packets(scene: EmbreeScene, rays: Rays, coherent: bool) -> int:
    """The same in the packets of sixteen that the renderer traces."""
    hits: list[int] = []
    arrays = (rays.origin, rays.direction)
    for_blocks(
        lambda a, b: hits.append(_trace_sixteen(scene.handle, *arrays, a, b, coherent)),
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
        """Trace all rays by embreex's `run`, on the threads that are set; returns how many hit."""
        hits: list[int] = []

        def block(start: int, stop: int) -> None:
            found = self._scene.run(
                rays.origin[start:stop], rays.direction[start:stop], query="OCCLUDED"
            )
            hits.append(int((found >= 0).sum()))

        for_blocks(block, len(rays), RAY_BLOCK)
        return sum(hits)
