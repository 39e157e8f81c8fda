"""Samples of points side by side are those that the plain formulas draw one by one."""

import numpy as np
import pytest

from renderer.packet.embree import LANES
from renderer.packet.lane_samples import packet_numbers
from renderer.packet.lanes import packets_of
from renderer.packet.low_discrepancy import seeds_of, sobol_first, sobol_pair
from renderer.packet.material_table import pack
from renderer.packet.reflectance import draw
from renderer.scene.materials import Ward
from samplers.compiled import kernel
from tests.renderer.lab import SURFACES
from tests.renderer.packet import plain_brdf

POINTS, COUNT = (3, 40), 5


def of_points(rows: np.ndarray) -> np.ndarray:
    """Rows by sample and point as (points, samples, …), without spare lanes."""
    by_sample = rows.reshape(COUNT, -1, *rows.shape[1:])
    return np.swapaxes(by_sample, 0, 1)[: POINTS[1] - POINTS[0]]


def all_rows() -> int:
    return -(-(POINTS[1] - POINTS[0]) // LANES) * LANES * COUNT


@kernel
def one_by_one(pixel, subpixel, subpixels, first, count, seed, stream):
    """Sample s of sub-pixel k is point k · count + s of the run of its pixel's sequence."""
    out = np.empty((len(pixel), count, 3), np.float32)
    for i in range(len(pixel)):
        base, other = seeds_of(pixel[i], seed, stream)
        for s in range(count):
            index = first * subpixels + subpixel[i] * count + s
            out[i, s, 0], out[i, s, 1] = sobol_pair(index, base)
            out[i, s, 2] = sobol_first(index, other)
    return out


def test_numbers_are_those_of_the_sequence() -> None:
    rng = np.random.default_rng(0)
    pixel = rng.integers(0, 1000, 50).astype(np.int32)
    subpixel = rng.integers(0, 4, 50).astype(np.int32)
    out = np.empty((all_rows(), 3), np.float32)
    packet_numbers(POINTS, pixel, subpixel, 4, 7, COUNT, 11, 1, False, out)
    start, stop = POINTS
    expected = one_by_one(pixel[start:stop], subpixel[start:stop], 4, 7, COUNT, 11, 1)
    np.testing.assert_array_equal(of_points(out), expected)


@pytest.mark.parametrize("name", SURFACES)
def test_directions_are_those_of_the_scalar_model(name: str) -> None:
    surface = SURFACES[name]
    rng = np.random.default_rng(1)
    normal, eye = rng.normal(size=(2, 50, 3))
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    eye /= np.linalg.norm(eye, axis=1, keepdims=True)
    eye *= np.sign((normal * eye).sum(axis=1, keepdims=True))
    normal, eye = normal.astype(np.float32), eye.astype(np.float32)
    material, materials = np.zeros(50, np.int32), pack([surface])
    packets, ward = packets_of(POINTS, normal, normal, normal, eye, material, materials)
    assert ward == isinstance(surface, Ward)
    u = rng.random((all_rows(), 3), np.float32)
    direction = np.empty_like(u)
    draw(packets, ward, POINTS, material, materials, u, COUNT, direction)
    numbers, drawn = of_points(u).astype(float), of_points(direction)
    for i in range(POINTS[1] - POINTS[0]):
        for s in range(COUNT):
            n, v = normal[POINTS[0] + i].astype(float), eye[POINTS[0] + i].astype(float)
            expected, _ = plain_brdf.sample(materials[0], n, v, numbers[i, s])
            # Some ten roundings of 2⁻²⁴ each; a visible normal seen at a grazing angle, and a
            # frame whose pole is near, enlarge them up to a hundredfold.
            np.testing.assert_allclose(drawn[i, s], expected, atol=6e-5)
    ends = rng.choice(np.float32([0.0, 1.0 - 2.0**-24]), u.shape)
    draw(packets, ward, POINTS, material, materials, ends, COUNT, direction)
    # A square root and a product for each of three components.
    np.testing.assert_allclose(np.linalg.norm(of_points(direction), axis=2), 1.0, atol=2.0**-22)


def test_independent_numbers_are_uniform_and_not_stratified():
    """Of 64 stratified numbers one lies in each 64th; of independent ones in 63.6 % (1 − 1/e)."""
    pixel = np.arange(4096, dtype=np.int32)
    subpixel = np.zeros(4096, np.int32)
    filled = {}
    for independent in (False, True):
        out = np.empty((4096 * 64, 3), np.float32)
        packet_numbers((0, 4096), pixel, subpixel, 1, 0, 64, 5, 0, independent, out)
        by_point = out.reshape(64, 4096, 3).swapaxes(0, 1)
        filled[independent] = np.mean(
            [len(np.unique((row[:, 0] * 64).astype(int))) / 64 for row in by_point]
        )
        # Mean of 2.6e5 uniform numbers: standard deviation .29 / √2.6e5 = 5.6e-4, five of them.
        assert np.allclose(out.mean(axis=0), 0.5, atol=2.8e-3)
    assert filled[False] == 1.0
    expected = 1.0 - (1.0 - 1.0 / 64.0) ** 64
    # Standard deviation of a point's share about .04, of the mean of 4096 of them 6e-4.
    assert abs(filled[True] - expected) < 3e-3
