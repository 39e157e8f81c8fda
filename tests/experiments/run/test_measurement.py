"""A measurement's key changes with all that determines its result, and with nothing else."""

from dataclasses import replace

import numpy as np
import pytest

from experiments.maps.sources import EnvironmentSource
from experiments.run import measurement as measurement_module
from experiments.run.budget import Budget
from experiments.run.case import Case
from experiments.run.identity import library_versions, source_digest
from experiments.run.measurement import Measurement
from experiments.run.sampler_spec import SamplerSpec
from experiments.run.scale import Scale
from renderer.image import write_exr

TINY = Scale("tiny", 24, 18, 1, 0.5, 64, 16, (4,))
CASE = Case("vase", EnvironmentSource("constant", height=16), TINY)
MEASUREMENT = Measurement(CASE, SamplerSpec("median-cut"), Budget(4), 0)


def in_case(**changes):
    return replace(MEASUREMENT, case=replace(CASE, **changes))


def at_scale(**changes):
    return in_case(scale=replace(TINY, **changes))


OTHERS = {
    "seed": replace(MEASUREMENT, seed=1),
    "budget": replace(MEASUREMENT, budget=Budget(5)),
    "sampler": replace(MEASUREMENT, sampler=SamplerSpec("uniform")),
    "parameter": replace(MEASUREMENT, sampler=SamplerSpec("median-cut", (("order", "rounds"),))),
    "scene": in_case(scene="teapot"),
    "environment": in_case(environment=EnvironmentSource("overcast-moor", height=16)),
    "map height": in_case(environment=EnvironmentSource("constant", height=18)),
    "width": at_scale(width=25),
    "height": at_scale(height=19),
    "sub-pixels": at_scale(subpixels=2),
    "noise target": at_scale(noise_target=0.4),
    "most samples": at_scale(max_samples=65),
}


def test_every_ingredient_changes_the_key():
    keys = [MEASUREMENT.key, *(other.key for other in OTHERS.values())]
    assert len(set(keys)) == len(keys)


def test_an_equal_measurement_has_the_same_key():
    again = Measurement(
        Case("vase", EnvironmentSource("constant", height=16), replace(TINY)),
        SamplerSpec("median-cut", (("order", "heap"),)),
        Budget.parse("lights=4"),
        0,
    )
    assert again.key == MEASUREMENT.key


def test_what_a_scale_is_called_does_not_count():
    assert at_scale(name="other", budgets=(1, 2)).key == MEASUREMENT.key


@pytest.mark.parametrize(
    ("part", "references_too"),
    [
        ("samplers.median_cut", False),
        ("metrics.errors", False),
        ("renderer.render", False),
        ("renderer.reference", True),
        ("renderer.scenes.vase", True),
        ("experiments.maps.places", True),
    ],
)
def test_an_edit_of_the_source_changes_the_key(monkeypatch, part, references_too):
    def edited(*modules):
        return "edited" if part in modules else source_digest(*modules)

    monkeypatch.setattr(measurement_module, "source_digest", edited)
    monkeypatch.setattr("experiments.maps.sources.source_digest", edited)
    environment = EnvironmentSource("constant", height=16)
    other = Measurement(
        replace(CASE, environment=environment), SamplerSpec("median-cut"), Budget(4), 0
    )
    assert other.key != MEASUREMENT.key
    assert (other.case.key != MEASUREMENT.case.key) == references_too


@pytest.mark.parametrize(
    ("library", "references_too"), [("scipy", True), ("embreex", True), ("sklearn", False)]
)
def test_another_version_of_a_library_changes_the_key(monkeypatch, library, references_too):
    def renewed(*modules):
        # The sampler is taken for one that clusters.
        versions = dict(library_versions(*modules))
        versions |= {"sklearn": "1"} if modules == ("samplers.median_cut",) else {}
        return versions | ({library: "new"} if library in versions else {})

    monkeypatch.setattr(measurement_module, "library_versions", renewed)
    other = Measurement(replace(CASE), SamplerSpec("median-cut"), Budget(4), 0)
    assert other.key != MEASUREMENT.key
    assert (other.case.key != MEASUREMENT.case.key) == references_too


def test_an_edit_of_another_sampler_does_not_change_the_key(monkeypatch):
    asked = set()

    def noted(*modules):
        asked.update(modules)
        return source_digest(*modules)

    monkeypatch.setattr(measurement_module, "source_digest", noted)
    other = Measurement(replace(CASE), SamplerSpec("median-cut"), Budget(4), 0)
    assert other.key == MEASUREMENT.key
    assert {name for name in asked if name.startswith("samplers.")} == {"samplers.median_cut"}


def test_a_map_counts_by_its_content_and_repair(tmp_path):
    def key(name, value, repair=False):
        write_exr(tmp_path / name / "map.exr", np.full((2, 4, 3), value, np.float32))
        path = str(tmp_path / name / "map.exr")
        return in_case(environment=EnvironmentSource("map", path, repair=repair)).key

    assert key("a", 1.0) == key("b", 1.0)
    assert len({key("a", 1.0), key("c", 2.0), key("d", 1.0, repair=True)}) == 3


def test_labels_name_what_differs_from_the_paper():
    assert SamplerSpec("median-cut").label == "median-cut"
    assert SamplerSpec("median-cut", (("order", "rounds"),)).label == "median-cut[order=rounds]"
