"""Survivors are drawn in proportion to their weights, and stand for all candidates."""

import numpy as np
import pytest

from samplers.grids.survivors import FEW, choose, choose_of_sets


def drawn(weight: np.ndarray, target: np.ndarray, count: int, u: np.ndarray, place: np.ndarray):
    """Numbers of the survivors (count, p) and their scales."""
    number = np.empty((count, weight.shape[1]), np.int32)
    scale = np.empty(number.shape)
    choose(target, weight, place, u, number, scale)
    return number, scale


@pytest.mark.parametrize("count", [1, 3, 8])
def test_survivors_follow_the_weights(count: int) -> None:
    """With equal steps of u through [0, 1) each candidate survives its share to one step."""
    rng = np.random.default_rng(count)
    steps, candidates = 4096, 12
    one = rng.random(candidates) ** 3 * (rng.random(candidates) < 0.8)
    weight = np.repeat(one[:, None], steps, axis=1)
    target = np.repeat((1.0 + rng.random(candidates))[:, None], steps, axis=1)
    place = np.repeat(rng.permutation(candidates).astype(np.int32)[:, None], steps, axis=1)
    u = ((np.arange(steps) + 0.5) / steps).astype(np.float32)
    number, scale = drawn(weight, target, count, u, place)
    share = np.bincount(number.ravel(), minlength=candidates) / number.size
    # A candidate's interval, over all survivors, is cut at two ends for each of them.
    np.testing.assert_allclose(share, one / one.sum(), atol=2.0 / steps)
    assert not share[one == 0.0].any()
    np.testing.assert_allclose(scale, one.sum() / target[number, 0], rtol=1e-12)


@pytest.mark.parametrize("number", [(6, 6), (8, 0), (0, 5)])
def test_a_survivor_of_a_set_follows_the_weights_of_its_own_candidates(
    number: tuple[int, int],
) -> None:
    rng, steps, count = np.random.default_rng(0), 4096, 3
    of_map, of_brdf = number
    one = rng.random(count * sum(number)) * (rng.random(count * sum(number)) < 0.8)
    weight = np.repeat(one[:, None], steps, axis=1)
    u = np.tile(((np.arange(steps) + 0.5) / steps).astype(np.float32), (count, 1))
    chosen, scale = np.empty((count, steps), np.int32), np.empty((count, steps))
    choose_of_sets(np.ones_like(weight), weight, number, u, chosen, scale)
    for s in range(count):
        brdf = count * of_map + s * of_brdf
        own = [*range(s * of_map, (s + 1) * of_map), *range(brdf, brdf + of_brdf)]
        total = one[own].sum()
        share = np.bincount(chosen[s], minlength=len(one))[own] / steps
        # A candidate's interval is cut at two ends; nothing survives from another set.
        np.testing.assert_allclose(share, one[own] / total, atol=2.0 / steps)
        assert share.sum() == 1.0
        np.testing.assert_allclose(scale[s], count * total, rtol=1e-12)


def test_nothing_survives_where_nothing_weighs() -> None:
    nothing, place = np.zeros((4, 2)), np.zeros((4, 2), np.int32)
    _, scale = drawn(nothing, nothing, 2, np.float32([0.0, 0.999]), place)
    assert not scale.any()
    chosen, scale = np.empty((2, 2), np.int32), np.empty((2, 2))
    choose_of_sets(nothing, nothing, (1, 1), np.full((2, 2), 0.5, np.float32), chosen, scale)
    assert not scale.any()


@pytest.mark.parametrize("apart", [1, 256, 2047])
@pytest.mark.parametrize("candidates", [FEW, FEW + 4, 64])
def test_survivors_share_the_places_out(candidates: int, apart: int) -> None:
    """Of equal weights one of each run of four neighbours survives, whatever their order."""
    order = np.random.default_rng(0).permutation(candidates).astype(np.int32)[:, None]
    one, runs = np.ones((candidates, 1)), candidates // 4
    apart = min(apart, 0xFFFF // (candidates - 1))  # places have sixteen bits
    number, _ = drawn(one, one, runs, np.float32([0.7]), apart * order)
    np.testing.assert_array_equal(np.sort(order[number[:, 0], 0] // 4), np.arange(runs))


@pytest.mark.parametrize("candidates", [2, FEW, FEW + 1, 300])
def test_candidates_of_one_place_stay_in_their_order(candidates: int) -> None:
    """Every one survives once, so that the survivors are the order itself."""
    place = np.random.default_rng(1).integers(0, 1 << 16, (candidates, 1)).astype(np.int32)
    place[candidates // 2 :] = place[: -(-candidates // 2)]
    one = np.ones((candidates, 1))
    number, _ = drawn(one, one, candidates, np.float32([0.5]), place)
    np.testing.assert_array_equal(number[:, 0], np.argsort(place[:, 0], kind="stable"))
