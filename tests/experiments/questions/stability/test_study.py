"""Stability: figures are right where the truth is known, and failures are told, not raised."""

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from experiments.questions.stability import figures as figures
from experiments.questions.stability import study as experiment
from experiments.questions.stability.brute_force import (
    PLATES,
    map_irradiance,
    texel_solid_angle,
    total_flux,
)
from experiments.questions.stability.study import findings
from samplers import DirectionalLights, EnvironmentMap, LightSampler, make_sampler, sampler_names
from samplers.sphere import pixel_directions, row_solid_angle
from tests.experiments.stored import run_into


def noise(height: int = 16) -> np.ndarray:
    return np.random.default_rng(1).uniform(0.1, 1.0, (height, 2 * height, 3)).astype(np.float32)


@pytest.fixture(autouse=True)
def small_maps_wait_for_their_memory(monkeypatch):
    """A full collection after each map takes half a second among all that a test process holds."""
    monkeypatch.setattr(figures, "gc", SimpleNamespace(collect=lambda: None))


class Broken(LightSampler):
    """Raises on bright maps."""

    def _prepare(self, environment, count, rng):
        if environment.radiance.max() > 2.0:
            raise ZeroDivisionError("no luck")
        return DirectionalLights([[0.0, 1.0, 0.0]], environment.total_flux[None] * 0.5, [0.1])


@pytest.mark.parametrize("height", [1, 2, 3, 16, 37])
def test_solid_angles_are_those_of_the_sphere(height):
    mine = texel_solid_angle(height).astype(np.float64)
    np.testing.assert_allclose(mine, row_solid_angle(height, 2 * height), rtol=1e-12)
    assert float(mine.sum()) * 2 * height == pytest.approx(4.0 * np.pi, rel=1e-14)


@pytest.mark.parametrize("height", [1, 3, 16])
def test_irradiance_of_a_constant_map_is_pi(height):
    # Six digits less than float64 has: sums of at most 512 texels.
    irradiance = map_irradiance(np.ones((height, 2 * height, 3), np.float32))
    np.testing.assert_allclose(irradiance, np.pi, rtol=1e-12)


def test_irradiance_of_texels_tends_to_that_of_their_centres():
    radiance = noise(128)
    weight = row_solid_angle(128, 256)[:, None, None] * radiance
    cosine = np.maximum(pixel_directions(128) @ PLATES.T, 0.0)
    centres = np.einsum("rcp,rck->pk", cosine, weight)
    # A midpoint rule of step π/128 is off by the square of half a step over 6 and the like: 1e-4.
    np.testing.assert_allclose(map_irradiance(radiance), centres, rtol=1e-3)


def test_brute_force_flux_is_that_of_the_map():
    radiance = noise(33)
    np.testing.assert_allclose(
        total_flux(radiance), EnvironmentMap(radiance.copy()).total_flux, rtol=1e-12
    )


def test_a_failing_sampler_is_a_row_and_others_go_on():
    rows = figures.measure_samplers(noise() * 3.0, {"broken": Broken(), "mis": make_sampler("mis")})
    assert rows["broken"] == {"error": "ZeroDivisionError: no luck"}
    assert figures.ERROR not in rows["mis"]


def test_a_property_that_fails_is_a_figure():
    # Half of the energy is lost; × 1024 it would raise, × 1000/3 too.
    rows = figures.measure_samplers(noise() * np.float32(1e-4), {"broken": Broken()})
    assert rows["broken"]["energy_error"] == pytest.approx(0.5)
    assert rows["broken"]["rotation_moved"] == 0.0


@pytest.mark.parametrize("name", sampler_names())
def test_every_sampler_has_figures(name):
    row = figures.measure_samplers(noise(), {name: make_sampler(name)})[name]
    assert figures.ERROR not in row
    turns_not = ("energy_error", "fraction_moved", "rotation_moved")
    for key in row.keys() & figures.PROPERTIES.keys() - set(turns_not):
        assert not figures.PROPERTIES[key].exceeds(row[key]), key


class Boastful(LightSampler):
    """Tells densities that are a hundredth too large."""

    def _prepare(self, environment, count, rng):
        return Boast(make_sampler("mis").prepare(environment, count, rng))


class Boast:
    def __init__(self, honest):
        self.honest, self.count, self.nbytes = honest, honest.count, 0

    def sample(self, u):
        direction, pdf = self.honest.sample(u)
        return direction, pdf * np.float32(1.01)

    def pdf(self, direction):
        return self.honest.pdf(direction) * np.float32(1.01)


def test_a_density_that_is_too_large_is_seen():
    row = figures.measure_samplers(noise(), {"boastful": Boastful()})["boastful"]
    assert row["pdf_integral_error"] == pytest.approx(0.01, rel=1e-3)
    assert figures.PROPERTIES["pdf_integral_error"].exceeds(row["pdf_integral_error"])


