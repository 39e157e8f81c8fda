"""Surface materials: what a scene says of a surface. `packet/` evaluates and samples them.

A material refuses values that no surface has, so that a slip of the pen does not turn into light
from nowhere.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from samplers.errors import EnvlightError

Color = tuple[float, float, float]
"""Linear Rec. 709 RGB."""


@dataclass(frozen=True)
class Lambert:
    """Ideal diffuse reflection. albedo in [0, 1] per channel."""

    albedo: Color

    def __post_init__(self) -> None:
        _store_color(self, "albedo")


@dataclass(frozen=True)
class Coated:
    """A diffuse base under a rough dielectric coat: GGX specular lobe over attenuated diffuse.

    albedo : of the base
    roughness : GGX α of the coat, as given (not squared), in [0, 1]
    ior : index of refraction of the coat, in [1, 10]
    """

    albedo: Color
    roughness: float
    ior: float = 1.5

    def __post_init__(self) -> None:
        _store_color(self, "albedo")
        _store_number(self, "roughness", 0.0, 1.0)
        _store_number(self, "ior", 1.0, 10.0)


@dataclass(frozen=True)
class Conductor:
    """Rough metal: GGX with Schlick's Fresnel term.

    reflectance : at normal incidence
    roughness : GGX α, as given (not squared), in [0, 1]
    """

    reflectance: Color
    roughness: float

    def __post_init__(self) -> None:
        _store_color(self, "reflectance")
        _store_number(self, "roughness", 0.0, 1.0)


@dataclass(frozen=True)
class Ward:
    """Ward's anisotropic model (1992) with a diffuse term.

    diffuse, specular : at most 1 together in each channel
    roughness_x, roughness_y : α along the surface's tangent and across it, in [0, 1]; the tangent
        runs around the +Y axis
    """

    diffuse: Color
    specular: Color
    roughness_x: float
    roughness_y: float

    def __post_init__(self) -> None:
        _store_color(self, "diffuse")
        _store_color(self, "specular")
        _store_number(self, "roughness_x", 0.0, 1.0)
        _store_number(self, "roughness_y", 0.0, 1.0)
        if any(d + s > 1.0 for d, s in zip(self.diffuse, self.specular, strict=True)):
            raise EnvlightError(
                f"material: Ward diffuse {self.diffuse} and specular {self.specular} reflect more "
                "than arrives; their sum may be 1 at most in each channel"
            )


Material = Lambert | Coated | Conductor | Ward


def _store_color(material: Any, name: str) -> None:
    value = getattr(material, name)
    fits = isinstance(value, Sequence) and len(value) == 3 and all(map(_is_number, value))
    if not fits or not all(0.0 <= channel <= 1.0 for channel in value):
        raise EnvlightError(
            f"material: {type(material).__name__} {name} is {value!r}; "
            "give three numbers in [0, 1], linear red, green and blue"
        )
    object.__setattr__(material, name, tuple(float(channel) for channel in value))


def _store_number(material: Any, name: str, low: float, high: float) -> None:
    value = getattr(material, name)
    if not _is_number(value) or not low <= value <= high:
        raise EnvlightError(
            f"material: {type(material).__name__} {name} is {value!r}; "
            f"give a number in [{low:g}, {high:g}]"
        )
    object.__setattr__(material, name, float(value))


def _is_number(value: object) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)
