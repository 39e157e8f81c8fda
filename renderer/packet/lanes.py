"""Sixteen shading points side by side, in the layout of Embree's packets.

A block is a one-dimensional float32 array: the twelve rows of a ray packet, then rows of what the
points' surfaces are, each row one number for each of sixteen points. Loops over the lanes of a
block have a constant length and no branches, so that compilers make vector instructions of them.
The formulas are those of `brdf.py`, with everything that depends on the eye alone taken out in
advance; Lambert, coated and metallic surfaces are one formula with other numbers, and surfaces of
Ward's model are left to `brdf.py`. Float32 is what positions, normals and directions are given in.
"""

import math

import numpy as np
from numba import njit

from renderer.packet import brdf
from renderer.packet.embree import DIR_X, DIR_Y, DIR_Z, LANES, MASK, ORG_X, ORG_Y, ORG_Z

(
    NX, NY, NZ, GX, GY, GZ, VX, VY, VZ, NV, ROOT_V, ALPHA_2, DIFFUSE_R, DIFFUSE_G, DIFFUSE_B,
    BASE, F0_R, F0_G, F0_B, SPECULAR, SHARE, COSINE, FACING, RED, GREEN, BLUE, PDF,
) = range(12, 39)  # fmt: skip
"""Rows of a block after its packet's.

NV … SHARE : n·v, the root of Smith's term for v, α², diffuse f_r for light from above, 1 where a
coat dims the base by Fresnel's term, reflectance at normal incidence, 1 where there is a specular
lobe, and the probability of sampling it
COSINE … PDF : results for the directions in the packet's rows
"""
BLOCK_ROWS = 39
BLOCK_SIZE = BLOCK_ROWS * LANES
ZERO, HALF, ONE = np.float32(0.0), np.float32(0.5), np.float32(1.0)
INV_PI = np.float32(1.0 / math.pi)
LEAST_SHARE = np.float32(brdf.LEAST_SHARE)
TINY = np.float32(1e-30)
"""Keeps divisions by products of cosines finite where nothing faces the light anyway."""


