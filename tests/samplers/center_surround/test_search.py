"""Responses of centre-surround filters against sums over finely cut pixels, and their upkeep."""

import math
from typing import Literal

import numpy as np
import pytest

from samplers.center_surround import CenterSurround
from samplers.center_surround.kernels import reduce_rows
from samplers.center_surround.search import SurroundSearch, first_of_ties
from samplers.sphere import angular_distance, direction_from_uv, pixel_direction, row_solid_angle

Surface = Literal["sphere", "plane"]
CUT = 24
"""Parts per side of a pixel in the brute-force sums."""


def search_of(
    radiance: np.ndarray, brightest: float = 0.1, surface: Surface = "sphere"
) -> SurroundSearch:
    return SurroundSearch(radiance, CenterSurround(surface=surface).bank(), 128, brightest, False)


def brute_responses(radiance, row, column, sampler: CenterSurround) -> tuple[np.ndarray, float]:
    """Responses (filters,) at a pixel, and the largest sum of absolute terms among them.

    Float64 sums over pixels cut into CUT × CUT, each part belonging to a zone by its centre."""
    height = len(radiance)
    fine = height * CUT
    grid = direction_from_uv(
        (np.arange(2 * fine) + 0.5)[None, :] / (2 * fine), (np.arange(fine) + 0.5)[:, None] / fine
    )
    luminance = radiance.astype(np.float64) @ [0.2126, 0.7152, 0.0722]
    flux = (
        np.repeat(np.repeat(luminance, CUT, 0), CUT, 1) * row_solid_angle(fine, 2 * fine)[:, None]
    )
    angle = angular_distance(grid, pixel_direction(row, column, height))
    if sampler.surface == "plane":
        flux = flux / np.maximum(np.cos(angle), 0.1) ** 3
    bank, responses, terms = sampler.bank(), [], []
    extents = np.radians(np.linspace(4.5, 45.0, 20))
    for inner, outer, extent in zip(bank.inner, bank.outer, extents, strict=True):
        center = flux[angle < inner].sum()
        ring = flux[(angle >= inner) & (angle < outer)].sum()
        responses.append((center - 10.0 * ring) / extent)
        terms.append((center + 10.0 * ring) / extent)
    return np.array(responses), max(terms)


@pytest.mark.parametrize("surface", ["sphere", "plane"])
@pytest.mark.parametrize("pixel", [(0, 3), (4, 0), (8, 31), (9, 16), (15, 20)])
def test_response_is_the_weighted_flux_of_disc_and_ring(pixel, surface):
    radiance = np.random.default_rng(7).random((16, 32, 3)).astype(np.float32) ** 6
    radiance[pixel] = 200.0
    sampler = CenterSurround(surface=surface)
    search = search_of(radiance, surface=surface, brightest=1.0)
    search.best()
    flat = pixel[0] * 32 + pixel[1]
    expected, scale = brute_responses(radiance, *pixel, sampler)
    # A rim is followed to a third of a degree by the search and half a degree here, across discs of
    # 1.7° and more: each errs by a few thousandths of the sum of absolute terms. The staircase of
    # planar weights is exact on average, and so no worse here.
    tolerance = 0.005 * scale
    assert abs(search.response[flat] - expected.max()) < tolerance
    assert expected[search.size[flat]] > expected.max() - 2.0 * tolerance


@pytest.mark.parametrize("height", [1, 3, 16])
def test_a_constant_map_has_no_positive_response(height):
    search = search_of(np.ones((height, 2 * height, 3), np.float32), brightest=1.0)
    assert search.best() is None
    assert (search.response < 0.0).all()


@pytest.mark.parametrize(("source", "target"), [(256, 128), (150, 128), (5, 5), (7, 3)])
def test_reduction_keeps_the_flux_of_every_row_and_column(source, target):
    radiance = np.random.default_rng(8).random((source, 2 * source, 3)).astype(np.float32)
    out = np.zeros((target, 2 * target))
    reduce_rows(radiance, target, 0, target, out)
    luminance = radiance.astype(np.float64) @ [0.2126, 0.7152, 0.0722]
    flux = luminance * row_solid_angle(source, 2 * source)[:, None]
    # Float64 sums of up to 10⁵ terms.
    assert math.isclose(out.sum(), flux.sum(), rel_tol=1e-11)
    edge = np.arange(target + 1) * source / target
    below = np.interp(edge, np.arange(source + 1), np.concatenate([[0], flux.sum(1).cumsum()]))
    if source % target == 0:
        assert np.allclose(out.sum(axis=1), np.diff(below), rtol=1e-11)
    edge = np.arange(2 * target + 1) * source / target
    below = np.interp(edge, np.arange(2 * source + 1), np.concatenate([[0], flux.sum(0).cumsum()]))
    assert np.allclose(out.sum(axis=0), np.diff(below), rtol=1e-10)


def test_updates_agree_with_a_search_from_scratch():
    rng = np.random.default_rng(9)
    radiance = rng.random((64, 128, 3)).astype(np.float32) * 0.02
    for row, column in ((10, 3), (12, 126), (40, 60), (41, 70), (60, 90)):
        radiance[row : row + 2, column : column + 2] += 30.0
    search = search_of(radiance)
    for _ in range(4):
        found = search.best()
        assert found is not None
        distance = angular_distance(
            pixel_direction(np.arange(64)[:, None], np.arange(128)[None, :], 64), found.direction
        )
        radiance[distance <= search.bank.inner[found.filter]] = 0.0
        search.forget(radiance, found)
        fresh, again = search_of(radiance).best(), search.best()
        assert (fresh is None) == (again is None)
        if fresh is not None and again is not None:
            assert (fresh.row, fresh.column, fresh.filter) == (
                again.row,
                again.column,
                again.filter,
            )


@pytest.mark.parametrize("roll", range(8))
def test_ties_are_broken_alike_on_both_sides_of_the_seam(roll):
    column = (np.array([0, 7, 3]) + roll) % 8
    k = first_of_ties(np.array([2, 2, 2]), column, 8)
    # The gaps before columns 0, 7 and 3 are 1, 4 and 3.
    assert column[k] == (7 + roll) % 8
