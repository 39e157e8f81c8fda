"""Processor time is told by kind of work, all of it, from every thread and process."""

import json
import threading
import time
from functools import partial

import pytest
from numba import njit

from experiments.cli.commands import finish
from experiments.run import time_spent
from experiments.run.process_executor import ProcessExecutor
from experiments.run.record import add_to_record
from experiments.run.store import Store
from experiments.run.time_spent import (
    COMPILING,
    JUDGING,
    LIGHTS,
    MAPS,
    OTHER,
    REFERENCES,
    RENDERING,
    handing_over,
)
from experiments.wu2025.table1 import table1
from tests.experiments.stored import run_plan

BURNT = 0.05


def burn(seconds=BURNT):
    """Use so much processor time in this thread."""
    end = time.thread_time() + seconds
    while time.thread_time() < end:
        pass


def test_all_time_of_the_process_is_told_and_the_innermost_kind_has_it():
    before = time.process_time()
    time_spent.taken()
    begun = time.process_time()
    burn()
    with time_spent.on(RENDERING):
        burn()
        with time_spent.on(MAPS):
            burn()
    ended = time.process_time()
    used = time_spent.taken()
    # The clock is read for the account between the readings here.
    assert ended - begun <= sum(used.values()) <= time.process_time() - before
    assert min(used[OTHER], used[RENDERING], used[MAPS]) >= 0.99 * BURNT


def test_threads_share_what_is_used_while_both_work():
    begun, done = threading.Event(), threading.Event()

    def beside():
        with time_spent.on(JUDGING):
            begun.set()
            done.wait()

    thread = threading.Thread(target=beside)
    time_spent.taken()
    with time_spent.on(RENDERING):
        thread.start()
        begun.wait()
        burn()
        done.set()
        thread.join()
    used = time_spent.taken()
    assert used[RENDERING] >= used[JUDGING] >= 0.49 * BURNT


def test_compiling_in_another_thread_is_not_told_of_the_one_that_waits():
    @njit
    def fresh(values):
        total = 0.0
        for k in range(len(values)):
            total += values[k] ** 3
        return total

    time_spent.taken()
    with time_spent.on(RENDERING):
        thread = threading.Thread(target=fresh, args=((1.0, 2.0, 3.0),))
        thread.start()
        thread.join()
    used = time_spent.taken()
    assert used[COMPILING] > used[RENDERING] + used.get(OTHER, 0.0)


def judge(seconds):
    with time_spent.on(JUDGING):
        burn(seconds)
    return seconds


def test_another_process_hands_over_what_it_used_and_this_one_nothing():
    assert handing_over(judge)(0.0) == (0.0, {})
    processes = ProcessExecutor(1, threads=1)
    try:
        first, second = (processes.submit(handing_over(judge), BURNT).result() for _ in range(2))
    finally:
        processes.shutdown()
    assert first[0] == second[0] == BURNT
    assert min(first[1][JUDGING], second[1][JUDGING]) >= BURNT
    assert first[1][OTHER] > BURNT > second[1][OTHER]  # starting belongs to the first


@pytest.mark.parametrize("elsewhere", [False, True])
def test_a_run_records_where_its_time_went(tmp_path, measurements_of, capsys, elsewhere):
    measurements = measurements_of(("noise",), ("median-cut",))
    processes = ProcessExecutor(1, threads=1) if elsewhere else None
    time_spent.taken()
    begun = time.process_time()
    try:
        with Store.writing(tmp_path / "run") as store:
            made = partial(finish, images=False)
            assert run_plan(table1(), store, measurements, made, executor=processes) == 0
    finally:
        if processes is not None:
            processes.shutdown()
    seconds = json.loads((tmp_path / "run" / "run.json").read_text())["processor_seconds"]
    # This process may have kept the map and its lights from an earlier test.
    assert {RENDERING, JUDGING} | ({MAPS, REFERENCES, LIGHTS} if elsewhere else set()) <= set(
        seconds
    )
    assert list(seconds.values()) == sorted(seconds.values(), reverse=True)
    own = time.process_time() - begun
    assert (sum(seconds.values()) > own) == elsewhere
    lines = capsys.readouterr().err.splitlines()
    table = lines[lines.index(next(line for line in lines if "processor time" in line)) :]
    assert [line.split("  ")[1] for line in table[1:]] == list(seconds)


def test_what_earlier_starts_used_is_added(tmp_path, measurements_of):
    measurements, begun = measurements_of(("noise",), ("median-cut",)), time.process_time()
    with Store.writing(tmp_path / "run") as store:
        made = partial(finish, images=False)
        start = partial(run_plan, table1(), store, measurements, made, images=False)
        assert start() == 0
        add_to_record(store.run, {"processor_seconds": {RENDERING: 1000.0, "by hand": 10.0}})
        assert start() == 0
    seconds = json.loads((tmp_path / "run" / "run.json").read_text())["processor_seconds"]
    assert seconds["by hand"] == 10.0
    assert 1000.0 <= seconds[RENDERING] <= 1000.0 + time.process_time() - begun