@njit(nogil=True, cache=True)
def new_blocks(count):
    """Blocks (count, 39 · 16) float32, aligned to 64 bytes, with empty packets."""
    memory = np.empty(count * BLOCK_SIZE + 16, np.float32)
    start = (-(memory.ctypes.data // 4)) % 16
    blocks = memory[start : start + count * BLOCK_SIZE].reshape((count, BLOCK_SIZE))
    blocks[:] = 0.0
    blocks.view(np.uint32)[:, MASK * LANES : (MASK + 1) * LANES] = np.uint32(0xFFFFFFFF)
    return blocks


@njit(nogil=True, cache=True)
def lane_materials(materials):
    """What the blocks need of `brdf.pack`'s table, (m, 12) float32.

    α², diffuse f_r (3), 1 for a coat, reflectance (3), 1 for a specular lobe, 1 for Ward's model,
    and what the choice between the lobes weighs: luminance of the diffuse colour, and of the
    specular one where it does not depend on the eye
    """
    table = np.zeros((len(materials), 12), np.float32)
    for m in range(len(materials)):
        row = materials[m]
        kind = int(row[brdf.KIND])
        scale = row[brdf.BASE_SCALE] if kind == brdf.COATED else 1.0
        glossy = kind == brdf.COATED or kind == brdf.CONDUCTOR
        table[m, 0] = row[brdf.ALPHA_X] ** 2 if glossy else 1.0
        for c in range(3):
            table[m, 1 + c] = row[brdf.DIFFUSE + c] * brdf.INV_PI * scale
            table[m, 5 + c] = row[brdf.COAT] if kind == brdf.COATED else row[brdf.SPECULAR + c]
        table[m, 4] = 1.0 if kind == brdf.COATED else 0.0
        table[m, 8] = 1.0 if glossy else 0.0
        table[m, 9] = 1.0 if kind == brdf.WARD else 0.0
        # As `brdf.specular_share` has it: 0 for Lambert's surfaces, 1 for metals.
        if kind == brdf.LAMBERT:
            table[m, 10] = 1.0
        elif kind == brdf.CONDUCTOR:
            table[m, 11] = 1.0
        else:
            table[m, 10] = brdf.luminance(row, brdf.DIFFUSE)
            table[m, 11] = brdf.luminance(row, brdf.SPECULAR) if kind == brdf.WARD else 0.0
    return table


@njit(nogil=True, cache=True)
def fill_block(
    block, start, stop, position, normal, geometric, toward_eye, material, table
):  # fmt: skip
    """Put the points start … stop, at most sixteen, into a block; the last one into spare lanes.

    Returns whether a surface follows Ward's model.
    """
    ward = False
    for k in range(LANES):
        i = min(start + k, stop - 1)
        m = material[i]
        block[ORG_X * LANES + k] = position[i, 0]
        block[ORG_Y * LANES + k] = position[i, 1]
        block[ORG_Z * LANES + k] = position[i, 2]
        block[NX * LANES + k] = normal[i, 0]
        block[NY * LANES + k] = normal[i, 1]
        block[NZ * LANES + k] = normal[i, 2]
        block[GX * LANES + k] = geometric[i, 0]
        block[GY * LANES + k] = geometric[i, 1]
        block[GZ * LANES + k] = geometric[i, 2]
        block[VX * LANES + k] = toward_eye[i, 0]
        block[VY * LANES + k] = toward_eye[i, 1]
        block[VZ * LANES + k] = toward_eye[i, 2]
        block[ALPHA_2 * LANES + k] = table[m, 0]
        block[DIFFUSE_R * LANES + k] = table[m, 1]
        block[DIFFUSE_G * LANES + k] = table[m, 2]
        block[DIFFUSE_B * LANES + k] = table[m, 3]
        block[BASE * LANES + k] = table[m, 4]
        block[F0_R * LANES + k] = table[m, 5]
        block[F0_G * LANES + k] = table[m, 6]
        block[F0_B * LANES + k] = table[m, 7]
        block[SPECULAR * LANES + k] = table[m, 8]
        ward |= table[m, 9] > ZERO
        block[RED * LANES + k] = table[m, 10]
        block[GREEN * LANES + k] = table[m, 11]
    _view_terms(block)
    return ward


@njit(nogil=True, cache=True, error_model="numpy")
def _view_terms(block):
    """What depends on the eye: n·v, Smith's root, the coat's dimming, the lobes' shares.

    RED and GREEN hold the luminances of the diffuse and the specular colour.
    """
    for k in range(LANES):
        nv = (
            block[NX * LANES + k] * block[VX * LANES + k]
            + block[NY * LANES + k] * block[VY * LANES + k]
            + block[NZ * LANES + k] * block[VZ * LANES + k]
        )
        a2 = block[ALPHA_2 * LANES + k]
        m = ONE - nv
        f0 = block[F0_R * LANES + k]
        coat = block[BASE * LANES + k] * (f0 + (ONE - f0) * (m * m * m * m * m))
        block[NV * LANES + k] = nv
        block[ROOT_V * LANES + k] = math.sqrt(a2 + (ONE - a2) * nv * nv)
        block[DIFFUSE_R * LANES + k] *= ONE - coat
        block[DIFFUSE_G * LANES + k] *= ONE - coat
        block[DIFFUSE_B * LANES + k] *= ONE - coat
        specular = block[GREEN * LANES + k] + coat
        diffuse = block[RED * LANES + k] * (ONE - coat)
        share = min(max(specular / max(specular + diffuse, TINY), LEAST_SHARE), ONE - LEAST_SHARE)
        share = ZERO if specular <= ZERO else share
        block[SHARE * LANES + k] = ONE if diffuse <= ZERO else share


@njit(nogil=True, cache=True)
def aim(block, x, y, z):
    """Put one direction into all lanes of the block's packet."""
    for k in range(LANES):
        block[DIR_X * LANES + k], block[DIR_Y * LANES + k], block[DIR_Z * LANES + k] = x, y, z


@njit(nogil=True, cache=True)
def aim_each(block, direction, first):
    """Put the sixteen directions (rows, 3) from row `first` on into the block's packet."""
    for k in range(LANES):
        block[DIR_X * LANES + k] = direction[first + k, 0]
        block[DIR_Y * LANES + k] = direction[first + k, 1]
        block[DIR_Z * LANES + k] = direction[first + k, 2]


@njit(nogil=True, cache=True)
def face_lights(block):
    """COSINE and FACING of the directions in the block's packet; returns how many lanes face."""
    count = 0
    for k in range(LANES):
        lx, ly, lz = block[DIR_X * LANES + k], block[DIR_Y * LANES + k], block[DIR_Z * LANES + k]
        cosine = (
            block[NX * LANES + k] * lx + block[NY * LANES + k] * ly + block[NZ * LANES + k] * lz
        )
        above = block[GX * LANES + k] * lx + block[GY * LANES + k] * ly + block[GZ * LANES + k] * lz
        facing = (cosine > ZERO) & (above > ZERO)
        block[COSINE * LANES + k] = cosine
        block[FACING * LANES + k] = ONE if facing else ZERO
        count += 1 if facing else 0
    return count


@njit(nogil=True, cache=True, error_model="numpy")
def reflect(block):
    """f_r · cosine into RED, GREEN, BLUE and the sampling density into PDF; 0 where not facing.

    COSINE and FACING are those of `face_lights`.
    """
    for k in range(LANES):
        lx, ly, lz = block[DIR_X * LANES + k], block[DIR_Y * LANES + k], block[DIR_Z * LANES + k]
        nx, ny, nz = block[NX * LANES + k], block[NY * LANES + k], block[NZ * LANES + k]
        vx, vy, vz = block[VX * LANES + k], block[VY * LANES + k], block[VZ * LANES + k]
        nl, nv, a2 = block[COSINE * LANES + k], block[NV * LANES + k], block[ALPHA_2 * LANES + k]
        facing = block[FACING * LANES + k]
        hx, hy, hz = vx + lx, vy + ly, vz + lz
        scale = ONE / math.sqrt(max(hx * hx + hy * hy + hz * hz, TINY))
        hx, hy, hz = hx * scale, hy * scale, hz * scale
        vh, nh = hx * vx + hy * vy + hz * vz, nx * hx + ny * hy + nz * hz
        cx, cy, cz = ny * hz - nz * hy, nz * hx - nx * hz, nx * hy - ny * hx
        spread = (cx * cx + cy * cy + cz * cz) + a2 * nh * nh
        lobe = HALF * block[SPECULAR * LANES + k] * a2 * INV_PI / max(spread * spread, TINY)
        root_v = block[ROOT_V * LANES + k]
        root_l = math.sqrt(a2 + (ONE - a2) * nl * nl)
        share = block[SHARE * LANES + k]
        s = lobe / max(abs(nl) * root_v + nv * root_l, TINY)
        m = ONE - vh
        m = m * m * m * m * m
        f0_r, f0_g, f0_b = block[F0_R * LANES + k], block[F0_G * LANES + k], block[F0_B * LANES + k]
        q = ONE - nl
        base = ONE - block[BASE * LANES + k] * (f0_r + (ONE - f0_r) * (q * q * q * q * q))
        factor = facing * nl
        block[RED * LANES + k] = factor * (
            block[DIFFUSE_R * LANES + k] * base + s * (f0_r + (ONE - f0_r) * m)
        )
        block[GREEN * LANES + k] = factor * (
            block[DIFFUSE_G * LANES + k] * base + s * (f0_g + (ONE - f0_g) * m)
        )
        block[BLUE * LANES + k] = factor * (
            block[DIFFUSE_B * LANES + k] * base + s * (f0_b + (ONE - f0_b) * m)
        )
        block[PDF * LANES + k] = facing * (
            (ONE - share) * nl * INV_PI + share * lobe / (nv + root_v)
        )


@njit(nogil=True, cache=True)
def reflect_ward(block, start, stop, material, materials):
    """The same for the lanes of Ward's model, after `reflect`, in float64."""
    for k in range(min(LANES, stop - start)):
        row = materials[material[start + k]]
        if int(row[brdf.KIND]) != brdf.WARD or block[FACING * LANES + k] == ZERO:
            continue
        red, green, blue, pdf = brdf.evaluate_with_pdf(
            row,
            np.float64(block[NX * LANES + k]),
            np.float64(block[NY * LANES + k]),
            np.float64(block[NZ * LANES + k]),
            np.float64(block[VX * LANES + k]),
            np.float64(block[VY * LANES + k]),
            np.float64(block[VZ * LANES + k]),
            np.float64(block[DIR_X * LANES + k]),
            np.float64(block[DIR_Y * LANES + k]),
            np.float64(block[DIR_Z * LANES + k]),
        )
        cosine = np.float64(block[COSINE * LANES + k])
        block[RED * LANES + k] = red * cosine
        block[GREEN * LANES + k] = green * cosine
        block[BLUE * LANES + k] = blue * cosine
        block[PDF * LANES + k] = pdf
