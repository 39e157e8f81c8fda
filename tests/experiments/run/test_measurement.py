"""A reference, an image and a score each have a key that changes with all that determines them."""

import json
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from experiments.maps.sources import EnvironmentSource
from experiments.run import case as case_module
from experiments.run import measurement as measurement_module
from experiments.run.budget import Budget
from experiments.run.case import Case
from experiments.run.identity import dependencies, library_versions, source_digest
from experiments.run.measurement import Measurement
from experiments.run.sampler_spec import SamplerSpec
from metrics.registry import metrics
from renderer.image import write_exr
from tests.experiments.tiny import TINY

CASE = Case("vase", EnvironmentSource("constant", height=16), TINY)
MEASUREMENT = Measurement(CASE, SamplerSpec("median-cut"), Budget(4), 0)


@pytest.fixture(autouse=True)
def _known_before_a_test_changes_what_they_depend_on():
    """Keys are computed once and kept."""
    assert MEASUREMENT.key and MEASUREMENT.case.reference_key and MEASUREMENT.case.score_keys


def in_case(**changes):
    return replace(MEASUREMENT, case=replace(CASE, **changes))


def at_scale(**changes):
    return in_case(scale=replace(TINY, **changes))


OTHER_IMAGES = {
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
    "interleaved sets": at_scale(sets=1),
}
OTHER_REFERENCES = {
    "noise target": at_scale(noise_target=0.4),
    "most samples": at_scale(max_samples=65),
}


def test_every_ingredient_of_an_image_changes_its_key():
    keys = [MEASUREMENT.key, *(other.key for other in OTHER_IMAGES.values())]
    assert len(set(keys)) == len(keys)


def test_a_deeper_reference_renders_no_image_again_but_scores_it_anew():
    for other in OTHER_REFERENCES.values():
        assert other.key == MEASUREMENT.key
        assert other.case.reference_key != CASE.reference_key
        assert not set(other.case.score_keys.values()) & set(MEASUREMENT.case.score_keys.values())


def test_an_equal_measurement_has_the_same_keys():
    again = Measurement(
        Case("vase", EnvironmentSource("constant", height=16), replace(TINY)),
        SamplerSpec("median-cut", (("order", "heap"),)),
        Budget.parse("lights=4"),
        0,
    )
    assert again.key == MEASUREMENT.key
    assert again.case.score_keys == MEASUREMENT.case.score_keys


def test_what_a_scale_is_called_does_not_count():
    assert at_scale(name="other", budgets=(1, 2)).key == MEASUREMENT.key


def fresh(environment="constant"):
    """An equal measurement that has computed nothing yet."""
    for known in (case_module.environment_identity, measurement_module.program):
        known.cache_clear()
    source = EnvironmentSource(environment, height=16)
    return Measurement(replace(CASE, environment=source), SamplerSpec("median-cut"), Budget(4), 0)


@pytest.mark.parametrize(
    ("part", "changed"),
    [
        ("samplers.median_cut", {"image"}),
        ("samplers.uniform", set()),
        ("metrics.errors", {"rmse"}),
        ("metrics.flip", {"flip"}),
        ("renderer.render", {"image"}),
        ("renderer.reference", {"reference", "flip", "rmse"}),
        ("renderer.scenes.vase", {"reference", "image", "flip", "rmse"}),
        ("experiments.maps.places", {"reference", "image", "flip", "rmse"}),
    ],
)
def test_an_edit_of_the_source_changes_what_depends_on_it_alone(monkeypatch, part, changed):
    def edited(*modules):
        return "edited" if part in modules else source_digest(*modules)

    before = fresh()
    keys = {"reference": before.case.reference_key, "image": before.key, **before.case.score_keys}
    monkeypatch.setattr("experiments.run.identity.source_digest", edited)
    other = fresh()
    now = {"reference": other.case.reference_key, "image": other.key, **other.case.score_keys}
    found = {name for name in ("reference", "image", "flip", "rmse") if now[name] != keys[name]}
    fresh()
    assert found == changed


