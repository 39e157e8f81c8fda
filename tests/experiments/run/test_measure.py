"""What stands outside the clock of a measurement."""

import pytest

from experiments.maps.sources import EnvironmentSource
from experiments.run import measure
from experiments.run.budget import Budget
from experiments.run.case import Case
from experiments.run.measurement import Measurement
from experiments.run.rendering import cached_view, rehearse, shoot
from experiments.run.sampler_spec import SamplerSpec
from renderer.view import View
from samplers import sampler_names
from tests.experiments.tiny import TINY


@pytest.fixture
def found_in_time(monkeypatch, tmp_path):
    """What is found for a view to keep while its first image by a sampler is timed."""

    def of(name: str) -> list:
        found = []
        kept = View.kept

        def noted(view, key, find):
            return kept(view, key, lambda: (found.append(key), find())[1])

        def timed(measurement):
            with monkeypatch.context() as clock:
                clock.setattr(View, "kept", noted)
                return shoot(measurement)

        monkeypatch.setattr(measure, "shoot", timed)
        monkeypatch.setattr(measure, "finished", lambda task, scene, shot: None)
        cached_view.cache_clear()
        case = Case("three-boxes", EnvironmentSource("overcast-moor", height=16), TINY)
        one = Measurement(case, SamplerSpec(name), Budget(16), 0)
        rehearse(one.sampler)  # its tiny view is not timed either
        measure.measure(measure.MeasurementTask(one, str(tmp_path), 0.0, False, ()))
        return found

    return of


@pytest.mark.parametrize("name", sampler_names())
def test_no_image_pays_for_what_its_view_keeps(name, found_in_time):
    assert found_in_time(name) == []


def test_otherwise_the_first_upsampled_one_would(found_in_time, monkeypatch):
    monkeypatch.setattr(measure, "fill_view", lambda *_: None)
    assert ("reduced", 4) in found_in_time("ours")
