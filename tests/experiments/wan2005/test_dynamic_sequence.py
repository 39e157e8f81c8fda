"""The fire, what is measured between its frames, and the coherent Q²-tree."""

import numpy as np
import pandas as pd
import pytest

from experiments.maps.places import FIRE_SINES, fire
from experiments.maps.sources import EnvironmentSource
from experiments.run.case import Case
from experiments.run.scale import SCALES
from experiments.wan2005 import dynamic_sequence as experiment
from experiments.wan2005.dynamic_sequence import TIMED, summary_of, time_summary
from experiments.wan2005.frame_changes import FireSequence, Flames, change, kept_share, unburnt
from samplers import EnvironmentMap
from samplers.sphere import pixel_directions
from tests.experiments.stored import run_into
from tests.experiments.tiny import TINY_QUICK


def lit(frame: int) -> float:
    return EnvironmentMap(fire(frame, 32)).luminous_flux


def test_fire_grows_from_a_point_to_a_ring():
    direction = pixel_directions(64)
    angle = np.arctan2(-direction[..., 2], direction[..., 0])
    cells = np.floor((angle + np.pi) / (2.0 * np.pi) * 24.0).astype(int).clip(0, 23)

    def burning(frame: int) -> set[int]:
        return set(cells[fire(frame, 64).max(axis=2) > 0.05].tolist())

    assert len(burning(4)) <= 3 and len(burning(110)) == 24
    # Anticlockwise from above: angles from +X towards −Z grow.
    assert burning(20) < burning(40) < burning(60)
    assert lit(4) < lit(30) < lit(60) < lit(110)


def test_flames_stay_in_their_band_and_change_every_frame():
    y = pixel_directions(64)[..., 1]
    # A texel's sub-texels reach half a texel beyond its centre.
    slack = np.pi / 128
    for frame in (50, 51, 119):
        found = y[fire(frame, 64).max(axis=2) > 0.0]
        assert found.min() > FIRE_SINES[0] - slack and found.max() < FIRE_SINES[1] + slack
    assert not np.array_equal(fire(50, 32), fire(51, 32))
    assert np.array_equal(fire(50, 32), fire(50, 32))


def test_fire_has_the_same_energy_at_every_size():
    # Tongues of 0.45 m at 4 m are five texels wide at 64 rows; their edges are lost to averaging.
    fine = EnvironmentMap(fire(100, 128)).luminous_flux
    assert EnvironmentMap(fire(100, 64)).luminous_flux == pytest.approx(fine, rel=0.03)


UP, AHEAD = [0.0, 1.0, 0.0], [0.0, 0.0, -1.0]


def test_change_is_in_degrees_per_energy():
    before = np.array([UP]), np.array([4.0])
    after = np.array([[np.sin(0.1), np.cos(0.1), 0.0]]), np.array([4.0])
    assert change(before, after) == pytest.approx(np.degrees(0.1), rel=1e-5)
    assert change(before, before) == 0.0


def test_unburnt_lights_are_those_outside_the_flames():
    lights = np.array([UP, AHEAD]), np.array([1.0, 2.0])
    assert unburnt(lights)[1].tolist() == [1.0]


def test_kept_share_counts_lights_that_stay():
    before = np.array([UP, AHEAD]), np.array([1.0, 3.0])
    after = np.array([UP, AHEAD]), np.array([1.0, 2.0])
    assert kept_share(before, before) == 1.0
    assert kept_share(before, after) == pytest.approx(2.0 / 7.0)


def test_summaries_take_means_of_squares_and_medians_of_ratios():
    rows = pd.DataFrame(
        {
            "method": "m", "lights": 12, "lights_change": [1.0, 3.0], "map_change": 1.0,
            "unburnt_change": 0.0, "unburnt_kept": 1.0, "temporal_noise": [3.0, 4.0],
            "image_change": 1.0, "true_change": [5.0, 5.0],
        }
    )  # fmt: skip
    table = summary_of(rows).iloc[0]
    assert table["lights_change"] == 2.0 and table["most_noise"] == 4.0
    assert table["noise_ratio"] == pytest.approx(np.sqrt(12.5) / 5.0)
    seconds = {f"seconds_{name}": 1.0 for name in TIMED}
    seconds |= {"seconds_alone": [2.0, 6.0, 4.0], "seconds_coherent": [1.0, 2.0, 4.0]}
    seconds |= {"seconds_tree_alone": [3.0, 4.0, 5.0]}
    same = {"identical": [True, True, False], "quads_changed": 3}
    found = time_summary(pd.DataFrame({"environment": "e", "scene": "s", **seconds, **same}))
    row = found.iloc[0]
    assert row["speed_up"] == 2.0 and row["tree_speed_up"] == 4.0 and row["identical"] == 2


def test_flames_are_named_after_all_that_determines_them():
    flames = Flames.of(90, 2.0, 32)
    assert flames == Flames.of(90, 2.0, 32)
    assert len({flames.name, Flames.of(91, 2.0, 32).name, Flames.of(90, 3.0, 32).name}) == 3
    assert flames.load().luminous_flux == pytest.approx(2.0 * lit(90), rel=1e-6)  # float32


def test_a_frame_is_judged_by_the_place_and_the_fire_together(tmp_path):
    case = Case("three-boxes", EnvironmentSource("constant", height=32), TINY_QUICK)
    sequence = FireSequence(case, tmp_path)
    truth, still = sequence.truth(90), sequence.still_truth
    assert truth.exposure == still.exposure
    assert (truth.image >= still.image).all() and truth.image.mean() > still.image.mean()
    assert truth.halves is not None
    # float32 values of about 1, four of which are summed and rounded.
    mean = 0.5 * (truth.halves[0].astype(np.float64) + truth.halves[1])
    np.testing.assert_allclose(mean, truth.image, rtol=1e-6, atol=1e-6)
    alone = sequence.change_floor(90, 90) / np.sqrt(2.0)
    assert truth.noise_floor == pytest.approx(np.hypot(alone, still.noise_floor))


def test_experiment_measures_each_pair_of_frames(tmp_path, monkeypatch):
    monkeypatch.setitem(SCALES, TINY_QUICK.name, TINY_QUICK)
    monkeypatch.setitem(experiment.NOISE_TARGET, "quick", 0.5)
    monkeypatch.setitem(experiment.WINDOW, "quick", (89, 92))
    monkeypatch.setitem(experiment.ROUNDS, "quick", 1)
    run_into(
        tmp_path, experiment.dynamic_sequence(), maps=["constant"], scenes=["three-boxes"],
        samplers=["q2-tree"], budgets=["24"],
    )  # fmt: skip
    rows = pd.read_csv(tmp_path / "measurements.csv").set_index("method")
    assert sorted(rows["frame"]) == [90, 90, 90, 91, 91, 91]
    assert (rows.loc[["q2-tree", experiment.CALMED], "temporal_noise"] > 0.0).all()
    times = pd.read_csv(tmp_path / "times.csv")
    assert times.loc[0, "identical"] == times.loc[0, "frames"] == 2
    assert len(list((tmp_path / "references").glob("*[0-9a-f].exr"))) == 2 * (1 + 3)
    for name in ("lights", "images"):
        assert (tmp_path / f"{name}_three-boxes_constant.svg").is_file()
    assert (tmp_path / "patterns_three-boxes_constant.webp").is_file()
