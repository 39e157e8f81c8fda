"""Radiance of points by the survivors of many candidates: resampling in one pass for each packet.

A packet's candidates come from a table of the map and from its BRDFs, a few ahead
(`drawn_samples.py`); the texel that each falls in gives its radiance and its density. All are
judged, survivors drawn lane by lane, and these alone are traced: `samplers.grids.resampled_light`
in place, with the same random numbers.
"""

import numpy as np

from renderer.packet.drawn_samples import AHEAD, aim_drawn, draw_samples
from renderer.packet.embree import DIR_X, LANES, occluded
from renderer.packet.estimate import add_unblocked, find_densities, new_scratch, weigh
from renderer.packet.lane_samples import begin_numbers, look_up, next_numbers
from renderer.packet.lanes import face_lights, fill_packet, store_lanes
from renderer.packet.layout import BLUE, GREEN, PDF, RED, Sequences, Texels
from renderer.packet.reflectance import reflect, reflect_ward
from samplers.compiled import inner, kernel
from samplers.grids.survivors import choose_at, choose_of_set, judged, room_for


@inner
def _judge(packet, light, density, texel, width, candidates, curve, target, weight, place):
    """Targets, weights and places (16,) of a packet: `samplers.grids.survivors.judge`."""
    down, along = curve
    for k in range(LANES):
        target[k], weight[k] = judged(
            light[k], light[LANES + k], light[2 * LANES + k], packet[RED * LANES + k],
            packet[GREEN * LANES + k], packet[BLUE * LANES + k], density[k],
            np.float64(packet[PDF * LANES + k]), candidates[0], candidates[1],
        )  # fmt: skip
    if len(down) == 0:
        return
    columns, per_row = np.float64(width), 1.0 / width
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


@inner
def _choose(
    target, weight, place, candidates, sequences, numbers, sorting, shared, count, chosen, scale
):
    """The survivors of the first `count` lanes; others repeat the last one's, of no weight.

    shared : whether all are drawn from all candidates, else each from a set of its own
    """
    survivors = len(chosen)
    in_set = candidates[0] // survivors, candidates[1] // survivors
    for s in range(1 if shared else survivors):
        next_numbers(sequences.state, 0, sequences.independent, numbers)
        for k in range(count):
            u = np.float64(numbers[k])
            if shared:
                choose_at(k, target, weight, place, u, sorting, chosen, scale)
            else:
                choose_of_set(k, target, weight, in_set, u, s, chosen, scale)
    for k in range(count, LANES):
        for s in range(survivors):
            chosen[s, k], scale[s, k] = chosen[s, count - 1], 0.0


@kernel
def shade_resampled(
    scene, points, span, radiance, density_of, curve, candidates, survivors, stream, numbers_of, out
):
    """Radiance of the points span[0] … span[1] into out (n, 3); returns the rays traced.

    points, numbers_of : `layout.Points` and `layout.Numbers`
    radiance, density_of : the map, and the `layout.Density` that candidates are drawn from
    curve : of the map, `samplers.grids.survivors.curve_of`; two empty arrays where each survivor
        has a set of candidates of its own
    candidates : at each point, of the map and of the BRDF
    stream : the first of three of random numbers: of either kind's candidates, of the survivors
    """
    position, normal, geometric, toward_eye, material, materials, pixel, subpixel, _ = points
    subpixels, seed, table = points.subpixels, numbers_of.seed, density_of.table
    packet, valid, arguments, lanes, state, room, density, light, total, _ = new_scratch(materials)
    _, _, whole, real, numbers = room
    many, shared = candidates[0] + candidates[1], len(curve[0]) > 0
    texel, draws = np.empty(LANES, np.int32), 1 if shared else survivors
    ways, texels = np.empty((many, 3 * LANES), np.float32), np.empty((many, LANES), np.int32)
    target, weight = np.empty((many, LANES)), np.empty((many, LANES))
    place, sorting = np.empty((many, LANES), np.int32), room_for(many)
    chosen, scale = np.empty((survivors, LANES), np.int32), np.empty((survivors, LANES))
    flat, flux = Texels(radiance.reshape(-1), radiance.shape[0]), table.marginal[-1]
    traced, sequences = 0, Sequences(state, numbers_of.independent)
    for start in range(span[0], span[1], LANES):
        stop = span[1]
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
                packet, ward, (start, stop), points, (first, last), candidates[0], sequences, table,
                flat, drawn,
            )  # fmt: skip
            for s in range(first, last):
                aim_drawn(packet, drawn, s - first)
                face_lights(packet)
                reflect(packet)
                if ward:
                    reflect_ward(packet, start, stop, material, materials)
                look_up(flat.radiance, texels[s], light)
                find_densities(density_of, light, texels[s], flux, density)
                _judge(
                    packet, light, density, texels[s], 2 * flat.height, candidates, curve,
                    target[s], weight[s], place[s],
                )  # fmt: skip
        begin_numbers(
            (start, stop), pixel, subpixel, subpixels, (0, 0), (draws, draws), seed,
            (stream + 2, stream + 2), state,
        )  # fmt: skip
        _choose(
            target, weight, place, candidates, sequences, numbers, sorting, shared, count, chosen,
            scale,
        )  # fmt: skip
        for k in range(3 * LANES):
            total[k] = 0.0
        for s in range(survivors):
            _aim_survivor(packet, s, chosen, scale, ways, texels, texel, density)
            if face_lights(packet) == 0:
                continue
            reflect(packet)
            if ward:
                reflect_ward(packet, start, stop, material, materials)
            look_up(flat.radiance, texel, light)
            marked = weigh(packet, light, density, True, survivors, 0, valid, count)
            if marked == 0:
                continue
            occluded(scene, valid, packet, arguments)
            traced += marked
            add_unblocked(packet, valid, light, total)
        store_lanes(total, start, start + count, out)
    return traced
