"""Samples of a packet, drawn some ahead of their use, so that tables are asked for early.

Where in a map's tables a sample falls nobody can foresee, so each of its three reads (where to
search, the sums to search, the texel) comes from far memory and takes as long as hundreds of
instructions. The samples that come next are therefore drawn stage by stage, all of them at each:
what one stage asks for arrives while the others are drawn, and the texels while rays are traced.
"""

import numpy as np

from renderer.packet.embree import DIR_X, LANES
from renderer.packet.lane_samples import (
    NUMBERS_SIZE,
    ask_for_texels,
    find_texels,
    next_numbers,
)
from renderer.packet.reflectance import draw_packet
from samplers.compiled import inner, kernel
from samplers.grids.running_sums import ACROSS, ALONG, KEY, LOW, WHOLE_SIZE
from samplers.grids.tabulated import DRAWN_SIZE, X, begin_texels, end_texels, narrow_texels

STREAMS = LIGHT_STREAM, BRDF_STREAM = 0, 1
AHEAD = 4
"""Samples of a packet that are drawn together."""
WAY, TEXEL, WHOLE, REAL, NUMBERS = range(5)
"""What is kept of them: directions (48,) and texels (16,), a row each; the search of the table; and
the random numbers of one."""


@kernel
def new_drawn():
    """Room for a packet's next samples."""
    return (
        np.zeros((AHEAD, 3 * LANES), np.float32),
        np.zeros((AHEAD, LANES), np.int32),
        np.zeros((AHEAD, WHOLE_SIZE), np.int32),
        np.zeros((AHEAD, DRAWN_SIZE)),
        np.zeros(NUMBERS_SIZE, np.float32),
    )


@inner
def aim_drawn(packet, drawn, s):
    """Put the directions of the sample drawn as number `s` into the packet's rays."""
    way = drawn[WAY][s]
    for k in range(3 * LANES):
        packet[DIR_X * LANES + k] = way[k]


@inner
def _begin_light(numbers, table, whole, real):
    for k in range(LANES):
        real[ACROSS + k], real[ALONG + k] = numbers[k], numbers[LANES + k]
    begin_texels(table, whole, real)


@inner
def _end_light(table, whole, real, width, way, texel):
    end_texels(table, whole, real)
    for k in range(3 * LANES):
        way[k] = real[X + k]
    for k in range(LANES):
        texel[k] = whole[KEY + k] * width + whole[LOW + k]


@inner
def draw_from_brdf(packet, ward, span, points, row, samples, sequences, texels, drawn):
    """Draw the samples samples[0] … samples[1] from the BRDFs of the points of a span.

    points, sequences, texels : `layout.Points`, `layout.Sequences` and `layout.Texels`
    row : number of the sample that is kept in the first row. Changes the packet's rays.
    """
    way, texel, numbers = drawn[WAY], drawn[TEXEL], drawn[NUMBERS]
    for s in range(samples[0], samples[1]):
        next_numbers(sequences.state, BRDF_STREAM, sequences.independent, numbers)
        draw_packet(packet, ward, span[0], span[1], points.material, points.materials, numbers)
        for k in range(3 * LANES):
            way[s - row, k] = packet[DIR_X * LANES + k]
        find_texels(way[s - row], texels.height, texel[s - row])
        ask_for_texels(texels.radiance, texel[s - row])


@inner
def draw_samples(packet, ward, span, points, samples, lights, sequences, table, texels, drawn):
    """Draw the samples samples[0] … samples[1] of a span's points: directions and texels.

    The first `lights` samples of a point are the table's, the others their BRDFs', as
    `draw_from_brdf` draws them.
    """
    way, texel, whole, real, numbers = drawn
    first, last = samples
    for s in range(first, min(last, lights)):
        next_numbers(sequences.state, LIGHT_STREAM, sequences.independent, numbers)
        _begin_light(numbers, table, whole[s - first], real[s - first])
    of_brdf = (max(first, lights), last)
    draw_from_brdf(packet, ward, span, points, first, of_brdf, sequences, texels, drawn)
    for s in range(first, min(last, lights)):
        narrow_texels(table, whole[s - first])
    for s in range(first, min(last, lights)):
        i = s - first
        _end_light(table, whole[i], real[i], 2 * texels.height, way[i], texel[i])
        ask_for_texels(texels.radiance, texel[i])


@inner
def take_samples(direction, first, last, packets, packet, texels, drawn):
    """Take the samples first … last of a packet, of so many, from given directions (rows, 3)."""
    way, texel = drawn[WAY], drawn[TEXEL]
    for s in range(first, last):
        i, row = s - first, (s * packets + packet) * LANES
        for k in range(LANES):
            for axis in range(3):
                way[i, axis * LANES + k] = direction[row + k, axis]
        find_texels(way[i], texels.height, texel[i])
        ask_for_texels(texels.radiance, texel[i])
