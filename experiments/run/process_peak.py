"""Peak memory of a whole process, and work in a fresh one that knows nothing of its parent's."""

import multiprocessing
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import ParamSpec, TypeVar

from experiments.run.rendering import peak_memory_mib

STATUS = Path("/proc/self/status")
P = ParamSpec("P")
R = TypeVar("R")


def own_peak_mib() -> float:
    """Peak resident memory of this process, MiB.

    From the system's record of this program where there is one (Linux): `getrusage` there begins
    at what the process held that started this one.
    """
    if not STATUS.is_file():
        return peak_memory_mib()
    line = next(line for line in STATUS.read_text().splitlines() if line.startswith("VmHWM"))
    return int(line.split()[1]) / 1024.0


def in_fresh_process(work: Callable[P, R], *args: P.args, **kwargs: P.kwargs) -> R:
    """The result of a function of a module, called in a process of its own."""
    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as pool:
        return pool.submit(work, *args, **kwargs).result()
