"""The cost model of an image, on costs that are known."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from experiments.run.counts import FEW, CostLine, CountRange, count_for, probe

ALLOWED = CountRange(1, 1 << 14)
BUDGET = 4.0


def probed(cost, allowed=ALLOWED):
    """The count for the budget, and what probes cost."""
    costs = probe(cost, BUDGET, allowed)
    assert costs == {count: cost(count) for count in costs}
    return count_for(BUDGET, costs, allowed), costs


@given(fixed=st.floats(0.0, 3.9), per_light=st.floats(1e-3, 0.5), least=st.sampled_from([1, 2, 12]))
def test_a_line_is_found_at_no_more_than_the_budget_a_probe(fixed, per_light, least):
    cost = CostLine(fixed, per_light).seconds
    count, costs = probed(cost, CountRange(least, 1 << 14))
    best = max(round((BUDGET - fixed) / per_light), least)
    # Half a light may round either way, and the line is told to about 1e-9 of a cost.
    assert abs(count - best) <= 1 and abs(cost(count) - cost(best)) <= per_light
    # The first probe is no larger than FEW, the next may be twice as large whatever it costs.
    assert all(seconds <= BUDGET for tried, seconds in costs.items() if tried > 2 * max(FEW, least))
    assert len(costs) <= 4


@pytest.mark.parametrize("noise", [-0.04, 0.04])
@pytest.mark.parametrize(("fixed", "per_light"), [(0.1, 0.05), (0.25, 0.4), (1.8, 0.02)])
def test_noise_of_probes_is_not_blown_up(fixed, per_light, noise):
    """Probes that are off by 4 %, in turn up and down; then one correction."""
    signs = iter([1, -1] * 8)
    line = CostLine(fixed, per_light)
    costs = probe(lambda count: line.seconds(count) * (1 + next(signs) * noise), BUDGET, ALLOWED)
    count = count_for(BUDGET, costs, ALLOWED)
    costs[count] = line.seconds(count)
    count = count_for(BUDGET, costs, ALLOWED)
    assert line.seconds(count) == pytest.approx(BUDGET, rel=0.1)


def test_a_smallest_count_that_takes_too_long_is_probed_and_taken():
    assert probed(lambda count: 5.0 * count) == (1, {4: 20.0, 1: 5.0})
    assert probed(lambda count: 1.0 * count, CountRange(12, 20)) == (12, {12: 12.0})


def test_costs_that_do_not_grow_end_at_the_most():
    assert probed(lambda _: 1e-3)[0] == ALLOWED.most
    assert probed(lambda count: 1.0 / count, CountRange(3, 3)) == (3, {3: 1 / 3})


def test_the_line_goes_through_what_is_nearest():
    costs = {4: 1.0, 16: 2.0, 64: 5.0}
    line = CostLine.near(4.5, costs)
    assert line.seconds(64) == pytest.approx(5.0) and line.seconds(4) == pytest.approx(1.0)
    assert line.count(line.seconds(30)) == pytest.approx(30)
    assert CostLine.near(1.0, {4: 1.0, 16: 0.5}) == CostLine(1.0, 0.0)  # noise hides the slope
