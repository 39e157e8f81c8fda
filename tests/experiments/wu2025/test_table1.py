"""The summary: means over seeds, then scenes, then maps; ranks per map; only fair comparisons."""

import pandas as pd
import pytest

from experiments.maps.sources import EnvironmentSource
from experiments.report.summary import compared, summary
from experiments.run.budget import Budget
from experiments.run.measurement import Grid
from experiments.run.sampler_spec import SamplerSpec
from experiments.run.scale import SCALES


def row(scene, environment, sampler, seed, rmse, flip, budget="lights=8"):
    return {
        "scene": scene, "environment": environment, "sampler": sampler, "budget": budget,
        "seed": seed, "rmse": rmse, "flip": flip, "lights": 8, "rays_shadow": 30, "rays_brdf": 10,
        "rays_primary": 20, "seconds_lights": 0.5, "seconds_render": 2.0,
        "rmse_floor": 0.01, "over_budget": False, "rmse_near_floor": rmse < 0.1,
    }  # fmt: skip


ROWS = pd.DataFrame(
    [
        # One seed against two, two scenes on map m and one on map n.
        row("s", "m", "a", 0, 0.2, 0.4), row("t", "m", "a", 0, 0.4, 0.4),
        row("s", "n", "a", 0, 1.0, 0.5),
        row("s", "m", "b", 0, 0.1, 0.5), row("s", "m", "b", 1, 0.3, 0.3),
        row("t", "m", "b", 0, 0.5, 0.6), row("t", "m", "b", 1, 0.7, 0.6),
        row("s", "n", "b", 0, 0.0, 0.6), row("s", "n", "b", 1, 0.2, 0.4),
    ]
)  # fmt: skip


def table_of(rows):
    return summary(pd.DataFrame(rows)).set_index("sampler")


def test_means_go_over_seeds_then_scenes_then_maps():
    table = table_of(ROWS)
    assert table.loc["a", "rmse"] == pytest.approx(((0.2 + 0.4) / 2 + 1.0) / 2)
    assert table.loc["b", "rmse"] == pytest.approx(((0.2 + 0.6) / 2 + 0.1) / 2)
    assert list(table["maps"]) == [2, 2]
    assert list(table["cases"]) == [3, 3]
    assert list(table["rays"]) == [2.0, 2.0]
    assert table.loc["b", "rmse_near_floor"] == 1


def test_ranks_are_per_map_and_ties_share_the_better_one():
    table = table_of(ROWS)
    assert table.loc["a", "rmse_rank"] == 1.5  # first on m, second on n
    assert table.loc["b", "rmse_rank"] == 1.5
    assert table.loc["a", "flip_rank"] == 1.0  # 0.4 against 0.5, then a tie at 0.5
    assert table.loc["b", "flip_rank"] == 1.5
    assert list(table.index) == ["a", "b"]


def test_budgets_are_ordered_by_size_and_do_not_mix():
    rows = pd.concat([ROWS.assign(budget="lights=16"), ROWS.assign(rmse=2 * ROWS["rmse"])])
    table = summary(rows)
    assert list(table["budget"]) == ["lights=8"] * 2 + ["lights=16"] * 2
    assert table["rmse"][0] == pytest.approx(2 * table["rmse"][2])


def test_a_case_that_a_sampler_or_one_of_its_seeds_misses_counts_for_nobody():
    without = ROWS[~((ROWS["environment"] == "n") & (ROWS["sampler"] == "b"))]
    assert set(compared(without)["environment"]) == {"m"}
    pd.testing.assert_frame_equal(summary(without), summary(ROWS[ROWS["environment"] == "m"]))
    assert set(compared(ROWS.drop(index=ROWS.index[-1]))["environment"]) == {"m"}


def test_nothing_comparable_gives_no_number_rather_than_a_wrong_one():
    rows = [row("s", "m", "a", 0, 0.2, 0.4), row("s", "n", "b", 0, 0.1, 0.1)]
    table = table_of(rows)
    assert list(table.index) == ["a", "b"]
    assert table[["rmse", "rmse_rank", "flip", "flip_rank", "rays"]].isna().all(axis=None)
    assert list(table["cases"]) == [0, 0]


def test_a_sampler_that_cannot_meet_a_budget_is_left_out_by_name(monkeypatch):
    environments = (EnvironmentSource("constant", height=16),)
    samplers = (SamplerSpec("median-cut"), SamplerSpec("uniform"))
    monkeypatch.setattr(type(samplers[0].sampler), "minimum_count", 6)
    grid = Grid(("vase",), environments, samplers, (Budget(4), Budget(8)), SCALES["quick"])
    assert [(str(m.budget), m.sampler.name) for m in grid.measurements()] == [
        ("lights=4", "uniform"), ("lights=8", "median-cut"), ("lights=8", "uniform"),
    ]  # fmt: skip
    assert grid.left_out() == ["median-cut needs at least 6 lights and is left out at lights=4"]
