"""How fast this machine traces rays: a short probe, kept for the next time.

The probe is a small image by the sampler in whose seconds per ray a model tells its own machine's
speed, rendered a few times; the least time counts, since whatever else runs only adds. It is kept
by the kind of machine and by the renderer's source, in the user's folder for such things.
"""

import json
from pathlib import Path

import numpy as np
import platformdirs

from experiments.maps import places
from experiments.questions.advice.model import Model
from experiments.run.identity import source_digest
from experiments.run.machine import machine_kind
from renderer.render import render
from renderer.scene.load import load_scene
from renderer.view import make_view
from samplers import make_sampler

FILE = "speed.json"
PROBE_SAMPLER, PROBE_COUNT, PROBE_MAP, PROBE_HEIGHT, PROBE_SCENE = (
    "median-cut", 16, "noon-desert", 64, "vase",
)  # fmt: skip
PROBE_SIZE = (112, 84, 4)
ROUNDS = 5


def speed_here(model: Model, folder: Path | None = None) -> tuple[float, bool]:
    """Seconds for a ray on this machine over those on the model's, and whether they were kept.

    folder : where the probe is kept, by default the user's own
    """
    file = (folder or Path(platformdirs.user_cache_dir("envlight"))) / FILE
    key = f"{machine_kind()} {source_digest('renderer.render')}"
    kept = _read(file)
    known = key in kept
    if not known:
        kept[key] = probe()
        _keep(file, kept)
    return kept[key] / model.machine_seconds, known


def probe() -> float:
    """Seconds for a ray: the least over a few small images, after one that is thrown away."""
    environment = places.make(PROBE_MAP, PROBE_HEIGHT)
    lighting = make_sampler(PROBE_SAMPLER).prepare(
        environment, PROBE_COUNT, np.random.default_rng(0)
    )
    view = make_view(load_scene(PROBE_SCENE), *PROBE_SIZE)
    shots = [render(view, lighting, environment) for _ in range(ROUNDS + 1)][1:]
    return min(shot.seconds / shot.rays.traced for shot in shots)


def _read(file: Path) -> dict[str, float]:
    """What is kept; nothing where that cannot be read."""
    try:
        found = json.loads(file.read_text(encoding="utf-8"))
        return {str(key): float(value) for key, value in found.items() if float(value) > 0.0}
    except (OSError, ValueError, TypeError, AttributeError):
        return {}


def _keep(file: Path, found: dict[str, float]) -> None:
    """Best effort: without it the probe is made again."""
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(json.dumps(found), encoding="utf-8")
    except OSError:
        return
