"""Blocks cover the range once, errors come out, and nesting does not dead-lock."""

import threading

import numpy as np
import pytest

from samplers.threads import for_blocks, set_thread_count, thread_count


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


def test_no_threads_are_refused():
    with pytest.raises(ValueError, match="at least 1"):
        set_thread_count(0)
