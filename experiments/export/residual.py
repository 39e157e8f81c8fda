"""A map parted into lights and a residual map: a sun that casts shadows, a sky that shines once.

A program that lights a scene by a map and by lights from it counts light twice, unless what the
lights carry is taken out of the map. "Ours" parts a map so by itself: EnvDirects stands for the
emissive pixels that were given to it (Wu 2025, 3.3), whose radiance becomes 0 in the residual; the
lights of EnvIndirects, which stand for the other pixels, are left out, because the residual is
those pixels. Disc lights come with an ambient map, which is their residual. The lights of all other
methods carry the whole map: nothing is left, and their residual is black. A distribution has no
lights to take out.

Energy: lights and residual together carry ∫ L dω of the map, per channel; `Parted.error` is how far
they are off, in float64, by the texels' solid angles.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from experiments.export.light_set import DIRECT, LIGHTS
from samplers import DirectionalLights, DiscLights, EnvironmentMap, LayeredLights, LightSampler
from samplers.conformance.lighting_check import prepared
from samplers.decomposition import Decomposition
from samplers.lighting import Lighting


@dataclass(frozen=True, eq=False)
class Parted:
    """A map as lights and what they leave.

    lights : those that are written; a distribution, too, which has none
    layer : what directional lights among them are called
    residual : the map without what the lights carry
    meaning : one sentence about what is left, and why
    whole : (3,) ∫ L dω of the map; carried : (3,) that of the lights; left : (3,) of the residual
    """

    lights: Lighting
    layer: str
    residual: EnvironmentMap
    meaning: str
    whole: NDArray[np.float64]
    carried: NDArray[np.float64]
    left: NDArray[np.float64]

    @property
    def error(self) -> NDArray[np.float64]:
        """(3,) by which part of the map's energy lights and residual are off, signed; 0 of none."""
        off = self.carried + self.left - self.whole
        return np.divide(off, self.whole, out=off.copy(), where=self.whole > 0.0)


def part(
    sampler: LightSampler, environment: EnvironmentMap, count: int, rng: np.random.Generator
) -> Parted:
    """The lights of a sampler at a budget of `count`, and the map without what they carry."""
    radiance, layer = environment.radiance, LIGHTS
    if isinstance(sampler, Decomposition):
        found = sampler.decompose(environment, count, rng)
        lights: Lighting = found.lights.direct
        layer = DIRECT
        radiance = np.where(found.carried[..., None], np.float32(0.0), radiance)
        meaning = (
            f"lights of EnvDirects, which are written: {len(found.lights.direct)}; pixels that "
            f"they carry, black in the residual: {int(found.carried.sum())}; lights of "
            f"EnvIndirects, in whose place the residual is: {len(found.lights.indirect)}"
        )
        if not len(found.lights.direct):
            meaning = "EnvDirects has no pixels to stand for: no lights; the residual is the map"
    else:
        lights = prepared(sampler, environment, count, rng)
        if isinstance(lights, DiscLights):
            radiance = lights.ambient.radiance
            meaning = "the residual is the ambient map, what the discs leave"
        else:
            radiance = np.zeros(radiance.shape, np.float32)  # unlike zeros_like, no memory yet
            meaning = f"nothing is left: {sampler.name} gives all of the map to its lights"
    residual = EnvironmentMap(radiance, f"{environment.name} residual")
    carried, left = _carried(lights), residual.total_flux
    return Parted(lights, layer, residual, meaning, environment.total_flux, carried, left)


def _carried(lights: Lighting) -> NDArray[np.float64]:
    match lights:
        case DirectionalLights() | DiscLights():
            return np.asarray(lights.irradiance.sum(axis=0))
        case LayeredLights():
            return np.asarray(
                lights.direct.irradiance.sum(axis=0) + lights.indirect.irradiance.sum(axis=0)
            )
    return np.zeros(3)


def audit(parted: Parted) -> str:
    """The energy of lights and residual beside the map's, per channel, in one line."""
    share = np.divide(parted.carried, parted.whole, out=np.zeros(3), where=parted.whole > 0.0)
    channels = (
        f"{name} {100.0 * lit:.4g} % in lights, off by {off:+.1e}"
        for name, lit, off in zip("RGB", share, parted.error, strict=True)
    )
    return f"energy of lights + residual against the map's: {'; '.join(channels)}"
