"""Results come back from processes, whatever dies."""

import multiprocessing
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from experiments.run.executors import ProcessExecutor
from samplers import EnvlightError
from samplers.threads import thread_count


def identity(value):
    return value, os.getpid()


def die():
    os.kill(os.getpid(), signal.SIGKILL)


def die_once(mark):
    """The first call, as the file tells, ends the process."""
    if not mark.exists():
        mark.touch()
        die()
    return "survived"


def fail():
    raise EnvlightError("a sentence")


def sleep():
    time.sleep(600.0)


@pytest.fixture
def executor():
    with ProcessExecutor(2, 3) as pool:
        yield pool


def test_results_and_errors_come_back(executor):
    futures = [executor.submit(identity, k) for k in range(6)]
    assert [future.result()[0] for future in futures] == list(range(6))
    assert os.getpid() not in {future.result()[1] for future in futures}
    assert executor.submit(thread_count).result() == 3
    with pytest.raises(EnvlightError, match="a sentence"):
        executor.submit(fail).result()


def test_one_task_after_another_is_worked_on_by_the_process_that_has_loaded_its_data(executor):
    assert len({executor.submit(identity, k).result()[1] for k in range(8)}) == 1


def test_a_process_that_dies_takes_no_task_with_it(executor, tmp_path):
    futures = [executor.submit(identity, k) for k in range(8)]
    lost = executor.submit(die_once, tmp_path / "mark")
    futures += [executor.submit(identity, k) for k in range(8, 12)]
    assert lost.result() == "survived"
    assert [future.result()[0] for future in futures] == list(range(12))


def test_a_task_that_kills_its_process_each_time_is_given_up_alone(executor):
    futures = [executor.submit(identity, k) for k in range(4)]
    deadly = [executor.submit(die), executor.submit(die)]
    futures += [executor.submit(identity, k) for k in range(4, 8)]
    for future in deadly:
        with pytest.raises(EnvlightError, match=r"its process died 2 times"):
            future.result()
    assert [future.result()[0] for future in futures] == list(range(8))
    assert executor.submit(identity, 9).result()[0] == 9


@pytest.mark.skipif(not hasattr(signal, "pthread_sigmask"), reason="a system without such signals")
def test_processes_get_no_interrupts_from_the_keyboard(executor):
    assert executor.submit(blocks_interrupts).result()
    assert signal.SIGINT not in signal.pthread_sigmask(signal.SIG_BLOCK, ())


def blocks_interrupts():
    return signal.SIGINT in signal.pthread_sigmask(signal.SIG_BLOCK, ())


def test_cancelled_work_ends_at_once():
    executor = ProcessExecutor(1, 1)
    executor.submit(identity, 0).result()
    future = executor.submit(sleep)
    while not future.running() and not multiprocessing.active_children():
        time.sleep(0.01)
    executor.shutdown(cancel_futures=True)
    assert not multiprocessing.active_children()
    with pytest.raises(RuntimeError, match="shutdown"):
        executor.submit(identity, 1)


ORPHAN = """
import os, sys, time
from experiments.run.executors import ProcessExecutor
if __name__ == "__main__":
    executor = ProcessExecutor(1, 1)
    print(executor.submit(os.getpid).result(), flush=True)
    executor.submit(time.sleep, 600.0)
    time.sleep(600.0)
"""


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="it looks into /proc")
def test_processes_end_with_the_one_that_started_them(tmp_path):
    script = tmp_path / "orphan.py"
    script.write_text(ORPHAN, encoding="utf-8")
    parent = subprocess.Popen([sys.executable, str(script)], stdout=subprocess.PIPE, text=True)
    assert parent.stdout is not None
    with parent.stdout:
        child = int(parent.stdout.readline())
        parent.kill()
        parent.wait()
        while _lives(child):
            time.sleep(0.01)


def _lives(process: int) -> bool:
    try:
        text = Path(f"/proc/{process}/stat").read_text(encoding="utf-8")
        return text.rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False


DEADLY = """
import os
from experiments.run.executors import ProcessExecutor
if __name__ == "__main__":
    with ProcessExecutor(1, 1) as pool:
        assert pool.submit(os._exit, 3).exception() is not None
        assert pool.submit(abs, -1).result() == 1
        work = "import threading, time; threading.Thread(target=time.sleep, args=(1e4,)).start()"
        pool.submit(exec, work).result()
"""


def test_a_program_ends_though_a_process_of_its_has_died(tmp_path):
    """A pool that is collected while it gives up its work may wait for itself for ever, as may a
    process for a thread that goes on."""
    (tmp_path / "deadly.py").write_text(DEADLY)
    command = [sys.executable, str(tmp_path / "deadly.py")]
    paths = {"PYTHONPATH": str(Path(__file__).parents[3])}
    assert subprocess.run(command, env={**os.environ, **paths}, timeout=300).returncode == 0
