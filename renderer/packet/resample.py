"""Radiance of points by the survivors of many candidates: resampling in one pass for each packet.

A packet's candidates come from a table of the map and from its BRDFs, a few ahead
(`drawn_samples.py`); the texel that each falls in gives its radiance and its density. All are
judged, survivors drawn lane by lane, and these alone are traced: `samplers.grids.resampled_light`
in place, with the same random numbers.
"""

import numpy as np

from renderer.packet.drawn_samples import AHEAD, aim_drawn, draw_samples
from renderer.packet.embree import DIR_X, LANES, occluded
from renderer.packet.estimate import add_unblocked, light_densities, new_scratch, weigh
from renderer.packet.lane_samples import begin_numbers, look_up, next_numbers
from renderer.packet.lanes import face_lights, fill_packet, store_lanes
from renderer.packet.layout import BLUE, GREEN, PDF, RED
from renderer.packet.reflectance import reflect, reflect_ward
from samplers.compiled import inner, kernel
from samplers.grids.survivors import choose_at, judged, room_for


@inner
def _judge(packet, light, density, texel, width, candidates, curve, target, weight, place):
    """Targets, weights and places (16,) of a packet: `samplers.grids.survivors.judge`."""
    down, along = curve
    columns, per_row = np.float64(width), 1.0 / width
    for k in range(LANES):
        target[k], weight[k] = judged(
            light[k], light[LANES + k], light[2 * LANES + k], packet[RED * LANES + k],
            packet[GREEN * LANES + k], packet[BLUE * LANES + k], density[k],
            np.float64(packet[PDF * LANES + k]), candidates[0], candidates[1],
        )  # fmt: skip
    for k in range(LANES):
        # The middle of a texel is further from a row's end than this product rounds.
        row = np.floor((texel[k] + 0.5) * per_row)
        place[k] = down[np.uint64(row)] + along[np.uint64(texel[k] - row * columns)]


@inner
def _aim_survivor(packet, s, chosen, scale, way, texels, texel, density):
    """The lanes' survivors number s: directions into the packet's rays, texels and densities."""
    for k in range(LANES):
        j = np.uint64(chosen[s, k])
        for axis in range(3):
            packet[(DIR_X + axis) * LANES + k] = way[j, axis * LANES + k]
        texel[k] = texels[j, k]
        density[k] = 1.0 / scale[s, k] if scale[s, k] > 0.0 else 0.0


@kernel
def shade_resampled(
    scene, surface, material, materials, pixel, subpixel, subpixels, points, radiance, table,
    offset, curve, candidates, survivors, seed, stream, out,
):  # fmt: skip
    """Radiance of the points points[0] … points[1] into out (n, 3); returns the rays traced.

    surface : positions, shading and geometric normals, and directions to the eye, (n, 3) each
    radiance, table, offset : the map, and the distribution that candidates are drawn from
    curve : of the map, `samplers.grids.survivors.curve_of`
    candidates : at each point, of the map and of the BRDF
    stream : the first of three of random numbers: of either kind's candidates, of the survivors
    """
    position, normal, geometric, toward_eye = surface
    packet, valid, arguments, lanes, state, room, density, light, total, _ = new_scratch(materials)
    _, _, whole, real, numbers = room
    texel, many = np.empty(LANES, np.int32), candidates[0] + candidates[1]
    ways, texels = np.empty((many, 3 * LANES), np.float32), np.empty((many, LANES), np.int32)
    target, weight = np.empty((many, LANES)), np.empty((many, LANES))
    place, sorting = np.empty((many, LANES), np.int32), room_for(many)
    chosen, scale = np.empty((survivors, LANES), np.int32), np.empty((survivors, LANES))
    flat, height, flux = radiance.reshape(-1), radiance.shape[0], table[3][-1]
    traced = 0
    for start in range(points[0], points[1], LANES):
        stop = points[1]
        count = min(LANES, stop - start)
        ward = fill_packet(
            packet, start, stop, position, normal, geometric, toward_eye, material, lanes
        )
        begin_numbers(
            (start, stop), pixel, subpixel, subpixels, (0, 0), candidates, seed,
            (stream, stream + 1), state,
        )  # fmt: skip
        for first in range(0, many, AHEAD):
            last = min(first + AHEAD, many)
            drawn = ways[first:last], texels[first:last], whole, real, numbers
            draw_samples(
                packet, ward, start, stop, material, materials, first, last, candidates[0], state,
                False, table, flat, height, drawn,
            )  # fmt: skip
            for s in range(first, last):
                aim_drawn(packet, drawn, s - first)
                face_lights(packet)
                reflect(packet)
                if ward:
                    reflect_ward(packet, start, stop, material, materials)
                look_up(flat, texels[s], light)
                light_densities(light, offset, flux, density)
                _judge(
                    packet, light, density, texels[s], 2 * height, candidates, curve,
                    target[s], weight[s], place[s],
                )  # fmt: skip
        begin_numbers(
            (start, stop), pixel, subpixel, subpixels, (0, 0), (1, 1), seed,
            (stream + 2, stream + 2), state,
        )  # fmt: skip
        next_numbers(state, 0, False, numbers)
        for k in range(count):
            choose_at(k, target, weight, place, np.float64(numbers[k]), sorting, chosen, scale)
        for k in range(count, LANES):
            for s in range(survivors):
                chosen[s, k], scale[s, k] = chosen[s, count - 1], 0.0
        for k in range(3 * LANES):
            total[k] = 0.0
        for s in range(survivors):
            _aim_survivor(packet, s, chosen, scale, ways, texels, texel, density)
            if face_lights(packet) == 0:
                continue
            reflect(packet)
            if ward:
                reflect_ward(packet, start, stop, material, materials)
            look_up(flat, texel, light)
            marked = weigh(packet, light, density, True, survivors, 0, valid, count)
            if marked == 0:
                continue
            occluded(scene, valid, packet, arguments)
            traced += marked
            add_unblocked(packet, valid, light, total)
        store_lanes(total, start, start + count, out)
    return traced
