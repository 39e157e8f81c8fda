"""The experiment is what it says: small at scale quick, four scenes and six counts otherwise."""

import pytest

from experiments.maps.sources import EMBEDDED
from experiments.questions.which_sampler import LIGHTS, QUICK_LIGHTS, which_sampler
from experiments.report.parts import Table
from experiments.run.experiment import TEST_SCENES, all_samplers
from experiments.run.request import RunRequest
from experiments.run.scale import SCALES
from tests.experiments.questions.advice.known_law import law_run


def request(scale: str, maps: list[str]) -> RunRequest:
    return RunRequest("which-sampler", scale, EMBEDDED, maps, [], [], [], None, False, False, 0)


def test_quick_has_two_scenes_three_counts_and_a_seed_each():
    grid = which_sampler().grid(request("quick", []))
    assert [budget.lights for budget in grid.budgets] == list(QUICK_LIGHTS)
    assert grid.scenes == TEST_SCENES[:2] and len(grid.environments) == 32
    assert grid.samplers == all_samplers()
    assert {one.seed for one in grid.measurements()} == {0}


def test_larger_scales_have_all_scenes_and_finer_references():
    grid = which_sampler().grid(request("medium", ["constant"]))
    assert [budget.lights for budget in grid.budgets] == list(LIGHTS)
    assert grid.scenes == TEST_SCENES
    assert grid.scale.noise_target == SCALES["medium"].noise_target / 2.0


def test_its_report_tells_what_maps_and_scenes_are_like(tmp_path):
    run = law_run(tmp_path, maps=6)
    rows = run.rows.assign(scene_glossy=0.25, scene_occlusion=[0.1, 0.3] * (len(run.rows) // 2))
    run = type(run)(tmp_path, rows, run.record)
    _, of_maps, of_scenes, _ = which_sampler().sections
    maps = next(part for part in of_maps(run) if isinstance(part, Table)).rows
    assert len(maps) == 6
    assert (
        maps["emitter_size"].tolist()
        == rows.groupby("environment")["map_emitter_size"].first().tolist()
    )
    found, errors = (part.rows for part in of_scenes(run) if isinstance(part, Table))
    assert errors["rmse"].tolist() == pytest.approx([0.8, 1.2])
    assert found.to_dict("list") == {
        "scene": ["rubiks-cube", "vase"], "glossy": [0.25, 0.25], "occlusion": [0.1, 0.3],
    }  # fmt: skip
    # Rows that are older than a feature have no table of it.
    older = [part for part in of_scenes(law_run(tmp_path, maps=6)) if isinstance(part, Table)]
    assert [part.stem for part in older] == ["errors_by_scene"]
