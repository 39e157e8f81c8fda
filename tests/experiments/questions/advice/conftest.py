"""A model trained once for all tests: errors follow a known law, with a fifth of noise."""

import pytest

from experiments.questions.advice.train import Trained, trained_on
from experiments.run.loaded_run import Run
from tests.experiments.questions.advice.known_law import law_run

NOISE = 0.15


@pytest.fixture(scope="session")
def run(tmp_path_factory) -> Run:
    return law_run(tmp_path_factory.mktemp("law"), maps=60, noise=NOISE)


@pytest.fixture(scope="session")
def noisy(run) -> Trained:
    return trained_on([run])


@pytest.fixture(scope="session")
def model(noisy):
    return noisy.model