def test_what_a_compensated_table_never_draws_is_told():
    radiance = noise()
    row = figures.measure_samplers(radiance, {"m": make_sampler("mis-compensated")})["m"]
    environment = EnvironmentMap(radiance)
    flux = environment.luminance * row_solid_angle(16, 32)[:, None]
    # Half of the samples are the table's, so the mean over the sphere is taken off.
    dim = environment.luminance <= environment.luminous_flux / (4.0 * np.pi)
    assert row["unreached"] == pytest.approx(flux[dim].sum() / flux.sum(), rel=1e-6)


def test_a_map_that_turns_into_itself_says_nothing_of_lights():
    samplers = {name: make_sampler(name) for name in ("median-cut", "mis")}
    rows = figures.measure_samplers(np.ones((16, 32, 3), np.float32), samplers)
    assert np.isnan(rows["median-cut"]["rotation_moved"])
    assert rows["mis"]["rotation_moved"] < 1e-6


def test_lightgen_on_a_finer_map_than_its_copy_does_not_move_by_rounding():
    rows = figures.measure_samplers(noise(128), {"lightgen": make_sampler("lightgen")})
    assert not figures.PROPERTIES["fraction_moved"].exceeds(rows["lightgen"]["fraction_moved"])


def test_share_of_probability_that_is_elsewhere():
    def seen(radiance, turn=0.0):
        lighting = make_sampler("mis").prepare(
            EnvironmentMap(radiance), 64, np.random.default_rng(0)
        )
        return figures.observe(lighting, 16, turn)

    radiance = noise()
    assert figures.moved(seen(radiance), seen(np.roll(radiance, 8, axis=1), 0.25)) < 1e-6
    # A lower hemisphere of three quarters of the light, and of one quarter.
    dark, bright = np.ones((16, 32, 3), np.float32), np.ones((16, 32, 3), np.float32)
    bright[8:], dark[:8] = 3.0, 3.0
    assert figures.moved(seen(dark), seen(bright)) == pytest.approx(0.5, abs=1e-6)


def test_what_sees_the_surface_is_compared_by_its_samples():
    def seen(count, seed=0):
        lighting = make_sampler("ris").prepare(
            EnvironmentMap(noise()), count, np.random.default_rng(seed)
        )
        return figures.observe(lighting, 16)

    one = seen(8)
    assert len(one.samples[0]) == 8 * figures.SURFACE_POINTS
    assert figures.scale_deviation(one, seen(8), 1.0) == 0.0
    direction, weight = one.samples
    other = figures.Observation(
        [], (), np.zeros(3), np.empty(0), np.empty(0), (direction, 1.1 * weight)
    )
    assert figures.scale_deviation(one, other, 1.0) == pytest.approx(0.1 / 1.1)
    turned = figures.Observation(
        [], (), np.zeros(3), np.empty(0), np.empty(0), (-direction, weight)
    )
    assert figures.scale_deviation(one, turned, 1.0) == pytest.approx(np.pi)
    assert np.isnan(figures.moved(one, other))


def test_moved_is_the_angle_between_lights():
    def seen(angle):
        direction = [[np.sin(angle), np.cos(angle), 0.0], [0.0, 0.0, 1.0]]
        lights = DirectionalLights(direction, [[3.0] * 3, [1.0] * 3], [0.0, 0.0])
        return figures.observe(lights, 16)

    # Three quarters of the energy move by 0.1 rad.
    assert figures.moved(seen(0.0), seen(0.1)) == pytest.approx(0.075)
    assert figures.scale_deviation(seen(0.0), seen(0.1), 1.0) == pytest.approx(0.1)
    assert figures.differing_bytes(seen(0.0), seen(0.0)) == 0
    assert figures.differing_bytes(seen(0.0), seen(0.1)) > 0


def test_experiment_writes_the_matrix(tmp_path):
    run_into(
        tmp_path,
        experiment.stability(),
        maps=["noise", "sun-1e[05]"],
        samplers=["mis", "median-cut"],
    )
    rows = pd.read_csv(tmp_path / "measurements.csv")
    assert len(rows) == 6 and set(rows["sampler"]) == {"mis", "median-cut"}
    assert set(pd.read_csv(tmp_path / "stability.csv")["sampler"]) == {"mis", "median-cut"}
    for name in ("stability.tex", "stability_growth_plate_error.svg"):
        assert (tmp_path / name).stat().st_size > 0
    assert "0 of 2 samplers leave a tolerance on denormals alone; elsewhere: none." in (
        tmp_path / "report.md"
    ).read_text(encoding="utf-8")


def test_findings_name_what_fails_and_what_was_raised():
    rows = pd.DataFrame(
        {
            "sampler": ["mis", "mis", "ours", "broken"], "map": ["a", "b", "denormal", "a"],
            "energy_error": [0.0, 0.5, 0.5, np.nan],
            "error": [*3 * [None], "ZeroDivisionError: no luck"],
        }
    )  # fmt: skip
    assert findings(rows) == [
        "1 of 3 samplers leave a tolerance on denormals alone; elsewhere: energy of 1.",
        "Raised: broken on a: ZeroDivisionError: no luck",
    ]
