"""Samples of sixteen shading points at a time: random numbers, BRDF directions, the map's radiance.

The arrays that pass between a light distribution and the kernels hold one row per sample, ordered
by block of sixteen points, then by sample, then by lane: row (block · count + sample) · 16 + lane.
"""

import math

import numpy as np
from numba import njit

from renderer.packet import brdf
from renderer.packet.embree import DIR_X, DIR_Y, DIR_Z, LANES
from renderer.packet.lanes import (
    ALPHA_2,
    NV,
    NX,
    NY,
    NZ,
    ONE,
    SHARE,
    TINY,
    VX,
    VY,
    VZ,
    ZERO,
    fill_block,
    lane_materials,
    new_blocks,
)
from renderer.packet.low_discrepancy import hash_mix, seeds_of, sobol_first, sobol_pair
from samplers.sphere import sine_cosine, turns


@njit(nogil=True, cache=True)
def blocks_of(points, position, normal, geometric, toward_eye, material, materials):
    """The points points[0] … points[1] as blocks, and whether any surface follows Ward's model."""
    start, stop = points
    table = lane_materials(materials)
    blocks = new_blocks((stop - start + LANES - 1) // LANES)
    ward = False
    for b in range(len(blocks)):
        ward |= fill_block(
            blocks[b], start + b * LANES, stop, position, normal, geometric, toward_eye, material,
            table,
        )  # fmt: skip
    return blocks, ward


@njit(nogil=True, cache=True)
def _numbers(index, seed, other_index, other_seed, numbers):
    """Three rows of sixteen numbers: a pair and the first of another pair."""
    for k in range(LANES):
        numbers[k], numbers[LANES + k] = sobol_pair(index[k], seed[k])
        numbers[2 * LANES + k] = sobol_first(other_index[k], other_seed[k])


@njit(nogil=True, cache=True)
def block_numbers(points, pixel, subpixel, subpixels, first, count, seed, stream, independent, out):
    """Three-dimensional low-discrepancy points for samples first … first + count − 1 of each point.

    The samples of all sub-pixels of a pixel are one sequence: sample s of sub-pixel k is point
    s · subpixels + k. `stream` keeps the techniques apart; spare lanes repeat the last point's
    numbers. Where `independent`, each sample is the first point of a sequence of its own.
    """
    start, stop = points
    memory = np.zeros((6, LANES), np.uint32)
    index, base, other, lone, lone_other, zero = (
        memory[0], memory[1], memory[2], memory[3], memory[4], memory[5],
    )  # fmt: skip
    numbers = np.empty(3 * LANES, np.float32)
    for b in range((stop - start + LANES - 1) // LANES):
        for k in range(LANES):
            i = min(start + b * LANES + k, stop - 1)
            base[k], other[k] = seeds_of(pixel[i], seed, stream)
            index[k] = first * subpixels + subpixel[i]
        for s in range(count):
            if independent:
                for k in range(LANES):
                    lone[k] = hash_mix(base[k] ^ hash_mix(index[k]))
                    lone_other[k] = hash_mix(other[k] ^ hash_mix(index[k]))
                _numbers(zero, lone, zero, lone_other, numbers)
            else:
                _numbers(index, base, index, other, numbers)
            row = (b * count + s) * LANES
            for k in range(LANES):
                for axis in range(3):
                    out[row + k, axis] = numbers[axis * LANES + k]
                index[k] += np.uint32(subpixels)


@njit(nogil=True, cache=True, error_model="numpy")
def _polar(u, polar):
    """√u₀ cos 2πu₁, √u₀ sin 2πu₁, u₀ and u₂, rows of polar (64,) float32."""
    for k in range(LANES):
        r = math.sqrt(u[k, 0])
        sine, cosine = sine_cosine(np.float64(u[k, 1]))
        polar[k] = r * np.float32(cosine)
        polar[LANES + k] = r * np.float32(sine)
        polar[2 * LANES + k] = u[k, 0]
        polar[3 * LANES + k] = u[k, 2]


@njit(nogil=True, cache=True, error_model="numpy")
def _draw(block, polar):
    """Directions of the BRDF into the packet's rows: `brdf.sample` for all but Ward's model."""
    for k in range(LANES):
        nx, ny, nz = block[NX * LANES + k], block[NY * LANES + k], block[NZ * LANES + k]
        vx, vy, vz = block[VX * LANES + k], block[VY * LANES + k], block[VZ * LANES + k]
        nv, alpha = block[NV * LANES + k], math.sqrt(block[ALPHA_2 * LANES + k])
        # A frame around the normal, as `brdf.frame` has it.
        sign = ONE if nz >= ZERO else -ONE
        a = -ONE / (sign + nz)
        b = nx * ny * a
        tx, ty, tz = ONE + sign * nx * nx * a, sign * b, -sign * nx
        bx, by, bz = b, sign + ny * ny * a, -ny
        p1, p2, u0 = polar[k], polar[LANES + k], polar[2 * LANES + k]
        diffuse = polar[3 * LANES + k] >= block[SHARE * LANES + k]
        # Visible normals (Heitz 2018), seen from v in the stretched frame.
        sx = alpha * (vx * tx + vy * ty + vz * tz)
        sy = alpha * (vx * bx + vy * by + vz * bz)
        scale = ONE / math.sqrt(sx * sx + sy * sy + nv * nv)
        sx, sy, sz = sx * scale, sy * scale, nv * scale
        flat = sx * sx + sy * sy
        scale = ONE / math.sqrt(max(flat, TINY))
        ax, ay = -sy * scale if flat > ZERO else ONE, sx * scale
        cx, cy, cz = -sz * ay, sz * ax, sx * ay - sy * ax
        half = np.float32(0.5) * (ONE + sz)
        q2 = (ONE - half) * math.sqrt(max(ZERO, ONE - p1 * p1)) + half * p2
        q3 = math.sqrt(max(ZERO, ONE - p1 * p1 - q2 * q2))
        mx = alpha * (p1 * ax + q2 * cx + q3 * sx)
        my = alpha * (p1 * ay + q2 * cy + q3 * sy)
        mz = max(ZERO, q2 * cz + q3 * sz)
        # One of the two, in the frame; a half vector is then mirrored at.
        x, y = p1 if diffuse else mx, p2 if diffuse else my
        z = math.sqrt(max(ZERO, ONE - u0)) if diffuse else mz
        hx, hy, hz = x * tx + y * bx + z * nx, x * ty + y * by + z * ny, x * tz + y * bz + z * nz
        scale = ONE / math.sqrt(max(hx * hx + hy * hy + hz * hz, TINY))
        hx, hy, hz = hx * scale, hy * scale, hz * scale
        twice = np.float32(2.0) * (vx * hx + vy * hy + vz * hz)
        lx = hx if diffuse else twice * hx - vx
        ly = hy if diffuse else twice * hy - vy
        lz = hz if diffuse else twice * hz - vz
        scale = ONE / math.sqrt(max(lx * lx + ly * ly + lz * lz, TINY))
        block[DIR_X * LANES + k] = lx * scale
        block[DIR_Y * LANES + k] = ly * scale
        block[DIR_Z * LANES + k] = lz * scale


@njit(nogil=True, cache=True)
def _draw_ward(block, u, start, stop, material, materials):
    for k in range(LANES):
        row = materials[material[min(start + k, stop - 1)]]
        if int(row[brdf.KIND]) == brdf.WARD:
            lx, ly, lz, _ = brdf.sample(
                row,
                np.float64(block[NX * LANES + k]),
                np.float64(block[NY * LANES + k]),
                np.float64(block[NZ * LANES + k]),
                np.float64(block[VX * LANES + k]),
                np.float64(block[VY * LANES + k]),
                np.float64(block[VZ * LANES + k]),
                np.float64(u[k, 0]),
                np.float64(u[k, 1]),
                np.float64(u[k, 2]),
            )
            block[DIR_X * LANES + k] = lx
            block[DIR_Y * LANES + k] = ly
            block[DIR_Z * LANES + k] = lz


@njit(nogil=True, cache=True)
def draw_brdf(blocks, ward, points, material, materials, u, count, direction):
    """Draw `count` directions (rows, 3) from the BRDF at each point, by the numbers u (rows, 3).

    They may go below the surface, where their density is 0.
    """
    polar = np.empty(4 * LANES, np.float32)
    for b in range(len(blocks)):
        block = blocks[b]
        for s in range(count):
            row = (b * count + s) * LANES
            numbers, ways = u[row : row + LANES], direction[row : row + LANES]
            _polar(numbers, polar)
            _draw(block, polar)
            if ward:
                start = points[0] + b * LANES
                _draw_ward(block, numbers, start, points[1], material, materials)
            for k in range(LANES):
                ways[k, 0] = block[DIR_X * LANES + k]
                ways[k, 1] = block[DIR_Y * LANES + k]
                ways[k, 2] = block[DIR_Z * LANES + k]


@njit(nogil=True, cache=True, error_model="numpy")
def _texels(block, height, texel):
    """`pixel_of` the directions of the packet, so written that it is inlined: texel (32,)."""
    rows, columns = np.float64(height), np.float64(2 * height)
    last_row, last_column = np.int32(height - 1), np.int32(2 * height - 1)
    for k in range(LANES):
        x = np.float64(block[DIR_X * LANES + k])
        y = np.float64(block[DIR_Y * LANES + k])
        z = np.float64(block[DIR_Z * LANES + k])
        row = np.int32(2.0 * turns(math.sqrt(x * x + z * z), y) * rows)
        column = np.int32(turns(x, -z) * columns)
        texel[k], texel[LANES + k] = min(row, last_row), min(column, last_column)


@njit(nogil=True, cache=True)
def look_up(block, radiance, texel, light):
    """The map's radiance in the directions of the packet, into light (48,) float64.

    texel : (32,) int32, scratch
    """
    _texels(block, radiance.shape[0], texel)
    for k in range(LANES):
        y, x = np.uint32(texel[k]), np.uint32(texel[LANES + k])
        light[k] = radiance[y, x, 0]
        light[LANES + k] = radiance[y, x, 1]
        light[2 * LANES + k] = radiance[y, x, 2]


@njit(nogil=True, cache=True)
def store_blocks(total, points, out):
    """Put blocks (b, 48) of the points points[0] … points[1] into rows of out (n, 3)."""
    for i in range(points[0], points[1]):
        block, lane = divmod(i - points[0], LANES)
        for channel in range(3):
            out[i, channel] = total[block, channel * LANES + lane]
