"""Slopes and costs to reach an error, on points whose law is known."""

import math

import numpy as np
import pytest

from experiments.questions.power_law import cost_to_reach, fit_power_law


def test_a_power_law_is_found_exactly():
    cost = np.array([4.0, 8.0, 16.0, 32.0])
    law = fit_power_law(cost, 3.0 * cost**-0.7)
    assert (law.slope, law.low, law.high) == pytest.approx((-0.7, -0.7, -0.7), abs=1e-6)
    assert law.at(100.0) == pytest.approx(3.0 * 100.0**-0.7)


def test_the_interval_holds_the_slope_in_95_of_100_cases():
    rng = np.random.default_rng(5)
    cost = 2.0 ** np.arange(2, 9)
    held = 0
    for _ in range(1000):
        law = fit_power_law(cost, cost**-0.5 * np.exp(rng.normal(0.0, 0.2, len(cost))))
        held += law.low <= -0.5 <= law.high
    # Binomial with p = 0.95: four standard deviations are 28.
    assert abs(held - 950) < 28


def test_too_few_points_have_no_law():
    assert fit_power_law([1.0, 2.0], [1.0, 0.5]) is None
    assert fit_power_law([4.0, 4.0, 8.0], [1.0, 1.1, 0.5]) is None
    assert fit_power_law([1.0, 2.0, 4.0, 8.0], [1.0, 0.0, math.nan, 0.5]) is None


def test_costs_are_interpolated_between_points():
    cost, error = [1.0, 4.0, 16.0], [0.4, 0.2, 0.1]
    assert cost_to_reach(cost, error, 0.2) == pytest.approx(4.0)
    # Halfway between the logarithms of 0.2 and 0.1 lies 0.1 √2, at the cost 8.
    assert cost_to_reach(cost, error, 0.1 * math.sqrt(2.0)) == pytest.approx(8.0)
    assert cost_to_reach(cost, error, 0.5) == 1.0
    assert cost_to_reach(cost, error, 0.05) == math.inf
    assert cost_to_reach([16.0, 1.0, 4.0], [0.1, 0.4, 0.2], 0.2) == pytest.approx(4.0)
