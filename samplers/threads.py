"""One shared thread pool for compiled kernels that release the interpreter lock.

Work is cut into blocks whose bounds depend on the problem alone, never on the number of
threads, so that every result is the same bit for bit on any machine.
"""

import os
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import cache

MOST_BLOCKS = 256
"""Enough to share out among any number of threads of one machine."""
_state = threading.local()


def core_count() -> int:
    """The cores that this process may use; `taskset` or a cluster's scheduler may leave it few."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


_thread_count = core_count()


def thread_count() -> int:
    """The number of threads that kernels run on."""
    return _thread_count


def set_thread_count(count: int) -> None:
    """Run kernels on `count` threads from now on (1: in the calling thread)."""
    global _thread_count
    if count < 1:
        raise ValueError(f"thread count {count}: at least 1 is needed")
    _thread_count = count


@cache
def _pool(count: int) -> ThreadPoolExecutor:
    return ThreadPoolExecutor(count, "kernel", initializer=_mark_worker)


def _mark_worker() -> None:
    _state.is_worker = True


def block_of(size: int, least: int) -> int:
    """How many of `size` items make a block: `least`, more where that makes too many blocks.

    Each is begun under the interpreter's lock: thousands of short ones keep threads waiting.
    """
    return max(least, -(-size // MOST_BLOCKS))


def groups_of(groups: int, items: int, least: int) -> int:
    """How many of `groups`, which hold `items` together, make a block of about `least` or more."""
    return max(1, block_of(items, least) * groups // max(1, items))


def for_blocks(work: Callable[[int, int], None], size: int, block: int) -> None:
    """Call `work(start, stop)` for consecutive blocks that cover range(size).

    Blocks run concurrently; each must write only what belongs to its own range. Called from
    inside a block, it runs in the calling thread, so nesting cannot dead-lock. An exception of a
    block, and an interrupt, calls off the blocks that have not begun.
    """
    bounds = [(start, min(start + block, size)) for start in range(0, size, block)]
    if _thread_count == 1 or len(bounds) == 1 or getattr(_state, "is_worker", False):
        for start, stop in bounds:
            work(start, stop)
        return
    waiting = [_pool(_thread_count).submit(work, start, stop) for start, stop in bounds]
    try:
        for done in waiting:
            done.result()
    except BaseException:
        for future in waiting:
            future.cancel()
        raise
