"""Blocks and law against maps whose fits are known; equal time; what the experiment writes."""

import math

import numpy as np
import pandas as pd
import pytest

from experiments.ergun2012 import kd_tree_blocks as fits
from experiments.ergun2012 import kd_tree_images as images
from experiments.ergun2012 import kd_tree_quality as experiment
from experiments.ergun2012.kd_tree_quality_report import image_table
from experiments.run.request import RunRequest
from samplers import EnvironmentMap, EnvlightError

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


def test_equal_time_inverts_a_linear_cost():
    probes = {8: 3.0 + 8 * 0.5, 16: 3.0 + 16 * 0.5, 32: 3.0 + 32 * 0.5}
    assert images.fitted_samples(probes, 3.0 + 11 * 0.5) == 11
    assert images.fitted_samples(probes, 0.0) == images.LEAST_SAMPLES
    assert images.fitted_samples({8: 1.0, 16: 1.0}, 5.0) == 8


def test_the_sphere_stands_alone_and_the_teapot_on_its_ground():
    assert [o.name for o in images.scene_of("sphere", "pink-fabric").objects] == ["pink-fabric"]
    assert len(images.scene_of("ward-teapot", "brushed-metal").objects) == 2


def test_gain_is_over_inversion_at_the_same_block():
    rows = pd.DataFrame(
        {
            "environment": "e", "scene": "sphere", "material": "pink-fabric", "base_samples": 8.0,
            "method": ["binary search", "kd-tree", "kd-tree"],
            "mode": [images.EQUAL_SAMPLES, images.EQUAL_TIME, images.EQUAL_SAMPLES],
            "samples": 8.0, "psnr": [30.0, 33.0, 29.0], "seconds": [2.0, 2.2, 1.0],
        }
    )  # fmt: skip
    table = image_table(rows)
    assert table["gain"].tolist()[1:] == pytest.approx([3.0, -1.0])
    assert table["time_ratio"].tolist() == pytest.approx([1.0, 1.1, 0.5])
    assert list(table["published"])[:2] == ["36.90 dB", "39.22 dB (+2.32)"]


def test_experiment_writes_both_parts(tmp_path, monkeypatch):
    monkeypatch.setattr(experiment, "HEIGHT", 32)
    monkeypatch.setitem(experiment.NOISE_TARGET, "quick", 0.5)
    monkeypatch.setattr(experiment, "BLOCKS", (16, 64))
    monkeypatch.setattr(experiment, "PAPER_BLOCKS", 64)
    monkeypatch.setitem(experiment.SCENES, "quick", [("sphere", "pink-fabric")])
    monkeypatch.setitem(experiment.SAMPLES, "quick", (8,))
    monkeypatch.setitem(experiment.SIZE, "quick", 16)
    monkeypatch.setitem(experiment.ROUNDS, "quick", 1)
    request = RunRequest(
        experiment.NAME, "quick", "embedded", ["overcast-moor"], [], [], [], tmp_path, False, True,
        0,
    )  # fmt: skip
    assert experiment.run(request, False) == 0
    blocks = pd.read_csv(tmp_path / "kd_tree_quality_blocks.csv")
    assert len(blocks) == 4 * 2
    found = pd.read_csv(tmp_path / "kd_tree_quality_images.csv")
    assert len(found) == 8 and (found["psnr"] > 5.0).all() and (found["samples"] >= 2).all()
    assert (tmp_path / "kd_tree_quality_law_overcast-moor.svg").is_file() is False
    assert (tmp_path / "kd_tree_quality_variance_law_overcast-moor.svg").is_file()
    assert (tmp_path / "kd_tree_quality_sphere_pink-fabric_8.jpg").is_file()
