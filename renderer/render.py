"""From a view and a lighting to an image: one dispatch on what the lighting can do."""

import time
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from renderer.area import Mode, shade_discs
from renderer.background import background_radiance
from renderer.denoise import denoised, is_denoised
from renderer.direct import interleaved, shade_directional
from renderer.monte_carlo import shade_distribution
from renderer.picture import shade_picture
from renderer.rays import RayCount
from renderer.resampled import candidates_in_place, shade_in_place
from renderer.surface import shade_surface
from renderer.upsampling import guides_of, split_guides_of, unsplit, upsample
from renderer.view import View, finite
from samplers.environment import EnvironmentMap
from samplers.lighting import (
    SETS,
    DirectionalLights,
    DiscLights,
    LayeredLights,
    LightDistribution,
    Lighting,
    PictureDistribution,
    ResampledCandidates,
    SurfaceDistribution,
)
from samplers.preview import thumbnail

DIRECT_STREAM, INDIRECT_STREAM = 0, 1


@dataclass(frozen=True, eq=False)
class Rendering:
    """An image and what it cost.

    image : (height, width, 3) float32, linear radiance
    rays : by kind; primary rays belong to the view and are not traced again
    seconds : wall time of shading, without the view and the lighting
    """

    image: NDArray[np.float32]
    rays: RayCount
    seconds: float

    def __repr__(self) -> str:
        height, width = self.image.shape[:2]
        return f"Rendering({width}×{height}, {self.rays.traced} rays, {self.seconds:.3g} s)"

    def _repr_png_(self) -> bytes:
        return thumbnail(self.image)


def render(
    view: View,
    lighting: Lighting,
    environment: EnvironmentMap,
    seed: int = 0,
    sets: int = SETS,
    mode: Mode = "area",
) -> Rendering:
    """The view under `lighting`, with `environment` behind it.

    seed : of the interleaved sets and of the low-discrepancy points
    sets : interleaved sets of directional lights, 1 for none
    mode : how disc lights are shaded
    """
    started = time.perf_counter()
    match lighting:
        case LayeredLights() if lighting.upsampling > 1:
            points, layer, rays = _layered(view, lighting, seed, sets)
            image = view.to_image(points, background_radiance(view, environment))
            if layer is not None:
                image = finite(image + layer)
        case _:
            points, rays = _shade(view, lighting, environment, seed, sets, mode)
            image = view.to_image(points, background_radiance(view, environment))
    if is_denoised(lighting):
        image = denoised(view, image)
    primary = view.width * view.height * view.subpixels
    return Rendering(image, replace(rays, primary=primary), time.perf_counter() - started)


def _shade(
    view: View,
    lighting: Lighting,
    environment: EnvironmentMap,
    seed: int,
    sets: int,
    mode: Mode,
) -> tuple[NDArray[np.float32], RayCount]:
    match lighting:
        case DirectionalLights():
            return _directional(view, lighting, seed, sets, DIRECT_STREAM)
        case LayeredLights():
            return _both_layers(view, lighting, seed, sets)
        case DiscLights():
            return shade_discs(view, lighting, seed, mode)
        case PictureDistribution():
            return shade_picture(view, environment, lighting, seed)
        case SurfaceDistribution():
            density = candidates_in_place(lighting, environment)
            if density is not None and isinstance(lighting, ResampledCandidates):
                return shade_in_place(view, environment, lighting, density, seed)
            return shade_surface(view, environment, lighting, seed)
        case LightDistribution():
            return shade_distribution(view, environment, lighting, seed)
    raise TypeError(f"not a lighting: {type(lighting).__name__}")


def _directional(
    view: View, lights: DirectionalLights, seed: int, sets: int, stream: int
) -> tuple[NDArray[np.float32], RayCount]:
    return shade_directional(view, *_sets_of(lights, seed, sets, stream))


def _sets_of(
    lights: DirectionalLights, seed: int, sets: int, stream: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Directions and irradiance (sets, n, 3) of a layer's interleaved sets."""
    return interleaved(lights, sets, np.random.default_rng([seed, stream]))


def _both_layers(
    view: View, lights: LayeredLights, seed: int, sets: int
) -> tuple[NDArray[np.float32], RayCount]:
    """The points under both layers at full resolution, in one pass over them."""
    parts = (
        _sets_of(lights.direct, seed, sets, DIRECT_STREAM),
        _sets_of(lights.indirect, seed, sets, INDIRECT_STREAM),
    )
    direction, irradiance = (np.concatenate(part, axis=1) for part in zip(*parts, strict=True))
    return shade_directional(view, direction, irradiance)


def _layered(
    view: View, lights: LayeredLights, seed: int, sets: int
) -> tuple[NDArray[np.float32], NDArray[np.float32] | None, RayCount]:
    """The points under the direct layer, and the indirect one as an image, upsampled."""
    points, rays = _directional(view, lights.direct, seed, sets, DIRECT_STREAM)
    if len(lights.indirect) == 0:
        return points, None, rays
    depth_range = (float(view.depth.min()), float(view.depth.max())) if len(view) else (0.0, 1.0)
    small_view = view.reduced(lights.upsampling)
    small_guides = guides_of(small_view, depth_range)
    small_points, more = _directional(small_view, lights.indirect, seed, sets, INDIRECT_STREAM)
    small = small_view.to_image(small_points, None)
    coverage = small_guides.coverage[..., None]
    small = np.divide(small, coverage, out=np.zeros_like(small), where=coverage > 0.0)
    if lights.guides == "subpixel":
        guides = split_guides_of(view, depth_range)
    else:
        guides = unsplit(guides_of(view, depth_range))
    return points, upsample(small, small_guides, guides), rays + more
