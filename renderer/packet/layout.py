"""The layout of a packet: sixteen shading points side by side, one number of each in every row.

A packet is a one-dimensional float32 array: the twelve rows of Embree's packet of rays, then rows
of what the points' surfaces are and reflect. A lane is one of the sixteen columns. Loops over the
lanes have a constant length and no branches, so that compilers make vector instructions of them.
Float32 is what positions, normals and directions are given in.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.packet.embree import LANES, MASK, RAY_ROWS
from renderer.packet.material_table import INV_PI
from samplers.compiled import kernel


class Points(NamedTuple):
    """The shading points of a view as kernels take them: see `renderer.view.View`."""

    position: NDArray[np.float32]
    normal: NDArray[np.float32]
    geometric: NDArray[np.float32]
    toward_eye: NDArray[np.float32]
    material: NDArray[np.int32]
    materials: NDArray[np.float64]
    pixel: NDArray[np.int32]
    subpixel: NDArray[np.int32]
    subpixels: int


class Density(NamedTuple):
    """A table of a map that is drawn from in place: `samplers.lighting.TabulatedLight`.

    weight : (2H²,) float32, flat; empty where it is the luminance of the map that is looked up
    """

    table: Any
    weight: NDArray[np.float32]
    offset: float


class Given(NamedTuple):
    """Samples that are given instead of drawn, those of the light first, then those of the BRDF.

    direction : (rows, 3), of sample s of a lane in row (s · packets + packet) · 16 + lane; with
        (0, 3) all are drawn in place
    density : (rows,) float64, as samples of the light
    radiance : (rows, 3); with (0, 3) the map's
    shadowed : whether rays are traced
    """

    direction: NDArray[np.float32]
    density: NDArray[np.float64]
    radiance: NDArray[np.float32]
    shadowed: bool = True


class Numbers(NamedTuple):
    """What random numbers samples draw: those of a seed, in low-discrepancy sequences or not."""

    seed: int
    independent: bool = False


class Texels(NamedTuple):
    """A map to look up. radiance : (6H²,) float32, flat; height : its rows, H"""

    radiance: NDArray[np.float32]
    height: int


class Sequences(NamedTuple):
    """A packet's random numbers. state : of `lane_samples.begin_numbers`; independent : of all"""

    state: NDArray[np.uint32]
    independent: bool


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
