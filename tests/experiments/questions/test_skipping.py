"""Skips change nothing but the work, and each saves what it should."""

from dataclasses import replace

import pandas as pd
import pytest

from experiments.questions import skipping as experiment
from tests.experiments.stored import run_into
from tests.experiments.tiny import TINY_QUICK

SMALL = replace(TINY_QUICK, width=32, height=24, subpixels=4)


@pytest.fixture(scope="module")
def rows(tmp_path_factory) -> pd.DataFrame:
    folder = tmp_path_factory.mktemp("skipping")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(experiment, "find_scale", lambda _: SMALL)
        patch.setitem(experiment.ROUNDS, "quick", 1)
        run_into(
            folder,
            experiment.skipping(),
            maps=["noon-desert"],
            scenes=["rubiks-cube", "three-boxes"],
        )
    return pd.read_csv(folder / "skipping.csv").set_index(["scene", "skip", "lighting"])


def test_an_empty_layer_leaves_the_image_identical(rows):
    compared = rows.xs("empty layer", level="skip")
    assert len(rows) == 2 * 8 and len(compared) == 2
    assert (compared["identical"] == 1.0).all() and (compared["difference"] == 0.0).all()


@pytest.mark.parametrize(
    ("skip", "lighting"),
    [
        ("facing away", "median-cut"),
        ("facing away", "mis"),
        ("zero contribution, black ground", "mis"),
        ("background points", "median-cut"),
    ],
)
def test_rays_are_saved(rows, skip, lighting):
    for scene in ("rubiks-cube", "three-boxes"):
        row = rows.loc[scene, skip, lighting]
        assert 0 <= row["rays_on"] < row["rays_off"]


def test_reasons_account_for_every_pair_of_point_and_light(rows):
    for scene in ("rubiks-cube", "three-boxes"):
        away, zero, background = (
            rows.loc[scene, skip, "median-cut"]
            for skip in ("facing away", "zero contribution", "background points")
        )
        assert away["rays_off"] == background["rays_on"]  # of every point all of its 16 lights
        assert background["rays_off"] == 16 * 32 * 24 * 4
        assert zero["rays_off"] == away["rays_on"] >= zero["rays_on"]


def test_brdf_sampling_is_left_out_only_where_all_is_lambertian(rows):
    assert rows.loc["rubiks-cube", experiment.LAMBERT, "mis"]["identical"] == 1.0
    row = rows.loc["three-boxes", experiment.LAMBERT, "mis"]
    assert row["identical"] == 0.0 and row["rays_on"] != row["rays_off"]
