"""Surface materials: what a scene says of a surface. `brdf.py` evaluates and samples them."""

from dataclasses import dataclass

Color = tuple[float, float, float]
"""Linear Rec. 709 RGB."""


@dataclass(frozen=True)
class Lambert:
    """Ideal diffuse reflection. albedo in [0, 1] per channel."""

    albedo: Color


@dataclass(frozen=True)
class Coated:
    """A diffuse base under a rough dielectric coat: GGX specular lobe over attenuated diffuse.

    albedo : of the base
    roughness : GGX α of the coat, as given (not squared)
    ior : index of refraction of the coat
    """

    albedo: Color
    roughness: float
    ior: float = 1.5


@dataclass(frozen=True)
class Conductor:
    """Rough metal: GGX with Schlick's Fresnel term. reflectance at normal incidence."""

    reflectance: Color
    roughness: float


@dataclass(frozen=True)
class Ward:
    """Ward's anisotropic model (1992) with a diffuse term.

    roughness_x, roughness_y : α along the surface's tangent and across it; the tangent runs
        around the +Y axis
    """

    diffuse: Color
    specular: Color
    roughness_x: float
    roughness_y: float


Material = Lambert | Coated | Conductor | Ward
