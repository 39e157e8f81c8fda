"""A direction in each region: where it should fall, and what the regions' shares come to."""

import numpy as np
import pytest

from samplers import EnvironmentMap, make_sampler
from samplers.conformance.open_surface import OpenSurface
from samplers.conformance.stress_maps import stress_map
from samplers.conformance.suite import pooled_chi_square
from samplers.lighting import SurfaceSamples
from samplers.sphere import pixel_of_direction
from samplers.stratified_regions import RegionLight

POINTS = 1 << 15


def drawn(environment: EnvironmentMap, count: int, **parameters: str) -> tuple:
    sampler = make_sampler("stratified-regions", **parameters)
    lighting = sampler.prepare(environment, count, np.random.default_rng(0))
    assert isinstance(lighting, RegionLight)
    rng = np.random.default_rng(1)
    u = [rng.random((1, POINTS, 3), np.float32) for _ in lighting.draws]
    samples: SurfaceSamples = lighting.sample_at(OpenSurface.turned(16), u)
    return lighting, samples


@pytest.mark.parametrize("within", ["luminance", "solid-angle"])
@pytest.mark.parametrize("regions", ["median-cut", "kollig-keller"])
def test_each_sample_falls_in_its_region_as_its_weight_says(regions: str, within: str) -> None:
    from scipy.stats import chi2

    environment = stress_map("noise")
    lighting, samples = drawn(environment, 8, regions=regions, within=within)
    row, column = pixel_of_direction(samples.direction, environment.height)
    mass = lighting.weight * environment.row_solid_angle[:, None]
    seen_twice = set()
    for s in range(8):
        own = lighting.texel[lighting.begin[s] : lighting.begin[s + 1]]
        found = row[s] * environment.width + column[s]
        assert set(found) <= set(own) and not seen_twice & set(own)
        seen_twice |= set(own)
        share = mass.reshape(-1)[own] / mass.reshape(-1)[own].sum()
        seen = np.bincount(np.searchsorted(np.sort(own), found), minlength=len(own))
        statistic, cells = pooled_chi_square(seen, POINTS * share[np.argsort(own)])
        # A false alarm in one of a million of each of the 32 tests.
        assert cells == 1 or chi2.sf(statistic, cells - 1) > 1e-6
        density = share / environment.row_solid_angle[own // environment.width]
        wanted = dict(zip(own, 8.0 / density, strict=True))
        # Weights are float32.
        np.testing.assert_allclose(samples.weight[s], [wanted[k] for k in found], rtol=1e-6)
    lit = np.flatnonzero(environment.luminance.reshape(-1))
    assert seen_twice == set(lit)
