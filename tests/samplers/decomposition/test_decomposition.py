"""The decomposition sampler as a whole."""

import numpy as np
import pytest

from samplers import make_sampler
from samplers.decomposition.emissive import classify
from samplers.decomposition.env_directs import masking_radius
from samplers.environment import EnvironmentMap
from samplers.sphere import angular_distance, pixel_direction
from tests.samplers.maps import data_folder


def street(height=64, seed=0, contrast=1e3):
    """A textured night with a few lamps of one to nine pixels."""
    rng = np.random.default_rng(seed)
    radiance = rng.uniform(0.1, 1.0, (height, 2 * height, 3))
    for size in (1, 2, 3, 1, 2, 3):
        row, column = rng.integers(height - 3), rng.integers(2 * height - 3)
        radiance[row : row + size, column : column + size] *= contrast
    return EnvironmentMap.from_array(radiance)


def lights_of(environment, count, seed=0, **parameters):
    sampler = make_sampler("ours", **parameters)
    return sampler.prepare(environment, count, np.random.default_rng(seed))


def arrays(layered):
    return [
        getattr(layer, name)
        for layer in (layered.direct, layered.indirect)
        for name in ("direction", "irradiance", "extent")
    ]


def assert_energy_is_conserved(layered, environment):
    total = layered.direct.irradiance.sum(axis=0) + layered.indirect.irradiance.sum(axis=0)
    # Two orders of summing up to 10⁶ positive numbers in float64.
    assert total == pytest.approx(environment.total_flux, rel=1e-10)


def test_full_resolution_has_the_same_lights():
    environment = street()
    upsampled = lights_of(environment, 16)
    full = make_sampler("ours-no-upsampling").prepare(environment, 16, np.random.default_rng(0))
    assert (upsampled.upsampling, full.upsampling) == (4, 1)
    assert all(np.array_equal(a, b) for a, b in zip(arrays(upsampled), arrays(full), strict=True))


@pytest.mark.parametrize("exclusion", ["converged", "each-round", "none"])
@pytest.mark.parametrize("kmeans", [True, False])
def test_what_env_directs_carry_can_be_looked_at(exclusion, kmeans):
    environment = street()
    sampler = make_sampler("ours", exclusion=exclusion, kmeans=kmeans)
    found = sampler.decompose(environment, 8, np.random.default_rng(0))
    lights = sampler.prepare(environment, 8, np.random.default_rng(0))
    pairs = zip(arrays(found.lights), arrays(lights), strict=True)
    assert all(np.array_equal(a, b) for a, b in pairs)
    assert np.array_equal(found.emissive, classify(environment).emissive)
    assert not (found.carried & ~found.emissive).any()
    assert (found.carried == found.emissive).all() == (exclusion == "none" or not kmeans)
    weighted = environment.radiance * environment.row_solid_angle[:, None, None]
    # Sums over at most 8192 pixels in another order.
    wanted = weighted[found.carried].sum(axis=0)
    assert lights.direct.irradiance.sum(axis=0) == pytest.approx(wanted, rel=1e-12)


def test_direct_lights_stand_on_bright_pixels_of_photographed_maps():
    near = []
    for path in sorted(data_folder("environments").glob("*.exr"))[:6]:
        environment = EnvironmentMap.from_file(path)
        layered = lights_of(environment, 16)
        assert_energy_is_conserved(layered, environment)
        emissive = classify(environment).emissive
        row, column = np.nonzero(emissive)
        bright = pixel_direction(row, column, environment.height)
        near += [angular_distance(bright, light).min() for light in layered.direct.direction]
    # The kept pixels of a light lie within 2 Ω of their centre. Their root mean square distance
    # from the centroid is smaller than from any other point, and the nearest one is nearer still.
    assert max(near) < 2.0 * masking_radius(16, "solid_angle")
    # Clusters of scattered windows have their centroid between them; the usual light is on one.
    assert np.median(near) < 0.01
