"""Peak memory of making lights: each sampler alone in a fresh process.

A process's peak cannot be attributed to one of several calls, and memory that was freed earlier
hides what is taken later, so every sampler gets a new process. There the map and the shared tables
are made and kernels compiled on a tiny map first; then the high-water mark of resident memory is
set back (Linux), or read before and after (elsewhere, where earlier peaks can hide a part).
"""

import contextlib
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from experiments.run.process_peak import in_fresh_process, own_peak_mib
from experiments.run.rendering import SHARED_TABLES
from experiments.run.sampler_spec import SamplerSpec
from samplers import EnvironmentMap

CLEAR = Path("/proc/self/clear_refs")


def peak_of(sampler: SamplerSpec, environment: EnvironmentMap, count: int) -> float:
    """MiB that `prepare` needs at its peak beyond the map and the shared tables."""
    return in_fresh_process(_peak, sampler, environment.radiance, count)


def rehearse(sampler: SamplerSpec) -> None:
    """Prepare something tiny, so that every kernel is there."""
    radiance = np.random.default_rng(0).uniform(0.5, 1.0, (32, 64, 3))
    environment = EnvironmentMap.from_array(radiance, "rehearsal")
    count = max(16, sampler.sampler.minimum_count)
    sampler.sampler.prepare(environment, count, np.random.default_rng(0))


def make_tables(environment: EnvironmentMap) -> None:
    """Make the tables that samplers share."""
    for table in SHARED_TABLES:
        getattr(environment, table)


def _peak(sampler: SamplerSpec, radiance: NDArray[np.float32], count: int) -> float:
    environment = EnvironmentMap(radiance)
    make_tables(environment)
    rehearse(sampler)
    with contextlib.suppress(OSError):
        CLEAR.write_text("5")  # the high-water mark becomes what is resident now
    before = own_peak_mib()
    lighting = sampler.sampler.prepare(environment, count, np.random.default_rng(0))
    after = own_peak_mib()
    del lighting
    return after - before
