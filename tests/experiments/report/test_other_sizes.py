"""Orders of methods in images of two sizes, whose errors are given."""

from dataclasses import replace

import pytest

from experiments.report.other_sizes import in_other_sizes
from experiments.report.parts import Items, Table
from tests.experiments.grid_rows import grid_run

SAMPLERS = ("a", "b", "c", "d")
SCENES = ("vase", "teapot")
MAPS = ("m1", "m2")


def in_order(scene, environment, sampler, count):
    return 0.1 * (1 + SAMPLERS.index(sampler)), 0.2 * (1 + SAMPLERS.index(sampler))


def run(folder, errors=in_order, scenes=SCENES, maps=MAPS, samplers=SAMPLERS, lights=(8, 16)):
    return grid_run(folder, scenes, maps, samplers, errors, lights)


def large(run):
    return replace(run, record=run.record | {"scale": {"width": 640, "height": 480}})


def lines(*runs):
    _, items, table = in_other_sizes(runs)
    assert isinstance(items, Items) and isinstance(table, Table)
    return " ".join(items.sentences), table.rows.set_index("metric")


def test_the_smaller_images_stand_first_and_every_budget_is_compared(tmp_path):
    def worst_is_best_at_8(scene, environment, sampler, count):
        rmse, flip = in_order(scene, environment, sampler, count)
        return (0.05 if (sampler, count) == ("d", 8) else rmse), flip

    text, rows = lines(large(run(tmp_path / "x", worst_is_best_at_8)), run(tmp_path / "y"))
    assert rows.loc["RMSE", ["run", "images", "other", "its_images"]].to_list() == [
        "y", "112×84", "x", "640×480",
    ]  # fmt: skip
    assert (rows["maps"] == 2).all() and (rows["compared"] == 2).all()
    # Ranks 1 2 3 4 beside 2 3 4 1: 1 - 6 (1 + 1 + 1 + 9) / (4 · 15).
    assert rows["least"].to_dict() == pytest.approx({"RMSE": -0.2, "FLIP": 1.0})
    assert rows["median"].to_dict() == pytest.approx({"RMSE": 0.4, "FLIP": 1.0})
    assert rows["same_first"].to_dict() == {"RMSE": 1, "FLIP": 2}
    assert rows.loc["RMSE", "moved"] == "d (4.0, 1.0)"
    assert "were compared 4 times between images of two sizes" in text
    assert "3 times the same method is first" in text


def test_only_cases_and_methods_that_both_have_are_compared(tmp_path):
    """Elsewhere the order is turned round."""

    def elsewhere(scene, environment, sampler, count):
        rmse, flip = in_order(scene, environment, sampler, count)
        common = (scene, environment) == ("vase", "m1")
        return (rmse, flip) if common else (9.0 - rmse, 9.0 - flip)

    other = run(tmp_path / "y", elsewhere, ("vase",), ("m1", "m3"), SAMPLERS[:3])
    _, rows = lines(run(tmp_path / "x", elsewhere), large(other))
    assert rows.loc["RMSE", ["scenes", "maps", "methods"]].to_list() == ["vase", 1, 3]
    assert rows["least"].to_list() == pytest.approx([1.0, 1.0])


def test_a_case_that_one_of_them_has_in_part_is_left_out(tmp_path):
    """Of the map m2 one method has no row in the large images: no map is left but m1."""
    small, other = run(tmp_path / "x"), large(run(tmp_path / "y"))
    lost = (other.rows["environment"] == "m2") & (other.rows["sampler"] == "c")
    _, rows = lines(small, replace(other, rows=other.rows[~lost]))
    assert rows["maps"].to_list() == [1, 1] and rows["methods"].to_list() == [4, 4]


@pytest.mark.parametrize("case", ["one size", "no case", "no budget", "seconds"])
def test_other_pairs_are_not_compared(tmp_path, case):
    one, other = run(tmp_path / "x", lights=(8,)), large(run(tmp_path / "y", lights=(8,)))
    if case == "one size":
        other = run(tmp_path / "y", lights=(8,))
    if case == "no case":
        other = large(run(tmp_path / "y", maps=("n1",), lights=(8,)))
    if case == "no budget":
        other = large(run(tmp_path / "y", lights=(16,)))
    if case == "seconds":
        one, other = (timed(one), timed(other))
    assert not list(in_other_sizes([one, other]))


def timed(run):
    return replace(
        run,
        rows=run.rows.assign(budget="seconds=1"),
        record=run.record | {"budgets": ["seconds=1"]},
    )
