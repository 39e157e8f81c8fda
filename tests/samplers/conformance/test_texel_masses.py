"""Masses of texels: exact where they can be, and within what they say they may be off."""

import numpy as np
import pytest

from samplers.conformance.texel_masses import integral_error, texel_masses
from samplers.sphere import pixel_of_direction, row_solid_angle, uv_from_direction

HEIGHT = 6
NOTHING = np.empty((0, 3), np.float32), np.empty(0, np.float32)


def test_a_density_that_is_constant_over_texels_is_exact():
    values = np.random.default_rng(0).random((HEIGHT, 2 * HEIGHT)).astype(np.float32)
    mass, error = texel_masses(
        lambda direction: values[pixel_of_direction(direction, HEIGHT)], HEIGHT, *NOTHING
    )
    np.testing.assert_allclose(
        mass, values * row_solid_angle(HEIGHT, 2 * HEIGHT)[:, None], rtol=1e-12
    )
    assert not error.any()


@pytest.mark.parametrize("edge", np.random.default_rng(1).random(8))
@pytest.mark.parametrize("fine", [2, 8])
def test_an_edge_across_texels_is_within_the_error(edge, fine):
    def half(direction):
        u, _ = uv_from_direction(direction.astype(np.float64))
        return (u < edge).astype(np.float32) / np.float32(4.0 * np.pi * edge)

    # An edge past the last midpoint is seen by samples alone.
    drawn = np.random.default_rng(2).normal(size=(1 << 15, 3))
    drawn = (drawn / np.linalg.norm(drawn, axis=1, keepdims=True)).astype(np.float32)
    mass, error = texel_masses(half, HEIGHT, drawn, half(drawn), fine)
    truth = np.clip(edge * 2 * HEIGHT - np.arange(2 * HEIGHT), 0.0, 1.0) / (4.0 * np.pi * edge)
    truth = truth * row_solid_angle(HEIGHT, 2 * HEIGHT)[:, None]
    # Along a column all rows err alike, by at most half a part: fine^-1 / 2 of the step.
    assert (np.abs(mass - truth) <= 0.5 * error * fine**0.5 + 1e-7).all()
    assert integral_error(mass, error) == 0.0


def test_what_is_beyond_the_error_is_told():
    mass, error = np.full((2, 4), 0.15), np.zeros((2, 4))
    assert integral_error(mass, error) == pytest.approx(0.2)
    assert integral_error(mass, error + 0.01) == pytest.approx(0.2 - 0.05 * np.sqrt(8))


def test_samples_show_what_no_midpoint_does():
    direction = np.array([[0.0, 1.0, 0.0]], np.float32)
    _, error = texel_masses(
        lambda found: np.ones(len(found), np.float32), HEIGHT, direction,
        np.array([3.0], np.float32),
    )  # fmt: skip
    assert (error > 0.0).sum() == 1
