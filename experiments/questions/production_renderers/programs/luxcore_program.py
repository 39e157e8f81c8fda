"""Renders a written scene by LuxCore, through the package `pyluxcore`.

`render.cfg` and the scene that it names say what is rendered. The engine goes over the film pass
by pass until it is told to stop, so that a rendering may have a few samples more than asked for:
the mean number is told.
"""

import os
import runpy
import time
from pathlib import Path
from typing import Any

import numpy as np

POLL_SECONDS = 0.001


class LuxCoreScene:
    """render.cfg and its scene, loaded."""

    def __init__(self, folder: Path, threads: int) -> None:
        import pyluxcore

        # Not with a log callback: at its end the interpreter then aborts.
        pyluxcore.Init()
        os.chdir(folder)
        settings = pyluxcore.Properties("render.cfg")
        settings.Set(pyluxcore.Property("native.threads.count", threads))
        self._luxcore: Any = pyluxcore
        self._settings: Any = settings
        self._scene: Any = pyluxcore.Scene()
        self._scene.Parse(pyluxcore.Properties("scene.scn"))
        self._session: Any = None
        self._size = tuple(settings.Get(f"film.{side}").GetInt() for side in ("height", "width"))
        names = [name for name in settings.GetAllNames() if not name.startswith("film.outputs")]
        self.facts = {
            "renderer": "LuxCore",
            "version": pyluxcore.Version(),
            **{name: settings.Get(name).GetString() for name in names},
        }

    def render(self, samples: int, seed: int) -> tuple[float, dict[str, Any]]:
        settings = self._luxcore.Properties()
        settings.Set(self._settings)
        settings.Set(self._luxcore.Property("renderengine.seed", seed))
        settings.Set(self._luxcore.Property("batch.haltspp", samples))
        session = self._luxcore.RenderSession(self._luxcore.RenderConfig(settings, self._scene))
        session.Start()
        started = time.perf_counter()
        while not session.HasDone():
            time.sleep(POLL_SECONDS)
            session.UpdateStats()
        seconds = time.perf_counter() - started
        session.Stop()
        self._session = session
        taken = session.GetStats().Get("stats.renderengine.total.samplecount").GetFloat()
        return seconds, {"mean_samples": taken / (self._size[0] * self._size[1])}

    def image(self) -> np.ndarray:
        image = np.empty((*self._size, 3), np.float32)
        film = self._session.GetFilm()
        film.GetOutputFloat(self._luxcore.FilmOutputType.RGB_IMAGEPIPELINE, image)
        return np.ascontiguousarray(image[::-1])

    def write(self, path: Path) -> None:
        film, kind = self._session.GetFilm(), self._luxcore.FilmOutputType.RGB_IMAGEPIPELINE
        film.SaveOutput(str(path), kind, self._luxcore.Properties())


if __name__ == "__main__":
    here = Path(__file__).resolve().parent
    runpy.run_path(str(here / "session.py"))["main"](LuxCoreScene, here)
