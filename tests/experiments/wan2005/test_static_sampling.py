"""Fixed patterns of lights: who takes part, what is judged, and what is written."""

import pandas as pd
import pytest

from experiments.report.write import write_report
from experiments.run.loaded_run import Run
from experiments.run.sampler_spec import SamplerSpec
from experiments.run.scale import SCALES
from experiments.wan2005 import static_sampling as experiment
from experiments.wan2005.static_sampling import chosen_fixed_sets, fixed_sets, makes_fixed_set
from samplers import EnvlightError
from tests.experiments.stored import run_into
from tests.experiments.tiny import TINY_QUICK


@pytest.mark.parametrize("name", ["q2-tree", "median-cut", "ours"])
def test_global_sets_take_part(name):
    assert makes_fixed_set(SamplerSpec(name))
    assert SamplerSpec(name) in fixed_sets()


@pytest.mark.parametrize("name", ["mis", "kd-tree", "center-surround"])
def test_others_are_left_out_and_refused(name):
    assert SamplerSpec(name) not in fixed_sets()
    with pytest.raises(EnvlightError, match=name):
        chosen_fixed_sets([name], 300)


def test_who_cannot_make_so_few_is_left_out():
    assert chosen_fixed_sets(["q2-tree", "median-cut"], 4) == (SamplerSpec("median-cut"),)


def test_ranks_are_by_psnr_within_a_scene_and_map():
    rows = pd.DataFrame(
        {
            "scene": "s", "environment": ["a", "a", "b", "b"], "sampler": ["x", "y"] * 2,
            "psnr": [30.0, 20.0, 50.0, 51.0], "lights": 12,
        }
    )  # fmt: skip
    table = experiment.summary_of(rows).set_index("sampler")
    assert table.loc["x", "rank"] == table.loc["y", "rank"] == 1.5
    assert table.loc["x", "psnr"] == 40.0 and table.loc["y", "psnr_least"] == 20.0


def test_experiment_writes_tables_and_patterns_that_outlive_the_images(tmp_path, monkeypatch):
    monkeypatch.setitem(SCALES, TINY_QUICK.name, TINY_QUICK)
    run_into(
        tmp_path, experiment.static_sampling(), maps=["constant"], scenes=["three-boxes"],
        samplers=["q2-tree", "fhis", "ours"], budgets=["16"],
    )  # fmt: skip
    table = pd.read_csv(tmp_path / "psnr.csv").set_index("sampler")
    assert set(table.index) == {"q2-tree", "fhis", "ours"}
    assert table.loc["fhis", "published"] == 33.3
    assert not (tmp_path / "beside_paper.csv").exists()
    cases = pd.read_csv(tmp_path / "psnr_by_case.csv")
    assert cases.loc[0, "q2-tree"] == pytest.approx(table.loc["q2-tree", "psnr"])
    before = {name: (tmp_path / name).read_bytes()
              for name in ("report.md", "psnr.csv", "patterns_constant_lights16.webp")}  # fmt: skip
    for place in ("images", "references"):
        (tmp_path / place).rename(tmp_path / f"no-{place}")
    write_report(experiment.static_sampling(), Run.load(tmp_path))
    assert all((tmp_path / name).read_bytes() == data for name, data in before.items())
