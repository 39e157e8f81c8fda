"""Maps of other projections keep the energy of each pixel, and every direction its place."""

import itertools
import math

import numpy as np
import pytest

from samplers.errors import EnvlightError
from samplers.files.projections import PROJECTIONS, candidates, to_lat_long
from samplers.sphere import pixel_directions, row_solid_angle

SHAPES = {
    "lat-long": (17, 33), "cube-cross": (48, 64), "cube-column": (64, 48), "cube-row": (16, 96),
    "cube-stack": (96, 16), "octahedral": (32, 32), "angular": (65, 65), "mirror-ball": (64, 64),
}  # fmt: skip
"""Rows and columns of test pictures."""


def face_solid_angles(side):
    """Of a cube's face's pixels, by the arc tangents that bound them."""
    edge = np.linspace(-1.0, 1.0, side + 1)
    s, t = np.meshgrid(edge, edge)
    corner = np.arctan2(s * t, np.sqrt(1.0 + s * s + t * t))
    return np.diff(np.diff(corner, axis=0), axis=1)


def disc_solid_angles(side, within):
    """Of a disc's pixels, in polar coordinates; within : solid angle inside a radius, over 2π."""
    edge = np.linspace(-1.0, 1.0, side + 1)
    x, y = np.abs(np.meshgrid(edge, edge))
    ends = np.sort([0.0 * x, np.arctan2(y, x), np.arccos(x), np.arcsin(y), 0.0 * x + 0.5 * math.pi],
                   axis=0)  # fmt: skip
    node, weight = np.polynomial.legendre.leggauss(200)
    half = 0.5 * np.diff(ends, axis=0)
    angle = ends[:-1, ..., None] + half[..., None] * (1.0 + node)
    sides = (x[..., None] / np.maximum(np.cos(angle), 1e-300),
             y[..., None] / np.maximum(np.sin(angle), 1e-300))  # fmt: skip
    radius = np.minimum(1.0, np.minimum(*sides))
    corner = (within(radius) @ weight * half).sum(axis=0)
    corner *= np.sign(edge) * np.sign(edge)[:, None]
    return np.diff(np.diff(corner, axis=0), axis=1)


def octahedral_solid_angles(side):
    """Of an even number of pixels a side: two triangles each, whose sides are great circles."""
    edge = np.linspace(-1.0, 1.0, side + 1)
    a, b = np.meshgrid(edge, edge)
    y = 1.0 - np.abs(a) - np.abs(b)
    x = np.where(y < 0.0, np.copysign(1.0 - np.abs(b), a), a)
    z = np.where(y < 0.0, np.copysign(1.0 - np.abs(a), b), b)
    way = np.stack([x, y, z], axis=-1)
    way /= np.linalg.norm(way, axis=-1, keepdims=True)

    def triangle(*corners):  # Van Oosterom and Strackee 1983
        volume = np.abs(np.linalg.det(np.stack(corners, axis=-1)))
        sides = sum((p * q).sum(axis=-1) for p, q in itertools.combinations(corners, 2))
        return 2.0 * np.arctan2(volume, 1.0 + sides)

    first, right, below, last = way[:-1, :-1], way[:-1, 1:], way[1:, :-1], way[1:, 1:]
    middle = edge[:-1] + edge[1:]
    return np.where(
        middle * middle[:, None] > 0.0,  # the fold runs from the right to below there
        triangle(first, right, below) + triangle(last, right, below),
        triangle(first, right, last) + triangle(first, below, last),
    )


