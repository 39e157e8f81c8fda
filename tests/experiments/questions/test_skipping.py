"""Skips change nothing but the work, and each saves what it should."""

from dataclasses import replace

import pandas as pd
import pytest

from experiments.cli.commands import finish_study
from experiments.questions import skipping as experiment
from experiments.run.request import RunRequest
from experiments.run.study_run import run_study
from tests.experiments.tiny import TINY_QUICK

SMALL = replace(TINY_QUICK, width=32, height=24, subpixels=4)


@pytest.fixture(scope="module")
def rows(tmp_path_factory) -> pd.DataFrame:
    folder = tmp_path_factory.mktemp("skipping")
    request = RunRequest(
        "skipping", "quick", "embedded", ["noon-desert"], ["rubiks-cube", "three-boxes"], [], [],
        folder, False, True, 0,
    )  # fmt: skip
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(experiment, "find_scale", lambda _: SMALL)
        patch.setitem(experiment.ROUNDS, "quick", 1)
        assert run_study(experiment.skipping(), request, False, finish_study) == 0
    return pd.read_csv(folder / "skipping.csv").set_index(["scene", "skip", "lighting"])


LAMBERT = "BRDF sampling if Lambertian"


def test_all_skips_but_brdf_sampling_leave_the_image_identical(rows):
    exact = rows.drop(index=LAMBERT, level="skip")
    assert len(exact) == 2 * (len(experiment.PAIRS) - 1)
    assert exact["identical"].all() and (exact["difference"] == 0.0).all()


@pytest.mark.parametrize(
    ("skip", "lighting"),
    [
        ("facing away", "median-cut"),
        ("facing away", "mis"),
        ("zero contribution, black ground", "mis"),
        ("background points", "median-cut"),
        ("view reused", "any"),
        ("reference reused", "any"),
        ("stored measurement", "any"),
    ],
)
def test_rays_are_saved(rows, skip, lighting):
    for scene in ("rubiks-cube", "three-boxes"):
        row = rows.loc[scene, skip, lighting]
        assert 0 <= row["rays_on"] < row["rays_off"]


def test_facing_away_accounts_for_every_pair_of_point_and_light(rows):
    off = rows.loc["three-boxes", "facing away", "median-cut"]["rays_off"]
    assert off % 16 == 0  # no pair is left out: every point traces all of its 16 lights


def test_brdf_sampling_is_left_out_only_where_all_is_lambertian(rows):
    assert rows.loc["rubiks-cube", LAMBERT, "mis"]["identical"]
    row = rows.loc["three-boxes", LAMBERT, "mis"]
    assert not row["identical"] and row["rays_on"] != row["rays_off"]


def test_the_sentence_counts_what_is_identical(rows):
    plain = rows.reset_index()
    exact = len(plain[plain["skip"] != LAMBERT])
    assert experiment.unchanged(plain).startswith(f"{exact} of {exact} skips")
    one_off = plain.assign(identical=plain["skip"] != "view reused")
    assert experiment.unchanged(one_off).startswith(f"{exact - 2} of {exact} skips")
