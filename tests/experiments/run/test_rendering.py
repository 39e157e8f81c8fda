"""What a row says of the rendering behind it."""

import numpy as np
import pytest

from experiments.report.summary import LEAGUES
from experiments.run.rendering import league
from samplers import EnvironmentMap, make_sampler, sampler_names

OF_A_KIND = {
    "median-cut": "fixed lights",
    "ours": "layers",
    "center-surround": "disc lights",
    "mis": "distribution",
    "kd-tree": "distribution",
    "ris": "distribution that sees the surface",
    "filtered-importance-sampling": "distribution that sees the surface",
}


@pytest.fixture(scope="module")
def environment():
    return EnvironmentMap(np.random.default_rng(0).random((32, 64, 3), np.float32))


@pytest.mark.parametrize("name", sampler_names())
def test_every_sampler_is_in_a_league_that_reports_know(name, environment):
    found = league(make_sampler(name).prepare(environment, 16, np.random.default_rng(0)))
    assert found in LEAGUES
    assert found == OF_A_KIND.get(name, found)
