"""References are taken from run folders beside, and only those that are what they should be."""

import shutil

import pytest

from experiments import measure
from experiments.measure import ReferenceTask, reference_path
from experiments.runner import run_cells
from experiments.shared_references import take_reference
from experiments.store import Store


@pytest.fixture
def runs(finished, tmp_path):
    """A folder with a complete run in it."""
    shutil.copytree(finished, tmp_path / "runs" / "other")
    return tmp_path / "runs"


def test_a_run_takes_what_one_beside_it_has(runs, finished, cells_of, monkeypatch):
    cells = cells_of(("noise",), ("uniform",))
    monkeypatch.setattr(measure, "render_reference", None)  # would fail where it is called
    with Store.writing(runs / "mine") as store:
        assert run_cells(store, cells, beside=runs).measured == 1
        row = store.get("reference", cells[0].block.key)
    with Store.reading(finished) as store:
        assert row == store.get("reference", cells[0].block.key)
    mine = reference_path(runs / "mine", cells[0].block)
    assert mine.read_bytes() == reference_path(finished, cells[0].block).read_bytes()


@pytest.mark.parametrize("damage", ["image", "row", "database"])
def test_damaged_ones_are_left_alone(runs, cells_of, damage):
    block = cells_of(("noise",), ("uniform",))[0].block
    other = runs / "other"
    if damage == "image":
        path = reference_path(other, block)
        path.write_bytes(path.read_bytes()[:-20])
    elif damage == "row":
        with Store.writing(other) as store:
            store._connection.execute("DELETE FROM reference")
    else:
        (other / "results.sqlite").write_bytes(b"no database, though as long as one" * 9)
    assert take_reference(ReferenceTask(block, str(runs / "mine")), str(runs)) is None
    assert not (runs / "mine").exists()


def test_a_missing_neighbourhood_is_no_error(tmp_path, cells_of):
    task = ReferenceTask(cells_of(("noise",))[0].block, str(tmp_path / "mine"))
    assert take_reference(task, str(tmp_path / "nowhere")) is None
