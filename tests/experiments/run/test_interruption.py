"""A full disk, a clock that jumps, a second start: nothing is lost, and a sentence says what to do.

Kills are in tests/robustness, workers that die in test_process_executor.py, folders that cannot be
written in test_store.py.
"""

import errno
import os
import sqlite3
import subprocess
import sys
from contextlib import closing

import pytest

from experiments.run.store import DATABASE, Store
from tests.experiments.stored import run_measurements
from tests.robustness.watched_run import write_maps

RUN = """
import resource, sys
from pathlib import Path
from tests.robustness.watched_run import Marker, run
limit = int(sys.argv[4])
if limit:
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, resource.RLIM_INFINITY))
sys.exit(run(Path(sys.argv[1]), Path(sys.argv[2]), Marker(Path(sys.argv[3]))))
"""


def start(place, folder, limit=0):
    command = [sys.executable, "-c", RUN, str(place), str(folder), str(place / "marker")]
    return subprocess.run([*command, str(limit)], capture_output=True, text=True)


def finished(folder):
    with closing(sqlite3.connect(folder.parent / "store" / DATABASE)) as connection:
        assert connection.execute("PRAGMA integrity_check").fetchall() == [("ok",)]
        return dict(connection.execute("SELECT key, start FROM result WHERE kind = 'image'"))


@pytest.fixture(scope="module")
def warm(tmp_path_factory):
    """Whatever a first run leaves in caches is there, so that limits meet the run's own files."""
    place = tmp_path_factory.mktemp("warm")
    write_maps(place)
    assert start(place, place / "runs" / "run").returncode == 0


@pytest.mark.skipif(sys.platform == "win32", reason="it limits the size of files")
def test_a_disk_that_fills_up_loses_nothing(tmp_path, warm):
    """No file may grow beyond a limit, which the database's log meets sooner or later."""
    write_maps(tmp_path)
    folder = tmp_path / "runs" / "run"
    for kilobytes in (8, 300):  # before the first measurement, and among them
        full = start(tmp_path, folder, 1024 * kilobytes)
        assert full.returncode == 2
        assert "Traceback" not in full.stderr
        assert "the space left" in full.stderr
    before = finished(folder)
    assert 0 < len(before) < 30
    done = start(tmp_path, folder)
    assert done.returncode == 0, done.stderr
    after = finished(folder)
    assert len(after) == 30
    assert {key: after[key] for key in before} == before
    assert not list(folder.parent.rglob(".*"))


def test_no_space_for_an_image_fails_its_measurement_alone(tmp_path, measurements_of, monkeypatch):
    measurements = measurements_of(("noise",), ("uniform", "median-cut"))
    with Store.writing(tmp_path / "run") as store:
        run_measurements(store, measurements[:0])
        replace, left = os.replace, [3]  # the reference, its half, and one image

        def full(path, target):
            if str(target).endswith(".exr"):
                left[0] -= 1
                if left[0] < 0:
                    raise OSError(errno.ENOSPC, "No space left on device")
            return replace(path, target)

        monkeypatch.setattr("pathlib.Path.replace", full)
        outcome = run_measurements(store, measurements)
        assert (outcome.measured, len(outcome.failures)) == (1, 1)
        assert "No space left on device" in outcome.failures[0]
        assert "check the folder and the space left" in outcome.failures[0]
        monkeypatch.undo()
        assert run_measurements(store, measurements).measured == 1
