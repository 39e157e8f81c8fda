"""How fast this machine traces rays: a short probe.

The probe is a small image by the sampler in whose seconds per ray a table tells its own machine's
speed, rendered a few times; the least time counts, since whatever else runs only adds.
"""

import numpy as np

from experiments.maps import places
from experiments.questions.advice.measured import Measured
from renderer.render import render
from renderer.scene.load import load_scene
from renderer.view import make_view
from samplers import make_sampler

MAP, MAP_HEIGHT, SCENE, SIZE, COUNT, ROUNDS = "noon-desert", 64, "vase", (112, 84, 4), 16, 5


def speed_here(table: Measured) -> float:
    """Seconds for a ray on this machine over those on the table's."""
    return probe() / table.machine_seconds


def probe() -> float:
    """Seconds for a ray: the least over a few small images, after one that is thrown away."""
    environment = places.make(MAP, MAP_HEIGHT)
    sampler = make_sampler("median-cut")
    lighting = sampler.prepare(environment, COUNT, np.random.default_rng(0))
    view = make_view(load_scene(SCENE), *SIZE)
    shots = [render(view, lighting, environment) for _ in range(ROUNDS + 1)][1:]
    return min(shot.seconds / shot.rays.traced for shot in shots)
