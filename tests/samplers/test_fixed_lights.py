"""What all sets of fixed lights keep, whatever the method and its reading."""

import math
from dataclasses import fields

import numpy as np
import pytest

from experiments.questions.readings import Choice, every_reading
from samplers import DirectionalLights, EnvironmentMap, make_sampler, sampler_class, sampler_names
from samplers.conformance.stress_maps import stress_map
from samplers.conformance.suite import parts_of
from samplers.grids.nearest_light import shining_radius
from samplers.lighting import LIGHT_EXTENT, SETS, LayeredLights
from samplers.sphere import (
    angular_distance,
    cap_solid_angle,
    direction_from_uv,
    pixel_direction,
    pixel_directions,
    row_solid_angle,
)
from tests.samplers.maps import sizes_of_a_sun

Lights = DirectionalLights | LayeredLights
PERTURBED = [
    name
    for name in sampler_names()
    if "light_extent" in {field.name for field in fields(sampler_class(name))}
]


def lights_of(name: str, environment: EnvironmentMap, count: int, **parameters: object) -> Lights:
    sampler = make_sampler(name, **parameters)
    count = max(count, sampler.minimum_count)
    return sampler.prepare(environment, count, np.random.default_rng(1))


def directions(lighting: Lights) -> np.ndarray:
    return np.concatenate([direction for direction, _, _ in parts_of(lighting)])


