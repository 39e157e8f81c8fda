"""Fixed patterns of lights: who takes part, what is judged, and what is written."""

import numpy as np
import pandas as pd
import pytest

from experiments.run.request import RunRequest
from experiments.run.scale import Scale
from experiments.wan2005 import static_sampling as experiment
from samplers import DirectionalLights, EnvironmentMap, make_sampler

TINY = Scale("quick", 24, 18, 1, 0.5, 64, 32, (16,))
RADIANCE = np.random.default_rng(0).uniform(0.2, 1.0, (16, 32, 3))


def made(name: str, count: int = 16):
    environment = EnvironmentMap.from_array(RADIANCE)
    return environment, make_sampler(name).prepare(environment, count, np.random.default_rng(0))


@pytest.mark.parametrize("name", ["q2-tree", "median-cut", "ours"])
def test_global_sets_take_part(name):
    assert experiment.reason_to_leave_out(made(name)[1]) == ""


@pytest.mark.parametrize(
    ("name", "words"),
    [("mis", "shading point"), ("kd-tree", "shading point"), ("center-surround", "number")],
)
def test_others_are_left_out_with_a_reason(name, words):
    assert words in experiment.reason_to_leave_out(made(name)[1])


@pytest.mark.parametrize("name", ["q2-tree", "ours"])
def test_energy_error_sees_lost_light(name):
    environment, lighting = made(name)
    assert experiment.energy_error(environment, lighting) < 1e-12  # sums of a few hundred float64
    if isinstance(lighting, DirectionalLights):
        less = DirectionalLights(lighting.direction, 0.9 * lighting.irradiance, lighting.extent)
        assert experiment.energy_error(environment, less) == pytest.approx(0.1, rel=1e-9)


def test_ranks_are_by_psnr_within_a_scene_and_map():
    rows = pd.DataFrame(
        {
            "scene": "s", "environment": ["a", "a", "b", "b"], "method": ["x", "y"] * 2,
            "psnr": [30.0, 20.0, 50.0, 51.0], "rmse": 0.1, "lights": 12.0,
            "energy_error": [0.0, 0.1, 0.2, 0.0],
        }
    )  # fmt: skip
    table = experiment.summary_of(rows).set_index("method")
    assert table.loc["x", "rank"] == table.loc["y", "rank"] == 1.5
    assert table.loc["x", "psnr"] == 40.0 and table.loc["y", "energy_error"] == 0.1


def test_experiment_writes_tables_plot_and_sheets(tmp_path, monkeypatch):
    monkeypatch.setattr(experiment, "find_scale", lambda _: TINY)
    monkeypatch.setitem(experiment.NOISE_TARGET, "quick", 0.5)
    request = RunRequest(
        experiment.NAME, "quick", "embedded", ["constant"], ["three-boxes"],
        ["q2-tree", "fhis", "mis", "ours"], ["16"], tmp_path, False, True, 0,
    )  # fmt: skip
    assert experiment.run(request, False) == 0
    table = pd.read_csv(tmp_path / "static_sampling.csv")
    assert set(table["method"]) == {"q2-tree", "fhis", "ours"}
    names = [
        "static_sampling_psnr.svg", "static_sampling_q2_tree_patterns.jpg",
        "static_sampling_patterns_constant.jpg", "static_sampling_images_three-boxes_constant.jpg",
    ]  # fmt: skip
    before = {name: (tmp_path / name).read_bytes() for name in names}
    assert "mis is left out" in (tmp_path / "static_sampling.md").read_text(encoding="utf-8")
    assert experiment.run(request, False) == 0
    assert all((tmp_path / name).read_bytes() == data for name, data in before.items())
