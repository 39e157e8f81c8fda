"""Jobs run so many at once, what follows goes first, and errors call the rest off."""

import threading
import time
from concurrent.futures import ThreadPoolExecutor

import pytest

from experiments.run.executors import Job, SerialExecutor, run_jobs


def family(seen, name, children=0):
    """A job that notes its result, and so many children after it."""

    def then(future):
        seen.append(future.result())
        return [family(seen, f"{name}.{k}") for k in range(children)]

    return Job(str, name, then)


def test_one_at_a_time_runs_children_before_the_next():
    seen = []
    serial = SerialExecutor()
    serial.slots = 1
    run_jobs(serial, ([family(seen, name, 2)] for name in "ab"))
    assert seen == ["a", "a.0", "a.1", "b", "b.0", "b.1"]


def test_all_jobs_run_on_many_threads_and_no_more_than_the_slots_at_once():
    running, most, lock, seen = 0, 0, threading.Lock(), []

    def work(name):
        nonlocal running, most
        with lock:
            running += 1
            most = max(most, running)
        time.sleep(0.001)
        with lock:
            running -= 1
        return name

    with ThreadPoolExecutor(8) as executor:
        executor.slots = 3
        jobs = [Job(work, k, lambda f: seen.append(f.result())) for k in range(200)]
        run_jobs(executor, [[job] for job in jobs])
    assert sorted(seen) == list(range(200))
    assert most <= 3


def test_jobs_are_made_only_when_there_is_room():
    made, seen = [], []

    def jobs():
        for k in range(5):
            made.append(k)
            yield [Job(str, k, lambda future: seen.append((future.result(), len(made))))]

    serial = SerialExecutor()
    serial.slots = 1
    run_jobs(serial, jobs())
    assert seen == [(str(k), k + 1) for k in range(5)]


def test_an_error_while_handling_calls_off_what_has_not_begun():
    gate, begun = threading.Event(), []

    def work(k):
        begun.append(k)
        return k if k == 0 else gate.wait()

    def then(future):
        future.result()
        raise KeyError("no")

    with ThreadPoolExecutor(2) as executor:
        executor.slots = 10
        with pytest.raises(KeyError):
            run_jobs(executor, [[Job(work, k, then)] for k in range(10)])
        gate.set()
    assert len(begun) <= 3  # the first, the one beside it, and the one that took its thread


def test_what_follows_stays_with_its_line_until_a_line_has_run_out():
    """Of two lines one is held up until its last job was done: by the other, at its end."""
    done, both, taken_over = [], threading.Barrier(2), threading.Event()

    def work(name):
        if "." not in name:
            both.wait()  # the lines begin side by side
        if name == "b.0":
            assert taken_over.wait(60.0)
        if name == "b.5":
            taken_over.set()
        done.append(name)
        return name

    def line(name):
        followers = [
            Job(work, f"{name}.{k}", lambda future: future.result() and None) for k in range(6)
        ]
        return Job(work, name, lambda future: followers)

    with ThreadPoolExecutor(2) as executor:
        executor.slots = 2
        run_jobs(executor, [[line("a")], [line("b")]])
    assert [name for name in done if name[0] == "a"] == ["a", *(f"a.{k}" for k in range(6))]
    assert done.index("a.5") < done.index("b.5") < done.index("b.0")
