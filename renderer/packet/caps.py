"""Rays toward a disc light, a cap of the sphere, and the lanes that its centre faces."""

import math

import numpy as np

from renderer.packet import lambert
from renderer.packet.embree import DIR_X, DIR_Y, DIR_Z, LANES
from renderer.packet.layout import COSINE, FACING, GX, GY, GZ, NX, NY, NZ, ONE, ZERO
from samplers.compiled import inner
from samplers.sphere import sine_cosine


@inner
def face_caps(packet, centre, half_angle, numbers):
    """Directions uniform in the cap around a unit centre into the packet's rays.

    numbers : two rows of sixteen random numbers
    """
    reach = math.sin(0.5 * half_angle)
    tx, ty, tz, bx, by, bz = lambert.frame(centre[0], centre[1], centre[2])
    cx, cy, cz = centre[0], centre[1], centre[2]
    for k in range(LANES):
        radius = math.sqrt(np.float64(numbers[k])) * reach  # sin(θ/2), exact for small caps
        cosine = 1.0 - 2.0 * radius * radius
        sine = 2.0 * radius * math.sqrt(max(0.0, 1.0 - radius * radius))
        up, across = sine_cosine(np.float64(numbers[LANES + k]))
        x, y = sine * across, sine * up
        packet[DIR_X * LANES + k] = x * tx + y * bx + cosine * cx
        packet[DIR_Y * LANES + k] = x * ty + y * by + cosine * cy
        packet[DIR_Z * LANES + k] = x * tz + y * bz + cosine * cz


@inner
def face_centre(packet, centre):
    """COSINE of the centre, and FACING where it and the ray are above; how many lanes face."""
    facing = 0
    x, y, z = np.float32(centre[0]), np.float32(centre[1]), np.float32(centre[2])
    for k in range(LANES):
        cosine = (
            packet[NX * LANES + k] * x + packet[NY * LANES + k] * y + packet[NZ * LANES + k] * z
        )
        above = (
            packet[GX * LANES + k] * packet[DIR_X * LANES + k]
            + packet[GY * LANES + k] * packet[DIR_Y * LANES + k]
            + packet[GZ * LANES + k] * packet[DIR_Z * LANES + k]
        )
        faces = (cosine > ZERO) & (above > ZERO)
        packet[COSINE * LANES + k] = cosine
        packet[FACING * LANES + k] = ONE if faces else ZERO
        facing += 1 if faces else 0
    return facing
