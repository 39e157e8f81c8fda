"""A cluster gives the rows and images of one process, loses nothing, and is told from others."""

import os
import shutil
import signal
from concurrent.futures import Future
from dataclasses import replace
from pathlib import Path

import pytest

from experiments.run.cluster_executor import (
    LOSSES,
    ClusterExecutor,
    Order,
    bare,
    carry_out,
    cluster_executor,
    key_of,
    map_name,
    needed,
)
from experiments.run.executors import work_off
from experiments.run.kept_images import half_path, reference_path, stored_image
from experiments.run.measure import MeasurementTask, ReferenceTask, measure, measure_reference
from experiments.run.rendering import MACHINE_COLUMNS
from experiments.run.runner import Runner
from experiments.run.store import Store
from samplers import EnvlightError
from tests.experiments.stored import run_measurements, untimed

dask = pytest.importorskip("dask", reason="the extra 'cluster' is not installed")
distributed = pytest.importorskip("distributed", reason="the extra 'cluster' is not installed")
CommClosedError = distributed.comm.CommClosedError


@pytest.fixture(scope="module")
def cluster():
    """Two workers in processes of their own, two threads each."""
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=2, dashboard_address=None
    ) as running:
        yield running


def images(folder):
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for place in ("images", "references")
        for path in (folder / place).rglob("*.exr")
    }


def test_a_table_equals_that_of_one_process_even_where_a_worker_dies(
    cluster, grid, finished, tmp_path, monkeypatch
):
    with (
        Store.writing(tmp_path / "run") as store,
        distributed.Client(cluster) as client,
        ClusterExecutor(client) as executor,
    ):
        client.wait_for_workers(2)
        processes, killed, keep = client.run(os.getpid), [], Runner.keep

        def keep_and_kill(runner, *result):
            """End a worker that works when three measurements are finished."""
            keep(runner, *result)
            if runner.outcome.measured >= 3 and not killed:
                busy = (name for name, count in executor._busy.items() if count)
                killed.extend(name for name in [next(busy, "")] if name in processes)
                for name in killed:
                    os.kill(processes[name], signal.SIGKILL)

        monkeypatch.setattr(Runner, "keep", keep_and_kill)
        outcome = run_measurements(store, grid.measurements(), executor)
        measured = untimed(store)
    assert (outcome.measured, outcome.failures) == (25, [])
    with Store.reading(finished) as store:
        assert measured == untimed(store)
    assert images(tmp_path / "store") == images(finished.parent / "store")
    assert killed


def test_a_scheduler_is_found_by_its_address(cluster):
    with cluster_executor(cluster.scheduler_address, 0, 0) as executor:
        assert executor.slots >= 1


def test_a_cluster_of_this_machine_listens_to_it_alone():
    with cluster_executor("", 1, 1) as executor:
        executor._client.wait_for_workers(1)
        places = [executor._client.scheduler.address, *executor._workers()]
        assert [place.rpartition(":")[0] for place in places] == ["tcp://127.0.0.1"] * 2


def test_a_scheduler_that_is_gone_is_said(cluster):
    with distributed.Client(cluster) as client, ClusterExecutor(client) as executor:
        client.close()
        with pytest.raises(EnvlightError, match="scheduler does not answer any more"):
            _ = executor.slots


def test_no_scheduler_is_said(monkeypatch):
    monkeypatch.setattr("experiments.run.cluster_executor.CONNECT_SECONDS", 0.5)
    for address in ("tcp://127.0.0.1:9", "nonsense://", "no-such-file.json"):
        with (
            pytest.raises(EnvlightError, match=f"cluster '{address}': no scheduler answers there"),
            cluster_executor(address, 0, 0),
        ):
            pass


def test_a_task_that_kills_its_workers_ends_in_a_sentence(
    cluster, measurements_of, tmp_path, monkeypatch
):
    monkeypatch.setattr(cluster.scheduler, "allowed_failures", 0)  # each costs a worker's start
    task = ReferenceTask(measurements_of(("noise",))[0].case, str(tmp_path))
    with distributed.Client(cluster) as client, ClusterExecutor(client) as executor:
        with pytest.raises(EnvlightError, match="its workers were lost again and again"):
            executor.submit(work_off, deadly, [task]).result()
        done = executor.submit(work_off, measure_reference, [task]).result()
        assert done.results[0][0]["environment"] == "noise"


class Gone:
    """A result that lay on a worker which is gone: it cannot be fetched."""

    status = "finished"

    def result(self):
        raise CommClosedError("Stream is closed")


