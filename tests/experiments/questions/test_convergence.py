"""Run time against error: points, slopes, fronts and choices of rows whose laws are known."""

import csv
import math

import numpy as np
import pandas as pd
import pytest

from experiments.questions import convergence
from experiments.questions.convergence_tables import (
    ALL,
    advice,
    choices,
    convergence_points,
    fronts,
    slopes,
    time_steps,
    times_to_reach,
)
from experiments.report import figures
from tests.experiments.grid_rows import contents, grid_run

LIGHTS = (4, 8, 16, 32, 64)
MAPS = ("noon-desert", "constant")
SAMPLERS = ("mis", "ours")


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


def test_points_are_means_over_scenes_and_maps(rows):
    points = convergence_points(rows).set_index(["class", "sampler", "budget"])
    assert points.loc[("sun", "mis", "lights=8"), "rmse"] == pytest.approx(1.0)
    assert points.loc[(ALL, "mis", "lights=8"), "rmse"] == pytest.approx(0.75)
    assert points.loc[(ALL, "mis", "lights=8"), "maps"] == 2
    assert points.loc[(ALL, "ours", "lights=8"), "seconds"] == pytest.approx(0.004 + 0.008)
    assert not points["near_floor"].any()


def test_slopes_are_those_of_the_laws(rows):
    table = slopes(convergence_points(rows)).set_index(["class", "sampler", "error", "cost"])
    assert table.loc[("sun", "mis", "rmse", "lights"), "slope"] == pytest.approx(-1.0)
    assert table.loc[(ALL, "ours", "flip", "rays"), "slope"] == pytest.approx(-0.5)
    assert (table["points"] == len(LIGHTS)).all()


def test_no_slope_goes_through_points_near_the_noise_floor(rows):
    rows = rows.assign(noise_floor=0.1)
    points = convergence_points(rows)
    assert (points["near_floor"] == (points["rmse"] < 0.3)).all() and points["near_floor"].any()
    table = slopes(points).set_index(["class", "sampler", "error", "cost"])
    # MIS on the constant map: 4 / N is above 0.3 at 4 and 8 lights alone.
    assert math.isnan(table.loc[("uniform", "mis", "rmse", "lights"), "slope"])
    assert table.loc[("uniform", "mis", "rmse", "lights"), "points"] == 2


def test_nothing_beats_a_point_of_the_front(rows):
    points = convergence_points(rows, by_scene=True)
    front = fronts(points)
    part = front[(front["class"] == "sun") & (front["scene"] == "vase")]
    part = part[part["measure"] == "rmse"]
    everything = points[(points["class"] == "sun") & (points["scene"] == "vase")]
    for _, best in part.iterrows():
        faster = everything[everything["seconds"] <= best["seconds"]]
        assert faster["rmse"].min() == best["value"]
    assert set(part["sampler"]) == {"mis", "ours"}


def test_times_to_reach_an_error_lie_between_the_points(rows):
    table = times_to_reach(convergence_points(rows), [0.25, 1e-9])
    table = table.set_index(["class", "sampler", "flip"])
    # Constant map: ours has FLIP 0.5 / √N, 0.25 at 4 lights, its first point, 4 ms to render.
    assert table.loc[("uniform", "ours", 0.25), "seconds_render"] == pytest.approx(0.004)
    # MIS has 2 / N: 0.25 at 8 lights, 8 ms to render and 2 ms for its lights.
    assert table.loc[("uniform", "mis", 0.25), "seconds_render"] == pytest.approx(0.008)
    assert table.loc[("uniform", "mis", 0.25), "seconds"] == pytest.approx(0.010)
    assert np.isinf(table.xs(1e-9, level="flip")["seconds"]).all()


def test_the_best_in_a_given_time_is_the_least_error_within_it(rows):
    points = convergence_points(rows)
    assert time_steps(points) == pytest.approx([0.005, 0.01, 0.02, 0.05, 0.1])
    chosen = choices(points)
    part = chosen[(chosen["class"] == "sun") & (chosen["time"] == "seconds_render")]
    by_time = part[part["error"] == "rmse"].set_index("within")["sampler"].to_dict()
    # 4 and 8 lights: ours; 16, which both reach within 20 ms: equal, so the first of the faster;
    # 32 and more: MIS.
    assert by_time[0.005] == by_time[0.01] == "ours" and by_time[0.1] == by_time[0.05] == "mis"
    words = advice(part, "seconds_render", "rmse")
    assert words[0].startswith("sun: **ours** with 5 ms to ")
    assert "**mis** with" in words[0] and words[0].endswith(" to 100 ms or more.")


def run_in(folder, maps=MAPS):
    folder.mkdir()
    return grid_run(folder, ("vase",), maps, SAMPLERS, errors, LIGHTS)


def test_reports_have_the_same_bytes(tmp_path):
    for name in ("one", "two"):
        convergence.report(run_in(tmp_path / name, MAPS[:1]))
    first = contents(tmp_path / "one")
    assert first == contents(tmp_path / "two")
    assert {"report.md", "flip_seconds.svg", "rmse_rays.png", "pareto_flip_vase.svg"} < set(first)


def test_classes_of_unknown_maps_are_kept_with_the_run(tmp_path, monkeypatch):
    monkeypatch.setattr(figures, "SUFFIXES", ("svg",))
    run = run_in(tmp_path / "run", ("mine", "constant"))
    convergence.report(run, {"mine": "contrast above 10⁴", "constant": "uniform"})
    with (run.folder / "classes.csv").open(encoding="utf-8", newline="") as file:
        assert {line["environment"]: line["class"] for line in csv.DictReader(file)} == {
            "mine": "contrast above 10⁴", "constant": "uniform",
        }  # fmt: skip
    before = contents(run.folder)
    convergence.report(run)
    assert contents(run.folder) == before
    assert "contrast above 10⁴" in (run.folder / "report.md").read_text(encoding="utf-8")
