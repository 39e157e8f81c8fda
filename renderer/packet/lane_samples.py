"""Samples of sixteen shading points at a time: their random numbers, and the map's radiance.

The arrays that pass between a light distribution and the kernels hold one row per sample: sample s
of all points, spare lanes included, then the next one, row (s · packets + packet) · 16 + lane.
"""

import math

import numpy as np

from renderer.packet.embree import LANES
from renderer.packet.low_discrepancy import hash_mix, seeds_of, sobol_first, sobol_pair
from samplers.compiled import inner, kernel, prefetch
from samplers.sphere import turns

INDEX, BASE, OTHER, AT, SEED, OTHER_SEED = (LANES * i for i in (0, 2, 4, 6, 7, 8))
STATE_SIZE = 9 * LANES
"""Rows of whole numbers: for each of two streams the next sample's number in its pixel's sequence,
and the seeds of that sequence's pair and of its third number; then the point of which sequences is
drawn next."""
NUMBERS_SIZE = 5 * LANES
"""Rows of a sample's three numbers, and two that drawing from a BRDF works in."""


@kernel
def new_state():
    """Room for what `begin_numbers` finds."""
    return np.zeros(STATE_SIZE, np.uint32)


@inner
def begin_numbers(points, pixel, subpixel, subpixels, first, count, seed, streams, state):
    """Where in their pixels' sequences the samples of a packet begin: see `packet_numbers`.

    points : the packet's first point, and the end of all points
    first, count, streams : of two techniques
    state : (STATE_SIZE,) uint32
    """
    start, stop = points
    for k in range(LANES):
        i = min(start + k, stop - 1)
        state[INDEX + k] = first[0] * subpixels + subpixel[i] * count[0]
        state[INDEX + LANES + k] = first[1] * subpixels + subpixel[i] * count[1]
        state[BASE + k] = pixel[i]
    for k in range(LANES):
        here = state[BASE + k]
        state[BASE + k], state[OTHER + k] = seeds_of(here, seed, streams[0])
        state[BASE + LANES + k], state[OTHER + LANES + k] = seeds_of(here, seed, streams[1])


@inner
def next_numbers(state, stream, independent, numbers):
    """The next sample's numbers, three rows of sixteen, into numbers (NUMBERS_SIZE,) float32.

    stream : 0 or 1, which of the two streams

    All three in one loop, even where the third is not used: a shorter one is unrolled before it
    could become vector instructions, and takes four times as long.
    """
    row = stream * LANES
    for k in range(LANES):
        state[AT + k], state[SEED + k] = state[INDEX + row + k], state[BASE + row + k]
        state[OTHER_SEED + k] = state[OTHER + row + k]
        state[INDEX + row + k] += np.uint32(1)
    if independent:
        for k in range(LANES):
            index = hash_mix(state[AT + k])
            state[AT + k] = 0
            state[SEED + k] = hash_mix(state[SEED + k] ^ index)
            state[OTHER_SEED + k] = hash_mix(state[OTHER_SEED + k] ^ index)
    for k in range(LANES):
        numbers[k], numbers[LANES + k] = sobol_pair(state[AT + k], state[SEED + k])
        numbers[2 * LANES + k] = sobol_first(state[AT + k], state[OTHER_SEED + k])


@kernel
def packet_numbers(
    points, pixel, subpixel, subpixels, first, count, seed, stream, independent, out
):
    """Three-dimensional low-discrepancy points for samples first … first + count − 1 of each point.

    The samples of all sub-pixels of a pixel are one sequence, cut into runs of `count`: sample
    first + s of sub-pixel k is point first · subpixels + k · count + s, so that the samples of each
    sub-pixel are stratified as those of the whole pixel are. `stream` keeps the techniques apart;
    spare lanes repeat the last point's numbers. Where `independent`, each sample is the first point
    of a sequence of its own.
    """
    start, stop = points
    state, numbers = new_state(), np.empty(NUMBERS_SIZE, np.float32)
    packets = (stop - start + LANES - 1) // LANES
    for b in range(packets):
        begin_numbers(
            (start + b * LANES, stop), pixel, subpixel, subpixels, (first, first), (count, count),
            seed, (stream, stream), state,
        )  # fmt: skip
        for s in range(count):
            next_numbers(state, 0, independent, numbers)
            row = (s * packets + b) * LANES
            for k in range(LANES):
                for axis in range(3):
                    out[row + k, axis] = numbers[axis * LANES + k]


@inner
def find_texels(way, height, texel):
    """The texels (16,) int32 of sixteen directions way (48,) x, y, z: row · 2h + column.

    `pixel_of` each, so written that it is inlined.
    """
    rows, columns = np.float64(height), np.float64(2 * height)
    last_row, last_column, width = np.int32(height - 1), np.int32(2 * height - 1), 2 * height
    for k in range(LANES):
        x, y, z = np.float64(way[k]), np.float64(way[LANES + k]), np.float64(way[2 * LANES + k])
        row = np.int32(2.0 * turns(math.sqrt(x * x + z * z), y) * rows)
        column = np.int32(turns(x, -z) * columns)
        texel[k] = min(row, last_row) * width + min(column, last_column)


@inner
def ask_for_texels(radiance, texel):
    """Ask for what `look_up` reads."""
    for k in range(LANES):
        prefetch(radiance, np.uint64(3) * np.uint64(np.uint32(texel[k])))


@inner
def look_up(radiance, texel, light):
    """Radiance of texels (16,) of a flat map into light (48,) float64."""
    for k in range(LANES):
        i = np.uint64(3) * np.uint64(np.uint32(texel[k]))
        light[k] = radiance[i]
        light[LANES + k] = radiance[i + np.uint64(1)]
        light[2 * LANES + k] = radiance[i + np.uint64(2)]
