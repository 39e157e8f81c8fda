"""Run time against error: laws, points, slopes, fronts and choices of rows whose laws are known."""

import math
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from experiments.questions.convergence import (
    ALL,
    best_in_time,
    classed,
    convergence,
    convergence_plot,
    convergence_points,
    fit_power_law,
    slopes,
    time_steps,
    whom_to_choose,
)
from experiments.report.figures import pareto_front, pareto_plot, relative_errors
from experiments.report.style import REST, label_of, looks
from experiments.report.write import write_report
from metrics.registry import find_metric, metrics
from tests.experiments.grid_rows import contents, grid_run

LIGHTS = (4, 8, 16, 32, 64)
MAPS = ("noon-desert", "constant")
SAMPLERS = ("mis", "ours")
METRIC = find_metric("rmse")


def errors(scene: str, environment: str, sampler: str, lights: int) -> tuple[float, float]:
    """MIS falls as N^-1 from far above, ours as N^-0.5: they meet at 16 lights."""
    level = 1.0 if environment == "constant" else 2.0
    error = 4.0 / lights if sampler == "mis" else 1.0 / math.sqrt(lights)
    return level * error, 0.5 * level * error


@pytest.fixture
def rows(tmp_path) -> pd.DataFrame:
    run = grid_run(tmp_path, ("vase", "teapot"), MAPS, SAMPLERS, errors, LIGHTS)
    kinds = run.rows["environment"].map({"noon-desert": "sun", "constant": "uniform"})
    return run.rows.assign(**{"class": kinds})


def test_slopes_are_those_of_the_laws(rows):
    table = slopes(convergence_points(rows)).set_index(["sampler", "metric", "cost"])
    assert table.loc[("mis", "rmse", "rays"), "slope"] == pytest.approx(-1.0)
    assert table.loc[("ours", "flip", "rays"), "slope"] == pytest.approx(-0.5)
    assert (table["points"] == len(LIGHTS)).all()


def test_no_slope_goes_through_points_near_the_noise_floor(rows):
    points = convergence_points(rows.assign(rmse_floor=0.2))
    near = points["rmse_near_floor"]
    assert (near == (points["rmse"] < 0.6)).all() and near.any()
    assert not points["flip_near_floor"].any()
    table = slopes(points).set_index(["sampler", "metric", "cost"])
    # MIS over all maps: 6 / N is above 0.6 at 4 and 8 lights alone.
    assert math.isnan(table.loc[("mis", "rmse", "rays"), "slope"])
    assert table.loc[("mis", "rmse", "rays"), "points"] == 2


def chosen(rows, group, metric=METRIC):
    """The table's entries of a class, by time."""
    table = best_in_time(convergence_points(rows), "seconds_render", metric).set_index("class")
    return table.loc[group].to_dict()


def test_the_best_in_a_given_time_is_the_least_error_within_it(rows):
    assert time_steps(convergence_points(rows)) == pytest.approx([0.005, 0.01, 0.02, 0.05, 0.1])
    # 4 and 8 lights: ours; 16, which both reach within 20 ms: equal, so the first of the faster;
    # 32 and more: MIS.
    found = chosen(rows, "sun")
    assert found["5 ms"] == "ours (lights=4) 1.000"
    assert found["100 ms"] == "mis (lights=64) 0.125"
    assert found["10 ms"].startswith("ours") and found["50 ms"].startswith("mis")


def test_places_near_the_floor_are_shared_and_not_ranked(rows):
    # RMSE on the constant map: ours 0.5 at 4 lights, 0.25 at 16; MIS 0.25 at 16, 0.0625 at 64.
    # Below 0.3 there is no order: from 16 lights on both share the place, whatever their means.
    found = chosen(rows.assign(rmse_floor=0.1), "uniform")
    assert found["10 ms"].startswith("ours ") and found["100 ms"] == "2 at the floor"
    # Below 0.09 there is MIS at 64 lights, 0.0625, and nobody else: ours ends at 0.125.
    alone = chosen(rows.assign(rmse_floor=0.03), "uniform")
    assert alone["100 ms"] == "mis (lights=64) 0.062"


def test_maps_without_a_known_name_are_classed_by_contrast(rows):
    names = ["red_wall", "mine", "yours"]
    maps = [names[k % 3] for k in range(len(rows))]
    contrast = [{"red_wall": 1e5, "mine": 1e5, "yours": 5.0}[name] for name in maps]
    found = classed(rows.assign(environment=maps, map_contrast=contrast))
    assert found.groupby("environment")["class"].first().to_dict() == {
        "red_wall": "named by Wu 2025", "mine": "contrast above 10⁴",
        "yours": "contrast below 10²",
    }  # fmt: skip


def test_reports_have_the_same_bytes(tmp_path):
    for name in ("one", "two"):
        (tmp_path / name).mkdir()
        run = grid_run(tmp_path / name, ("vase",), MAPS[:1], SAMPLERS, errors, LIGHTS)
        write_report(convergence(), run)
    first = contents(tmp_path / "one")
    assert first == contents(tmp_path / "two")
    assert {"report.md", "flip_seconds.svg", "rmse_rays.svg", "pareto_flip_vase.svg"} < set(first)
    assert {"best_in_time.csv", "points.csv", "slopes_all_maps.csv"} < set(first)


