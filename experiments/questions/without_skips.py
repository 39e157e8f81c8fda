"""Shading that leaves nothing out: what the renderer's skips are measured against.

The same light comes from the same lights and samples in the same order; only more rays are traced,
for lanes that face away or that carry nothing. The image must therefore be the renderer's, bit for
bit. A view can be given a black point at each background sub-pixel, too: lights shade it and rays
are traced from it, but it adds exactly nothing to the picture.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from renderer.direct import interleaved
from renderer.monte_carlo import SampleSplit
from renderer.packet.drawn_samples import BRDF_STREAM, LIGHT_STREAM
from renderer.packet.embree import DIR_X, LANES, T_FAR, new_valid, occluded, query_arguments
from renderer.packet.estimate import weigh
from renderer.packet.lane_samples import find_texels, look_up, packet_numbers
from renderer.packet.lanes import (
    aim,
    aim_each,
    face_lights,
    fill_packet,
    lane_materials,
    packets_of,
    store_lanes,
)
from renderer.packet.layout import BLUE, FACING, GREEN, PDF, RED, new_packets
from renderer.packet.reflectance import draw, reflect, reflect_ward
from renderer.render import DIRECT_STREAM, INTERLEAVED_SETS
from renderer.scene import Object, Scene
from renderer.scene.materials import Lambert
from renderer.view import CELLS, CELLS_X, CELLS_Y, TILE, View
from samplers import DirectionalLights, EnvironmentMap, LightDistribution
from samplers.compiled import kernel
from samplers.threads import for_blocks

GROUPS = 16
"""Runs of points handed to a thread at once."""
POINTS = 2048
SEED = 0
DISTANCE = 100.0
"""In units of the distance from the eye to what it looks at: beyond the scene."""


@dataclass(frozen=True)
class Kept:
    """What is left out all the same: rays of lanes that face away, and that carry nothing."""

    facing_away: bool
    zero: bool


@kernel
def _store(total, points, out):
    """Put packets (b, 48) of the points points[0] … points[1] into rows of out (n, 3)."""
    for packet in range(len(total)):
        start = points[0] + packet * LANES
        store_lanes(total[packet], start, min(start + LANES, points[1]), out)


@kernel
def _trace(scene, arguments, packet, valid, used, carried, away, zero, total):
    """Trace the `used` (16,) lanes and add what they carry (48,) to total; returns the rays."""
    traced = 0
    for k in range(LANES):
        facing = packet[FACING * LANES + k] != 0.0
        carries = carried[k] != 0.0 or carried[LANES + k] != 0.0 or carried[2 * LANES + k] != 0.0
        here = used[k] and ((not zero or carries) if facing else not away)
        valid[k] = -1 if here else 0
        traced += 1 if here else 0
    if traced > 0:
        occluded(scene, valid, packet, arguments)
    for k in range(LANES):
        if valid[k] != 0 and packet[T_FAR * LANES + k] >= 0.0:
            for channel in range(0, 3 * LANES, LANES):
                total[channel + k] += carried[channel + k]
    return traced


@kernel
def _every_light(
    scene, position, normal, geometric, toward_eye, material, materials,
    group, cell, first, last, direction, irradiance, away, zero, out,
):  # fmt: skip
    packet, valid, arguments = new_packets(1)[0], new_valid(), query_arguments(True)
    table, total = lane_materials(materials), np.empty(3 * LANES)
    used, carried, traced = np.empty(LANES, np.bool_), np.empty(3 * LANES), 0
    for g in range(first, last):
        ways, sent = direction[cell[g] % len(direction)], irradiance[cell[g] % len(direction)]
        for start in range(group[g], group[g + 1], LANES):
            stop = min(start + LANES, group[g + 1])
            ward = fill_packet(
                packet, start, stop, position, normal, geometric, toward_eye, material, table
            )
            total[:] = 0.0
            for light in range(len(ways)):
                aim(packet, ways[light, 0], ways[light, 1], ways[light, 2])
                face_lights(packet)
                reflect(packet)
                if ward:
                    reflect_ward(packet, start, stop, material, materials)
                for k in range(LANES):
                    used[k] = k < stop - start
                    carried[k] = packet[RED * LANES + k] * sent[light, 0]
                    carried[LANES + k] = packet[GREEN * LANES + k] * sent[light, 1]
                    carried[2 * LANES + k] = packet[BLUE * LANES + k] * sent[light, 2]
                traced += _trace(scene, arguments, packet, valid, used, carried, away, zero, total)
            store_lanes(total, start, stop, out)
    return traced


def shade_every_light(
    view: View, lights: DirectionalLights, kept: Kept
) -> tuple[NDArray[np.float32], int]:
    """Radiance (n, 3) of the view's points under the renderer's sets, and the rays traced."""
    rng = np.random.default_rng([SEED, DIRECT_STREAM])
    sets, sent = interleaved(lights, INTERLEAVED_SETS, rng)
    direction = np.ascontiguousarray(sets, np.float32)
    out, rays = np.zeros((len(view), 3), np.float32), []

    def groups(first: int, last: int) -> None:
        rays.append(
            _every_light(
                view.embree.handle, view.position, view.normal, view.geometric, view.toward_eye,
                view.material, view.materials, view.group, view.group_cell, first, last,
                direction, sent, kept.facing_away, kept.zero, out,
            )
        )  # fmt: skip

    for_blocks(groups, len(view.group_cell), GROUPS)
    return out, sum(rays)


@kernel
def _every_sample(
    scene, packets, ward, points, material, materials, radiance, direction, pdf, is_light,
    own_count, other_count, away, zero, total,
):  # fmt: skip
    valid, arguments = new_valid(), query_arguments(False)
    texel, used = np.empty(LANES, np.int32), np.empty(LANES, np.bool_)
    light, density = np.empty(3 * LANES), np.empty(LANES)
    traced = 0
    for b in range(len(packets)):
        packet, start = packets[b], points[0] + b * LANES
        count = min(LANES, points[1] - start)
        for s in range(own_count):
            first = (s * len(packets) + b) * LANES
            aim_each(packet, direction, first)
            face_lights(packet)
            find_texels(packet[DIR_X * LANES :], radiance.shape[0], texel)
            look_up(radiance.reshape(-1), texel, light)
            reflect(packet)
            if ward:
                reflect_ward(packet, start, points[1], material, materials)
            for k in range(LANES):
                density[k] = pdf[first + k]
                drawn = density[k] if is_light else np.float64(packet[PDF * LANES + k])
                used[k] = drawn > 0.0 and k < count
            weigh(packet, light, density, is_light, own_count, other_count, valid, count)
            traced += _trace(scene, arguments, packet, valid, used, light, away, zero, total[b])
    return traced


def shade_every_sample(
    view: View, environment: EnvironmentMap, lighting: LightDistribution, kept: Kept
) -> tuple[NDArray[np.float32], int]:
    """Radiance (n, 3) of the view's points by the renderer's samples, and the rays traced."""
    split = SampleSplit.half_and_half(lighting.count)
    out, rays = np.zeros((len(view), 3), np.float32), []

    def shade(start: int, stop: int) -> None:
        points = (start, stop)
        packets, ward = packets_of(points, *view.surface, view.material, view.materials)
        total = np.zeros((len(packets), 3 * LANES))
        for stream, own, other in (
            (LIGHT_STREAM, split.light, split.brdf),
            (BRDF_STREAM, split.brdf, split.light),
        ):
            u = np.empty((own * len(packets) * LANES, 3), np.float32)
            where = (points, view.pixel, view.subpixel, view.subpixels)
            packet_numbers(*where, 0, own, SEED, stream, False, u)
            if stream == LIGHT_STREAM:
                direction, pdf = lighting.sample(u)
            else:
                direction = np.empty_like(u)
                draw(packets, ward, points, view.material, view.materials, u, own, direction)
                pdf = lighting.pdf(direction)
            rays.append(
                _every_sample(
                    view.embree.handle, packets, ward, points, view.material, view.materials,
                    environment.radiance, direction, pdf, stream == LIGHT_STREAM, own, other,
                    kept.facing_away, kept.zero, total,
                )
            )  # fmt: skip
        _store(total, points, out)

    for_blocks(shade, len(view), POINTS)
    return out, sum(rays)


def with_background_points(view: View) -> View:
    """The same picture, with a point at every background sub-pixel after all others."""
    camera = view.scene.camera
    eye = np.array(camera.eye)
    reach = DISTANCE * float(np.linalg.norm(np.subtract(camera.target, eye)))
    order, key = _tile_order(view)
    way = view.background_direction[order]
    count, number = len(way), len(view)
    subpixel = np.zeros(count, np.int32)
    bounds = number + np.concatenate([np.flatnonzero(np.diff(key)) + 1, [count]])
    black = Object("background", view.scene.objects[0].mesh, Lambert((0.0, 0.0, 0.0)))
    scene = Scene(view.scene.name, (*view.scene.objects, black), camera)
    row = np.zeros((1, view.materials.shape[1]))
    tile = number + np.concatenate([np.flatnonzero(np.diff(key // CELLS)) + 1, [count]])

    def joined(first: np.ndarray, second: np.ndarray) -> np.ndarray:
        return np.concatenate([first, second.astype(first.dtype)])

    return replace(
        view,
        scene=scene,
        position=joined(view.position, eye + reach * way),
        normal=joined(view.normal, -way),
        geometric=joined(view.geometric, -way),
        toward_eye=joined(view.toward_eye, -way),
        depth=joined(view.depth, np.full(count, reach)),
        material=joined(view.material, np.full(count, len(view.materials))),
        pixel=joined(view.pixel, view.background_pixel[order]),
        subpixel=joined(view.subpixel, subpixel),
        group=joined(view.group, bounds),
        group_cell=joined(
            view.group_cell, key[np.concatenate([[0], bounds[:-1] - number])] % CELLS
        ),
        tile=joined(view.tile, tile),
        materials=np.concatenate([view.materials, row]),
    )


def _tile_order(view: View) -> tuple[np.ndarray, np.ndarray]:
    """Order of the background's sub-pixels by tile and cell, and their keys in that order."""
    y, x = np.divmod(view.background_pixel.astype(np.int64), view.width)
    tile = (y // TILE) * -(-view.width // TILE) + x // TILE
    key = tile * CELLS + (y % CELLS_Y) * CELLS_X + x % CELLS_X
    order = np.argsort(key, kind="stable")
    return order, key[order]
