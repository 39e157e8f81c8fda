"""On maps kept aside advice is judged by what was measured there, which follows a known law."""

import numpy as np
import pytest

from experiments.questions.advice.aside import judged_aside
from experiments.questions.advice.measured import measured, parted
from experiments.questions.advice.train import trained_without
from samplers import EnvlightError

ASIDE = [f"map-{number:02d}" for number in range(0, 60, 5)]


def test_maps_aside_are_not_trained_on(run):
    kept, aside = parted(measured([run]), ASIDE)
    assert set(aside.maps) == set(ASIDE) and not set(kept.maps) & set(ASIDE)
    assert len(kept.features) == len(kept.maps) == 48
    whole = measured([run])
    place = [whole.maps.index(name) for name in aside.maps]
    for name, errors in aside.errors.items():
        np.testing.assert_array_equal(errors, whole.errors[name][place])
    trained, of_training = trained_without([run], ASIDE)
    assert trained.model.maps == kept.maps and of_training.maps == aside.maps


def test_advice_on_maps_aside_is_better_than_always_the_same(run):
    trained, aside = trained_without([run], ASIDE)
    table = judged_aside(trained.model, aside).rows.set_index(["metric", "league", "budget"])
    line = table.loc["RMSE", "all", "lights=32"]
    # The law lets the best one differ from map to map by more than the noise.
    assert 1.0 <= line["choice"] < line["always"] < line["random"]
    assert line["maps"] == len(ASIDE)
    # 3 samplers on 12 maps, correlated: two standard deviations of 36 draws of 80 %.
    assert line["inside"] == pytest.approx(0.8, abs=2.0 * np.sqrt(0.8 * 0.2 / 36))


def test_unknown_maps_are_named(run):
    with pytest.raises(EnvlightError, match="nowhere"):
        parted(measured([run]), ["nowhere"])
