"""Low-discrepancy points: every elementary interval of every aligned block holds one point."""

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import kstest

from renderer.packet.embree import LANES
from renderer.packet.lane_samples import packet_numbers
from renderer.packet.low_discrepancy import sobol_pair
from samplers.compiled import kernel

SEEDS = (0, 1, 12345, 2**32 - 1)


@kernel
def pairs(first, count, seed):
    out = np.empty((count, 2), np.float32)
    for i in range(count):
        out[i] = sobol_pair(first + i, seed)
    return out


def points(
    pixel: int = 5,
    subpixels: int = 4,
    count: int = 64,
    first: int = 0,
    seed: int = 3,
    stream: int = 0,
) -> NDArray[np.float32]:
    """A pixel's points (count, subpixels, 3)."""
    lanes = -(-subpixels // LANES) * LANES
    out = np.empty((count * lanes, 3), np.float32)
    where = np.full(subpixels, pixel, np.int32), np.arange(subpixels, dtype=np.int32)
    packet_numbers((0, subpixels), *where, subpixels, first, count, seed, stream, False, out)
    return out.reshape(count, lanes, 3)[:, :subpixels]


def assert_stratified(block: NDArray[np.float32]) -> None:
    """One point of the 2^k in each of the 2^a × 2^b boxes, for all a + b = k."""
    k = len(block).bit_length() - 1
    for a in range(k + 1):
        column = (block[:, 0] * 2**a).astype(np.int64)
        row = (block[:, 1] * 2 ** (k - a)).astype(np.int64)
        assert len(np.unique(column * 2 ** (k - a) + row)) == len(block), (a, k - a)


@pytest.mark.parametrize("seed", SEEDS)
def test_aligned_blocks_are_stratified_in_all_elementary_intervals(seed: int) -> None:
    sequence = pairs(0, 1024, seed)
    for k in range(11):
        for block in sequence.reshape(-1, 2**k, 2):
            assert_stratified(block)
    far = pairs(2**20, 256, seed)
    assert_stratified(far)


def test_numbers_lie_in_the_half_open_unit_interval() -> None:
    for seed in SEEDS:
        u = pairs(0, 1 << 16, seed)
        assert u.dtype == np.float32
        # 2^16 points have one in each of 2^16 intervals of either axis, so the ends are visited.
        assert u.min() >= 0.0 and u.max() < 1.0
        assert (u.min(axis=0) < 2.0**-16).all() and (u.max(axis=0) >= 1.0 - 2.0**-16).all()
    last = np.float32(2**24 - 1) * np.float32(2.0**-24)
    assert last < 1.0  # the largest number that 24 bits make is not rounded up to 1


def test_the_samples_of_a_pixel_stratify_each_other() -> None:
    u = points(subpixels=4, count=16)
    assert_stratified(u.reshape(-1, 3)[:, :2])
    third = np.sort((u[..., 2].ravel() * 64).astype(int))
    np.testing.assert_array_equal(third, np.arange(64))


def test_the_samples_of_each_sub_pixel_are_stratified() -> None:
    u = points(subpixels=4, count=16)
    for k in range(4):
        assert_stratified(u[:, k, :2])


def test_later_calls_continue_the_sequence() -> None:
    """All sub-pixels of two calls together have the points of one longer call."""
    whole = points(count=24).reshape(-1, 3)
    parts = np.concatenate([points(count=8), points(count=16, first=8)]).reshape(-1, 3)
    np.testing.assert_array_equal(np.unique(parts, axis=0), np.unique(whole, axis=0))


@pytest.mark.parametrize("other", [{"pixel": 6}, {"seed": 4}, {"stream": 1}])
def test_pixels_seeds_and_streams_have_points_of_their_own(other: dict[str, int]) -> None:
    a, b = points(count=256).reshape(-1, 3), points(count=256, **other).reshape(-1, 3)
    assert len(np.intersect1d(a[:, 0], b[:, 0])) < 10  # 2^20 pairs of 2^24 numbers: 0.06 expected
    # Independent points correlate by 1/√1024; four of that in each of nine pairs is beyond chance.
    correlation = np.corrcoef(a.T, b.T)[:3, 3:]
    assert np.abs(correlation).max() < 4.0 / 32.0


def test_points_of_many_pixels_are_uniform() -> None:
    pixel = np.arange(4096, dtype=np.int32)
    out = np.empty((4096, 3), np.float32)
    packet_numbers((0, 4096), pixel, np.zeros_like(pixel), 1, 0, 1, 0, 0, False, out)
    for column in out.T:  # α = 0.001 in each of three independent tests
        assert kstest(column, "uniform").pvalue > 1e-3
    correlation = np.corrcoef(np.concatenate([out[1:], out[:-1]], axis=1).T)
    assert np.abs(correlation - np.eye(6)).max() < 4.5 / 64.0
