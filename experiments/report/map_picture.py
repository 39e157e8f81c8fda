"""A map as a picture: exposed, its emissive region outlined, lights as circles or dots."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from experiments.maps.features import SPHERE, Survey, share_in_brightest
from samplers import (
    DirectionalLights,
    DiscLights,
    EnvironmentMap,
    LayeredLights,
    Lighting,
    SurfaceDistribution,
)
from samplers.decomposition.emissive import classify
from samplers.preview import automatic_exposure, encoded, reduced
from samplers.sphere import uv_from_direction

WIDTH = 1024
COLORS = {"direct": (255, 60, 60), "indirect": (80, 140, 255), "sample": (255, 110, 200)}
EMISSIVE_COLOR = np.array([255, 190, 0])
TINT = 0.45
"""How strongly a region's colour covers the map."""
SHOWN_SAMPLES = 256
"""How many draws of a distribution stand for it."""
PATTERN_WIDTH = 512
DIMMED = 0.62
"""Factor on the bytes of the map, so that dots stand out."""
RADIUS = 2
FILLS = {**COLORS, "direct": (255, 225, 60)}


@dataclass(frozen=True)
class Circle:
    """A light on a map of 1024 × 512; kind: "direct", "indirect", or "sample" of a distribution."""

    x: float
    y: float
    radius: float
    kind: str


def statistics(environment: EnvironmentMap) -> dict[str, str]:
    """What characterises a map as a light source, as text by name; then what its file says."""
    survey, black = Survey(environment), environment.is_black
    mean = 0.0 if black else survey.energy / SPHERE
    largest = float(environment.luminance.max())

    def top(part: float) -> str:
        if black:
            return "none: the map is black"
        return f"{100.0 * share_in_brightest(survey, part):.1f} %"

    regions = classify(environment)
    return {
        "name": environment.name,
        "size": f"{environment.width}×{environment.height}",
        "mean luminance": f"{mean:.6g}",
        "largest luminance": f"{largest:.6g}",
        "largest over mean": "none" if black else f"{largest / mean:.1f}",
        "energy in top 2 % of sphere": top(0.02),
        "energy in top 0.1 %": top(0.001),
        "emissive texels": f"{100.0 * regions.emissive.mean():.2f} %",
        "energy of emissive texels": "none"
        if black
        else f"{100.0 * regions.emissive_flux / survey.energy:.1f} %",
        **environment.facts,
    }


def _shown(environment: EnvironmentMap) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Radiance (h, w, 3) and what of it is emissive (h, w), of at most 1024 columns.

    A wider map is reduced to means over blocks of texels, which are emissive where any texel is.
    """
    radiance, emissive = environment.radiance, classify(environment).emissive
    return reduced(radiance, WIDTH), reduced(emissive.astype(np.float32), WIDTH) > 0.0


def _exposed(radiance: NDArray[np.float32]) -> NDArray[np.uint8]:
    return encoded(radiance, automatic_exposure(radiance))


def draw_circles(environment: EnvironmentMap, lights: list[Circle]) -> NDArray[np.uint8]:
    """The map at 1024 × 512 with its emissive region outlined and the given circles."""
    from PIL import Image, ImageDraw

    radiance, emissive = _shown(environment)
    exposed = _exposed(radiance)
    exposed[_outline(emissive)] = EMISSIVE_COLOR
    picture = Image.fromarray(exposed).resize((WIDTH, WIDTH // 2), Image.Resampling.NEAREST)
    draw = ImageDraw.Draw(picture)
    for circle in lights:
        x, y, radius = circle.x, circle.y, circle.radius
        box = (x - radius, y - radius, x + radius, y + radius)
        draw.ellipse(box, outline=COLORS[circle.kind], width=3)
    return np.array(picture)


def draw_regions(environment: EnvironmentMap) -> NDArray[np.uint8]:
    """The map at 1024 × 512, emissive texels in red and all others in blue."""
    from PIL import Image

    radiance, emissive = _shown(environment)
    exposed = _exposed(radiance)
    tint = np.where(emissive[..., None], COLORS["direct"], COLORS["indirect"])
    mixed = np.round(exposed + TINT * (tint - exposed.astype(np.float64))).astype(np.uint8)
    picture = Image.fromarray(mixed).resize((WIDTH, WIDTH // 2), Image.Resampling.NEAREST)
    return np.array(picture)


def halved(picture: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """A picture (H, W, 3) at half its size, box-filtered."""
    from PIL import Image

    height, width = picture.shape[:2]
    small = Image.fromarray(picture).resize((width // 2, height // 2), Image.Resampling.BOX)
    return np.array(small)


def circles(lighting: Lighting) -> list[Circle]:
    """Where lights lie. Circles grow with the fourth root of a light's share of the energy.

    A distribution has no lights of its own; 256 draws stand for it.
    """
    match lighting:
        case LayeredLights():
            return [*_of(lighting.indirect, "indirect"), *_of(lighting.direct, "direct")]
        case DirectionalLights() | DiscLights():
            return _of(lighting, "direct")
        case SurfaceDistribution():
            return []
    u = np.random.default_rng(0).random((SHOWN_SAMPLES, 3), np.float32)
    direction, pdf = lighting.sample(u)
    x, y = uv_from_direction(direction[pdf > 0.0])
    return [
        Circle(round(float(a) * WIDTH, 1), round(float(b) * WIDTH / 2, 1), 3.0, "sample")
        for a, b in zip(x, y, strict=True)
    ]


def _of(lights: DirectionalLights | DiscLights, kind: str) -> list[Circle]:
    u, v = uv_from_direction(lights.direction)
    strength = lights.irradiance.sum(axis=1)
    share = strength / max(float(strength.sum()), 1e-300)
    return [
        Circle(
            round(float(x) * WIDTH, 1),
            round(float(y) * WIDTH / 2, 1),
            round(3.0 + 12.0 * float(part) ** 0.25, 2),
            kind,
        )
        for x, y, part in zip(u, v, share, strict=True)
    ]


def _outline(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Members of the mask that touch a texel outside it, across the seam too."""
    inside = mask & np.roll(mask, 1, axis=1) & np.roll(mask, -1, axis=1)
    inside[1:] &= mask[:-1]
    inside[:-1] &= mask[1:]
    return mask & ~inside


def draw_pattern(environment: EnvironmentMap, lighting: Lighting) -> NDArray[np.uint8]:
    """The map with the lights of a global set as dots of one size, (256, 512, 3)."""
    from PIL import Image, ImageDraw

    exposed = _exposed(_shown(environment)[0])
    dim = (exposed * DIMMED).astype(np.uint8)
    size = (PATTERN_WIDTH, PATTERN_WIDTH // 2)
    picture = Image.fromarray(dim).resize(size, Image.Resampling.BILINEAR)
    draw = ImageDraw.Draw(picture)
    for circle in circles(lighting):
        x, y = circle.x * PATTERN_WIDTH / WIDTH, circle.y * PATTERN_WIDTH / WIDTH
        box = (x - RADIUS, y - RADIUS, x + RADIUS, y + RADIUS)
        draw.ellipse(box, fill=FILLS[circle.kind], outline=(0, 0, 0))
    return np.array(picture)
