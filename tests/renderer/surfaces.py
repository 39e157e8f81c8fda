"""A material of every kind, and samplers that look at surfaces, prepared."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from renderer.scene.materials import Coated, Conductor, Lambert, Ward
from samplers.environment import EnvironmentMap
from samplers.lighting import SurfaceDistribution
from samplers.registry import make_sampler

SURFACES = {
    "lambert": Lambert((0.6, 0.5, 0.4)),
    "coated": Coated((0.5, 0.3, 0.2), 0.15),
    "conductor": Conductor((0.9, 0.7, 0.5), 0.15),
    "ward": Ward((0.2, 0.2, 0.1), (0.4, 0.3, 0.2), 0.3, 0.15),
}


def prepared(
    name: str, environment: EnvironmentMap, count: int, **parameters: Any
) -> SurfaceDistribution:
    lighting = make_sampler(name, **parameters).prepare(
        environment, count, np.random.default_rng(0)
    )
    assert isinstance(lighting, SurfaceDistribution)
    return lighting


def spoiled(array: NDArray, value: float) -> NDArray:
    """The same but for the very last number."""
    array = array.copy()
    array.flat[-1] = value
    return array
