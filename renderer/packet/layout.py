"""The layout of a packet: sixteen shading points side by side, one number of each in every row.

A packet is a one-dimensional float32 array: the twelve rows of Embree's packet of rays, then rows
of what the points' surfaces are and reflect. A lane is one of the sixteen columns. Loops over the
lanes have a constant length and no branches, so that compilers make vector instructions of them.
Float32 is what positions, normals and directions are given in.
"""

import numpy as np

from renderer.packet.embree import LANES, MASK, RAY_ROWS
from renderer.packet.material_table import INV_PI
from samplers.compiled import kernel

(
    NX, NY, NZ, GX, GY, GZ, VX, VY, VZ, NV, ROOT_V, ALPHA_2, DIFFUSE_R, DIFFUSE_G, DIFFUSE_B,
    DIMMED, F0_R, F0_G, F0_B, GLOSSY, SHARE, COSINE, FACING, RED, GREEN, BLUE, PDF,
) = range(RAY_ROWS, RAY_ROWS + 27)  # fmt: skip
"""Rows of a packet after its rays'.

NV … SHARE : n·v, the root of Smith's term for v, α², diffuse f_r for light from above, 1 where a
coat dims the base by Fresnel's term, reflectance at normal incidence, 1 where there is a specular
lobe, and the probability of sampling it
COSINE … PDF : results for the directions in the packet's rays
"""
PACKET_SIZE = (PDF + 1) * LANES
ZERO, HALF, ONE, TWO = np.float32(0.0), np.float32(0.5), np.float32(1.0), np.float32(2.0)
LANE_INV_PI = np.float32(INV_PI)
TINY = np.float32(1e-30)
"""Keeps divisions by products of cosines finite where nothing faces the light anyway."""


@kernel
def new_packets(count):
    """Packets (count, 39 · 16) float32, aligned to 64 bytes, with nothing in them."""
    memory = np.empty(count * PACKET_SIZE + 16, np.float32)
    start = (-(memory.ctypes.data // 4)) % 16
    packets = memory[start : start + count * PACKET_SIZE].reshape((count, PACKET_SIZE))
    packets[:] = 0.0
    packets.view(np.uint32)[:, MASK * LANES : (MASK + 1) * LANES] = np.uint32(0xFFFFFFFF)
    return packets
