"""Orders of methods on two scenes, whose errors are given."""

from dataclasses import replace

import pytest

from experiments.report.other_scenes import on_other_scenes
from experiments.report.parts import Items, Table
from tests.experiments.grid_rows import grid_run

SAMPLERS = ("a", "b", "c", "d")


def in_order(scene, environment, sampler, count):
    return 0.1 * (1 + SAMPLERS.index(sampler)), 0.2 * (1 + SAMPLERS.index(sampler))


def turned_on_teapot(scene, *which):
    rmse, flip = in_order(scene, *which)
    return 1.0 - rmse if scene == "teapot" else rmse, flip


def run(folder, scenes, maps=("m1", "m2"), errors=in_order, samplers=SAMPLERS, lights=(16,)):
    return grid_run(folder, scenes, maps, samplers, errors, lights)


def lines(*runs):
    _, items, table = on_other_scenes(runs)
    assert isinstance(items, Items) and isinstance(table, Table)
    return " ".join(items.sentences), table.rows


def test_the_scenes_of_a_run_are_compared_two_by_two(tmp_path):
    scenes, lights = ("vase", "teapot", "birdcage"), (8, 16)
    text, rows = lines(run(tmp_path / "x", scenes, errors=turned_on_teapot, lights=lights))
    found = rows.set_index("metric").loc["RMSE"]
    assert found[["maps", "methods", "compared"]].to_list() == [2, 4, 6]
    assert found["least"] == pytest.approx(-1.0) and found["median"] == pytest.approx(-1.0)
    assert found["same_first"] == 2  # of birdcage and vase at both budgets
    assert rows.set_index("metric").loc["FLIP", "least"] == pytest.approx(1.0)
    assert "were compared 12 times between two scenes" in text
    assert "is -1.00 to 1.00, median 1.00, and 8 times the same method is first" in text


def test_runs_without_a_scene_in_common_are_compared_under_their_common_maps(tmp_path):
    """Under the map that only one of them has its order is another."""

    def turned_under_m1(scene, environment, *which):
        rmse, flip = in_order(scene, environment, *which)
        return (9.0 - rmse if environment == "m1" else rmse), flip

    one = run(tmp_path / "x", ("vase",), errors=turned_under_m1)
    _, rows = lines(one, run(tmp_path / "y", ("teapot",), maps=("m2", "m3"), samplers=SAMPLERS[:3]))
    found = rows.set_index("metric").loc["RMSE"]
    assert found[["run", "scenes"]].to_list() == ["x, y", "teapot, vase"]
    assert found[["maps", "methods", "compared"]].to_list() == [1, 3, 1]
    assert found["least"] == pytest.approx(1.0) and found["same_first"] == 1


@pytest.mark.parametrize(
    "case", ["one scene", "the same scene", "other maps", "another size", "few", "no order"]
)
def test_nothing_is_said_where_nothing_can_be_compared(tmp_path, case):
    def equal(scene, *which):
        return (0.5, 0.5) if scene == "teapot" else in_order(scene, *which)

    one = run(tmp_path / "x", ("vase",))
    other = run(
        tmp_path / "y",
        ("vase",) if case in ("one scene", "the same scene") else ("teapot",),
        maps=("n1",) if case == "other maps" else ("m1", "m2"),
        samplers=SAMPLERS[:2] if case == "few" else SAMPLERS,
        errors=equal if case == "no order" else in_order,
    )
    if case == "another size":
        scale = other.record["scale"] | {"width": 640, "height": 480}
        other = replace(other, record=other.record | {"scale": scale})
    assert not list(on_other_scenes([one] if case == "one scene" else [one, other]))
