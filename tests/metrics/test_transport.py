"""Transport between sets of lights: known costs, and the properties of a distance."""

import math

import numpy as np
import pytest

from metrics.transport import PENALTY, transport_distance
from samplers import EnvlightError

UP, NONE = [[0.0, 1.0, 0.0]], np.empty((0, 3))


def turned(angle: float) -> list[list[float]]:
    return [[math.sin(angle), math.cos(angle), 0.0]]


def some_lights(seed: int, count: int = 12) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    direction = rng.normal(size=(count, 3))
    return direction / np.linalg.norm(direction, axis=1, keepdims=True), rng.random(count)


@pytest.mark.parametrize("angle", [1e-7, 0.01, 0.5, 0.99])
def test_a_light_that_turns_costs_energy_times_angle(angle):
    # The program's tolerance is 1e-7 of the energy that could be saved.
    cost = transport_distance(UP, [3.0], turned(angle), [3.0])
    assert cost == pytest.approx(3.0 * angle, rel=1e-6, abs=1e-9)


@pytest.mark.parametrize("angle", [1.01, 2.0, math.pi])
def test_a_light_that_jumps_far_is_put_out_and_lit(angle):
    assert transport_distance(UP, [3.0], turned(angle), [3.0]) == pytest.approx(6.0 * PENALTY)


def test_energy_that_appears_costs_the_penalty():
    assert transport_distance(NONE, [], UP, [2.0]) == pytest.approx(2.0 * PENALTY)
    assert transport_distance(UP, [1.0], UP, [2.5], 0.3) == pytest.approx(1.5 * 0.3)
    assert transport_distance(NONE, [], NONE, []) == 0.0


def test_a_light_that_splits_in_place_costs_what_its_parts_move():
    parts = turned(0.1) + turned(-0.1)
    cost = transport_distance(UP, [2.0], parts, [1.0, 1.0])
    assert cost == pytest.approx(0.2, rel=1e-6)


def test_equal_sets_in_another_order_cost_nothing():
    direction, energy = some_lights(1)
    order = np.random.default_rng(0).permutation(len(energy))
    assert transport_distance(direction, energy, direction[order], energy[order]) == 0.0


def test_it_is_symmetric_and_obeys_the_triangle_inequality():
    a, b, c = (some_lights(seed) for seed in (1, 2, 3))
    forth, back = transport_distance(*a, *b), transport_distance(*b, *a)
    assert forth == pytest.approx(back, rel=1e-6)
    # Slack: each of the three programs is solved to 1e-7 of its energy.
    assert forth <= transport_distance(*a, *c) + transport_distance(*c, *b) + 1e-6


def test_it_agrees_with_assignment_where_all_energies_are_equal():
    from scipy.optimize import linear_sum_assignment

    (a, _), (b, _) = some_lights(4), some_lights(5)
    angle = np.arccos(np.clip(a @ b.T, -1.0, 1.0))
    cost = np.minimum(angle, 2.0 * PENALTY)
    rows, columns = linear_sum_assignment(cost)
    ones = np.ones(len(a))
    wanted = cost[rows, columns].sum()
    assert transport_distance(a, ones, b, ones) == pytest.approx(wanted, rel=1e-6)


@pytest.mark.parametrize(
    ("energy", "penalty", "words"),
    [([1.0, 2.0], 0.5, "numbers"), ([-1.0], 0.5, "not negative"), ([1.0], 0.0, "positive")],
)
def test_bad_input_is_refused(energy, penalty, words):
    with pytest.raises(EnvlightError, match=words):
        transport_distance(UP, energy, UP, [1.0], penalty)
