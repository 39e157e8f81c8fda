"""What places are furnished with beyond plain materials: foliage, logs, flames, night windows."""

import numpy as np

from experiments.maps.places.materials import Material
from experiments.maps.places.noise import cell_random, fractal, mix, smoothstep
from experiments.maps.places.shapes import Array


def leafage(point: Array, flat: Array, width: Array) -> Array:
    """Foliage: leaves in clumps, lit on some edges."""
    clump = fractal(point, width, 0.15, 4, 0.7, 1010)
    leaf = fractal(point, width, 0.04, 3, 0.7, 1020, True)
    return np.exp(1.4 * clump + 0.9 * leaf)[:, None] * mix((0.8, 1.0, 1.0), (1.4, 1.1, 0.6), clump)


def log_wall(point: Array, flat: Array, width: Array) -> Array:
    """Round logs of 22 cm laid along the wall."""
    phase = (flat[:, 1] / 0.22) % 1.0
    bulge = np.sqrt(np.clip(1.0 - (2.0 * phase - 1.0) ** 2, 0.02, 1.0))
    tone = cell_random(np.floor(flat[:, 1] / 0.22), 3, 1030) - 0.5
    grain = fractal(point, width, (0.5, 0.03, 0.5), 4, 0.6, 1040)
    return (bulge * np.exp(0.5 * tone + 0.45 * grain))[:, None] * np.ones(3)


def flames(u: Array, v: Array) -> Array:
    """Tongues of fire over (−1, 1)²: white-hot at the foot, red at the tips."""
    point = np.stack([2.6 * u, 1.1 * v, np.zeros_like(u)], axis=1)
    lick = fractal(point, 0.0, (0.9, 1.4, 1.0), 5, 0.6, 1050)
    rise = 0.5 * (v + 1.0)
    body = 1.15 - 1.25 * rise - 0.75 * u * u + 1.1 * lick * (0.3 + rise)
    heat = np.clip(body, 0.0, 1.0)
    return np.stack([2.2 * heat**1.4, 2.0 * heat**2.2, 1.6 * heat**4.0], axis=1) + 2e-3


def night_window(direction: Array, width: float) -> Array:
    """What a window shows at night: a dim sky over dark trees."""
    trees = fractal(direction, width, 0.2, 6, 0.6, 1060)
    level = smoothstep(-0.02, 0.06, direction[:, 1] - 0.08 - 0.15 * trees)
    glow = 0.012 * np.exp(-2.5 * np.maximum(direction[:, 1], 0.0)) + 0.002
    return mix(np.array([0.0012, 0.0014, 0.0016]), glow[:, None] * [0.5, 0.7, 1.2], level)


def bark() -> Material:
    """Trunks: upright furrows, moss in patches."""

    def texture(point: Array, flat: Array, width: Array) -> Array:
        furrow = fractal(point, width, (0.07, 0.6, 0.07), 5, 0.6, 1260, True)
        moss = smoothstep(0.05, 0.35, fractal(point, width, 0.9, 5, 0.6, 1270))
        return mix((1.0, 1.0, 1.0), (0.7, 1.3, 0.5), moss) * np.exp(0.8 * furrow)[:, None]

    return Material((0.11, 0.085, 0.06), texture)


def forest_floor() -> Material:
    """Dead leaves, moss and earth."""

    def texture(point: Array, flat: Array, width: Array) -> Array:
        litter = fractal(point, width, 0.10, 5, 0.7, 1280)
        moss = smoothstep(0.0, 0.3, fractal(point, width, 1.5, 5, 0.55, 1290))
        colour = mix((1.25, 0.95, 0.7), (0.55, 1.1, 0.45), moss)
        return colour * np.exp(1.2 * litter)[:, None]

    return Material((0.11, 0.09, 0.05), texture)
