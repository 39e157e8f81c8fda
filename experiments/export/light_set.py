"""What every file format writes: lights by layer, with what they were made from."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from samplers import DirectionalLights, DiscLights, EnvironmentMap, EnvlightError, LayeredLights
from samplers.lighting import Lighting

LIGHTS, DIRECT, DISCS = "lights", "direct", "discs"


@dataclass(frozen=True, eq=False)
class Layer:
    """Lights of one kind.

    name : "lights", "direct", "indirect" or "discs"
    direction : (n, 3), unit, towards the light, +Y up
    irradiance : (n, 3), ∫ L dω, linear Rec. 709
    angle : (n,), angular radius in radians: of the disc, or the extent of the light's cluster
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

    ambient : what disc lights leave to an unshadowed map; it is no light
    residual : what the lights leave of the map, where the rest is to be lit by that, and the file
        that holds it, as the written file is to name it
    """

    map_name: str
    map_digest: str
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
        return f"{len(self)} lights of {self.map_name} by {self.sampler}, seed {self.seed}"


def light_set(
    lighting: Lighting,
    environment: EnvironmentMap,
    sampler: str,
    count: int,
    seed: int,
    layer: str = LIGHTS,
) -> LightSet:
    """The lights of a lighting; EnvlightError for a distribution, which has none.

    layer : what a single set of directional lights is called
    """
    ambient = None
    match lighting:
        case DirectionalLights():
            layers: tuple[Layer, ...] = (_layer(layer, lighting),)
        case LayeredLights():
            layers = (_layer(DIRECT, lighting.direct), _layer("indirect", lighting.indirect))
        case DiscLights():
            layers = (Layer(DISCS, lighting.direction, lighting.irradiance, lighting.half_angle),)
            ambient = lighting.ambient
        case _:
            raise EnvlightError(
                f"{sampler} gives a distribution, drawn from afresh at each point, and so has no "
                "set of lights; take a sampler that returns lights, such as median-cut or ours"
            )
    digest = environment.digest
    return LightSet(environment.name, digest, sampler, count, seed, layers, ambient)


def _layer(name: str, lights: DirectionalLights) -> Layer:
    return Layer(name, lights.direction, lights.irradiance, lights.extent)


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
