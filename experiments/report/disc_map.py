"""Disc lights drawn on their map: outlines over it, and the lighting that they stand for."""

import math

import numpy as np
from numpy.typing import NDArray

from experiments.report.preview import automatic_exposure, encoded
from samplers import DiscLights, EnvironmentMap
from samplers.center_surround import disc_pixels
from samplers.sphere import cap_solid_angle, normalized, uv_from_direction

COLOR = (255, 60, 60)
CORNERS = 256


def rim(centre: NDArray[np.float64], half_angle: float) -> list[NDArray[np.float64]]:
    """The rim of a disc as runs of map coordinates (n, 2), cut where it crosses the seam."""
    axis = np.eye(3)[np.argmin(np.abs(centre))]
    tangent = normalized(np.cross(axis, centre), axis)
    turn = np.linspace(0.0, 2.0 * math.pi, CORNERS + 1)[:, None]
    side = np.cos(turn) * tangent + np.sin(turn) * np.cross(centre, tangent)
    u, v = uv_from_direction(math.cos(half_angle) * centre + math.sin(half_angle) * side)
    seam = np.flatnonzero(np.abs(np.diff(u)) > 0.5) + 1
    return np.split(np.stack([u, v], axis=1), seam)


def as_map(lights: DiscLights) -> NDArray[np.float64]:
    """The radiance (H, 2H, 3) that the lighting stands for: ambient map and uniform discs."""
    radiance = lights.ambient.radiance.astype(np.float64)
    height, width = radiance.shape[:2]
    u, v = uv_from_direction(lights.direction)
    level = lights.irradiance / cap_solid_angle(lights.half_angle)[:, None]
    for k, half_angle in enumerate(lights.half_angle):
        disc = disc_pixels(height, float(u[k]), float(v[k]), float(half_angle))
        for i, row in enumerate(disc.row):
            radiance[row, disc.columns(i, width)] += level[k]
    return radiance


def draw_discs(
    environment: EnvironmentMap, lights: DiscLights, width: int
) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    """The map with the discs' rims, and the lighting as a map, (width / 2, width, 3) each.

    Both have the map's exposure.
    """
    from PIL import Image, ImageDraw

    exposure = automatic_exposure(environment.radiance)
    size = (width, width // 2)
    pictures = [
        Image.fromarray(encoded(radiance, exposure)).resize(size, Image.Resampling.BOX)
        for radiance in (environment.radiance, as_map(lights))
    ]
    draw = ImageDraw.Draw(pictures[0])
    for centre, half_angle in zip(lights.direction, lights.half_angle, strict=True):
        for run in rim(centre, float(half_angle)):
            draw.line([(u * size[0], v * size[1]) for u, v in run], fill=COLOR, width=2)
    return np.array(pictures[0]), np.array(pictures[1])
