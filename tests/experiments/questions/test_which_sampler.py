"""What maps and scenes are like stands in the report as the rows have it."""

import pytest

from experiments.questions.which_sampler import which_sampler
from experiments.report.parts import Table
from tests.experiments.questions.advice.known_law import law_run


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