def expected_number(name: str, parameters: dict[str, object], count: int) -> int:
    if parameters.get("order") == "rounds":
        return 2 ** (count.bit_length() - 1)
    return 12 + 3 * ((count - 12) // 3) if name == "q2-tree" else count


@pytest.mark.parametrize(
    "reading",
    [one for one in every_reading() if one.sampler in PERTURBED],
    ids=lambda one: one.spec.label,
)
def test_every_reading_gives_the_lights_that_are_asked_for(reading: Choice) -> None:
    """The suite of conformance asks for no more than there may be, and of defaults alone."""
    name, parameters = reading.sampler, dict(reading.parameters)
    radiance = 10.0 ** np.random.default_rng(0).uniform(-3.0, 3.0, (16, 32, 3))
    environment = EnvironmentMap.from_array(radiance)
    for count in (1, 2, 7, 64, 100):
        if count < make_sampler(name).minimum_count:
            continue
        lighting = lights_of(name, environment, count, **parameters)
        flux = np.concatenate([irradiance for _, irradiance, _ in parts_of(lighting)])
        assert (flux > 0.0).all()
        if name == "fhis" and parameters.get("light") != "point":  # cells may hold no texel
            assert 1 <= len(flux) <= count
        else:
            assert len(flux) == expected_number(name, parameters, count)
        if parameters.get("light") == "point":  # coloured by the texels below them
            flux, total = flux @ [0.2126, 0.7152, 0.0722], environment.luminous_flux
        else:
            total = environment.total_flux
        # Float64 sums of 512 terms, or differences of a summed-area table's.
        np.testing.assert_allclose(flux.sum(axis=0), total, rtol=1e-10)


def all_sets(lighting: Lights) -> list[tuple[DirectionalLights, ...]]:
    """By set, the lights of all layers."""
    one = isinstance(lighting, DirectionalLights)
    layers = [lighting] if one else [lighting.direct, lighting.indirect]
    return list(zip(*(layer.sets for layer in layers), strict=True))


@pytest.mark.parametrize("name", [name for name in PERTURBED if name != "fhis"])
def test_every_independent_set_has_the_flux_and_the_sun(name: str) -> None:
    """Of a textured sky, and a sun of one texel that has nine tenths of the flux."""
    height, row, column = 32, 11, 40
    sky = np.random.default_rng(5).uniform(0.5, 1.0, (height, 2 * height, 3))
    sky[row, column] = 9.0 * sky.sum(axis=(0, 1))
    environment = EnvironmentMap.from_array(sky.astype(np.float32))
    sets = all_sets(lights_of(name, environment, 16, sets="independent"))
    assert len(sets) == SETS and len(all_sets(lights_of(name, environment, 16))) == 1
    sun = pixel_direction(np.array([row]), np.array([column]), height)[0]
    for layers in sets:
        direction = np.concatenate([layer.direction for layer in layers])
        flux = np.concatenate([layer.irradiance for layer in layers])
        # The flux is summed in float64 from float32 radiance: 4096 texels round 1e-13 of it.
        np.testing.assert_allclose(flux.sum(axis=0), environment.total_flux, rtol=1e-11)
        # Nine tenths of the flux are the sun's: within a region of 60° the rest, a sixteenth or
        # less of a tenth, moves the centroid by 7° at most.
        bright = direction[flux.sum(axis=1).argmax()]
        assert math.degrees(math.acos(min(1.0, bright @ sun))) < 7.0
    seen = {b"".join(layer.direction.tobytes() for layer in layers) for layers in sets}
    assert len(seen) == SETS


@pytest.mark.parametrize(
    ("name", "parameters"),
    [
        ("lightgen", {}), ("ours", {}), ("structured", {}),
        ("variance-minimization", {"metric": "planar"}),
        ("variance-minimization", {"metric": "spherical"}),
    ],
)  # fmt: skip
def test_two_suns_are_told_apart_by_two_lights(name: str, parameters: dict[str, str]) -> None:
    radiance = np.full((32, 64, 3), 1e-6, np.float32)
    radiance[10, 8] = radiance[12, 40] = 1e4
    found = directions(lights_of(name, EnvironmentMap.from_array(radiance), 2, **parameters))
    suns = pixel_direction(np.array([10, 12]), np.array([8, 40]), 32)
    # The rest of a half holds 2e-10 × 2048 pixels / 2 of its energy and lies at most 2 away.
    assert np.linalg.norm(found[:, None] - suns, axis=2).min(axis=0).max() < 1e-6


def test_all_sets_of_lights_are_perturbed_by_one_rule() -> None:
    environment = stress_map("noise")
    fixed = [
        name
        for name in sampler_names()
        if isinstance(lights_of(name, environment, 16), DirectionalLights | LayeredLights)
    ]
    assert fixed == PERTURBED
    assert {make_sampler(name).light_extent for name in PERTURBED} == {LIGHT_EXTENT}


@pytest.mark.parametrize("name", PERTURBED)
def test_a_full_extent_is_twice_the_largest_and_a_mean_is_less(name: str) -> None:
    extent = {}
    # Another measure of a node gives "ours" another cut; with one light of a kind there is none.
    count = 2 if name.startswith("ours") else 16
    for which in ("mean", "largest", "full"):
        lighting = lights_of(name, stress_map("noise"), count, light_extent=which)
        extent[which] = np.concatenate([part for _, _, part in parts_of(lighting)])
    np.testing.assert_array_equal(extent["full"], 2.0 * extent["largest"])
    assert (extent["mean"] <= extent["largest"]).all()
    assert (extent["mean"] < extent["largest"]).any()


def sun_in_a_sky(height: int = 128) -> tuple[EnvironmentMap, np.ndarray]:
    """A sun of 1.4° that holds 94 % of the flux, off the grid's symmetries; and its pixels."""
    sun = angular_distance(pixel_directions(height), direction_from_uv(0.31, 0.29)) < 0.0244
    solid = np.broadcast_to(row_solid_angle(height, 2 * height)[:, None], sun.shape)
    sky = 0.06 / 0.94 * solid[sun].sum() / solid[~sun].sum()
    return EnvironmentMap.from_array(np.where(sun, 1.0, sky)[..., None] * np.ones(3)), sun


@pytest.mark.parametrize("count", [2, 16])
@pytest.mark.parametrize("name", PERTURBED)
def test_the_light_of_a_sun_is_as_large_as_the_sun(name: str, count: int) -> None:
    environment, sun = sun_in_a_sky()
    direction = directions(lights_of(name, environment, count))
    solid_angle = cap_solid_angle(shining_radius(environment, direction))
    for light, least, most in sizes_of_a_sun(environment, sun, direction):
        # Luminance is rounded to float32.
        assert least * (1.0 - 1e-5) <= solid_angle[light] <= most * (1.0 + 1e-5)


@pytest.mark.parametrize("count", [1, 2, 5, 16, 64])
def test_uniform_cells_share_the_sphere_equally(count: int) -> None:
    height = 512
    found = lights_of("uniform", EnvironmentMap.from_array(np.ones((height, 2 * height, 3))), count)
    share = found.irradiance[:, 0] / (4 * math.pi / count)
    # An edge moves by up to half a texel: half a row of the least band, which has H / 2 bands
    # rows or more for 7 bands, on both sides, and half a column of 2H / 16 on both sides.
    assert share == pytest.approx(np.ones(count), abs=2 * 0.5 / (height / 14) + 0.5 / (height / 16))
