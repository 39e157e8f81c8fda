"""My sampler: the idea in two or three sentences, then the source (authors, title, year, section).

This one puts each light where flux × squared distance from the lights so far is largest; every
texel then gives its energy to the nearest light.
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from samplers import DirectionalLights, EnvironmentMap, LightSampler, register
from samplers.sphere import angular_distance, pixel_directions


@register("my-sampler")  # what commands and rows call it
@dataclass(frozen=True)
class MySampler(LightSampler):
    """One line that says what it is."""

    label: ClassVar[str] = "My sampler"  # what tables and plots call it, with author and year
    spread: float = 2.0  # a field is a parameter: MySampler[spread=1]

    # A method that draws from `rng` also says: stochastic: ClassVar[bool] = True
    def _prepare(
        self, environment: EnvironmentMap, count: int, rng: np.random.Generator
    ) -> DirectionalLights:
        if environment.is_black:
            return DirectionalLights.none()
        texel = pixel_directions(environment.height).reshape(-1, 3)  # towards the light, +Y is up
        solid_angle = np.repeat(environment.row_solid_angle, environment.width)  # sr
        flux = environment.radiance.reshape(-1, 3) * solid_angle[:, None]  # W·m⁻² per channel
        importance = environment.flux.reshape(-1)  # luminance × solid angle
        lights: list[int] = []  # texels with a light; at most `count`, fewer where few are lit
        owner = np.zeros(len(texel), np.int64)  # each texel's light
        angle = np.full(len(texel), np.pi)  # and how far that is
        while len(lights) < count and (importance * angle).any():
            best = int(np.argmax(importance * angle**self.spread))
            distance = angular_distance(texel, texel[best])
            distance[best] = 0.0
            nearer = distance < angle - 1e-9  # of two at equal distance the first stays owner
            owner[nearer], angle[nearer] = len(lights), distance[nearer]
            lights.append(best)
        irradiance = [np.bincount(owner, flux[:, channel]) for channel in range(3)]
        extent = np.bincount(owner, solid_angle * angle) / np.bincount(owner, solid_angle)
        return DirectionalLights(texel[lights], np.stack(irradiance, axis=1), extent)
