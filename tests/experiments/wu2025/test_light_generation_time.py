"""Light generation: what is timed is what it says, and rows hold what tables need."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from experiments.cli.commands import finish
from experiments.run.experiment import RunRequest
from experiments.run.measure import peak_of
from experiments.run.sampler_spec import SamplerSpec
from experiments.run.start import run_experiment
from experiments.wu2025 import light_generation_time as measured
from experiments.wu2025.light_generation_time import enlarged_sentence, light_generation_time
from experiments.wu2025.published import LIGHT_GENERATION, LIGHT_GENERATION_MS
from renderer.image import write_exr
from samplers import EnvironmentMap, sampler_names


def noise_map(height: int = 32) -> EnvironmentMap:
    radiance = np.random.default_rng(3).uniform(0.0, 1.0, (height, 2 * height, 3))
    return EnvironmentMap.from_array(radiance, "noise")


def test_counts_follow_the_papers_unless_a_budget_is_given():
    fhis, tree, cut = (SamplerSpec(name) for name in ("fhis", "q2-tree", "median-cut"))
    assert [measured.counts_for(spec, []) for spec in (fhis, tree, cut)] == [[300], [300], [64]]
    assert measured.counts_for(tree, [4, 16]) == [16]  # 12 is its least


def test_one_texel_in_a_hundred_changes():
    before, after = noise_map(64), measured.brightened(noise_map(64))
    changed = (before.radiance != after.radiance).any(axis=2).mean()
    # A square of a whole number of texels: its side is off by at most half a texel of nine.
    assert changed == pytest.approx(0.01, rel=0.12)


def test_tables_are_built_anew_each_time():
    environment = noise_map()
    build = measured.table_task(environment, "flux_table")
    assert build() is not build()
    np.testing.assert_array_equal(build(), environment.flux_table)


@pytest.mark.skipif(not hasattr(__import__("os"), "getloadavg"), reason="needs a POSIX system")
def test_peak_memory_sees_the_tables_of_inversion():
    # A map of 512 × 1024 texels: running sums in float64 alone take 4 MiB.
    assert 4.0 <= peak_of(SamplerSpec("mis"), noise_map(512), 16) < 200.0


def request_of(folder: Path, environments: str, scale: str = "quick") -> RunRequest:
    return RunRequest(
        "light-generation-time", scale=scale, environments=environments,
        samplers=["median-cut", "q2-tree"], budgets=["lights=12"], output=folder,
    )  # fmt: skip


@pytest.fixture
def map_file(tmp_path) -> Path:
    """A map of 16 rows."""
    path = tmp_path / "noise.exr"
    write_exr(path, np.array(noise_map(16).radiance))
    return path


def test_maps_are_made_up_to_a_size_and_enlarged_beyond(map_file):
    embedded = measured.sized_maps(request_of(map_file, "embedded", "standard"))
    sizes = {(one.source.height, one.enlarged) for one in embedded}
    assert sizes == {(512, 1), (1024, 2), (1024, 4)}  # up to 8192 × 4096
    files = measured.sized_maps(request_of(map_file, str(map_file), "standard"))
    assert [16 * one.enlarged for one in files] == [16, 512, 2048, 4096]
    assert len(measured.sized_maps(request_of(map_file, str(map_file)))) == 1


def test_an_enlarged_map_is_the_same_in_every_direction(map_file):
    small, large = (
        replace(one, enlarged=factor).load()
        for one in measured.sized_maps(request_of(map_file, str(map_file)))
        for factor in (1, 4)
    )
    assert large.radiance.shape == (64, 128, 3)
    np.testing.assert_array_equal(large.radiance[1::4, 2::4], small.radiance)
    # The sum of the solid angles of a texel's parts is its own, but for rounding of float32.
    assert large.flux.sum(dtype=np.float64) == pytest.approx(
        small.flux.sum(dtype=np.float64), rel=1e-6
    )


def test_the_papers_times_are_of_methods_that_exist():
    assert set(LIGHT_GENERATION) - {measured.UPDATE} <= set(sampler_names())
    for name, milliseconds in LIGHT_GENERATION_MS.items():
        assert f"{milliseconds:g} ms" in LIGHT_GENERATION[name]


def test_maps_that_were_enlarged_are_told():
    rows = pd.DataFrame({"environment": ["a", "a"], "width": [32, 64], "enlarged": [1, 2]})
    assert enlarged_sentence(rows) == (
        "Enlarged maps, whose texels are repeated: a to 64×32 by 2×2."
    )
    assert not enlarged_sentence(rows[:1])


def test_experiment_writes_a_row_per_method_and_table(tmp_path, monkeypatch, map_file):
    monkeypatch.setitem(measured.HEIGHTS, "standard", (16, 32))
    monkeypatch.setitem(measured.ROUNDS, "standard", 2)
    monkeypatch.setattr(measured, "peak_of", lambda *_: 1.0)
    request = request_of(tmp_path / "run", str(map_file), "standard")
    assert run_experiment(light_generation_time(), request, False, finish) == 0
    rows = pd.read_csv(tmp_path / "run" / "light_generation_time.csv")
    methods = ["median-cut", "q2-tree", measured.UPDATE]
    assert set(rows["method"]) == {*methods, *(f"table {t}" for t in measured.SHARED_TABLES)}
    assert set(rows["width"]) == {32, 64} and (rows["seconds"] > 0.0).all()
    assert len(rows) == 2 * (3 + len(measured.SHARED_TABLES))
    assert (rows["peak_mib"].notna() == rows["method"].isin(["median-cut", "q2-tree"])).all()
    text = (tmp_path / "run" / "report.md").read_text(encoding="utf-8")
    assert "noise to 64×32 by 2×2" in text and "700 ms a map at 300" in text
    assert "](light_generation_time_noise_memory.svg)" in text
