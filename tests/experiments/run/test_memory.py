"""Memory that arrays gave back is used again, where the system lets a process keep it."""

import resource

import numpy as np
import pytest

from experiments.run.machine import in_fresh_process, keep_freed_memory

BYTES = 256 << 20


def page_faults() -> int:
    """Pages that the system has had to find for this process."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt


def faults_of_the_second_array(keep: bool) -> tuple[bool, int]:
    kept = keep_freed_memory() if keep else False
    np.ones(BYTES, np.uint8)
    before = page_faults()
    np.ones(BYTES, np.uint8)
    return kept, page_faults() - before


def test_a_second_array_finds_the_pages_of_the_first():
    kept, faults = in_fresh_process(faults_of_the_second_array, True)
    if not kept:
        pytest.skip("this system's allocator has no mallopt")
    _, usual = in_fresh_process(faults_of_the_second_array, False)
    assert faults < usual / 10.0
