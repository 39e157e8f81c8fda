"""A ring of fire that grows around the eye, frame by frame, to be laid over any map.

After the sequence of Wan, Wong and Leung, "Spherical Q²-tree for sampling dynamic environment
sequences", EGSR 2005, section 6, whose maps are not published: fire starts at a point, spreads
anticlockwise as seen from above until it is a ring, and flickers in place. Flames are a thin sheet
on an upright cylinder about the eye, which is near the floor, so that they rise over the horizon.
They only add light, so that a frame is the sum of the still map and of the fire; what the fire
would light in the room is left out.

Noise in the space of the cylinder and time shapes the flames: tongues rise at `RISE`, and heights
breathe at `BREATH`. Every frame is a function of its number alone, at any resolution.
"""

import math

import numpy as np
from numpy.typing import NDArray

from experiments.maps.places.colours import balanced
from experiments.maps.places.noise import fractal, smoothstep
from experiments.maps.places.raster import Picture, rasterized
from experiments.maps.places.shapes import Array

FRAMES = 120
"""Length of the sequence; the ring is closed at three quarters of it."""
RATE = 24.0
"""Frames per second."""
RING_CLOSED = 0.75 * FRAMES / RATE
KINDLING = 0.6
"""Seconds that flames take to reach their height where the fire arrives."""
RADIUS, EYE_HEIGHT = 4.0, 0.3
FLAME_HEIGHT, HIGHEST_FLAME = 2.2, 4.4
"""Usual and greatest height of flames over the floor, in m."""
RISE, BREATH = 2.2, 1.6
"""How fast tongues rise, in m/s, and how fast heights change, in noise cells per second."""
START = math.radians(-60.0)

SINES = (
    -EYE_HEIGHT / math.hypot(RADIUS, EYE_HEIGHT),
    (HIGHEST_FLAME - EYE_HEIGHT) / math.hypot(RADIUS, HIGHEST_FLAME - EYE_HEIGHT),
)
"""No flame is ever seen below or above these sines of elevation."""


def fire(frame: int, height: int) -> NDArray[np.float32]:
    """Radiance (H, 2H, 3) of the flames alone in a frame; their hottest parts have luminance 1.

    frame : 0 … FRAMES − 1
    """
    time = frame / RATE

    def shade(direction: Array, width: float) -> Array:
        out = np.zeros_like(direction)
        y = direction[:, 1]
        band = np.flatnonzero((y > SINES[0]) & (y < SINES[1]))
        if len(band):
            out[band] = _flames(direction[band], width, time)
        return out

    return rasterized(Picture(shade), height)


def _flames(direction: Array, width: float, time: float) -> Array:
    """Radiance (n, 3) of directions that meet the cylinder between floor and highest flame."""
    flat = np.hypot(direction[:, 0], direction[:, 2])
    x, z = direction[:, 0] / flat, direction[:, 2] / flat
    up = EYE_HEIGHT + RADIUS * direction[:, 1] / flat
    # Seen from above with −Z ahead, angles from +X towards −Z are anticlockwise.
    along = (np.arctan2(-z, x) - START) % (2.0 * math.pi)
    age = time - along / (2.0 * math.pi) * RING_CLOSED
    grown = smoothstep(0.0, KINDLING, age)
    cell = np.stack([RADIUS * x, np.full(len(x), time * BREATH), RADIUS * z], axis=1)
    reach = np.clip(1.0 + 0.9 * fractal(cell, 0.0, (1.1, 1.0, 1.1), 4, 0.55, 2050), 0.4, 2.0)
    top = np.maximum(FLAME_HEIGHT * reach * grown, 1e-3)
    point = np.stack([RADIUS * x, up - RISE * time, RADIUS * z], axis=1)
    lick = fractal(point, RADIUS * width, (0.45, 0.75, 0.45), 5, 0.6, 2060)
    rise = up / top
    heat = np.clip(1.15 - 1.25 * rise + 1.1 * lick * (0.3 + rise), 0.0, 1.0)
    heat *= grown * smoothstep(0.0, 0.1, up) * (1.0 - smoothstep(0.9, 1.0, up / HIGHEST_FLAME))
    body = np.stack([heat**1.4, 0.91 * heat**2.2, 0.73 * heat**4.0], axis=1)
    return np.asarray(body * balanced(2000.0, 3200.0))
