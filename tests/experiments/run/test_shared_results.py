"""Results are taken from run folders beside, and only those that are what they should be."""

import shutil

import pytest

from experiments.run import measure
from experiments.run.measure import ReferenceTask, image_path, reference_path
from experiments.run.runner import run_cells
from experiments.run.shared_results import take_reference
from experiments.run.store import Store


@pytest.fixture
def runs(finished, tmp_path):
    """A folder with a complete run in it."""
    shutil.copytree(finished, tmp_path / "runs" / "other")
    return tmp_path / "runs"


@pytest.mark.parametrize("images", [True, False])
def test_a_run_measures_nothing_that_one_beside_it_has(
    runs, finished, cells_of, monkeypatch, images
):
    cells = cells_of(("noise",), ("uniform", "mis"))
    monkeypatch.setattr(measure, "render_reference", None)  # would fail where it is called
    monkeypatch.setattr(measure, "render", None)
    with Store.writing(runs / "mine") as store:
        outcome = run_cells(store, cells, keep_images=images, beside=runs)
        assert (outcome.measured, outcome.stored, outcome.failures) == (0, len(cells), [])
        mine = [store.get("reference", cells[0].block.key)]
        mine += [store.get("cell", cell.key) for cell in cells]
    with Store.reading(finished) as store:
        assert mine[0] == store.get("reference", cells[0].block.key)
        assert mine[1:] == [store.get("cell", cell.key) for cell in cells]
    path = reference_path(runs / "mine", cells[0].block)
    assert path.read_bytes() == reference_path(finished, cells[0].block).read_bytes()
    first = [cell for cell in cells if cell.seed == 0]
    assert all(image_path(runs / "mine", cell).is_file() == images for cell in first)


def test_a_cell_whose_image_is_missing_is_measured_where_images_are_kept(runs, cells_of):
    cells = cells_of(("noise",), ("uniform",))
    image_path(runs / "other", cells[0]).unlink()
    with Store.writing(runs / "mine") as store:
        assert run_cells(store, cells, keep_images=True, beside=runs).measured == 1
    with Store.writing(runs / "without") as store:
        assert run_cells(store, cells, keep_images=False, beside=runs).measured == 0


def test_cells_without_their_reference_are_measured(runs, cells_of):
    cells = cells_of(("noise",), ("uniform",))
    reference_path(runs / "other", cells[0].block).unlink()
    with Store.writing(runs / "mine") as store:
        assert run_cells(store, cells, beside=runs).measured == 1


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
    assert take_reference(ReferenceTask(block, str(runs / "mine")), runs) is None
    assert not (runs / "mine").exists()


def test_a_missing_neighbourhood_is_no_error(tmp_path, cells_of):
    task = ReferenceTask(cells_of(("noise",))[0].block, str(tmp_path / "mine"))
    assert take_reference(task, tmp_path / "nowhere") is None
