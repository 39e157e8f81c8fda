"""The blocks of a kd-tree: a partition, split where brute force splits, robust to a sun."""

import numpy as np
import pytest

from samplers import EnvironmentMap
from samplers.kd_tree.build import SELECTIONS, _best_split, build_kd_tree
from tests.samplers.maps import noisy_map


def leaf_of(tree, row, column):
    """The leaf that holds a pixel, by descent."""
    node = 0
    while tree.child[node] >= 0:
        inside = row if tree.axis[node] else column
        node = tree.child[node] + (inside >= tree.cut[node])
    return node


def sse_of(environment, block):
    top, left, bottom, right = block
    luminance = environment.luminance[top:bottom, left:right].astype(np.float64)
    weight = np.broadcast_to(environment.row_solid_angle[top:bottom, None], luminance.shape)
    mean = (luminance * weight).sum() / weight.sum()
    return (weight * (luminance - mean) ** 2).sum()


def reconstruction_error(environment, tree):
    return sum(sse_of(environment, block) for block in tree.block)


@pytest.mark.parametrize("selection", SELECTIONS)
@pytest.mark.parametrize("weighting", ["solid-angle", "pixels"])
def test_the_blocks_are_a_partition_that_the_descent_finds(selection, weighting):
    environment = noisy_map(13)
    tree = build_kd_tree(environment, 57, selection, weighting)
    assert len(tree.leaf) == 57
    size = np.prod(tree.block[:, 2:] - tree.block[:, :2], axis=1)
    assert (size > 0).all()
    assert size.sum() == 13 * 26
    node = tree.painted(tree.leaf)
    for row in range(13):
        for column in range(26):
            assert leaf_of(tree, row, column) == node[row, column]


@pytest.mark.parametrize("seed", range(5))
def test_a_split_leaves_least_variation(seed):
    environment = noisy_map(10, seed, 1e3)
    rng = np.random.default_rng(seed)
    edge = np.concatenate([[0.0], np.cumsum(environment.row_solid_angle)])
    for _ in range(15):
        top, bottom = (int(k) for k in np.sort(rng.choice(11, 2, replace=False)))
        left, right = (int(k) for k in np.sort(rng.choice(21, 2, replace=False)))
        rows = [((top, left, k, right), (k, left, bottom, right)) for k in range(top + 1, bottom)]
        columns = [
            ((top, left, bottom, k), (top, k, bottom, right)) for k in range(left + 1, right)
        ]
        if not rows + columns:
            continue
        gain, across_rows, cut = _best_split(edge, environment.flux_table, top, left, bottom, right)
        chosen = rows[cut - top - 1] if across_rows else columns[cut - left - 1]
        left_over = [sum(sse_of(environment, part) for part in pair) for pair in rows + columns]
        # Both sides are sums of at most 200 squares; the table's part rounds 200 ε of the whole.
        slack = 1e3 * 2.0**-52 * (environment.luminance.astype(np.float64) ** 2).sum()
        assert sum(sse_of(environment, part) for part in chosen) <= min(left_over) + slack
        assert gain > 0.0


def test_the_block_that_varies_most_is_split_next():
    environment = noisy_map(12)
    for blocks in (3, 9, 20):
        before = {tuple(b) for b in build_kd_tree(environment, blocks, "sse", "solid-angle").block}
        after = {
            tuple(b) for b in build_kd_tree(environment, blocks + 1, "sse", "solid-angle").block
        }
        (gone,) = before - after
        assert sse_of(environment, gone) == max(sse_of(environment, block) for block in before)


def test_more_blocks_never_reconstruct_worse_and_all_of_them_exactly():
    environment = noisy_map(8, 2)
    errors = [
        reconstruction_error(environment, build_kd_tree(environment, n, "sse", "solid-angle"))
        for n in (1, 2, 5, 17, 60, 128)
    ]
    assert (np.diff(errors) < 0.0).all()
    # Blocks of one pixel: only L w / w is rounded.
    assert errors[-1] < 128 * 2.0**-100 * errors[0]
    assert len(build_kd_tree(environment, 10_000, "sse", "solid-angle").leaf) == 128


def test_sse_reconstructs_better_than_variance_and_range():
    # A wide scene of 128 tiles and a glittering spot: the other two criteria do not see how wide
    # the scene is and spend their blocks in the spot.
    rng = np.random.default_rng(4)
    luminance = np.kron(rng.uniform(0.0, 10.0, (8, 16)), np.ones((8, 8)))
    luminance[24:32, 40:48] = rng.uniform(0.0, 20.0, (8, 8))
    radiance = np.repeat(luminance[..., None], 3, axis=2).astype(np.float32)
    environment = EnvironmentMap.from_array(radiance)
    sse, variance, span = (
        reconstruction_error(environment, build_kd_tree(environment, 60, s, "solid-angle"))
        for s in SELECTIONS
    )
    assert sse < 0.8 * variance
    assert sse < 0.8 * span


def test_a_sun_does_not_hide_the_variation_of_the_rest():
    # Two halves of the lower sky differ by a half; the sun's L² is 1e18 times theirs, so that
    # differences of a table of squares hold nothing of them.
    radiance = np.full((32, 64, 3), 1.0, np.float32)
    radiance[16:, 20:] = 1.5
    radiance[2, 3] = 1e9
    tree = build_kd_tree(EnvironmentMap.from_array(radiance), 12, "sse", "solid-angle")
    for top, left, bottom, right in tree.block:
        assert np.ptp(radiance[top:bottom, left:right]) == 0.0


def test_totals_are_summed_from_the_pixels():
    environment = noisy_map(16, 3, 1e8)
    tree = build_kd_tree(environment, 100, "sse", "solid-angle")
    for total, (top, left, bottom, right) in zip(tree.total, tree.block, strict=True):
        # Sums of at most 512 positive terms in another order.
        expected = environment.flux[top:bottom, left:right].sum()
        assert total == pytest.approx(expected, rel=512 * 2.0**-52)
