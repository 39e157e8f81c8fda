"""Where compiled kernels are kept between starts.

Numba decides by a function's own file whether its cached machine code is still good, although the
code holds inlined functions of other files. So each state of the files with kernels has a folder of
its own: after any edit kernels are compiled anew, and never run stale. Old ones go, but none that a
running process may still compile into.
"""

import hashlib
import os
import shutil
import time
from pathlib import Path

import platformdirs

PACKAGES = ("samplers", "renderer", "metrics", "experiments")
KEPT = 4
KEPT_SECONDS = 7 * 24 * 3600.0
"""Folders used since then stay, however many: a process that uses one may be running."""


def _state() -> str:
    """A hash of all the project's source files that declare kernels."""
    root = Path(__file__).resolve().parent.parent
    hasher = hashlib.blake2b(str(root).encode(), digest_size=8)
    for package in PACKAGES:
        for path in sorted((root / package).rglob("*.py")):
            source = path.read_bytes()
            if b"@kernel" in source or b"njit" in source:
                hasher.update(str(path).encode())
                hasher.update(source)
    return hasher.hexdigest()


def choose_folder() -> None:
    """Point Numba to the folder of this state, unless NUMBA_CACHE_DIR says otherwise."""
    if os.environ.get("NUMBA_CACHE_DIR"):
        return
    import numba.core.config

    home = platformdirs.user_cache_path("envlight") / "kernels"
    folder = home / _state()
    try:
        folder.mkdir(parents=True, exist_ok=True)
        folder.touch()
        used = sorted(((path.stat().st_mtime, path) for path in home.iterdir()), reverse=True)
    except OSError:
        return  # Numba then falls back to the places it knows.
    for last_use, path in used[KEPT:]:
        if time.time() - last_use > KEPT_SECONDS:
            shutil.rmtree(path, ignore_errors=True)
    setattr(numba.core.config, "CACHE_DIR", str(folder))  # noqa: B010  # unknown to type checkers


choose_folder()
