"""What every file format writes: lights by layer, with what they were made from; and the rest.

A program that lights a scene by a map and by lights from it counts light twice, unless what the
lights carry is taken out of the map: a sun that casts shadows, a sky that shines once. "Ours" parts
a map so by itself: EnvDirects stands for the emissive pixels that were given to it (Wu 2025, 3.3),
whose radiance becomes 0 in the residual; the lights of EnvIndirects, which stand for the other
pixels, are left out, because the residual is those pixels. Disc lights come with an ambient map,
which is their residual. The lights of all other methods carry the whole map: nothing is left, and
their residual is black. A distribution has no lights to take out.

Energy: lights and residual together carry ∫ L dω of the map, per channel; `Parted.error` is how far
they are off, in float64, by the texels' solid angles.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from samplers import (
    DirectionalLights,
    DiscLights,
    EnvironmentMap,
    EnvlightError,
    LayeredLights,
    LightSampler,
)
from samplers.conformance.lighting_check import prepared
from samplers.decomposition import Decomposition
from samplers.grids.nearest_light import shining_radius
from samplers.lighting import Lighting

LIGHTS, DIRECT, DISCS = "lights", "direct", "discs"
WIDEST = 0.5 * math.pi
"""Angular radius of a hemisphere: Blender's suns are no wider, and beyond it the irradiance that
USD's `normalize` keeps is no longer that of a facing plane."""


@dataclass(frozen=True, eq=False)
class Layer:
    """Lights of one kind.

    name : "lights", "direct", "indirect" or "discs"
    direction : (n, 3), unit, towards the light, +Y up
    irradiance : (n, 3), ∫ L dω, linear Rec. 709
    angle : (n,), angular radius in radians, at most `WIDEST`: of the disc, or of what shines
        nearer to the light than to all others, those of other layers too (`shining_radius`)
    """

    name: str
    direction: NDArray[np.float64]
    irradiance: NDArray[np.float64]
    angle: NDArray[np.float64]

    @property
    def on_facing_plane(self) -> NDArray[np.float64]:
        """Irradiance (n, 3) of a plane that faces the light.

        A uniform disc of angular radius α gives ∫ L cos θ dω = E (1 + cos α) / 2 there, E being
        its ∫ L dω. A directional light stands for its cluster by E itself.
        """
        if self.name != DISCS:
            return self.irradiance
        return self.irradiance * (0.5 * (1.0 + np.cos(self.angle)))[:, None]


@dataclass(frozen=True, eq=False)
class LightSet:
    """A lighting's lights.

    map_flux : (3,) ∫ L dω of the whole map
    count : lights that were asked for
    ambient : what disc lights leave to an unshadowed map; it is no light
    residual : what the lights leave of the map, where the rest is to be lit by that, and the file
        that holds it, as the written file is to name it
    """

    map_name: str
    map_digest: str
    map_flux: NDArray[np.float64]
    sampler: str
    count: int
    seed: int
    layers: tuple[Layer, ...]
    ambient: EnvironmentMap | None = None
    residual: EnvironmentMap | None = None
    residual_file: str = ""

    def __len__(self) -> int:
        return sum(len(layer.direction) for layer in self.layers)

    @property
    def title(self) -> str:
        """One line. A residual stands for the lights that are left out on purpose."""
        name = " ".join(self.map_name.split())
        text = f"{len(self)} lights of {name} by {self.sampler}, seed {self.seed}"
        fewer = len(self) < self.count and self.residual is None
        return f"{text}; {len(self)} of {self.count} asked" if fewer else text


def light_set(
    lighting: Lighting,
    environment: EnvironmentMap,
    sampler: str,
    count: int,
    seed: int,
    layer: str = LIGHTS,
    residual: EnvironmentMap | None = None,
) -> LightSet:
    """The lights of a lighting; EnvlightError for a distribution, which has none.

    layer : what a single set of directional lights is called
    residual : what the lights leave of the map, where the rest is to be lit by that; lights are as
        large as what they take
    """
    ambient = None
    match lighting:
        case DirectionalLights():
            layers = _layers(environment, residual, {layer: lighting})
        case LayeredLights():
            both = {DIRECT: lighting.direct, "indirect": lighting.indirect}
            layers = _layers(environment, residual, both)
        case DiscLights():
            layers = (Layer(DISCS, lighting.direction, lighting.irradiance, lighting.half_angle),)
            ambient = lighting.ambient
        case _:
            raise EnvlightError(
                f"{sampler} gives a distribution, drawn from afresh at each point, and so has no "
                "set of lights; take a sampler that returns lights, such as median-cut or ours"
            )
    return LightSet(
        environment.name, environment.digest, environment.total_flux, sampler, count, seed, layers,
        ambient, residual,
    )  # fmt: skip


def _layers(
    carried: EnvironmentMap, residual: EnvironmentMap | None, sets: dict[str, DirectionalLights]
) -> tuple[Layer, ...]:
    """Sets of lights by name, as large as what shines of the map that they carry together."""
    if residual is not None and not residual.is_black:
        carried = EnvironmentMap(carried.radiance - residual.radiance)
    direction = np.concatenate([lights.direction for lights in sets.values()])
    angle = np.minimum(shining_radius(carried, direction), WIDEST)
    ends = np.cumsum([len(lights) for lights in sets.values()])
    return tuple(
        Layer(name, lights.direction, lights.irradiance, own)
        for (name, lights), own in zip(sets.items(), np.split(angle, ends[:-1]), strict=True)
    )


def strength_and_color(irradiance: NDArray[np.float64]) -> tuple[float, tuple[float, ...]]:
    """Irradiance (3,) as its largest channel, and the colour that makes the rest of it."""
    strength = float(irradiance.max())
    return strength, tuple((irradiance / strength if strength else np.ones(3)).tolist())


def frame_towards(direction: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rotation matrix (3, 3) whose columns are the images of x, y and z; z goes to `direction`."""
    z = direction / np.linalg.norm(direction)
    helper = np.eye(3)[int(np.abs(z).argmin())]
    x = np.cross(helper, z)
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(z, x), z], axis=1)


def quaternion(rotation: NDArray[np.float64]) -> tuple[float, float, float, float]:
    """Unit quaternion (w, x, y, z) of a rotation matrix."""
    from scipy.spatial.transform import Rotation

    x, y, z, w = Rotation.from_matrix(rotation).as_quat().tolist()
    return w, x, y, z


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
