"""A new or changed metric scores the images that are kept, and renders nothing."""

import shutil

import numpy as np
import pytest

from experiments.cli.commands import finish
from experiments.run import rendering
from experiments.run.kept_images import image_path, link_image, stored_image
from experiments.run.measurement import Measurement
from experiments.run.store import FEATURES, IMAGE, Store
from experiments.wu2025.table1 import table1
from metrics import registry
from metrics.registry import Metric, register
from tests.experiments.stored import (
    alter_result,
    damage,
    forget,
    forget_scores,
    run_measurements,
    run_plan,
)


@pytest.fixture
def third_metric():
    mean = lambda image, truth: float(np.abs(image - truth.image).mean())  # noqa: E731
    register(Metric("mean_error", "mean error", mean, ranked=True))
    yield "mean_error"
    del registry._registry["mean_error"]


def held(store):
    return [(one.result, one.scores) for one in store.results(IMAGE)]


def anew(measurements):
    """The same, with nothing computed yet."""
    return [Measurement(m.case, m.sampler, m.budget, m.seed) for m in measurements]


def test_a_new_metric_stands_in_rows_and_report_and_nothing_is_rendered(
    copied, grid, monkeypatch, third_metric, capsys
):
    monkeypatch.setattr(rendering, "render", None)  # would fail where it is called
    monkeypatch.setattr(rendering, "render_reference", None)
    measurements = anew(grid.measurements())

    def finish_all(experiment, run, outcome):
        assert (outcome.measured, outcome.stored, outcome.failures) == (25, 0, [])
        assert (run.rows["mean_error"] >= 0.0).all()
        finish(experiment, run, outcome, images=False)

    with Store.writing(copied) as store:
        before = held(store)
        assert run_plan(table1(), store, measurements, finish_all) == 0
        for (result, scores), (earlier, fewer) in zip(held(store), before, strict=True):
            assert result == earlier and fewer.items() <= scores.items()
            assert len(scores) == len(fewer) + 1
    assert "mean error" in (copied / "report.md").read_text(encoding="utf-8")
    assert "mean error" in (copied / "summary.tex").read_text(encoding="utf-8")
    assert "mean error" in capsys.readouterr().out


def test_scores_made_later_equal_those_made_at_once(copied, grid):
    measurements = anew(grid.measurements())
    with Store.writing(copied) as store:
        before = held(store)
        for one in measurements:
            forget_scores(store, one.key)
        assert run_measurements(store, measurements).measured == len(measurements)
        assert held(store) == before


@pytest.mark.parametrize("how", ["missing", "cut short", "altered"])
def test_an_image_that_is_lost_is_rendered_again_and_its_row_stays(copied, measurements_of, how):
    (one,) = measurements_of(("noise",), ("uniform",))
    with Store.writing(copied) as store:
        image = stored_image(store.folder, one.key)
        whole = image.read_bytes()
        damage(image, how)
        row, scores = store.get(one.key).result, store.get(one.key).scores
        forget_scores(store, one.key, one.case.score_keys["rmse"])
        assert run_measurements(store, [one]).measured == 1
        assert (store.get(one.key).result, store.get(one.key).scores) == (row, scores)
        image_path(copied, one).write_bytes(b"rendered before, within one tick of the clock")
        shutil.copystat(image, image_path(copied, one))
        link_image(store.folder, copied, one)
        assert image.read_bytes() == image_path(copied, one).read_bytes() == whole


def test_an_image_that_comes_out_differently_is_refused(copied, measurements_of):
    (one,) = measurements_of(("noise",), ("uniform",))
    with Store.writing(copied) as store:
        alter_result(store, one.key, pixels="other")
        forget_scores(store, one.key, one.case.score_keys["rmse"])
        stored_image(store.folder, one.key).unlink()
        (failure,) = run_measurements(store, [one]).failures
    assert "its image was lost, and rendering it again gives another one" in failure


def test_features_of_map_and_scene_stand_in_every_row(finished):
    with Store.reading(finished) as store:
        rows = list(store.rows(store.plan))
    for row in rows:
        for prefix, least in (("map_", 6), ("scene_", 2)):
            found = {name: value for name, value in row.items() if name.startswith(prefix)}
            assert len(found) >= least and np.isfinite(list(found.values())).all()


def test_features_that_are_missing_are_measured_and_nothing_is_rendered(copied, grid, monkeypatch):
    monkeypatch.setattr(rendering, "render", None)
    measurements = anew(grid.measurements())
    with Store.writing(copied) as store:
        before = {one.key: one.result for one in store.results(FEATURES)}
        keys = {key for one in measurements for key in one.case.features_keys.values()}
        assert len(keys) == 6  # of five maps and a scene
        for key in keys:
            forget(store, key)
        assert run_measurements(store, measurements).measured == len(measurements)
        assert {one.key: one.result for one in store.results(FEATURES)} == before
