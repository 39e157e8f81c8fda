"""What is left: nothing of what the folder holds, or a folder beside it, but times."""

import shutil
from dataclasses import replace

import pytest

from experiments.run.budget import Budget
from experiments.run.kept_images import image_path, reference_path
from experiments.run.left import left_to_do
from experiments.run.store import DATABASE, Store, StoreError


def counts(measurements, folder, images=True) -> tuple[int, int]:
    left = left_to_do(measurements, folder, images)
    return len(left.measurements), left.references


def test_all_is_left_where_nothing_is_stored(grid, tmp_path):
    assert counts(grid.measurements(), tmp_path / "runs" / "run") == (25, 5)
    assert list(tmp_path.iterdir()) == []


def test_nothing_is_left_of_a_finished_run(grid, copied):
    assert counts(grid.measurements(), copied) == (0, 0)


def test_a_row_without_a_score_is_left_and_its_reference_is_not(grid, copied):
    one = grid.measurements()[3]
    with Store.writing(copied) as store:
        key = next(iter(one.score_keys.values()))
        store._connection.execute("DELETE FROM score WHERE key = ?", (key,))
    assert left_to_do(grid.measurements(), copied, True).measurements == [one]
    assert counts(grid.measurements(), copied) == (1, 0)


def test_a_run_beside_is_taken(grid, copied):
    mine, measurements = copied.parent / "mine", grid.measurements()
    assert counts(measurements, mine) == (0, 0)
    image_path(copied, measurements[0]).unlink()
    assert counts(measurements, mine) == (1, 0)
    assert counts(measurements, mine, images=False) == (0, 0)


def test_without_its_reference_a_row_beside_is_of_no_use(grid, copied):
    measurements = grid.measurements()
    case = measurements[0].case
    reference_path(copied, case).unlink()
    mine = sum(one.case == case for one in measurements)
    assert counts(measurements, copied.parent / "mine", images=False) == (mine, 1)


def test_times_are_measured_again(grid, copied):
    timed = replace(grid, budgets=(Budget(0.1, "seconds"),)).measurements()
    assert counts(timed, copied.parent / "mine") == (25, 0)


def test_own_results_that_are_damaged_are_told(grid, copied):
    (copied / DATABASE).write_bytes(b"no database" * 100)
    with pytest.raises(StoreError, match="damaged"):
        left_to_do(grid.measurements(), copied, True)


def test_a_damaged_folder_beside_is_of_no_use(grid, copied):
    shutil.copytree(copied, copied.parent / "broken")
    (copied.parent / "broken" / DATABASE).write_bytes(b"no database" * 100)
    assert counts(grid.measurements(), copied.parent / "mine") == (0, 0)
