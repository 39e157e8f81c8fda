"""Blocks and law against maps whose fits are known; what the experiment writes."""

import math

import numpy as np
import pandas as pd
import pytest

from experiments.ergun2012 import fits
from experiments.ergun2012 import fits as experiment
from samplers import EnvironmentMap, EnvlightError
from tests.experiments.stored import run_into

RNG = np.random.default_rng(3)
NOISE = EnvironmentMap.from_array(RNG.uniform(0.1, 1.0, (16, 32, 3)) ** 3.0, "noise")


def fitted(environment: EnvironmentMap, blocks: int, selection: str = "sse"):
    made = fits.blocks_of(environment, blocks, selection, "solid-angle")
    return made, fits.fit_row(environment, made)


def test_compression_counts_eight_bytes_a_block():
    # The published ratios, 1:170 and 1:65536, in terms of pixels per block.
    constant = EnvironmentMap.from_array(np.ones((64, 128, 3)), "constant")
    assert fitted(constant, 16)[1]["compression"] == 64 * 128 * 4 / (16 * 8)
    assert pytest.approx(170.7, abs=0.1) == 2048 * 1024 * 4 / (6144 * 8)


def test_a_constant_map_is_fitted_without_error():
    row = fitted(EnvironmentMap.from_array(np.full((32, 64, 3), 0.7), "constant"), 16)[1]
    assert row["unexplained"] == 0.0 and row["psnr_shown"] == math.inf
    # Blocks halve solid angles only up to whole rows; the law must be nearly flat to follow.
    assert row["variance_blocks"] == pytest.approx(0.0, abs=1e-6)
    assert row["variance_law"] < 0.1


@pytest.mark.parametrize("selection", ["sse", "variance", "range"])
def test_more_blocks_leave_less_and_all_pixels_nothing(selection):
    left = [fitted(NOISE, blocks, selection)[1]["unexplained"] for blocks in (4, 32, 256, 512)]
    assert left[0] > left[1] > left[2] > left[3] == pytest.approx(0.0, abs=1e-12)


def test_block_means_keep_the_energy_and_densities_integrate_to_one():
    made, _ = fitted(NOISE, 40)
    weight = NOISE.row_solid_angle[:, None]
    assert (fits.block_means(NOISE, made) * weight).sum() == pytest.approx(NOISE.flux.sum())
    assert (fits.law_density(made) * weight).sum() == pytest.approx(1.0)


def test_variance_is_that_of_sampling_the_energy():
    made, row = fitted(NOISE, 40)
    u = np.random.default_rng(0).random((200_000, 3), np.float32)
    direction, pdf = made.sample(u)
    estimate = NOISE.lookup(direction) @ np.array([0.2126, 0.7152, 0.0722]) / pdf
    relative = estimate.var() / estimate.mean() ** 2
    # The variance of 200,000 samples with ratios below 100 is known to a few percent.
    assert relative == pytest.approx(row["variance_law"], rel=0.05)


def test_a_density_that_misses_light_has_infinite_variance():
    ones = np.ones((2, 4))
    assert fits._variance(ones, np.where(np.eye(2, 4) > 0.0, 0.0, 1.0), ones) == math.inf


def test_law_curve_falls_and_starts_at_the_first_block():
    curve = np.array(fits.law_curve(fitted(NOISE, 100)[0]))
    assert curve[0, 0] == 1.0 and curve[-1, 0] == 100.0
    assert (np.diff(curve[:, 1:], axis=0) <= 0.0).all()


def test_black_maps_are_refused():
    with pytest.raises(EnvlightError, match="black"):
        fits.blocks_of(EnvironmentMap.from_array(np.zeros((8, 16, 3))), 4, "sse", "pixels")


def test_error_pictures_are_white_where_right_red_above_blue_below():
    luminance = np.array([[1.0, 2.0, 4.0, 0.0]])
    drawn = np.array([[1.0, 16.0, 0.5, 0.0]])  # right, 8 times too often and too seldom, nothing
    picture = fits.ratio_picture(drawn, luminance)[0]
    assert picture[0] == pytest.approx([1.0] * 3)
    assert picture[1] == pytest.approx([1.0, 0.15, 0.15])
    assert picture[2] == pytest.approx([0.15, 0.15, 1.0])
    assert picture[3] == pytest.approx([0.0] * 3)


def test_experiment_writes_fits_curves_and_pictures(tmp_path, monkeypatch):
    monkeypatch.setattr(experiment, "HEIGHT", 32)
    monkeypatch.setattr(experiment, "BLOCKS", (16, 64))
    monkeypatch.setattr(experiment, "MOST_BLOCKS", 64)
    run_into(tmp_path, experiment.kd_tree_fits(), maps=["overcast-moor"])
    assert len(pd.read_csv(tmp_path / "fits.csv")) == 4 * 2
    for name in ("law", "variance_law", "unexplained"):
        assert (tmp_path / f"{name}_overcast-moor.svg").is_file()
    for name in ("criteria", "density"):
        assert (tmp_path / f"{name}_overcast-moor.webp").is_file()
