"""Light patterns: a map, dimmed, with a dot for each light."""

import numpy as np
from numpy.typing import NDArray

from experiments.report.map_picture import COLORS, WIDTH, circles
from experiments.report.preview import automatic_exposure, encoded
from samplers import EnvironmentMap, Lighting

PATTERN_WIDTH = 512
DIMMED = 0.62
"""Factor on the bytes of the map, so that dots stand out."""
RADIUS = 2
FILLS = {**COLORS, "direct": (255, 225, 60)}


def draw_pattern(environment: EnvironmentMap, lighting: Lighting) -> NDArray[np.uint8]:
    """The map with the lights of a global set as dots of one size, (256, 512, 3)."""
    from PIL import Image, ImageDraw

    exposed = encoded(environment.radiance, automatic_exposure(environment.radiance))
    dim = (exposed * DIMMED).astype(np.uint8)
    size = (PATTERN_WIDTH, PATTERN_WIDTH // 2)
    picture = Image.fromarray(dim).resize(size, Image.Resampling.BILINEAR)
    draw = ImageDraw.Draw(picture)
    for circle in circles(lighting):
        x, y = circle.x * PATTERN_WIDTH / WIDTH, circle.y * PATTERN_WIDTH / WIDTH
        box = (x - RADIUS, y - RADIUS, x + RADIUS, y + RADIUS)
        draw.ellipse(box, fill=FILLS[circle.kind], outline=(0, 0, 0))
    return np.array(picture)
