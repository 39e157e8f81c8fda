"""A sampler neither ends the program that measures it, nor holds it for ever."""

import signal
import subprocess
import sys
import time
from asyncio import CancelledError
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from threading import Event

import numpy as np
import pytest

from experiments.run.measure import guarded
from experiments.run.sampler_spec import single_sampler
from samplers import EnvlightError


def spin():
    while True:
        pass


def test_a_sampler_that_catches_errors_is_interrupted_all_the_same():
    def stubborn():
        try:
            spin()
        except Exception:
            spin()

    with pytest.raises(EnvlightError, match="not finished"):
        guarded(0.2, stubborn)


def test_what_ends_in_time_is_left_alone():
    def work(seconds):
        until = time.perf_counter() + seconds
        while time.perf_counter() < until:
            pass
        return seconds

    for k in range(300):  # some end just as their time is up
        seconds = 1e-5 * (k % 200)
        try:
            assert guarded(0.001, work, seconds) == seconds
        except EnvlightError as error:
            assert "not finished" in str(error)
    time.sleep(0.05)  # nothing comes later


@pytest.mark.parametrize("kind", [CancelledError, GeneratorExit, KeyboardInterrupt])
def test_what_no_except_exception_catches_is_an_error(kind):
    def work():
        raise kind("enough")

    done = ThreadPoolExecutor().submit(guarded, 0.0, work)  # where none of the user's comes
    with pytest.raises(EnvlightError, match=f"it raised {kind.__name__}: enough"):
        done.result()


def test_an_interrupt_that_a_sampler_raises_is_not_the_users():
    def noted(number, frame):
        raise KeyboardInterrupt

    def work():
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGINT, noted)
    try:
        with pytest.raises(EnvlightError, match="it raised KeyboardInterrupt"):
            guarded(0.0, work)
        with pytest.raises(KeyboardInterrupt):
            guarded(0.0, signal.raise_signal, signal.SIGINT)
    finally:
        signal.signal(signal.SIGINT, before)


@pytest.mark.skipif(not hasattr(signal, "SIGALRM"), reason="a system without alarms")
@pytest.mark.parametrize("wait", [partial(time.sleep, 600.0), Event().wait])
def test_what_waits_is_interrupted(wait):
    before = signal.getsignal(signal.SIGALRM)
    with pytest.raises(EnvlightError, match="not finished"):
        guarded(0.1, wait)
    assert signal.getsignal(signal.SIGALRM) == before


def test_where_interrupting_has_no_effect_the_process_ends():
    code = (
        "import time; from concurrent.futures import ThreadPoolExecutor as Pool\n"
        "from experiments.run import measure; measure.GRACE_SECONDS = 0.1\n"
        "Pool().submit(measure.guarded, 0.1, time.sleep, 600.0).result()"  # not the main thread
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 1
    assert done.stderr.startswith("envlight: a measurement neither ended within 0.1 s (--timeout)")
    assert "Traceback" not in done.stderr


ENDING = """
from dataclasses import dataclass
import os, ctypes; from os import _exit
from samplers import LightSampler
{loaded}
@dataclass(frozen=True)
class Ending(LightSampler):
    def _prepare(self, environment, count, rng): {called}
"""


@pytest.mark.parametrize(
    ("loaded", "called", "by"),
    [("0", "os._exit(0)", "os._exit.0."), ("_exit(0)", "0", "os._exit.0."),
     ("0", "os.execlp('true', 'true')", "os.exec of .*true"),
     ("0", "ctypes.CDLL(None)._exit(0)", "C's _exit")],
)  # fmt: skip
def test_no_sampler_in_a_file_ends_the_process(tmp_path, loaded, called, by):
    (tmp_path / "ending.py").write_text(ENDING.format(loaded=loaded, called=called))

    def work():
        single_sampler(f"{tmp_path}/ending.py:Ending").sampler.prepare(None, 4, None)

    with pytest.raises(EnvlightError, match=f"it ends the program, by {by}"):
        guarded(0.0, work)
    code = "import os; from samplers.conformance.lighting_check import contained\n"
    code += "with contained(): os.fork()\nprint('once', flush=True)\n"
    code += "with contained(): os._exit(3)"  # which is no sampler's
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (3, "once\n")


def test_a_copy_of_the_process_and_a_thread_may_end(tmp_path, capsys):
    called = "os.fork() or os.execlp('true', 'true'); t = Thread(target=lambda: 1 / 0); t.start(); "
    called += "t.join(); return os.wait()[1]"
    text = ENDING.format(loaded="from threading import Thread", called=called)
    (tmp_path / "ending.py").write_text(text)
    assert single_sampler(f"{tmp_path}/ending.py:Ending").sampler.prepare(None, 4, None) == 0
    told = "ending.py: line 8: its thread ended by ZeroDivisionError: division by zero\n"
    assert capsys.readouterr().err.endswith(told)


def test_what_a_file_does_to_folder_errors_and_output_is_over_with_it(tmp_path, capsys):
    loaded = "import numpy; os.chdir('/'); numpy.seterr(all='raise'); print('loading')"
    (tmp_path / "ending.py").write_text(ENDING.format(loaded=loaded, called=loaded))
    before = Path.cwd(), np.geterr()
    sampler = single_sampler(f"{tmp_path}/ending.py:Ending").sampler
    guarded(0.0, sampler.prepare, None, 4, None)
    assert (Path.cwd(), np.geterr()) == before
    assert capsys.readouterr() == ("", "loading\nloading\n")
