"""The same bits for any number of threads, in processes, and after a stop."""

from dataclasses import replace

import pytest

from experiments.run.budget import Budget
from experiments.run.sampler_spec import SamplerSpec
from experiments.run.store import IMAGE, Store
from samplers import sampler_names
from samplers.threads import set_thread_count, thread_count
from tests.experiments.stored import run_measurements, untimed


@pytest.fixture(scope="module")
def measurements(grid):
    """Every sampler on a map with a sun, at a budget that all can meet."""
    sun = tuple(source for source in grid.environments if source.name == "sun")
    specs = tuple(map(SamplerSpec, sampler_names()))
    return replace(grid, environments=sun, samplers=specs, budgets=(Budget(16),)).measurements()


def measured(folder, measurements, executor=None):
    """Rows without what depends on the machine, and the bytes of all images."""
    with Store.writing(folder / "run") as store:
        assert run_measurements(store, measurements, executor).failures == []
        images = {
            path.relative_to(store.folder): path.read_bytes()
            for path in store.folder.rglob("*.exr")
        }
        scores = {one.key: one.scores for one in store.results(IMAGE)}
        rows = untimed(store)
    assert len(images) > len(sampler_names())
    return rows, scores, images


@pytest.fixture(scope="module")
def on_one_thread(measurements, tmp_path_factory):
    before = thread_count()
    set_thread_count(1)
    yield measured(tmp_path_factory.mktemp("one"), measurements)
    set_thread_count(before)


def test_threads_do_not_matter(on_one_thread, measurements, tmp_path):
    set_thread_count(3)
    assert measured(tmp_path, measurements) == on_one_thread


def test_a_stop_and_the_order_do_not_matter(on_one_thread, measurements, tmp_path):
    set_thread_count(2)
    measured_first = len(sampler_names()) // 2
    with Store.writing(tmp_path / "run") as store:
        run_measurements(store, measurements[::-1][:measured_first])
    set_thread_count(3)
    assert measured(tmp_path, measurements) == on_one_thread
