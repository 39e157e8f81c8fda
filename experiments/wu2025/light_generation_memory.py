"""Peak memory of making lights: each sampler alone in a fresh process.

A process's peak cannot be attributed to one of several calls, and memory that was freed earlier
hides what is taken later, so every sampler gets a new process. There the map and the shared tables
are made and kernels compiled on a tiny map first; then the high-water mark of resident memory is
set back (Linux), or read before and after (elsewhere, where earlier peaks can hide a part).
"""

import contextlib
import multiprocessing
import sys
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from experiments.run.rendering import SHARED_TABLES, peak_memory_mib
from experiments.run.sampler_spec import SamplerSpec
from samplers import EnvironmentMap

STATUS, CLEAR = Path("/proc/self/status"), Path("/proc/self/clear_refs")


def peak_of(sampler: SamplerSpec, environment: EnvironmentMap, count: int) -> float:
    """MiB that `prepare` needs at its peak beyond the map and the shared tables."""
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(1, context) as pool:
        return pool.submit(_peak, sampler, environment.radiance, count).result()


def rehearse(sampler: SamplerSpec) -> None:
    """Prepare something tiny, so that every kernel is there."""
    radiance = np.random.default_rng(0).uniform(0.5, 1.0, (32, 64, 3))
    environment = EnvironmentMap.from_array(radiance, "rehearsal")
    count = max(16, sampler.sampler.minimum_count)
    sampler.sampler.prepare(environment, count, np.random.default_rng(0))


def _peak(sampler: SamplerSpec, radiance: NDArray[np.float32], count: int) -> float:
    environment = EnvironmentMap(radiance)
    for table in SHARED_TABLES:
        getattr(environment, table)
    rehearse(sampler)
    before = _start()
    lighting = sampler.sampler.prepare(environment, count, np.random.default_rng(0))
    after = _status("VmHWM") if sys.platform == "linux" else peak_memory_mib()
    del lighting
    return max(0.0, after - before)


def _start() -> float:
    """Resident memory in MiB, after the high-water mark has been set back to it."""
    if sys.platform != "linux":
        return peak_memory_mib()
    with contextlib.suppress(OSError):
        CLEAR.write_text("5")
        return _status("VmRSS")
    return _status("VmHWM")


def _status(name: str) -> float:
    line = next(line for line in STATUS.read_text().splitlines() if line.startswith(name))
    return int(line.split()[1]) / 1024.0
