"""Product sampling: its density, and how near it comes to the product."""

import numpy as np
import pytest
from scipy.stats import chi2

from samplers import make_sampler
from samplers.conformance.open_surface import OpenSurface
from samplers.conformance.stress_maps import stress_map
from samplers.conformance.suite import pooled_chi_square
from samplers.product import ProductLight
from samplers.sphere import pixel_directions, pixel_of_direction

SURFACE = OpenSurface(np.tile(np.float32([0.48, 0.6, -0.64]), (16, 1)))
DRAWS = 1 << 13


def light(name: str, count: int, **parameters: float) -> ProductLight:
    sampler = make_sampler("product", **parameters)
    found = sampler.prepare(stress_map(name), count, np.random.default_rng(0))
    assert isinstance(found, ProductLight)
    return found


@pytest.mark.parametrize("brdf_samples", [4, 16])
@pytest.mark.parametrize(
    "name", ["noise", "sun-and-sky", "odd-height", "bright-top-row", "one-texel"]
)
def test_directions_fall_as_the_density_of_the_cells_says(name: str, brdf_samples: int) -> None:
    """By a chi-square test over the texels, at a point whose cells are given."""
    lighting = light(name, DRAWS, brdf_samples=brdf_samples, brdf_share=1e-9)
    rng, environment = np.random.default_rng(2), stress_map(name)
    first = rng.random((brdf_samples, 16, 3), np.float32)
    one = np.full((1, 16, 3), 0.5, np.float32)
    u = [first, rng.random((DRAWS, 16, 3), np.float32), rng.random((DRAWS, 16, 3), np.float32), one]
    drawn = lighting.sample_at(SURFACE, u).direction
    cells = lighting.cells(SURFACE, first)
    height = environment.height
    centre = pixel_directions(height).reshape(-1, 1, 3).repeat(16, axis=1).astype(np.float32)
    density = lighting.densities(centre, cells)
    mass = density * np.repeat(environment.row_solid_angle, 2 * height)[:, None]
    np.testing.assert_allclose(mass.sum(axis=0), 1.0, rtol=1e-9)
    row, column = pixel_of_direction(drawn, height)
    for point in range(4):
        seen = np.bincount(row[:, point] * 2 * height + column[:, point], minlength=len(centre))
        statistic, number = pooled_chi_square(seen, DRAWS * mass[:, point])
        # A false alarm in one of a million of each of the 40 tests.
        assert number == 1 or chi2.sf(statistic, number - 1) > 1e-6


def test_the_density_comes_nearer_to_the_product_than_the_map_does() -> None:
    """In the spread of light × cosine over density, that of one sample's luminance."""
    environment = stress_map("noise")
    height = environment.height
    centre = pixel_directions(height).reshape(-1, 1, 3).repeat(16, axis=1).astype(np.float32)
    solid_angle = np.repeat(environment.row_solid_angle, 2 * height)
    cosine = SURFACE.reflect(centre)[1][:, 0].astype(np.float64)
    product = environment.luminance.reshape(-1) * cosine
    lighting = light("noise", 1, brdf_samples=64)
    first = np.random.default_rng(3).random((64, 16, 3), np.float32)
    found = lighting.densities(centre, lighting.cells(SURFACE, first))
    by_map = environment.luminance.reshape(-1) / environment.luminous_flux
    total = product @ solid_angle

    def variance(density: np.ndarray) -> float:
        return float((product**2 / density) @ solid_angle / total**2 - 1.0)

    share = 0.25
    of_product = [variance(share * cosine + (1.0 - share) * found[:, p]) for p in range(16)]
    # Half of the map is behind the surface; what that wastes is a third of the variance at least.
    assert np.mean(of_product) < 0.67 * variance(share * cosine + (1.0 - share) * by_map)
