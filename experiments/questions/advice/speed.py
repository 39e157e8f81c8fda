"""How fast this machine traces rays: a short probe, kept for the next time.

The probe is a small image by the sampler in whose seconds per ray a table tells its own machine's
speed, rendered a few times; the least time counts, since whatever else runs only adds. It is kept
by the kind of machine and by the renderer's source, in the user's cache folder.
"""

import json
from contextlib import suppress
from pathlib import Path

import numpy as np
import platformdirs

from experiments.maps import places
from experiments.questions.advice.measured import Measured
from experiments.run.identity import source_digest
from experiments.run.machine import machine_kind
from renderer.render import render
from renderer.scene.load import load_scene
from renderer.view import make_view
from samplers import make_sampler

FILE = "speed.json"
MAP, MAP_HEIGHT, SCENE, SIZE, COUNT, ROUNDS = "noon-desert", 64, "vase", (112, 84, 4), 16, 5


def speed_here(table: Measured, folder: Path | None = None) -> float:
    """Seconds for a ray on this machine over those on the table's.

    folder : where the probe is kept, by default the user's own
    """
    file = (folder or Path(platformdirs.user_cache_dir("envlight"))) / FILE
    key = f"{machine_kind()} {source_digest('renderer.render')}"
    kept: dict[str, float] = {}
    with suppress(OSError, ValueError, TypeError, AttributeError):
        found = json.loads(file.read_text(encoding="utf-8"))
        kept = {str(name): float(value) for name, value in found.items() if float(value) > 0.0}
    if key not in kept:
        kept[key] = probe()
        with suppress(OSError):  # without it the probe is made again
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_text(json.dumps(kept), encoding="utf-8")
    return kept[key] / table.machine_seconds


def probe() -> float:
    """Seconds for a ray: the least over a few small images, after one that is thrown away."""
    environment = places.make(MAP, MAP_HEIGHT)
    sampler = make_sampler("median-cut")
    lighting = sampler.prepare(environment, COUNT, np.random.default_rng(0))
    view = make_view(load_scene(SCENE), *SIZE)
    shots = [render(view, lighting, environment) for _ in range(ROUNDS + 1)][1:]
    return min(shot.seconds / shot.rays.traced for shot in shots)
