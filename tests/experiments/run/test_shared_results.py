"""Results are taken from run folders beside, and only those that are what they should be."""

import shutil

import pytest

from experiments.run import rendering
from experiments.run.kept_images import image_path, reference_path
from experiments.run.runner import run_measurements
from experiments.run.shared_results import take_reference
from experiments.run.store import Store


@pytest.fixture
def runs(finished, tmp_path):
    """A folder with a complete run in it."""
    shutil.copytree(finished, tmp_path / "runs" / "other")
    return tmp_path / "runs"


@pytest.mark.parametrize("images", [True, False])
def test_a_run_measures_nothing_that_one_beside_it_has(
    runs, finished, measurements_of, monkeypatch, images
):
    measurements = measurements_of(("noise",), ("uniform", "mis"))
    monkeypatch.setattr(rendering, "render_reference", None)  # would fail where it is called
    monkeypatch.setattr(rendering, "render", None)
    with Store.writing(runs / "mine") as store:
        outcome = run_measurements(store, measurements, keep_images=images, beside=runs)
        assert (outcome.measured, outcome.stored, outcome.failures) == (0, len(measurements), [])
        mine = [store.get("reference", measurements[0].case.reference_key)]
        mine += [store.get("image", measurement.key) for measurement in measurements]
    with Store.reading(finished) as store:
        assert mine[0] == store.get("reference", measurements[0].case.reference_key)
        assert mine[1:] == [store.get("image", measurement.key) for measurement in measurements]
    path = reference_path(runs / "mine", measurements[0].case)
    assert path.read_bytes() == reference_path(finished, measurements[0].case).read_bytes()
    there = [image_path(runs / "mine", one).is_file() for one in measurements]
    assert there == [images] * len(measurements)


def test_a_measurement_whose_image_is_missing_is_measured_where_images_are_kept(
    runs, measurements_of
):
    measurements = measurements_of(("noise",), ("uniform",))
    image_path(runs / "other", measurements[0]).unlink()
    with Store.writing(runs / "mine") as store:
        assert run_measurements(store, measurements, keep_images=True, beside=runs).measured == 1
    with Store.writing(runs / "without") as store:
        assert run_measurements(store, measurements, keep_images=False, beside=runs).measured == 0


def test_measurements_without_their_reference_are_measured(runs, measurements_of):
    measurements = measurements_of(("noise",), ("uniform",))
    reference_path(runs / "other", measurements[0].case).unlink()
    with Store.writing(runs / "mine") as store:
        assert run_measurements(store, measurements, beside=runs).measured == 1


@pytest.mark.parametrize("damage", ["image", "row", "database"])
def test_damaged_ones_are_left_alone(runs, measurements_of, damage):
    case = measurements_of(("noise",), ("uniform",))[0].case
    other = runs / "other"
    if damage == "image":
        path = reference_path(other, case)
        path.write_bytes(path.read_bytes()[:-20])
    elif damage == "row":
        with Store.writing(other) as store:
            store._connection.execute("DELETE FROM reference")
    else:
        (other / "results.sqlite").write_bytes(b"no database, though as long as one" * 9)
    assert take_reference(case, runs / "mine", runs) is None
    assert not (runs / "mine").exists()


def test_a_missing_neighbourhood_is_no_error(tmp_path, measurements_of):
    case = measurements_of(("noise",))[0].case
    assert take_reference(case, tmp_path / "mine", tmp_path / "nowhere") is None
