"""Memory of processes: their peaks, what preparing lights takes, and keeping what arrays gave back.

A process's peak cannot be attributed to one of several calls, and memory that was freed earlier
hides what is taken later, so every sampler gets a new process. There the map and the shared tables
are made and kernels compiled on a tiny map first; then the high-water mark of resident memory is
set back (Linux), or read before and after (elsewhere, where earlier peaks can hide a part).
"""

import ctypes
import multiprocessing
import sys
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from contextlib import suppress
from pathlib import Path
from typing import ParamSpec, TypeVar

import numpy as np
from numpy.typing import NDArray

from experiments.run.rendering import SHARED_TABLES, peak_memory_mib, rehearse_lights
from experiments.run.sampler_spec import SamplerSpec
from samplers import EnvironmentMap

STATUS, CLEAR = Path("/proc/self/status"), Path("/proc/self/clear_refs")
_TRIM_THRESHOLD, _MMAP_MAX = -1, -4
"""Parameters of glibc's `mallopt`."""
KEPT_BYTES = 1 << 30
"""Free memory at the end of the heap that a process keeps."""
P = ParamSpec("P")
R = TypeVar("R")


def keep_freed_memory() -> bool:
    """Let this process use again what its arrays gave back; returns whether the system can.

    A render asks for hundreds of MiB and returns them. By default the system takes large blocks at
    once, and finding and clearing their pages anew takes as long as tracing the primary rays. Needs
    glibc (Linux). Peak memory may grow by what lies between blocks of different size.
    """
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None) if sys.platform == "linux" else None
    if mallopt is None:
        return False
    return bool(mallopt(_MMAP_MAX, 0)) and bool(mallopt(_TRIM_THRESHOLD, KEPT_BYTES))


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


def peak_of(sampler: SamplerSpec, environment: EnvironmentMap, count: int) -> float:
    """MiB that `prepare` needs at its peak beyond the map and the shared tables."""
    return in_fresh_process(_peak, sampler, environment.radiance, count)


def make_tables(environment: EnvironmentMap) -> None:
    """Make the tables that samplers share."""
    for table in SHARED_TABLES:
        getattr(environment, table)


def _peak(sampler: SamplerSpec, radiance: NDArray[np.float32], count: int) -> float:
    environment = EnvironmentMap(radiance)
    make_tables(environment)
    rehearse_lights(sampler)
    with suppress(OSError):
        CLEAR.write_text("5")  # the high-water mark becomes what is resident now
    before = own_peak_mib()
    lighting = sampler.sampler.prepare(environment, count, np.random.default_rng(0))
    after = own_peak_mib()
    del lighting
    return after - before
