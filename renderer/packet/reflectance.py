"""Reflectance of sixteen points at once: what each model's file says of one lane, for all lanes.

Lambert's surface, metals and coated ones are one formula with other numbers (`coated.py`), so that
a packet may hold all of them without a branch. Lanes of Ward's model are done again, by `ward.py`.
"""

import math

import numpy as np

from renderer.packet import coated, ggx, lambert, ward
from renderer.packet.embree import DIR_X, DIR_Y, DIR_Z, LANES
from renderer.packet.lane_samples import NUMBERS_SIZE
from renderer.packet.layout import (
    ALPHA_2,
    BLUE,
    COSINE,
    DIFFUSE_B,
    DIFFUSE_G,
    DIFFUSE_R,
    DIMMED,
    F0_B,
    F0_G,
    F0_R,
    FACING,
    GLOSSY,
    GREEN,
    NV,
    NX,
    NY,
    NZ,
    ONE,
    PDF,
    RED,
    ROOT_V,
    SHARE,
    TINY,
    VX,
    VY,
    VZ,
    ZERO,
)
from renderer.packet.material_table import KIND, WARD
from samplers.compiled import inner, kernel
from samplers.sphere import sine_cosine


@inner
def reflect(packet):
    """f_r · n·l into RED, GREEN, BLUE and the sampling density into PDF; 0 where not facing.

    COSINE and FACING are those of `face_lights`.
    """
    for k in range(LANES):
        lx, ly, lz = (
            packet[DIR_X * LANES + k], packet[DIR_Y * LANES + k], packet[DIR_Z * LANES + k],
        )  # fmt: skip
        nx, ny, nz = packet[NX * LANES + k], packet[NY * LANES + k], packet[NZ * LANES + k]
        vx, vy, vz = packet[VX * LANES + k], packet[VY * LANES + k], packet[VZ * LANES + k]
        nl, nv = packet[COSINE * LANES + k], packet[NV * LANES + k]
        alpha_2, root_v = packet[ALPHA_2 * LANES + k], packet[ROOT_V * LANES + k]
        hx, hy, hz = ggx.half_vector(vx, vy, vz, lx, ly, lz)
        half_d = ggx.half_density(packet[GLOSSY * LANES + k], alpha_2, nx, ny, nz, hx, hy, hz)
        lobe = ggx.evaluate(half_d, alpha_2, nv, nl, root_v)
        power = ggx.fifth_power(hx * vx + hy * vy + hz * vz)
        f0_r, f0_g, f0_b = (
            packet[F0_R * LANES + k], packet[F0_G * LANES + k], packet[F0_B * LANES + k],
        )  # fmt: skip
        through = ONE - coated.coat_reflectance(packet[DIMMED * LANES + k], f0_r, nl)
        factor = packet[FACING * LANES + k] * nl
        packet[RED * LANES + k] = factor * coated.evaluate(
            packet[DIFFUSE_R * LANES + k], through, lobe, f0_r, power
        )
        packet[GREEN * LANES + k] = factor * coated.evaluate(
            packet[DIFFUSE_G * LANES + k], through, lobe, f0_g, power
        )
        packet[BLUE * LANES + k] = factor * coated.evaluate(
            packet[DIFFUSE_B * LANES + k], through, lobe, f0_b, power
        )
        packet[PDF * LANES + k] = packet[FACING * LANES + k] * coated.pdf(
            packet[SHARE * LANES + k], half_d, nl, nv, root_v
        )


@kernel
def reflect_ward(packet, start, stop, material, materials):
    """The same for the lanes of Ward's model, after `reflect`."""
    for k in range(LANES):
        row = materials[material[min(start + k, stop - 1)]]
        if int(row[KIND]) != WARD or packet[FACING * LANES + k] == ZERO:
            continue
        red, green, blue, pdf = ward.evaluate_with_pdf(
            row,
            np.float64(packet[NX * LANES + k]),
            np.float64(packet[NY * LANES + k]),
            np.float64(packet[NZ * LANES + k]),
            np.float64(packet[VX * LANES + k]),
            np.float64(packet[VY * LANES + k]),
            np.float64(packet[VZ * LANES + k]),
            np.float64(packet[DIR_X * LANES + k]),
            np.float64(packet[DIR_Y * LANES + k]),
            np.float64(packet[DIR_Z * LANES + k]),
        )
        cosine = np.float64(packet[COSINE * LANES + k])
        packet[RED * LANES + k] = red * cosine
        packet[GREEN * LANES + k] = green * cosine
        packet[BLUE * LANES + k] = blue * cosine
        packet[PDF * LANES + k] = pdf


