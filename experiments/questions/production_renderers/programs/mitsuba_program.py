"""Renders a written scene by Mitsuba 3.

The scene's file says what is rendered; `program.json` beside it names the variant. An LLVM variant
needs an LLVM library of version 16 or later, which DRJIT_LIBLLVM_PATH names.
"""

import json
import runpy
import time
from pathlib import Path
from typing import Any

import numpy as np


class MitsubaScene:
    """scene.xml, loaded."""

    def __init__(self, folder: Path, threads: int) -> None:
        import drjit
        import mitsuba

        settings = json.loads((folder / "program.json").read_text(encoding="utf-8"))
        mitsuba.set_variant(settings["variant"])
        mitsuba.set_log_level(mitsuba.LogLevel.Error)
        self._mitsuba: Any = mitsuba
        self._scene: Any = mitsuba.load_file(str(folder / "scene.xml"))
        # Only now: with one thread an image is neither read nor written, but waited for.
        drjit.set_thread_count(threads)
        self._image: Any = None
        self.facts = {"renderer": "Mitsuba", "version": mitsuba.__version__, **settings}

    def render(self, samples: int, seed: int) -> tuple[float, dict[str, Any]]:
        """Render; Mitsuba renders lazily, so that the clock stops when the pixels are there."""
        started = time.perf_counter()
        image = self._mitsuba.render(self._scene, spp=samples, seed=seed)
        self._image = np.array(image, np.float32)
        return time.perf_counter() - started, {}

    def image(self) -> np.ndarray:
        return self._image

    def write(self, path: Path) -> None:
        self._mitsuba.Bitmap(self._image).write(str(path))


if __name__ == "__main__":
    here = Path(__file__).resolve().parent
    runpy.run_path(str(here / "session.py"))["main"](MitsubaScene, here)
