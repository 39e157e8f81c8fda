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
    assert rows["spearman"].to_list() == pytest.approx([1.0, 1.0])
    assert (rows["maps"] == 2).all() and (rows["other_maps"] == 3).all()
    assert (rows["first"] == "a").all() and (rows["other_first"] == "a").all()
    assert "measured 2 times" in text and "2 times the same method is first" in text


def test_an_order_that_is_turned_round_is_told(tmp_path):
    text, rows = lines(run(tmp_path / "x", ("m1",)), run(tmp_path / "y", ("n1",), turned))
    assert rows["spearman"].to_dict() == pytest.approx({"RMSE": -1.0, "FLIP": 1.0})
    assert rows["other_first"].to_dict() == {"RMSE": "d", "FLIP": "a"}
    assert "is -1.00 to 1.00, median 0.00, and 1 time the same method is first" in text


def test_only_what_both_have_is_compared(tmp_path):
    """On the shared scene the other's order is turned round, on the scene of its own it is not."""

    def mixed(scene, *which):
        return (turned if scene == "vase" else in_order)(scene, *which)

    one = run(tmp_path / "x", ("m1",), scenes=("vase",), samplers=("a", "b", "c"))
    _, rows = lines(one, run(tmp_path / "y", ("n1",), mixed))
    assert rows.loc["RMSE", ["scenes", "methods"]].to_list() == ["vase", 3]
    assert rows.loc["RMSE", "spearman"] == pytest.approx(-1.0)


def test_methods_that_share_a_place_are_both_named(tmp_path):
    def tied(scene, environment, sampler, count):
        return max(0.2, in_order(scene, environment, sampler, count)[0]), 0.5

    text, rows = lines(run(tmp_path / "x", ("m1",), tied), run(tmp_path / "y", ("n1",)))
    assert rows["first"].to_dict() == {"RMSE": "a, b"}  # by FLIP there is no order
    assert "measured 1 time " in text and "1 time the same method is first" in text


@pytest.mark.parametrize("case", ["a map in common", "another size", "another experiment", "few"])
def test_other_pairs_are_not_compared(tmp_path, case):
    one = run(tmp_path / "x", ("m1", "m2"))
    other = run(tmp_path / "y", ("m2", "n1") if case == "a map in common" else ("n1",))
    if case == "another size":
        scale = other.record["scale"] | {"width": 640, "height": 480}
        other = replace(other, record=other.record | {"scale": scale})
    if case == "another experiment":
        other = replace(other, record=other.record | {"experiment": "else"})
    if case == "few":
        other = run(tmp_path / "y", ("n1",), samplers=SAMPLERS[:2])
    assert not list(on_other_maps([one, other]))
