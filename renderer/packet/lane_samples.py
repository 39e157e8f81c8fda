"""Samples of sixteen shading points at a time: their random numbers, and the map's radiance.

The arrays that pass between a light distribution and the kernels hold one row per sample: sample s
of all points, spare lanes included, then the next one, row (s · packets + packet) · 16 + lane.
"""

import math

import numpy as np

from renderer.packet.embree import DIR_X, DIR_Y, DIR_Z, LANES
from renderer.packet.low_discrepancy import hash_mix, seeds_of, sobol_first, sobol_pair
from samplers.compiled import kernel
from samplers.sphere import turns


@kernel
def _numbers(index, seed, other_index, other_seed, numbers):
    """Three rows of sixteen numbers: a pair and the first of another pair."""
    for k in range(LANES):
        numbers[k], numbers[LANES + k] = sobol_pair(index[k], seed[k])
        numbers[2 * LANES + k] = sobol_first(other_index[k], other_seed[k])


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
    memory = np.zeros((6, LANES), np.uint32)
    index, base, other, lone, lone_other, zero = (
        memory[0], memory[1], memory[2], memory[3], memory[4], memory[5],
    )  # fmt: skip
    numbers = np.empty(3 * LANES, np.float32)
    packets = (stop - start + LANES - 1) // LANES
    for b in range(packets):
        for k in range(LANES):
            i = min(start + b * LANES + k, stop - 1)
            base[k], other[k] = seeds_of(pixel[i], seed, stream)
            index[k] = first * subpixels + subpixel[i] * count
        for s in range(count):
            if independent:
                for k in range(LANES):
                    lone[k] = hash_mix(base[k] ^ hash_mix(index[k]))
                    lone_other[k] = hash_mix(other[k] ^ hash_mix(index[k]))
                _numbers(zero, lone, zero, lone_other, numbers)
            else:
                _numbers(index, base, index, other, numbers)
            row = (s * packets + b) * LANES
            for k in range(LANES):
                for axis in range(3):
                    out[row + k, axis] = numbers[axis * LANES + k]
                index[k] += np.uint32(1)


@kernel
def _texels(packet, height, texel):
    """`pixel_of` the directions of the packet, so written that it is inlined: texel (32,)."""
    rows, columns = np.float64(height), np.float64(2 * height)
    last_row, last_column = np.int32(height - 1), np.int32(2 * height - 1)
    for k in range(LANES):
        x = np.float64(packet[DIR_X * LANES + k])
        y = np.float64(packet[DIR_Y * LANES + k])
        z = np.float64(packet[DIR_Z * LANES + k])
        row = np.int32(2.0 * turns(math.sqrt(x * x + z * z), y) * rows)
        column = np.int32(turns(x, -z) * columns)
        texel[k], texel[LANES + k] = min(row, last_row), min(column, last_column)


@kernel
def look_up(packet, radiance, texel, light):
    """The map's radiance in the directions of the packet, into light (48,) float64.

    texel : (32,) int32, scratch
    """
    _texels(packet, radiance.shape[0], texel)
    for k in range(LANES):
        y, x = np.uint32(texel[k]), np.uint32(texel[LANES + k])
        light[k] = radiance[y, x, 0]
        light[LANES + k] = radiance[y, x, 1]
        light[2 * LANES + k] = radiance[y, x, 2]


@kernel
def store_packets(total, points, out):
    """Put packets (b, 48) of the points points[0] … points[1] into rows of out (n, 3)."""
    for i in range(points[0], points[1]):
        packet, lane = divmod(i - points[0], LANES)
        for channel in range(3):
            out[i, channel] = total[packet, channel * LANES + lane]
