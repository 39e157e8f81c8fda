"""Light generation: what is timed is what it says, and rows hold what tables need."""

import numpy as np
import pandas as pd
import pytest

from experiments.run.request import RunRequest
from experiments.run.sampler_spec import SamplerSpec
from experiments.wu2025 import light_generation_time as experiment
from experiments.wu2025.light_generation_memory import peak_of
from samplers import EnvironmentMap


def noise_map(height: int = 32) -> EnvironmentMap:
    radiance = np.random.default_rng(3).uniform(0.0, 1.0, (height, 2 * height, 3))
    return EnvironmentMap.from_array(radiance, "noise")


def test_counts_follow_the_papers_unless_a_budget_is_given():
    fhis, tree, cut = (SamplerSpec(name) for name in ("fhis", "q2-tree", "median-cut"))
    assert [experiment.counts_for(spec, []) for spec in (fhis, tree, cut)] == [[300], [300], [64]]
    assert experiment.counts_for(tree, [4, 16]) == [16]  # 12 is its least


def test_one_texel_in_a_hundred_changes():
    before, after = noise_map(64), experiment.brightened(noise_map(64))
    changed = (before.radiance != after.radiance).any(axis=2).mean()
    # A square of a whole number of texels: its side is off by at most half a texel of nine.
    assert changed == pytest.approx(0.01, rel=0.12)


def test_tables_are_built_anew_each_time():
    environment = noise_map()
    build = experiment._table_task(environment, "flux_table")
    assert build() is not build()
    np.testing.assert_array_equal(build(), environment.flux_table)


@pytest.mark.skipif(not hasattr(__import__("os"), "getloadavg"), reason="needs a POSIX system")
def test_peak_memory_sees_the_tables_of_inversion():
    # A map of 512 × 1024 texels: running sums in float64 alone take 4 MiB.
    assert 4.0 <= peak_of(SamplerSpec("mis"), noise_map(512), 16) < 200.0


def test_experiment_writes_a_row_per_method_and_table(tmp_path, monkeypatch):
    monkeypatch.setitem(experiment.HEIGHTS, "quick", (16, 32))
    monkeypatch.setitem(experiment.ROUNDS, "quick", 2)
    monkeypatch.setattr(experiment, "peak_of", lambda *_: 1.0)
    request = RunRequest(
        "light-generation-time", "quick", "embedded", ["constant"], [], ["median-cut", "q2-tree"],
        ["lights=12"], tmp_path, False, True, 0,
    )  # fmt: skip
    assert experiment.run(request, False) == 0
    rows = pd.read_csv(tmp_path / "light_generation_time.csv")
    methods = ["median-cut", "q2-tree", experiment.UPDATE]
    assert set(rows["method"]) == {*methods, *(f"table {t}" for t in experiment.SHARED_TABLES)}
    assert set(rows["width"]) == {32, 64} and (rows["seconds"] > 0.0).all()
    assert (rows["seconds_lower"] <= rows["seconds"]).all()
    assert (tmp_path / "light_generation_time_constant.png").is_file()