def test_the_front_is_at_one_in_colour_and_named_and_all_others_lie_above_it(rows):
    points, metric, styles = convergence_points(classed(rows)), metrics()[0], looks(SAMPLERS)
    drawn = convergence_plot(points, metric, "seconds", styles)
    large, *small = drawn.axes
    assert [axes.get_title() for axes in small] == list(dict.fromkeys(points["class"]))[1:]
    assert all(axes.get_position().height < large.get_position().height for axes in small)
    every = points[points["class"] == ALL].assign(error=lambda part: part[metric.name])
    front = pareto_front(every)
    assert {text.get_text() for text in large.texts} == set(map(label_of, front["sampler"]))
    places = np.array([text.xyann for text in large.texts]) * [1.0, large.bbox.height]
    assert (places[:, 0] > 1.0).all() and np.diff(np.sort(places[:, 1])).min() * 72 > 11 * drawn.dpi
    crowd = pd.concat([every.assign(sampler=f"mis[a={k}]", near=False) for k in range(40)])
    (axes,) = pareto_plot(crowd, metric, looks(list(crowd["sampler"].unique())), "").axes
    assert min(text.xyann[1] for text in axes.texts) >= 0.0  # forty names, none below the axes
    colored = {styles[name].color for name in front["sampler"]}
    assert {line.get_color() for line in large.lines} <= colored | {REST}
    relative = relative_errors(every)
    np.testing.assert_allclose(relative[front.index], 1.0, rtol=1e-12)
    assert (relative >= 1.0 - 1e-12).all()


def test_the_interval_holds_the_slope_in_95_of_100_cases():
    rng = np.random.default_rng(5)
    cost = 2.0 ** np.arange(2, 9)
    held = 0
    for _ in range(1000):
        law = fit_power_law(cost, cost**-0.5 * np.exp(rng.normal(0.0, 0.2, len(cost))))
        held += law["low"] <= -0.5 <= law["high"]
    # Binomial with p = 0.95: four standard deviations are 28.
    assert abs(held - 950) < 28


def test_too_few_points_have_no_law():
    for cost, error in (
        ([1.0, 2.0], [1.0, 0.5]),
        ([4.0, 4.0, 8.0], [1.0, 1.1, 0.5]),
        ([1.0, 2.0, 4.0, 8.0], [1.0, 0.0, math.nan, 0.5]),
    ):
        law = fit_power_law(cost, error)
        assert math.isnan(law["slope"]) and law["points"] == len(cost)


def on_two_machines(rows: pd.DataFrame) -> pd.DataFrame:
    """The map of a constant by a machine that is ten times slower, and one budget of both by it."""
    slow = rows["environment"].eq("constant") | rows["budget"].eq("lights=8")
    times = {
        name: rows[name] * np.where(slow, 10.0, 1.0)
        for name in ("seconds_lights", "seconds_render")
    }
    return rows.assign(machine=np.where(slow, "slow", "fast"), **times)


def test_times_of_a_class_are_of_one_kind_of_machine(rows):
    want = convergence_points(rows).set_index(["class", "sampler", "budget"])
    points = convergence_points(on_two_machines(rows)).set_index(["class", "sampler", "budget"])
    pd.testing.assert_frame_equal(points[["rmse", "flip"]], want[["rmse", "flip"]])
    assert (points["maps"] == want["maps"]).all()
    # More rows are of the slow machine: over all maps, times are on one of two, but at 8 lights.
    timed = points["maps_timed"].xs(ALL).groupby("budget").unique().map(list).to_dict()
    assert timed == {f"lights={count}": [2 if count == 8 else 1] for count in LIGHTS}
    ratio = points["seconds"] / want["seconds"]
    np.testing.assert_allclose(ratio[ALL], 10.0)
    np.testing.assert_allclose(ratio["uniform"], 10.0)
    # The other has more of the first map's, and none of that one budget.
    sun = ratio["sun"].drop("lights=8", level="budget")
    np.testing.assert_allclose(sun, 1.0)
    assert points.xs("lights=8", level="budget").loc["sun", "seconds"].isna().all()


def test_the_report_says_that_times_are_of_several_machines(tmp_path):
    run = grid_run(tmp_path, ("vase",), MAPS, SAMPLERS, errors, LIGHTS)
    for rows, said in ((on_two_machines(run.rows), True), (run.rows.assign(machine="x"), False)):
        told = [
            part.text for part in whom_to_choose(replace(run, rows=rows)) if hasattr(part, "text")
        ]
        assert any("do not compare between classes" in text for text in told) == said


def test_points_without_times_are_in_no_time(rows):
    points = convergence_points(on_two_machines(rows), by_scene=True)
    sun = points[points["class"].eq("sun") & points["sampler"].eq("mis")]
    untimed = sun[sun["seconds"].isna()]
    assert set(untimed["budget"]) == {"lights=8"}
    assert set(pareto_front(sun.assign(error=sun["rmse"]))["budget"]).isdisjoint({"lights=8"})
