"""From an environment map to a lighting: the samplers under comparison."""

from samplers import hidden_packages as hidden_packages  # isort: skip  # before they are missed
from samplers import kernel_cache as kernel_cache  # isort: skip  # before any kernel
from samplers.base import LightSampler, register
from samplers.environment import EnvironmentMap
from samplers.errors import EnvlightError
from samplers.lighting import (
    DirectionalLights,
    DiscLights,
    LayeredLights,
    LightDistribution,
    Lighting,
    Picture,
    PictureDistribution,
    Surface,
    SurfaceDistribution,
    SurfaceSamples,
    TabulatedLight,
)
from samplers.registry import make_sampler, sampler_class, sampler_labels, sampler_names

__all__ = [
    "DirectionalLights",
    "DiscLights", "EnvironmentMap", "EnvlightError", "LayeredLights", "LightDistribution",
    "LightSampler", "Lighting", "Picture", "PictureDistribution", "Surface",
    "SurfaceDistribution", "SurfaceSamples", "TabulatedLight", "make_sampler", "register",
    "sampler_class", "sampler_labels", "sampler_names",
]  # fmt: skip
