"""Surfaces of built places: plaster, boards, tiles, bricks, concrete and the like.

A material is a mean albedo and a texture: a factor per colour channel at points of a surface, given
the width of a sample there. Patterns of cells are drawn in the surface's own two axes with their
joints integrated over the sample; grain and stains are noise in space.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from experiments.maps.places.noise import cell_random, fractal, mix, stripes
from experiments.maps.places.shapes import Array

Texture = Callable[[Array, Array, Array], Array]
"""Factor (n, 3) or (n, 1) at points (n, 3) with surface coordinates (n, 2) and widths (n,)."""


def plaster(point: Array, flat: Array, width: Array) -> Array:
    """Hand-smoothed, with stains that run down."""
    broad = fractal(point, width, (1.1, 1.9, 1.1), 4, 0.5, 700)
    fine = fractal(point, width, 0.06, 4, 0.6, 710)
    return np.exp(0.16 * broad + 0.07 * fine)[:, None]


def concrete(point: Array, flat: Array, width: Array) -> Array:
    """Cast in panels 1.25 m wide, stained, pitted."""
    stain = fractal(point, width, (1.6, 0.9, 1.6), 6, 0.6, 720)
    pits = fractal(point, width, 0.05, 4, 0.7, 730)
    joint = stripes(flat[:, 0], 2.5, 0.015, width) + stripes(flat[:, 1], 1.25, 0.015, width)
    return (np.exp(0.35 * stain + 0.15 * pits) * (1.0 - 0.5 * np.minimum(joint, 1.0)))[:, None]


def _cells(
    flat: Array, width: Array, size: tuple[float, float], joint: float, shift: float, seed: int
) -> tuple[Array, Array]:
    """A tone in ±½ per cell and the share of joint, for cells laid in rows shifted by `shift`."""
    row = np.floor(flat[:, 1] / size[1])
    along = flat[:, 0] + shift * size[0] * (row % 2.0)
    cell = np.floor(along / size[0])
    tone = cell_random(cell, row, seed) - 0.5
    tone *= np.clip(1.6 - 1.2 * width / min(size), 0.0, 1.0)
    joints = stripes(along, size[0], joint, width) + stripes(flat[:, 1], size[1], joint, width)
    return tone, np.minimum(joints, 1.0)


def boards(point: Array, flat: Array, width: Array) -> Array:
    """Planks 14 cm wide that run along the second axis, 2.4 m long, with grain."""
    tone, joint = _cells(flat[:, ::-1], width, (2.4, 0.14), 0.005, 0.37, 740)
    offset = point + 7.0 * tone[:, None]
    grain = fractal(offset, width, (0.02, 0.02, 0.5), 4, 0.6, 750)
    knots = fractal(offset, width, (0.25, 0.25, 1.6), 3, 0.5, 760)
    warm = mix((0.9, 1.0, 1.1), (1.1, 1.0, 0.9), 0.5 + tone)
    factor = np.exp(0.55 * tone + 0.35 * grain + 0.3 * knots) * (1.0 - 0.75 * joint)
    return warm * factor[:, None]


def wood(point: Array, flat: Array, width: Array) -> Array:
    """Furniture: rings cut lengthwise."""
    bend = fractal(point, width, (0.5, 0.9, 0.5), 3, 0.5, 770)
    grain = fractal(point + bend[:, None] * 0.1, width, (0.025, 0.5, 0.025), 4, 0.6, 780)
    return np.exp(0.4 * grain + 0.3 * bend)[:, None] * np.array([1.02, 1.0, 0.96])


def tiles(point: Array, flat: Array, width: Array) -> Array:
    """Square tiles of 40 cm with grout."""
    tone, joint = _cells(flat, width, (0.4, 0.4), 0.008, 0.0, 790)
    veins = fractal(point + 9.0 * tone[:, None], width, 0.25, 5, 0.6, 800)
    return (np.exp(0.18 * tone + 0.16 * veins) * (1.0 - 0.5 * joint))[:, None]


def chequer(point: Array, flat: Array, width: Array) -> Array:
    """Pale and dark slabs of 60 cm by turns."""
    tone, joint = _cells(flat, width, (0.6, 0.6), 0.006, 0.0, 810)
    odd = (np.floor(flat[:, 0] / 0.6) + np.floor(flat[:, 1] / 0.6)) % 2.0
    veins = fractal(point + 9.0 * tone[:, None], width, 0.4, 6, 0.6, 820)
    base = mix(0.6, 1.3, odd)
    return (base * np.exp(0.2 * tone + 0.3 * veins) * (1.0 - 0.4 * joint))[:, None]


def bricks(point: Array, flat: Array, width: Array) -> Array:
    """Bricks of 24 × 7.5 cm in pale mortar."""
    tone, joint = _cells(flat, width, (0.25, 0.085), 0.012, 0.5, 830)
    rough = fractal(point, width, 0.08, 5, 0.65, 840)
    stain = fractal(point, width, 1.3, 4, 0.5, 850)
    brick = np.exp(0.7 * tone + 0.3 * rough)[:, None] * np.array([1.0, 1.0, 1.0])
    return mix(brick, (1.1, 1.5, 1.8), 0.8 * joint) * np.exp(0.35 * stain)[:, None]


def masonry(point: Array, flat: Array, width: Array) -> Array:
    """Cut stone in courses of 35 cm, worn."""
    tone, joint = _cells(flat, width, (0.7, 0.35), 0.012, 0.5, 860)
    rough = fractal(point, width, 0.3, 7, 0.6, 870)
    stain = fractal(point, width, (2.0, 3.0, 2.0), 4, 0.5, 880)
    factor = np.exp(0.35 * tone + 0.3 * rough + 0.35 * stain) * (1.0 - 0.45 * joint)
    return factor[:, None] * mix((1.05, 1.0, 0.92), (0.95, 1.0, 1.06), 0.5 + tone)


def cobbles(point: Array, flat: Array, width: Array) -> Array:
    """Setts of 11 cm, dark between."""
    tone, joint = _cells(flat, width, (0.16, 0.11), 0.018, 0.5, 890)
    rough = fractal(point, width, 0.09, 5, 0.65, 900)
    stain = fractal(point, width, 2.5, 4, 0.5, 910)
    return (np.exp(0.7 * tone + 0.45 * rough + 0.4 * stain) * (1.0 - 0.7 * joint))[:, None]


def asphalt(point: Array, flat: Array, width: Array) -> Array:
    """Grains, patches, and oil."""
    grains = fractal(point, width, 0.02, 3, 0.7, 920)
    patch = fractal(point, width, 1.8, 6, 0.55, 930)
    return np.exp(0.5 * grains + 0.5 * patch)[:, None]


def fabric(point: Array, flat: Array, width: Array) -> Array:
    """Carpet or cloth: soft folds and a coarse weave."""
    folds = fractal(point, width, 0.5, 4, 0.5, 940)
    weave = fractal(point, width, 0.012, 3, 0.7, 950)
    return np.exp(0.3 * folds + 0.35 * weave)[:, None]


def drapes(point: Array, flat: Array, width: Array) -> Array:
    """Heavy curtains: upright folds of about 20 cm."""
    sway = fractal(point, width, (0.5, 2.5, 0.5), 3, 0.5, 960)
    phase = (flat[:, 0] + 0.15 * sway) * 31.0
    fold = np.sin(phase) * np.clip(2.0 - 15.0 * width, 0.0, 1.0)
    return np.exp(0.55 * fold + 0.3 * sway)[:, None]


def sheet_metal(point: Array, flat: Array, width: Array) -> Array:
    """Corrugated sheets with rust at the seams."""
    wave = np.sin(flat[:, 0] * (6.2832 / 0.2)) * np.clip(2.0 - 20.0 * width, 0.0, 1.0)
    rust = fractal(point, width, (0.7, 1.8, 0.7), 6, 0.6, 970)
    tint = mix((1.0, 1.0, 1.0), (1.2, 0.8, 0.55), np.clip(1.5 * rust, 0.0, 1.0))
    return np.exp(0.35 * wave - 0.3 * np.maximum(rust, 0.0))[:, None] * tint


def shelves(point: Array, flat: Array, width: Array) -> Array:
    """Goods on shelves: boxes or books of many tones, dark gaps over them."""
    level = np.floor(flat[:, 1] / 0.36)
    size = 0.06 + 0.12 * cell_random(level, 5, 980)
    slot = np.floor(flat[:, 0] / size)
    tone, hue = cell_random(slot, level, 981), cell_random(slot, level, 982)
    height = 0.20 + 0.12 * cell_random(slot, level, 983)
    inside = flat[:, 1] - 0.36 * level
    shown = np.clip((height - inside) / np.maximum(width, 1e-3) + 0.5, 0.0, 1.0)
    colour = mix((1.5, 0.9, 0.6), (0.7, 1.0, 1.4), hue) * (0.3 + 1.5 * tone)[:, None]
    board = stripes(flat[:, 1], 0.36, 0.03, width)
    return mix(mix((0.08, 0.08, 0.08), colour, shown), (1.2, 1.0, 0.8), board)


@dataclass(frozen=True)
class Material:
    """albedo : mean, (3,); gloss : 0 dull … 1 like wet stone; polish : highlight exponent.

    emission : radiance (n, 3), for lit windows; called like a texture
    """

    albedo: tuple[float, float, float]
    texture: Texture = plaster
    gloss: float = 0.0
    polish: float = 300.0
    emission: Texture | None = None


STOREY, BAY = 3.4, 2.6


def _facade_window(flat: Array, width: Array) -> tuple[Array, Array]:
    """Share of window at points of a wall, and a random number per window."""
    columns = stripes(flat[:, 0] - 0.7, BAY, 1.2, width)
    rows = stripes(flat[:, 1] - 1.0, STOREY, 1.7, width)
    bay, storey = np.floor(flat[:, 0] / BAY), np.floor(flat[:, 1] / STOREY)
    return np.where(flat[:, 1] > 0.0, columns * rows, 0.0), cell_random(bay, storey, 991)


def facade(point: Array, flat: Array, width: Array) -> Array:
    """A rendered house front: windows with pale frames and bars, a string course per storey."""
    window, chance = _facade_window(flat, width)
    bars = stripes(flat[:, 0] - 1.27, BAY, 0.06, width) + stripes(
        flat[:, 1] - 2.1, STOREY, 0.06, width
    )
    course = stripes(flat[:, 1] - STOREY + 0.1, STOREY, 0.22, width)
    frame = stripes(flat[:, 0] - 0.55, BAY, 1.5, width) * stripes(
        flat[:, 1] - 0.85, STOREY, 2.0, width
    )
    wall = (
        plaster(point, flat, width) * np.exp(0.3 * fractal(point, width, 4.0, 5, 0.5, 992))[:, None]
    )
    wall = mix(wall * np.ones(3), (1.25, 1.2, 1.15), np.clip(0.8 * course + 0.6 * frame, 0.0, 1.0))
    glass = mix((0.05, 0.07, 0.10), (0.22, 0.26, 0.32), chance**2)
    glass = mix(glass, (1.0, 1.0, 1.0), np.clip(bars, 0.0, 1.0))
    return mix(wall, glass, window)


def lit_windows(share: float, level: float) -> Texture:
    """Emission of a facade at night: a share of its windows lit, each in its own tone."""
    from experiments.maps.places.colours import blackbody

    warm, cool = blackbody(2600.0), blackbody(4500.0)

    def emission(point: Array, flat: Array, width: Array) -> Array:
        window, chance = _facade_window(flat, width)
        inside = 1.0 + 0.8 * fractal(point, width, 0.7, 4, 0.5, 993)
        bars = stripes(flat[:, 0] - 1.27, BAY, 0.06, width)
        lit = np.where(chance < share, window * (1.0 - 0.9 * np.clip(bars, 0.0, 1.0)), 0.0)
        tone = np.modf(chance * 97.0)[0]
        strength = level * lit * np.maximum(inside, 0.1) * (0.2 + 1.3 * np.modf(chance * 31.0)[0])
        return strength[:, None] * mix(warm, cool, np.where(tone > 0.75, 1.0, 0.3 * tone))

    return emission


def surface_coordinates(point: Array, axis: Array) -> Array:
    """Along and up (n, 2) on a wall, x and z on a level surface, for faces across an axis (n,)."""
    x, y, z = point.T
    return np.stack([np.where(axis == 0, z, x), np.where(axis == 1, z, y)], axis=1)
