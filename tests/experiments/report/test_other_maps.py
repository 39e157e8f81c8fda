"""Orders of methods on two sets of maps, whose errors are given."""

from dataclasses import replace

import pytest

from experiments.report.other_maps import on_other_maps
from experiments.report.parts import Items, Table
from tests.experiments.grid_rows import grid_run

SAMPLERS = ("a", "b", "c", "d")
SCENES = ("vase", "teapot")


def in_order(scene, environment, sampler, count):
    return 0.1 * (1 + SAMPLERS.index(sampler)), 0.2 * (1 + SAMPLERS.index(sampler))


def turned(*which):
    rmse, flip = in_order(*which)
    return 1.0 - rmse, flip


def run(folder, maps, errors=in_order, scenes=SCENES, samplers=SAMPLERS):
    return grid_run(folder, scenes, maps, samplers, errors)


def lines(*runs):
    _, items, table = on_other_maps(runs)
    assert isinstance(items, Items) and isinstance(table, Table)
    return " ".join(items.sentences), table.rows.set_index("metric")


def test_equal_orders_agree(tmp_path):
    text, rows = lines(run(tmp_path / "x", ("m1", "m2")), run(tmp_path / "y", ("n1", "n2", "n3")))
    assert rows["least"].to_list() == pytest.approx([1.0, 1.0])
    assert (rows["maps"] == 2).all() and (rows["other_maps"] == 3).all()
    assert (rows["same_first"] == 1).all()
    assert "compared 2 times" in text and "2 times the same method is first" in text


def test_an_order_that_is_turned_round_is_told(tmp_path):
    text, rows = lines(run(tmp_path / "x", ("m1",)), run(tmp_path / "y", ("n1",), turned))
    assert rows["median"].to_dict() == pytest.approx({"RMSE": -1.0, "FLIP": 1.0})
    assert rows["same_first"].to_dict() == {"RMSE": 0, "FLIP": 1}
    assert "is -1.00 to 1.00, median 0.00, and 1 time the same method is first" in text


def test_only_what_both_have_is_compared(tmp_path):
    """On the shared scene the other's order is turned round, on the scene of its own it is not."""

    def mixed(scene, *which):
        return (turned if scene == "vase" else in_order)(scene, *which)

    one = run(tmp_path / "x", ("m1",), scenes=("vase",), samplers=("a", "b", "c"))
    _, rows = lines(one, run(tmp_path / "y", ("n1",), mixed))
    assert rows.loc["RMSE", ["scenes", "methods"]].to_list() == ["vase", 3]
    assert rows.loc["RMSE", "least"] == pytest.approx(-1.0)


def test_methods_that_share_the_first_place_are_both_first(tmp_path):
    def tied(scene, environment, sampler, count):
        return max(0.2, in_order(scene, environment, sampler, count)[0]), 0.5

    def b_first(scene, environment, sampler, count):
        rmse, flip = in_order(scene, environment, sampler, count)
        return 0.05 if sampler == "b" else rmse, flip

    text, rows = lines(run(tmp_path / "x", ("m1",), tied), run(tmp_path / "y", ("n1",), b_first))
    assert rows["same_first"].to_dict() == {"RMSE": 1}  # by FLIP there is no order
    assert "compared 1 time " in text and "1 time the same method is first" in text


def test_a_line_is_of_all_budgets_that_both_have(tmp_path):
    """Another experiment is compared, too: what a method is does not depend on it."""

    def turned_at_8(scene, environment, sampler, count):
        return (turned if count == 8 else in_order)(scene, environment, sampler, count)

    one = grid_run(tmp_path / "x", SCENES, ("m1",), SAMPLERS, in_order, lights=(4, 8))
    two = grid_run(tmp_path / "y", SCENES, ("n1",), SAMPLERS, turned_at_8, lights=(4, 8, 16))
    two = replace(two, record=two.record | {"experiment": "else"})
    text, rows = lines(one, two)
    assert rows["compared"].to_dict() == {"RMSE": 2, "FLIP": 2}
    assert rows["least"].to_dict() == pytest.approx({"RMSE": -1.0, "FLIP": 1.0})
    assert rows["median"].to_dict() == pytest.approx({"RMSE": 0.0, "FLIP": 1.0})
    assert "compared 4 times" in text


@pytest.mark.parametrize("case", ["a map in common", "another size", "other scenes", "few"])
def test_other_pairs_are_not_compared(tmp_path, case):
    one = run(tmp_path / "x", ("m1", "m2"))
    other = run(tmp_path / "y", ("m2", "n1") if case == "a map in common" else ("n1",))
    if case == "another size":
        scale = other.record["scale"] | {"width": 640, "height": 480}
        other = replace(other, record=other.record | {"scale": scale})
    if case == "other scenes":
        other = run(tmp_path / "y", ("n1",), scenes=("birdcage",))
    if case == "few":
        other = run(tmp_path / "y", ("n1",), samplers=SAMPLERS[:2])
    assert not list(on_other_maps([one, other]))
