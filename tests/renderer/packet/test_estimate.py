"""What a packet's lanes do to a sample is what the formulas say."""

import numpy as np
import pytest

from renderer.packet.embree import LANES, new_valid
from renderer.packet.estimate import weigh
from renderer.packet.layout import BLUE, FACING, GREEN, PDF, RED, new_packets


@pytest.mark.parametrize("is_light", [False, True])
@pytest.mark.parametrize("counts", [(1, 1), (3, 7), (4, 0)])
def test_samples_weigh_what_the_power_heuristic_says(is_light: bool, counts: tuple[int, int]):
    rng = np.random.default_rng(0)
    packet, valid, count = new_packets(1)[0], new_valid(), 13
    rows = packet.reshape(-1, LANES)
    rows[[RED, GREEN, BLUE]] = rng.random((3, LANES))
    rows[PDF] = 10.0 ** rng.uniform(-30.0, 30.0, LANES)
    rows[FACING] = rng.random(LANES) < 0.8
    radiance, density = rng.random((3, LANES)), 10.0 ** rng.uniform(-30.0, 30.0, LANES)
    rows[PDF, 0] = density[1] = 0.0
    light = radiance.flatten()
    marked = weigh(packet, light, density, is_light, *counts, valid, count)
    brdf = rows[PDF].astype(float)
    own, other = (density, brdf) if is_light else (brdf, density)
    n, m = counts
    drawn = own > 0.0
    with np.errstate(divide="ignore", invalid="ignore"):
        weight = (n * own) ** 2 / ((n * own) ** 2 + (m * other) ** 2)
        expected = radiance * rows[[RED, GREEN, BLUE]] * weight / (n * own)
    # Half a dozen operations of float64 each.
    np.testing.assert_allclose(light.reshape(3, LANES)[:, drawn], expected[:, drawn], rtol=2e-15)
    traced = drawn & (rows[FACING] != 0.0) & (np.arange(LANES) < count)
    np.testing.assert_array_equal(valid != 0, traced)
    assert marked == traced.sum()
