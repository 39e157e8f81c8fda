"""What a row says of the rendering behind it."""

from dataclasses import replace

import numpy as np
import pytest

from experiments.maps.sources import EnvironmentSource
from experiments.report.summary import LEAGUES
from experiments.run.budget import Budget
from experiments.run.case import Case
from experiments.run.measurement import Measurement
from experiments.run.rendering import CaseScene, league
from experiments.run.sampler_spec import SamplerSpec
from renderer.render import render
from samplers import EnvironmentMap, EnvlightError, make_sampler, sampler_names
from tests.experiments.tiny import TINY

OF_A_KIND = {
    "median-cut": "fixed lights", "ours": "layers", "center-surround": "disc lights",
    "mis": "distribution", "kd-tree": "distribution", "ris": "distribution that sees the surface",
    "filtered-importance-sampling": "distribution that sees the surface",
}  # fmt: skip


@pytest.fixture(scope="module")
def environment():
    return EnvironmentMap(np.random.default_rng(0).random((32, 64, 3), np.float32))


@pytest.mark.parametrize("name", sampler_names())
def test_every_sampler_is_in_a_league_that_reports_know(name, environment):
    found = league(make_sampler(name).prepare(environment, 16, np.random.default_rng(0)))
    assert found in LEAGUES
    assert found == OF_A_KIND.get(name, found)


@pytest.mark.parametrize("sets", [1, 8])
def test_pixels_take_turns_in_as_many_sets_as_the_scale_says(sets):
    scale = replace(TINY, sets=sets)
    case = Case("three-boxes", EnvironmentSource("overcast-moor", height=16), scale)
    scene = CaseScene.of(case)
    shot = scene.shoot(Measurement(case, SamplerSpec("median-cut"), Budget(4), 1), 4)
    images = {n: render(scene.view, shot.lighting, scene.environment, 1, n).image for n in (1, 8)}
    assert not np.array_equal(images[1], images[8])
    np.testing.assert_array_equal(shot.rendering.image, images[sets])


def test_a_distribution_that_grows_after_it_was_checked_is_refused(monkeypatch):
    case = Case("three-boxes", EnvironmentSource("overcast-moor", height=16), TINY)
    measurement = Measurement(case, SamplerSpec("mis"), Budget(4), 1)
    scene = CaseScene.of(case)
    of_64 = scene.shoot(measurement, 64).lighting
    monkeypatch.setattr("experiments.run.rendering._lighting", lambda *key: (of_64, 0.0))
    with pytest.raises(EnvlightError, match="more than 4 samples were taken at a point"):
        scene.shoot(measurement, 4)
