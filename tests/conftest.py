"""Garbage collection that fits a long-lived process which compiles much and keeps most of it."""

import gc


def pytest_collection_finish() -> None:
    """Leave what is loaded by now alone, and look through the rest a tenth as often.

    The collector takes an eighth of the time in which kernels are compiled otherwise.
    """
    gc.collect()
    gc.freeze()
    gc.set_threshold(20_000, 20, 20)