@inner
def _polar(numbers):
    """√u₀ cos 2πu₁ and √u₀ sin 2πu₁ into the fourth and the fifth row."""
    for k in range(LANES):
        r = math.sqrt(numbers[k])
        sine, cosine = sine_cosine(np.float64(numbers[LANES + k]))
        numbers[3 * LANES + k] = r * np.float32(cosine)
        numbers[4 * LANES + k] = r * np.float32(sine)


@inner
def _draw(packet, numbers):
    """Directions of all models but Ward's into the packet's rays."""
    for k in range(LANES):
        nx, ny, nz = packet[NX * LANES + k], packet[NY * LANES + k], packet[NZ * LANES + k]
        vx, vy, vz = packet[VX * LANES + k], packet[VY * LANES + k], packet[VZ * LANES + k]
        tx, ty, tz, bx, by, bz = lambert.frame(nx, ny, nz)
        p1, p2 = numbers[3 * LANES + k], numbers[4 * LANES + k]
        diffuse = numbers[2 * LANES + k] >= packet[SHARE * LANES + k]
        dx, dy, dz = lambert.sample(p1, p2, numbers[k])
        mx, my, mz = ggx.sample(
            math.sqrt(packet[ALPHA_2 * LANES + k]),
            vx * tx + vy * ty + vz * tz,
            vx * bx + vy * by + vz * bz,
            packet[NV * LANES + k],
            p1,
            p2,
        )
        # One of the two, in the frame; v is then mirrored at a half vector.
        x, y, z = dx if diffuse else mx, dy if diffuse else my, dz if diffuse else mz
        hx, hy, hz = x * tx + y * bx + z * nx, x * ty + y * by + z * ny, x * tz + y * bz + z * nz
        scale = ONE / math.sqrt(max(hx * hx + hy * hy + hz * hz, TINY))
        hx, hy, hz = hx * scale, hy * scale, hz * scale
        lx, ly, lz = ggx.mirrored(vx, vy, vz, hx, hy, hz)
        lx, ly, lz = hx if diffuse else lx, hy if diffuse else ly, hz if diffuse else lz
        scale = ONE / math.sqrt(max(lx * lx + ly * ly + lz * lz, TINY))
        packet[DIR_X * LANES + k] = lx * scale
        packet[DIR_Y * LANES + k] = ly * scale
        packet[DIR_Z * LANES + k] = lz * scale


@kernel
def _draw_ward(packet, numbers, start, stop, material, materials):
    for k in range(LANES):
        row = materials[material[min(start + k, stop - 1)]]
        if int(row[KIND]) == WARD:
            lx, ly, lz = ward.sample(
                row,
                np.float64(packet[NX * LANES + k]),
                np.float64(packet[NY * LANES + k]),
                np.float64(packet[NZ * LANES + k]),
                np.float64(packet[VX * LANES + k]),
                np.float64(packet[VY * LANES + k]),
                np.float64(packet[VZ * LANES + k]),
                np.float64(numbers[k]),
                np.float64(numbers[LANES + k]),
                np.float64(numbers[2 * LANES + k]),
            )
            packet[DIR_X * LANES + k] = lx
            packet[DIR_Y * LANES + k] = ly
            packet[DIR_Z * LANES + k] = lz


@inner
def draw_packet(packet, ward, start, stop, material, materials, numbers):
    """A direction from each point's BRDF into the packet's rays, by three rows of numbers.

    It may go below the surface, where its density is 0. The third number chooses the lobe.
    numbers : (NUMBERS_SIZE,) float32
    """
    _polar(numbers)
    _draw(packet, numbers)
    if ward:
        _draw_ward(packet, numbers, start, stop, material, materials)


@kernel
def draw(packets, any_ward, points, material, materials, u, count, direction):
    """Draw `count` directions (rows, 3) from the BRDF at each point, by the numbers u (rows, 3)."""
    numbers = np.empty(NUMBERS_SIZE, np.float32)
    for b in range(len(packets)):
        packet, start = packets[b], points[0] + b * LANES
        for s in range(count):
            row = (s * len(packets) + b) * LANES
            for k in range(LANES):
                for axis in range(3):
                    numbers[axis * LANES + k] = u[row + k, axis]
            draw_packet(packet, any_ward, start, points[1], material, materials, numbers)
            for k in range(LANES):
                direction[row + k, 0] = packet[DIR_X * LANES + k]
                direction[row + k, 1] = packet[DIR_Y * LANES + k]
                direction[row + k, 2] = packet[DIR_Z * LANES + k]
