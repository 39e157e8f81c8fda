"""What published runs say together, where errors are given: papers' orders, and elsewhere."""

from dataclasses import replace

import pytest

from experiments.report.across_runs import elsewhere
from experiments.report.parts import Table
from tests.experiments.grid_rows import grid_run

SAMPLERS = ("a", "b", "c", "d")
SCENE = ("vase",)


def in_order(scene, environment, sampler, count):
    return 0.1 * (1 + SAMPLERS.index(sampler)), 0.2 * (1 + SAMPLERS.index(sampler))


def turned(*which):
    rmse, flip = in_order(*which)
    return 1.0 - rmse, flip


def run(folder, maps=("m1", "m2"), errors=in_order, scenes=SCENE, samplers=SAMPLERS, lights=(16,)):
    return grid_run(folder, scenes, maps, samplers, errors, lights)


def large(run):
    return replace(run, record=run.record | {"scale": {"width": 640, "height": 480}})


def lines(between, *runs):
    """The lines of one kind, by metric; none where there is none."""
    tables = [part for part in elsewhere(runs) if isinstance(part, Table)]
    rows = tables[0].rows if tables else None
    return {} if rows is None else rows[rows["between"] == between].set_index("metric").T.to_dict()


def test_orders_on_two_sets_of_maps_are_compared_at_all_budgets_of_both(tmp_path):
    """Another experiment is compared, too: what a method is does not depend on it."""

    def turned_at_8(scene, environment, sampler, count):
        return (turned if count == 8 else in_order)(scene, environment, sampler, count)

    one = run(tmp_path / "x", ("m1",), lights=(4, 8))
    two = run(tmp_path / "y", ("n1",), turned_at_8, lights=(4, 8, 16))
    found = lines("maps", one, replace(two, record=two.record | {"experiment": "else"}))
    assert found["RMSE"] == {
        "between": "maps", "runs": 1, "compared": 2, "median": pytest.approx(0.0),
        "least": pytest.approx(-1.0), "of": "x, y", "same_first": 1, "moved": "a (1.0, 4.0)",
    }  # fmt: skip
    assert (found["FLIP"]["least"], found["FLIP"]["same_first"]) == (pytest.approx(1.0), 2)


def test_only_scenes_and_methods_that_both_have_are_compared(tmp_path):
    """On the shared scene the other's order is turned round, on the scene of its own it is not."""

    def mixed(scene, *which):
        return (turned if scene == "vase" else in_order)(scene, *which)

    one = run(tmp_path / "x", ("m1",), samplers=SAMPLERS[:3])
    two = run(tmp_path / "y", ("n1",), mixed, scenes=("vase", "teapot"))
    assert lines("maps", one, two)["RMSE"]["least"] == pytest.approx(-1.0)


def test_methods_that_share_the_first_place_are_both_first(tmp_path):
    def tied(scene, environment, sampler, count):
        return max(0.2, in_order(scene, environment, sampler, count)[0]), 0.5

    def b_first(scene, environment, sampler, count):
        rmse, flip = in_order(scene, environment, sampler, count)
        return 0.05 if sampler == "b" else rmse, flip

    found = lines("maps", run(tmp_path / "x", ("m1",), tied), run(tmp_path / "y", ("n1",), b_first))
    assert set(found) == {"RMSE"}  # by FLIP there is no order
    assert found["RMSE"]["same_first"] == 1


def test_runs_without_a_scene_in_common_are_compared_under_their_common_maps(tmp_path):
    """Under the map that only one of them has its order is another."""

    def turned_under_m1(scene, environment, *which):
        rmse, flip = in_order(scene, environment, *which)
        return (9.0 - rmse if environment == "m1" else rmse), flip

    one = run(tmp_path / "x", errors=turned_under_m1)
    other = run(tmp_path / "y", ("m2", "m3"), scenes=("teapot",), samplers=SAMPLERS[:3])
    found = lines("scenes", one, other)["RMSE"]
    assert (found["of"], found["compared"]) == ("x, y", 1)
    assert found["least"] == pytest.approx(1.0)
    assert not lines("scenes", one, large(other))


def test_a_case_that_one_of_them_has_in_part_is_left_out(tmp_path):
    """Of m2, where the order is turned round, one method has no row in the large images."""

    def turned_under_m2(scene, environment, *which):
        return (turned if environment == "m2" else in_order)(scene, environment, *which)

    small, other = run(tmp_path / "x", errors=turned_under_m2), large(run(tmp_path / "y"))
    lost = (other.rows["environment"] == "m2") & (other.rows["sampler"] == "c")
    found = lines("image sizes", small, replace(other, rows=other.rows[~lost]))
    assert found["RMSE"]["least"] == pytest.approx(1.0)


@pytest.mark.parametrize(
    "case", ["a map in common", "another size", "other scenes", "few", "no order", "seconds"]
)
def test_where_more_or_nothing_differs_nothing_is_compared(tmp_path, case):
    def equal(*which):
        return 0.5, 0.5

    one = run(tmp_path / "x")
    other = run(
        tmp_path / "y",
        ("m2", "n1") if case == "a map in common" else ("n1",),
        equal if case == "no order" else in_order,
        ("birdcage",) if case == "other scenes" else SCENE,
        SAMPLERS[:2] if case == "few" else SAMPLERS,
    )
    if case == "another size":
        other = large(other)
    if case == "seconds":
        one, other = (timed(one), timed(large(run(tmp_path / "y"))))
    assert not list(elsewhere([one, other]))


def timed(run):
    return replace(
        run,
        rows=run.rows.assign(budget="seconds=1"),
        record=run.record | {"budgets": ["seconds=1"]},
    )
