"""Blocks cover the range once, errors come out, nesting ends, and threads change no bit."""

import os
import threading

import numpy as np
import pytest

from samplers import EnvironmentMap
from samplers.fhis.max_pyramid import max_pyramid
from samplers.grids.nearest_light import nearest_light_cells
from samplers.grids.quad_map import QuadMap
from samplers.grids.regions import region_sums
from samplers.threads import core_count, for_blocks, set_thread_count, thread_count
from tests.samplers.maps import noisy_map


@pytest.fixture(params=[1, 2, 7])
def threads(request):
    before = thread_count()
    set_thread_count(request.param)
    yield request.param
    set_thread_count(before)


@pytest.mark.parametrize(("size", "block"), [(0, 4), (1, 4), (4, 4), (5, 4), (100, 7)])
def test_blocks_cover_the_range_once_whatever_the_threads(threads, size, block):
    seen, bounds = np.zeros(size, int), []

    def work(start, stop):
        seen[start:stop] += 1
        bounds.append((start, stop))

    for_blocks(work, size, block)
    assert (seen == 1).all()
    assert sorted(bounds) == [(a, min(a + block, size)) for a in range(0, size, block)]


def test_nested_blocks_finish(threads):
    total = np.zeros((40, 40), int)

    def row(start, stop):
        for r in range(start, stop):
            for_blocks(lambda a, b, r=r: np.add(total[r, a:b], 1, out=total[r, a:b]), 40, 3)

    for_blocks(row, 40, 1)
    assert (total == 1).all()


def test_an_error_comes_out(threads):
    def work(start, stop):
        if start == 3:
            raise ZeroDivisionError(start)

    with pytest.raises(ZeroDivisionError):
        for_blocks(work, 10, 1)
    for_blocks(lambda a, b: None, 10, 1)


def test_an_error_calls_off_what_has_not_begun():
    before, begun, gate = thread_count(), [], threading.Event()

    def work(start, stop):
        if start == 0:
            raise ZeroDivisionError
        begun.append(start)
        gate.wait(10.0)

    set_thread_count(2)
    try:
        with pytest.raises(ZeroDivisionError):
            for_blocks(work, 1000, 1)
        gate.set()
        for_blocks(lambda a, b: None, 4, 1)  # queues behind whatever is left
    finally:
        gate.set()
        set_thread_count(before)
    # Until the first block's error is seen, two threads can begin a block each and wait in it.
    assert len(begun) <= 2


MAP = noisy_map(150, sun=1e7)
REGIONS = np.array([[0, 0, 150, 300], [3, 40, 90, 41], [17, 299, 150, 300]])
DIRECTIONS = np.random.default_rng(6).normal(size=(40, 3))
DIRECTIONS /= np.linalg.norm(DIRECTIONS, axis=1, keepdims=True)
QUADS = np.array([[3, face, i, 7 - i] for face in range(12) for i in range(8)])
TABLES = (
    "luminance", "total_flux", "flux", "flux_table", "square_table", "band_table", "moment_table",
    "pixel_moment_table",
)  # fmt: skip
IN_BLOCKS = {
    "tables": lambda source: [getattr(source, name) for name in TABLES],
    "sums of regions": lambda source: region_sums(source, REGIONS),
    "nearest lights": lambda source: vars(
        nearest_light_cells(DIRECTIONS, source.radiance)
    ).values(),
    "maxima": lambda source: [max_pyramid(source.luminance, source.row_solid_angle).maximum],
    "quads": lambda source: [QuadMap.of(source).sums(QUADS), QuadMap.of(source).moments(QUADS)],
}


@pytest.mark.parametrize("name", IN_BLOCKS)
def test_threads_change_no_bit(name):
    """Of maps of several blocks of rows; those of the conformance suite have one."""
    before, found = thread_count(), []
    try:
        for threads in (1, 3):
            set_thread_count(threads)
            arrays = IN_BLOCKS[name](EnvironmentMap.from_array(MAP.radiance))
            found.append([np.asarray(array).tobytes() for array in arrays])
    finally:
        set_thread_count(before)
    assert found[0] == found[1]


def test_no_threads_are_refused():
    with pytest.raises(ValueError, match="at least 1"):
        set_thread_count(0)


@pytest.mark.skipif(not hasattr(os, "sched_setaffinity"), reason="this system binds no process")
def test_only_cores_that_the_process_may_use_count():
    before = os.sched_getaffinity(0)
    try:
        os.sched_setaffinity(0, {min(before)})
        assert core_count() == 1
    finally:
        os.sched_setaffinity(0, before)
    assert core_count() == len(before)
