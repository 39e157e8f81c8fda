"""The pyramid keeps energy at every level, and levels are those of the samples' solid angles."""

import math

import numpy as np
import pytest

from samplers.environment import EnvironmentMap
from samplers.filtered import FilteredImportanceSampling, FilteredLight
from samplers.sphere import pixel_directions, row_solid_angle


def light(radiance: np.ndarray, count: int = 1, bias: float = 0.0) -> FilteredLight:
    environment = EnvironmentMap.from_array(radiance)
    lighting = FilteredImportanceSampling(bias).prepare(
        environment, count, np.random.default_rng(0)
    )
    assert isinstance(lighting, FilteredLight)
    return lighting


@pytest.mark.parametrize("height", [1, 2, 5, 16, 21])
def test_every_level_holds_the_energy_of_the_map(height: int) -> None:
    radiance = np.random.default_rng(height).lognormal(0.0, 2.0, (height, 2 * height, 3))
    radiance[height // 3, 1] = 1e6
    pyramid = light(radiance)
    truth = (radiance * row_solid_angle(height, 2 * height)[:, None, None]).sum(axis=(0, 1))
    assert list(pyramid.rows) == [height >> k for k in range(height.bit_length())]
    for begin, rows in zip(pyramid.begin, pyramid.rows, strict=True):
        level = pyramid.texel[begin : begin + 2 * rows * rows].reshape(rows, 2 * rows, 3)
        # Rows of a level end where its own grid says only if heights are even throughout;
        # elsewhere its solid angles are those of the cut rows, which differ by the cut.
        angle = row_solid_angle(rows, 2 * rows)[:, None, None]
        exact = height % rows == 0
        np.testing.assert_allclose(
            (level * angle).sum(axis=(0, 1)), truth, rtol=1e-6 if exact else 0.25
        )


class _Probe:
    """A surface whose samples go where they are told, with a density."""

    def __init__(self, direction: np.ndarray, pdf: float) -> None:
        self.direction, self.pdf = direction[None].astype(np.float32), pdf

    def draw(self, u):
        return self.direction

    def reflect(self, direction):
        shape = direction.shape[:2]
        return np.ones((*shape, 3), np.float32), np.full(shape, self.pdf, np.float32)


def test_a_narrow_sample_reads_the_map_and_a_wide_one_its_mean() -> None:
    radiance = np.random.default_rng(0).lognormal(0.0, 1.0, (16, 32, 3)).astype(np.float32)
    centres = pixel_directions(16).reshape(-1, 3)
    pyramid = light(radiance)
    narrow = pyramid.sample_at(_Probe(centres, 1e9), [np.zeros((1, 512, 3), np.float32)])  # type: ignore[arg-type]
    assert narrow.radiance is not None and not narrow.shadowed
    # Centres of texels, off by float32 directions: 2⁻²⁴ · 32 texels of contrasts up to e³.
    np.testing.assert_allclose(narrow.radiance[0], radiance.reshape(-1, 3), rtol=1e-3)
    wide = pyramid.sample_at(_Probe(centres, 1e-9), [np.zeros((1, 512, 3), np.float32)])  # type: ignore[arg-type]
    coarsest = pyramid.texel[-2:]
    assert wide.radiance is not None
    assert (wide.radiance >= coarsest.min(axis=0) * (1 - 1e-6)).all()
    assert (wide.radiance <= coarsest.max(axis=0) * (1 + 1e-6)).all()


def test_a_sample_as_large_as_four_texels_reads_the_next_level() -> None:
    """Ω_s = 4 Ω_p is level 1, where the texel's 2 × 2 block has its mean."""
    height = 64
    radiance = np.zeros((height, 2 * height, 3))
    row = height // 2  # sin θ of these rows is one to 1 − (π/128)²/2
    radiance[row, 10] = 1.0
    pyramid = light(radiance, count=1)
    between = pixel_directions(height // 2)[row // 2, 5][None]
    texel = 2.0 * math.pi**2 / (2 * height * height)
    found = pyramid.sample_at(
        _Probe(between, 1.0 / (4.0 * texel)), [np.zeros((1, 1, 3), np.float32)]
    )  # type: ignore[arg-type]
    assert found.radiance is not None
    # The block's mean is a quarter; the row's own sin θ moves the level by 5e-4 of a level.
    np.testing.assert_allclose(found.radiance[0, 0], 0.25, rtol=5e-3)