def exact_solid_angles(name):
    rows, columns = SHAPES[name]
    match name:
        case "lat-long":
            return np.tile(row_solid_angle(rows, columns)[:, None], columns)
        case "octahedral":
            return octahedral_solid_angles(rows)
        case "angular":  # θ = π r
            return disc_solid_angles(rows, lambda r: 1.0 - np.cos(math.pi * r))
        case "mirror-ball":  # sin ½θ = r
            return disc_solid_angles(rows, lambda r: 2.0 * r * r)
    middle = (np.arange(columns) + 0.5) / columns, (np.arange(rows)[:, None] + 0.5) / rows
    shown = PROJECTIONS[name].density(*middle) > 0.0
    return shown * np.tile(face_solid_angles(16), (rows // 16, columns // 16))


@pytest.mark.parametrize("name", PROJECTIONS)
def test_the_energy_of_each_projection_is_kept(name):
    size = exact_solid_angles(name)
    assert size.sum() == pytest.approx(4.0 * math.pi, rel=1e-12)
    light = np.random.default_rng(0).exponential(1.0, (*size.shape, 3)).astype(np.float32) ** 4
    wanted = (size[..., None] * light.astype(np.float64)).sum(axis=(0, 1))
    # Where pixels are cut (`CELL_ERROR`) 4e-8, and as much of float32's roundings, of which a map
    # has thousands of chance sign. A rim is as bright as the rest here.
    assert to_lat_long(light, name).total_flux == pytest.approx(wanted, rel=2e-7)


@pytest.mark.parametrize("name", PROJECTIONS)
def test_an_even_picture_makes_an_even_map(name):
    made = to_lat_long(np.ones((*SHAPES[name], 3), np.float32), name)
    assert made.total_flux == pytest.approx(4.0 * math.pi, rel=1e-6)
    weight = made.row_solid_angle[:, None] / (8.0 * math.pi * made.height)
    spread = math.sqrt(((made.radiance[..., 0] - 1.0) ** 2 * weight).sum())
    # A pixel has 16 points, of which a quarter or so, at edges of the picture's pixels, are off by
    # half a point at chance: 0.5 · √4 / 16 = 0.06 before weights take most of it away.
    assert spread < 0.01


WAYS = {
    "front": (0, 0, 1), "back": (0, 0, -1), "up": (0, 1, 0), "down": (0, -1, 0),
    "left": (1, 0, 0), "right": (-1, 0, 0),
    "high in front": (0, 1, 0.5), "low behind": (0, -0.5, -1), "up to the left": (0.5, 1, 0),
}  # fmt: skip
WHERE = {
    "lat-long": {"front": (0.5, 0.5), "left": (0.5, 0.25), "up": (0.03, 0.5)},
    "cube-cross": {"front": (0.5, 0.375), "left": (0.5, 0.125), "right": (0.5, 0.625),
                   "back": (0.5, 0.875), "up": (1 / 6, 0.375), "down": (5 / 6, 0.375),
                   "high in front": (0.25, 0.375), "up to the left": (1 / 6, 0.3125)},
    "cube-column": {"front": (0.375, 0.5), "back": (0.875, 0.5), "up": (0.125, 0.5),
                    "high in front": (0.1875, 0.5), "low behind": (0.8125, 0.5)},
    "cube-row": {"right": (0.5, 1 / 12), "left": (0.5, 0.25), "up": (0.5, 5 / 12),
                 "down": (0.5, 7 / 12), "front": (0.5, 0.75), "back": (0.5, 11 / 12),
                 "high in front": (0.75, 5 / 12), "low behind": (0.75, 11 / 12)},
    "cube-stack": {"right": (1 / 12, 0.5), "front": (0.75, 0.5)},
    "octahedral": {"up": (0.5, 0.5), "front": (0.97, 0.5), "left": (0.5, 0.03)},
    "angular": {"front": (0.5, 0.5), "left": (0.5, 0.25), "up": (0.25, 0.5)},
    "mirror-ball": {"front": (0.5, 0.5), "left": (0.5, 0.5 + 0.5**1.5),
                    "up": (0.5 - 0.5**1.5, 0.5)},
}  # fmt: skip
"""Row and column, as shares of the picture, of some ways."""


@pytest.mark.parametrize("name", PROJECTIONS)
def test_a_spot_shines_from_where_the_projection_has_it(name):
    rows, columns = SHAPES[name]
    for way, (row, column) in WHERE[name].items():
        image = np.zeros((rows, columns, 3), np.float32)
        top, left = (min(round(s * n), n - 1) for s, n in ((row, rows), (column, columns)))
        image[max(top - 1, 0) : top + 1, max(left - 1, 0) : left + 1] = 1.0
        made = to_lat_long(image, name, 32)
        mean = (made.flux[..., None] * pixel_directions(32)).sum(axis=(0, 1))
        # The spot is two pixels wide, of 0.2 at most, and a pixel of the new map is 0.1.
        assert np.dot(mean, WAYS[way]) / np.linalg.norm(mean) > math.cos(0.3), (name, way)


def test_shapes_tell_projections():
    assert candidates(400, 300) == ["cube-cross"] and candidates(1917, 938) == ["lat-long"]
    assert candidates(512, 512) == ["octahedral", "angular", "mirror-ball"]
    square = np.ones((8, 8, 3), np.float32)
    with pytest.raises(EnvlightError, match="name their --projection: octahedral, angular, mirr"):
        to_lat_long(square)
    with pytest.raises(EnvlightError, match="name their --projection: lat-long, cube-cross"):
        to_lat_long(np.ones((8, 25, 3), np.float32))
    with pytest.raises(EnvlightError, match=r"8×8 pixels; cube-cross has an aspect of 1\.333"):
        to_lat_long(square, "cube-cross")
    with pytest.raises(EnvlightError, match="--projection fisheye: use lat-long, "):
        to_lat_long(square, "fisheye")
    with pytest.raises(EnvlightError, match="NaN, infinite or negative; mend the file"):
        to_lat_long(-square, "angular")


def test_a_map_that_memory_does_not_hold_is_refused(monkeypatch):
    monkeypatch.setattr("samplers.files.stored_image.available_memory", lambda: 10**9)
    with pytest.raises(EnvlightError, match=r"sky: 32768×16384 pixels need 6\.4 GB"):
        to_lat_long(np.ones((8, 8, 3), np.float32), "angular", 16384, "sky")
