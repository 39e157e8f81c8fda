"""Throughput of sampling: lookups and bytes are counted, rates are set against binary search."""

import numpy as np
import pandas as pd

from experiments.ergun2012 import throughput as experiment
from samplers import EnvironmentMap, LightDistribution
from tests.experiments.stored import run_into


def made(method: str, height: int = 32) -> LightDistribution:
    radiance = np.random.default_rng(5).uniform(0.1, 1.0, (height, 2 * height, 3))
    environment = EnvironmentMap.from_array(radiance, "noise")
    spec = experiment.METHODS[method]
    return spec.sampler.prepare(environment, 1, np.random.default_rng(0))  # type: ignore[return-value]


U = np.random.default_rng(1).random((4096, 3), np.float32)


def test_binary_search_reads_a_logarithm_of_the_map():
    # Rows of 32 and columns of 64 cells: as many steps as 31 and 63 have binary digits.
    assert experiment.lookups(made("binary search"), U) == 5 + 6


def test_lookups_fall_from_search_to_guide_to_table_to_formula():
    order = ["binary search", "guided search", "alias table", "kd-tree"]
    counts = [experiment.lookups(made(method), U) for method in order]
    assert counts[-1] == 0.0 and 1.0 <= counts[-2] <= 2.0
    assert sorted(counts, reverse=True) == counts


def test_bytes_of_blocks_do_not_grow_with_the_map():
    small, large = (experiment.table_bytes(made("kd-tree", height)) for height in (64, 128))
    assert small <= large <= 6144 * 64
    small, large = (experiment.table_bytes(made("binary search", height)) for height in (64, 128))
    assert large > 3.5 * small


def test_experiment_writes_a_row_per_map_method_and_threads(tmp_path, monkeypatch):
    monkeypatch.setitem(experiment.HEIGHTS, "quick", (16, 32))
    monkeypatch.setitem(experiment.KIND_HEIGHT, "quick", 16)
    monkeypatch.setitem(experiment.SAMPLES, "quick", 1 << 10)
    run_into(tmp_path, experiment.kd_tree_throughput(), maps=["constant"])
    rows = pd.read_csv(tmp_path / "rates.csv")
    assert len(rows) == 2 * 4 * 2 and (rows["million_per_second"] > 0.0).all()
    assert (tmp_path / "rates_constant.svg").is_file()