@pytest.mark.parametrize(
    ("library", "references_too"), [("scipy", True), ("embreex", True), ("sklearn", False)]
)
def test_another_version_of_a_library_changes_the_key(monkeypatch, library, references_too):
    def renewed(*modules):
        # The sampler is taken for one that clusters.
        versions = dict(library_versions(*modules))
        versions |= {"sklearn": "1"} if modules == ("samplers.median_cut",) else {}
        return versions | ({library: "new"} if library in versions else {})

    for module in ("measurement", "case", "sampler_spec"):
        monkeypatch.setattr(f"experiments.run.{module}.library_versions", renewed)
    other = fresh()
    assert other.key != MEASUREMENT.key
    assert (other.case.reference_key != MEASUREMENT.case.reference_key) == references_too


def test_references_depend_on_no_sampler():
    """No class that is registered as a sampler stands in a module that a reference is made by."""
    code = (
        "import json; from samplers import sampler_names, sampler_class;"
        " print(json.dumps([sampler_class(n).__module__ for n in sampler_names()]))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert not set(json.loads(done.stdout)) & set(dependencies("renderer.reference"))


TRACED = """
import json, sys, threading
from pathlib import Path
from experiments.maps.sources import EnvironmentSource
from experiments.run.budget import Budget
from experiments.run.case import Case
from experiments.run.identity import dependencies
from experiments.run.measure import MeasurementTask, ReferenceTask, measure, measure_reference
from experiments.run.measurement import Measurement
from experiments.run.sampler_spec import SamplerSpec
from experiments.run.scale import Scale
from metrics.registry import metrics

case = Case("vase", EnvironmentSource("constant", height=16), Scale("t", 8, 6, 1, 1.0, 16, 16, ()))
one = Measurement(case, SamplerSpec(sys.argv[1]), Budget(12), 0)
names = tuple(one.case.score_keys)
assert one.key
case.environment.load()
ran = set()
def note(frame, event, argument):
    ran.add(frame.f_code.co_filename)
threading.setprofile(note)
sys.setprofile(note)
floor = measure_reference(ReferenceTask(case, sys.argv[2]))["noise_floor"]
measure(MeasurementTask(one, sys.argv[2], floor, True, names))
sys.setprofile(None)
parts = ["renderer.reference", "renderer.render", "renderer.scenes.vase", "experiments.maps.places",
         type(one.sampler.sampler).__module__, *(metric.module for metric in metrics())]
counted = {str(path) for path in dependencies(*parts).values()}
root = Path(sys.modules["samplers"].__file__).parents[1]
print(json.dumps(sorted(
    str(Path(file).relative_to(root)) for file in ran - counted
    if any(Path(file).is_relative_to(root / part) for part in ("samplers", "renderer", "metrics")
))))
"""
WITHOUT_EFFECT = {
    "renderer/scene/load.py": "finds a scene by its name",
    "renderer/scenes/__init__.py": "finds a scene by its name",
    "renderer/scenes/three_boxes.py": "is rendered before the clock starts, and thrown away",
    "samplers/conformance/lighting_check.py": "raises or does nothing",
}


@pytest.mark.parametrize("name", ["ours", "mis"])
def test_no_module_that_runs_is_missing_from_the_identities(tmp_path, name):
    """Of the files whose functions a measurement calls, all that compute its row count."""
    done = subprocess.run(
        [sys.executable, "-c", TRACED, name, str(tmp_path)],
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    assert set(json.loads(done.stdout)) <= set(WITHOUT_EFFECT)


def test_every_metric_has_a_score_of_its_own():
    keys = MEASUREMENT.case.score_keys
    assert set(keys) == {metric.name for metric in metrics()}
    assert len(set(keys.values())) == len(keys)


def test_a_map_counts_by_its_content_and_repair(tmp_path):
    def key(name, value, repair=False):
        write_exr(tmp_path / name / "map.exr", np.full((2, 4, 3), value, np.float32))
        path = str(tmp_path / name / "map.exr")
        return in_case(environment=EnvironmentSource("map", path, repair=repair)).key

    assert key("a", 1.0) == key("b", 1.0)
    assert len({key("a", 1.0), key("c", 2.0), key("d", 1.0, repair=True)}) == 3
