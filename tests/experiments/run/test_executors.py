"""A run's tables do not depend on who works on its measurements."""

import pandas as pd
import pytest

from experiments.run import executors
from experiments.run.rendering import MACHINE_COLUMNS
from experiments.run.scale import SCALES
from tests.experiments.tiny import TINY


@pytest.fixture(scope="module", autouse=True)
def tiny():
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(SCALES, "tiny", TINY)
        yield


@pytest.fixture(scope="module")
def words(maps_folder):
    """The command of a small run, but for its folder and who works on it."""
    grid = ["--environments", maps_folder, "--scenes", "three-boxes"]
    return ["run", "table1", "--scale", "tiny", *grid, "--samplers", "mis", "--samplers", "u*"]


def untimed(folder):
    table = pd.read_csv(folder / "measurements.csv", dtype=str)
    files = {
        str(path.relative_to(folder)): path.read_bytes()
        for path in folder.rglob("*")
        if path.suffix in (".exr", ".png")
    }
    return table.drop(columns=list(MACHINE_COLUMNS)).to_csv(), files


@pytest.fixture(scope="module")
def serial(exit_status, words, tmp_path_factory):
    # Runs beside each other share their measurements.
    folder = tmp_path_factory.mktemp("serial") / "run"
    assert exit_status(*words, "--output", folder) == 0
    return untimed(folder)


@pytest.mark.parametrize("kind", ["processes", "dask"])
def test_rows_and_images_equal_those_of_one_process(exit_status, words, tmp_path, serial, kind):
    options = ["--executor", kind, "--workers", "2", "--threads", "1"]
    assert exit_status(*words, "--output", tmp_path / "run", *options) == 0
    table, files = untimed(tmp_path / "run")
    assert table == serial[0]
    assert files == serial[1]


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        (["--executor", "fork"], "no executor is called 'fork'; use serial, processes"),
        (["--cluster", "tcp://127.0.0.1:1"], "--cluster goes with --executor dask only"),
        (["--workers", "2"], "it works on one at a time"),
        (
            ["--executor", "dask", "--workers", "2", "--cluster", "tcp://127.0.0.1:1"],
            "the scheduler's workers are used",
        ),
    ],
)
def test_what_does_not_go_together_is_said(envlight, words, tmp_path, options, sentence):
    status, _, error = envlight(*words, "--output", tmp_path, *options)
    assert status == 2
    assert sentence in error


@pytest.mark.parametrize(
    ("workers", "threads", "shared", "alone"),
    [(0, 0, (4, 1), 4), (2, 0, (2, 2), 2), (3, 0, (3, 1), 3), (9, 0, (9, 1), 4),
     (0, 4, (4, 4), 1), (2, 9, (2, 9), 1)],
)  # fmt: skip
def test_workers_share_out_cores(workers, threads, shared, alone, monkeypatch):
    monkeypatch.setattr(executors, "core_count", lambda: 4)
    assert executors.shared_out(workers, threads) == shared
    assert executors.undisturbed(*shared) == alone