def test_a_result_that_is_lost_before_it_is_fetched_is_measured_again(
    cluster, measurements_of, tmp_path
):
    task = ReferenceTask(measurements_of(("noise",))[0].case, str(tmp_path))
    future: Future = Future()
    with distributed.Client(cluster) as client, ClusterExecutor(client) as executor:
        order = Order(work_off, measure_reference, bare([task]), key_of([task]))
        executor._receive(Gone(), order, [task], "", future, 0, {})
        ((row, _),) = future.result().results
        assert row["environment"] == "noise"
        assert reference_path(tmp_path, task.case).is_file()
        lost: Future = Future()
        executor._receive(Gone(), order, [task], "", lost, LOSSES - 1, {})
        with pytest.raises(EnvlightError, match="its workers were lost again and again"):
            lost.result()


def deadly(task):
    os.kill(os.getpid(), signal.SIGKILL)


@pytest.fixture
def shipped(measurements_of, tmp_path):
    """Does an order for a map whose file is gone from where it was; the run's folder apart."""
    measurement = measurements_of(("noise",), ("uniform",))[0]
    source = measurement.case.environment
    moved = tmp_path / "elsewhere" / "noise.exr"
    moved.parent.mkdir()
    shutil.copy(source.path, moved)
    case = replace(measurement.case, environment=replace(source, path=str(moved)))
    measurement = replace(measurement, case=case)
    run, scratch = tmp_path / "run", tmp_path / "scratch"
    reference, task = (
        ReferenceTask(case, str(run)),
        MeasurementTask(measurement, str(run), 0.01, True, tuple(case.score_keys)),
    )
    keys = {key_of([reference]), key_of([task])}
    assert len(keys) == 2
    measure_reference(reference)
    row = measure(task)
    truths = {name: path.read_bytes() for name, path in needed(task).items()}
    image = stored_image(run, measurement.key)
    names = {type(one): list(needed(one)) for one in (reference, task)}

    def do(task, function, key):
        order = Order(work_off, function, bare([task]), key, map_name(case))
        files = {name: truths[name] for name in names[type(task)]}
        return carry_out(order, files, str(scratch), 1)

    yield do, reference, task, row, {str(image.relative_to(run)): image.read_bytes()}
    assert not list(scratch.rglob("references/*"))
    assert not list(scratch.rglob("images/*.exr"))


def test_nothing_of_the_senders_folders_is_read(shipped, tmp_path):
    do, reference, task, row, files = shipped
    keys = key_of([reference]), key_of([task])
    truths = [path.read_bytes() for name, path in needed(task).items() if "maps/" not in name]
    shutil.rmtree(tmp_path / "elsewhere")
    shutil.rmtree(tmp_path / "run")
    delivered = do(task, measure, keys[1])
    ((result, _),) = delivered.done.results
    for name in result.image.keys() - MACHINE_COLUMNS:
        assert result.image[name] == row.image[name]
    assert result.scores == row.scores
    assert delivered.files == files
    made = do(reference, measure_reference, keys[0]).files
    assert sorted(made.values()) == sorted(truths)


def test_a_worker_with_other_sources_or_files_is_refused(shipped):
    do, _, task, *_ = shipped
    with pytest.raises(EnvlightError, match="other source code, library versions or files"):
        do(task, measure, "0" * 24)


def test_orders_carry_nothing_that_was_computed_by_the_sender(measurements_of):
    measurement = measurements_of(("noise",))[0]
    assert measurement.key
    assert "identity" in vars(measurement.case)
    (sent,) = bare([MeasurementTask(measurement, "run", 0.0, False, ())])
    assert not sent.measurement._key
    for part in (sent.measurement.case, sent.measurement.case.environment):
        assert not {"identity", "key"} & set(vars(part))


def test_work_is_spread_over_all_workers(cluster, measurements_of, tmp_path):
    task = ReferenceTask(measurements_of(("noise",))[0].case, str(tmp_path))
    with distributed.Client(cluster) as client, ClusterExecutor(client) as executor:
        client.wait_for_workers(2)
        futures: list[Future] = [executor.submit(work_off, where, [task]) for _ in range(2)]
        places = [future.result().results[0][0] for future in futures]
        assert len({place["process"] for place in places}) == 2
        assert {place["threads"] for place in places} == {2}


def where(task):
    from samplers.threads import thread_count

    for path in (reference_path, half_path):
        place = path(Path(task.folder), task.case)
        place.parent.mkdir(parents=True, exist_ok=True)
        place.touch()
    return {"process": os.getpid(), "threads": thread_count()}
