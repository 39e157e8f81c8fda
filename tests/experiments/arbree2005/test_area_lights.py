"""Area lights: what is drawn is what was found, and rows hold what tables need."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from experiments.arbree2005 import area_lights as experiment
from experiments.arbree2005.area_lights import as_map, rim
from experiments.run.scale import SCALES
from renderer.image import write_exr
from samplers import DiscLights, EnvironmentMap, make_sampler
from samplers.center_surround import disc_pixels
from samplers.sphere import angular_distance, direction_from_uv, row_solid_angle
from tests.experiments.stored import run_into
from tests.experiments.tiny import TINY_QUICK

SMALL = replace(TINY_QUICK, width=32, height=24)


def lamp_map(height: int = 64) -> EnvironmentMap:
    """A dim map with a bright disc of 4° around a point near the seam."""
    radiance = np.full((height, 2 * height, 3), 0.1, np.float32)
    disc = disc_pixels(height, 0.01, 0.4, np.radians(4.0))
    for k, row in enumerate(disc.row):
        radiance[row, disc.columns(k, 2 * height)] = 500.0
    return EnvironmentMap(radiance, "lamp")


def test_the_rim_lies_at_the_half_angle_and_is_cut_at_the_seam():
    centre = direction_from_uv(0.01, 0.4)
    runs = rim(centre, 0.2)
    assert len(runs) > 1
    for run in runs:
        assert (np.abs(np.diff(run[:, 0])) < 0.5).all()
        distance = angular_distance(direction_from_uv(run[:, 0], run[:, 1]), centre)
        np.testing.assert_allclose(distance, 0.2, atol=1e-12)  # a handful of roundings


def test_the_drawn_lighting_holds_the_energy_of_the_map():
    environment = lamp_map()
    lights = make_sampler("center-surround").prepare(environment, 16, np.random.default_rng(0))
    assert isinstance(lights, DiscLights) and len(lights)
    drawn = as_map(lights)
    solid_angle = row_solid_angle(*drawn.shape[:2])
    flux = np.einsum("rck,r->k", drawn, solid_angle)
    ambient = lights.ambient.total_flux
    # The disc is drawn in whole pixels: of a disc of radius r pixels, about 1/r of it is rim.
    rows = float(lights.half_angle.min()) * environment.height / np.pi
    np.testing.assert_allclose(flux - ambient, environment.total_flux - ambient, rtol=1.0 / rows)


def test_a_map_without_lights_is_drawn_as_it_is():
    constant = EnvironmentMap(np.full((16, 32, 3), 0.7, np.float32))
    lights = make_sampler("center-surround").prepare(constant, 16, np.random.default_rng(0))
    np.testing.assert_array_equal(as_map(lights), constant.radiance)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path, maps = tmp_path_factory.mktemp("area-lights"), tmp_path_factory.mktemp("maps")
    write_exr(maps / "constant.exr", np.full((32, 64, 3), 0.7, np.float32))
    write_exr(maps / "lamp.exr", lamp_map().radiance)
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(SCALES, SMALL.name, SMALL)
        patch.setitem(experiment.ROUNDS, "quick", 1)
        run_into(
            path,
            experiment.area_lights(),
            environments=str(maps),
            scenes=["three-boxes"],
            budgets=["16"],
        )
    return path


def test_experiment_counts_lights_and_times_them(folder):
    rows = pd.read_csv(folder / "lights.csv").set_index("environment")
    assert rows.loc["constant", "lights"] == 0 and rows.loc["lamp", "lights"] > 0
    assert (rows["seconds"] > 0.0).all()
    assert 0.0 < rows.loc["lamp", "energy_lights"] < 1.0
    assert rows.loc["constant", "energy_lights"] == 0.0
    told = "Lights are found on 1 of 2 maps."
    assert told in (folder / "report.md").read_text(encoding="utf-8")


def test_no_method_is_allowed_more_rays_than_the_others(folder):
    rows = pd.read_csv(folder / "images.csv")
    assert set(rows["method"]) == {"area", "centre", "median-cut", "ours"}
    assert (rows["rays_per_point"] <= 16.0).all()
    assert (rows["flip"] > 0.0).all() and (rows["brightness"] > 0.0).all()


def test_means_are_those_of_the_images(folder):
    rows, means = pd.read_csv(folder / "images.csv"), pd.read_csv(folder / "image_means.csv")
    centre = rows.loc[rows["method"] == "centre", "flip"]
    row = means.set_index("method").loc["centre"]
    assert row["flip"] == pytest.approx(centre.mean()) and row["maps"] == len(centre) == 2


def test_pictures_are_written(folder):
    for name in ("maps.webp", "images.webp"):
        assert (folder / name).stat().st_size > 0
