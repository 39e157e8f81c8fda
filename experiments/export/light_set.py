"""What every file format writes: lights by layer, with what they were made from."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from samplers import DirectionalLights, DiscLights, EnvironmentMap, EnvlightError, LayeredLights
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
