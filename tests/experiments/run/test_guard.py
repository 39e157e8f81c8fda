"""A sampler neither ends the program that measures it, nor holds it for ever."""

import subprocess
import sys
import time
from asyncio import CancelledError
from concurrent.futures import ThreadPoolExecutor

import pytest

from experiments.run.measure import guarded
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


def test_where_interrupting_has_no_effect_the_process_ends():
    code = (
        "import time; from experiments.run import measure; measure.GRACE_SECONDS = 0.1\n"
        "measure.guarded(0.1, time.sleep, 600.0)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 1
    assert done.stderr.startswith("envlight: a measurement neither ended within 0.1 s (--timeout)")
    assert "Traceback" not in done.stderr
