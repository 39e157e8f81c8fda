"""What a run ran on: machine, versions, commit and command, written once per start; and memory."""

import ctypes
import importlib.metadata
import math
import multiprocessing
import platform
import statistics
import subprocess
import sys
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from functools import cache
from pathlib import Path, PurePath
from typing import Any, ParamSpec, TypeVar

from experiments.run.bench import load_average
from samplers.threads import core_count, thread_count

REPORTED = (
    "numpy", "numba", "scipy", "embreex", "OpenEXR", "OpenImageIO", "colour-science", "pandas",
)  # fmt: skip


def _of_cores(what: str) -> list[str]:
    """What Linux says of each core; nothing elsewhere."""
    info = Path("/proc/cpuinfo")
    text = info.read_text(encoding="utf-8", errors="replace") if info.is_file() else ""
    return [line.partition(":")[2].strip() for line in text.splitlines() if line.startswith(what)]


def _megahertz() -> float | None:
    """The median of the cores' clock rates at this moment, where the system tells."""
    rates = [float(rate) for rate in _of_cores("cpu MHz")]
    return statistics.median(rates) if rates else None


def _commit() -> str:
    """The checkout's commit, with "+" where tracked files differ from it; empty outside one."""
    here = Path(__file__).resolve().parents[2]

    def git(*words: str) -> str:
        return subprocess.run(
            ["git", "-C", str(here), *words], capture_output=True, text=True, check=True, timeout=10
        ).stdout.strip()

    try:
        return git("rev-parse", "--short=12", "HEAD") + (
            "+" if git("status", "--porcelain", "--untracked-files=no") else ""
        )
    except (OSError, subprocess.SubprocessError):
        return ""


def machine_identity() -> dict[str, Any]:
    """What times depend on: processor, cores, system and threads."""
    return {**_machine(), "threads": thread_count()}


@cache
def _machine() -> dict[str, Any]:
    return {
        "processor": next(
            iter(_of_cores("model name")), platform.processor() or platform.machine()
        ),
        "cores": core_count(),
        "system": f"{platform.system()} {platform.machine()}",
    }


def machine_kind() -> str:
    """What times are compared within: processor, cores, and how much of them a measurement has."""
    machine = _machine()
    return f"{machine['processor']}, {thread_count()} of {machine['cores']} threads"


def record() -> dict[str, Any]:
    """What a reader needs to judge and repeat a run; of a path from the root, which says nothing
    elsewhere, the last name alone.
    """
    words = (PurePath(one).name if PurePath(one).is_absolute() else one for one in sys.argv[1:])
    return {
        "started": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()),
        "command": " ".join(["envlight", *words]),
        "commit": _commit(),
        "python": platform.python_version(),
        **machine_identity(),
        "load_average": load_average(),
        "megahertz": _megahertz(),
        "versions": {name: importlib.metadata.version(name) for name in REPORTED},
    }


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


def peak_memory_mib() -> float:
    """Peak resident memory of this process, MiB; NaN where the system does not tell.

    From the system's record of this program where there is one (Linux): `getrusage` there begins
    at what the process held that started this one.
    """
    if STATUS.is_file():
        status = STATUS.read_text().splitlines()
        line = next(line for line in status if line.startswith("VmHWM"))
        return int(line.split()[1]) / 1024.0
    try:
        import resource
    except ImportError:  # Windows
        return math.nan
    unit = 1 if sys.platform == "darwin" else 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit / 2**20


def in_fresh_process(work: Callable[P, R], *args: P.args, **kwargs: P.kwargs) -> R:
    """The result of a function of a module, called in a process of its own."""
    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as pool:
        return pool.submit(work, *args, **kwargs).result()
