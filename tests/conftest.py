"""The order of tests in two processes, and garbage collection that fits them."""

import gc
from pathlib import Path

import pytest

HERE = Path(__file__).parent
ORDER = ("renderer", "experiments", "samplers", "metrics", "benchmarks", "robustness", "examples")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """The renderer first and, where a second process begins in the middle, the samplers.

    Kernels that are not compiled yet are then compiled by one process each; the other folders, and
    the processes that their tests start, find most of them."""
    folders = [item.path.relative_to(HERE).parts[0] for item in items]
    place = [ORDER.index(folder) if folder in ORDER else len(ORDER) for folder in folders]
    items[:] = [items[k] for k in sorted(range(len(items)), key=place.__getitem__)]


def pytest_collection_finish() -> None:
    """Leave what is loaded by now alone, and look through the rest a tenth as often.

    The collector takes an eighth of the time in which kernels are compiled otherwise."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(20_000, 20, 20)
