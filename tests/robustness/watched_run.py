"""A tiny run by the command line that tells in a shared file which phase it is in.

Whoever kills it reads there what it was doing: the file outlives the process. Nothing heavy is
imported before the command line has begun, as in any other run, so that it can be interrupted while
libraries load.
"""

import mmap
import signal
import sys
import time
from contextlib import ExitStack
from functools import wraps
from importlib import import_module
from pathlib import Path
from typing import Any
from unittest.mock import patch

from experiments.cli import main as cli

START, REFERENCE, MEASUREMENT, REPORT = PHASES = ("start-up", "reference", "measurement", "report")
MAPS = ("black", "noise", "sun")
SAMPLERS = ("uniform", "median-cut", "mis")
SCALE = "tiny"
WORK = (
    ("experiments.run.measure", "make_reference", REFERENCE),
    ("experiments.run.measure", "_measure", MEASUREMENT),
    ("experiments.run.runner", "write_rows", REPORT),
)
"""Where each phase begins: a module, as whose member a function is called, and the phase."""
STORED = {"reference": REFERENCE, "image": MEASUREMENT}
"""Phases of a run whose workers are other threads or processes, by what it has just received."""


class Marker:
    """How often each phase was entered and which was the last, in a file that processes share.

    entered : phases and times of this process alone"""

    def __init__(self, path: Path) -> None:
        if not path.is_file():
            path.write_bytes(bytes(1 + len(PHASES)))
        with path.open("r+b") as file:
            self._memory = mmap.mmap(file.fileno(), 1 + len(PHASES))
        self.entered: list[tuple[str, float]] = []

    def clear(self) -> None:
        self._memory[:] = bytes(len(self._memory))

    def enter(self, phase: str) -> None:
        at = PHASES.index(phase)
        self._memory[1 + at] += 1
        self._memory[0] = 1 + at
        self.entered.append((phase, time.perf_counter()))

    @property
    def phase(self) -> str:
        """The phase that was entered last, empty before the first."""
        return PHASES[self._memory[0] - 1] if self._memory[0] else ""

    def entries(self, phase: str) -> int:
        return self._memory[1 + PHASES.index(phase)]


def write_maps(folder: Path) -> None:
    """Three maps of 32×16 texels: a black one, noise, and a sun."""
    import numpy as np

    from renderer.image import write_exr

    rng = np.random.default_rng(1)
    radiance = {name: 0.1 * rng.random((16, 32, 3)) for name in MAPS}
    radiance["black"] *= 0.0
    radiance["sun"][4, 9] = 1e4
    for name, values in radiance.items():
        write_exr(folder / f"{name}.exr", values.astype(np.float32))


def run(
    maps: Path, folder: Path, marker: Marker, executor: str = "serial", threads: int = 1
) -> int:
    """The run, in this process; its exit status."""
    words = ["run", "table1", "--scale", SCALE, "--environments", str(maps)]
    words += ["--scenes", "three-boxes", "--threads", str(threads), "--output", str(folder)]
    words += ["--executor", executor]
    for name in SAMPLERS:
        words += ["--samplers", name]
    command = next(c for c in cli.app.registered_commands if c.callback is cli.run)
    with (
        patch.object(sys, "argv", ["envlight", *words]),
        patch.object(command, "callback", _announcing(cli.run, marker, executor)),
    ):
        marker.enter(START)
        try:
            cli.main()
        except SystemExit as end:
            return int(end.code or 0)
    return 0


def _announcing(command: Any, marker: Marker, executor: str) -> Any:
    """The command that also tells of each phase, and knows the tiny scale."""

    @wraps(command)
    def announcing(**options: Any) -> Any:
        from experiments.run.scale import SCALES, Scale
        from experiments.run.store import Store

        tiny = Scale(SCALE, 24, 18, 1, 0.5, 64, 16, (4, 8))
        with ExitStack() as stack:
            stack.enter_context(patch.dict(SCALES, {SCALE: tiny}))
            if executor != "serial":
                stack.enter_context(patch.object(Store, "put", _storing(Store.put, marker)))
            for place, name, phase in WORK if executor == "serial" else WORK[-1:]:
                module = import_module(place)
                work = _entering(getattr(module, name), marker, phase)
                stack.enter_context(patch.object(module, name, work))
            return command(**options)

    return announcing


def _entering(work: Any, marker: Marker, phase: str) -> Any:
    def entering(*values: Any, **named: Any) -> Any:
        marker.enter(phase)
        return work(*values, **named)

    return entering


def _storing(put: Any, marker: Marker) -> Any:
    def storing(store: Any, kind: str, *values: Any, **named: Any) -> Any:
        if kind in STORED:
            marker.enter(STORED[kind])
        return put(store, kind, *values, **named)

    return storing


if __name__ == "__main__":
    # A process started in the background inherits that interrupts are ignored.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    sys.exit(run(*map(Path, sys.argv[1:3]), Marker(Path(sys.argv[3])), sys.argv[4], threads=2))
