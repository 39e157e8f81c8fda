"""Brightest texels: lights at the texels of the largest flux, and nothing is shared out by hand.

Each texel of the map gives its energy to the nearest of the lights, so that the total is kept. A
sun takes all the lights to itself, which is what makes this a poor sampler and a good example.
"""

from dataclasses import dataclass

import numpy as np

from samplers import DirectionalLights, EnvironmentMap, LightSampler
from samplers.grids.nearest_light import nearest_light_cells
from samplers.sphere import pixel_direction


@dataclass(frozen=True)
class BrightestTexels(LightSampler):
    """Lights at the texels of the largest flux."""

    def _prepare(
        self, environment: EnvironmentMap, count: int, rng: np.random.Generator
    ) -> DirectionalLights:
        flux = environment.flux.reshape(-1)
        brightest = np.argsort(-flux, kind="stable")[:count]
        brightest = brightest[flux[brightest] > 0.0]
        if len(brightest) == 0:
            return DirectionalLights.none()
        row, column = np.divmod(brightest, environment.width)
        direction = pixel_direction(row, column, environment.height)
        cells = nearest_light_cells(direction, environment.radiance)
        return DirectionalLights(direction, cells.flux, np.nan_to_num(cells.angle(direction)))
