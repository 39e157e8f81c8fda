"""What every command needs at its peak is bounded by the map."""

import contextlib
import io
import sys
from pathlib import Path

import numpy as np
import OpenEXR
import pytest

from experiments.cli import main as cli
from experiments.maps.sources import check_environments, find_environments
from experiments.run.budget import Budget
from experiments.run.machine import CLEAR, in_fresh_process, peak_memory_mib
from experiments.run.measurement import Grid
from experiments.run.sampler_spec import SamplerSpec
from experiments.run.store import Store
from experiments.wu2025.table1 import table1
from tests.experiments.stored import run_plan
from tests.experiments.tiny import TINY

HEIGHT = 2048
MOST = 4 * HEIGHT * 2 * HEIGHT * 12 / 2**20
"""MiB: four times the map in float32."""
COMMANDS = {
    "advise": "advise MAP",
    "lights": "lights MAP --output lights.json",
    "residual": "lights MAP --output lights.json --residual residual.exr",
    "render": "render MAP --scene three-boxes --width 16 --height 12 --output image.1",
    "inspect": "inspect MAP --output picture.png",
    "new-map": "new-map MAP same.exr",
}


def write_maps(folder: Path) -> None:
    """A tiny and a large map of half floats over three decades with a sun."""
    for name, height in (("tiny", 8), ("large", HEIGHT)):
        radiance = 10.0 ** np.random.default_rng(0).uniform(-2.0, 1.0, (height, 2 * height, 3))
        radiance[height // 4, height // 2] = 2e4
        header = {"compression": OpenEXR.NO_COMPRESSION, "type": OpenEXR.scanlineimage}
        OpenEXR.File(header, {"RGB": radiance.astype(np.float16)}).write(f"{folder}/{name}.exr")


def peak_of(folder: Path, words: list[str]) -> float:
    """MiB that a command takes beyond what this process holds."""
    sys.argv = ["envlight", *(word if "." not in word else str(folder / word) for word in words)]
    CLEAR.write_text("5")  # the high-water mark becomes what is resident now
    before = peak_memory_mib()
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
        try:
            cli.main()
        except SystemExit as end:
            assert not end.code
    return peak_memory_mib() - before


def peaks(folder: Path) -> dict[str, float]:
    """What the large map costs each command beyond the tiny one, once its code is loaded."""
    found = {}
    for name, command in COMMANDS.items():
        _, tiny, large = (
            peak_of(folder, command.replace("MAP", file).split())
            for file in ("tiny.exr", "tiny.exr", "large.exr")
        )
        found[name] = large - tiny
    return found


@pytest.mark.skipif(not CLEAR.exists(), reason="high-water marks are set back on Linux alone")
def test_a_command_takes_at_most_four_times_the_map(tmp_path):
    write_maps(tmp_path)
    found = in_fresh_process(peaks, tmp_path)
    assert min(found.values()) > MOST / 4  # the map itself is seen
    assert {name: peak for name, peak in found.items() if peak > MOST} == {}


def peak_of_run(folder: Path, file: str) -> float:
    """MiB that a run of one sampler takes, without its report."""
    CLEAR.write_text("5")
    before = peak_memory_mib()
    sources = tuple(check_environments(find_environments(str(folder / file), [], 0)).good)
    grid = Grid(("three-boxes",), sources, (SamplerSpec("median-cut"),), (Budget(4),), TINY)
    with Store.writing(folder / f"run-{before}") as store:
        assert run_plan(table1(), store, grid.measurements(), lambda *finished: None) == 0
    return peak_memory_mib() - before


def run_peaks(folder: Path) -> float:
    """What the large map costs a run beyond the tiny one."""
    _, tiny, large = (peak_of_run(folder, file) for file in ("tiny.exr", "tiny.exr", "large.exr"))
    return large - tiny


@pytest.mark.skipif(not CLEAR.exists(), reason="high-water marks are set back on Linux alone")
def test_a_run_of_one_sampler_takes_at_most_four_times_the_map(tmp_path):
    write_maps(tmp_path)
    # What a busy machine lets a process free late can only add: the least of a few counts.
    found = []
    while len(found) < 3 and not (found and found[-1] <= MOST):
        place = tmp_path / str(len(found))
        place.mkdir()
        for file in ("tiny.exr", "large.exr"):
            (place / file).symlink_to(tmp_path / file)
        found.append(in_fresh_process(run_peaks, place))
    assert MOST / 4 < min(found) <= MOST, found
