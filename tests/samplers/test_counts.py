"""Every reading of a method with fixed lights keeps the count and the energy."""

from itertools import product

import numpy as np
import pytest

from samplers import EnvironmentMap, make_sampler

READINGS: dict[str, dict[str, tuple]] = {
    "kollig-keller": {"addition": ("random", "brightest")},
    "lightgen": {"start": ("random", "k-means++")},
    "structured": {
        "useful_solid_angle": (0.01, None), "deviation": ("texels", "solid angle"),
    },
    "variance-minimization": {"metric": ("planar", "spherical"), "order": ("heap", "rounds")},
}  # fmt: skip
CASES = [
    (name, dict(zip(readings, values, strict=True)))
    for name, readings in READINGS.items()
    for values in product(*readings.values())
]


@pytest.mark.parametrize(("name", "parameters"), CASES, ids=str)
def test_the_count_and_the_energy_are_exact(name: str, parameters: dict) -> None:
    """The suite of conformance asks it of defaults alone, and no count of them."""
    radiance = 10.0 ** np.random.default_rng(0).uniform(-3.0, 3.0, (16, 32, 3))
    environment = EnvironmentMap.from_array(radiance)
    for count in (1, 2, 7, 64, 100):
        lights = make_sampler(name, **parameters).prepare(
            environment, count, np.random.default_rng(0)
        )
        in_rounds = parameters.get("order") == "rounds"
        assert len(lights) == (2 ** (count.bit_length() - 1) if in_rounds else count)
        assert (lights.irradiance > 0.0).all()
        # Float64 sums of 512 terms, or differences of a summed-area table's.
        np.testing.assert_allclose(lights.irradiance.sum(0), environment.total_flux, rtol=1e-10)
