"""Light patterns: a map, dimmed, with a dot for each light; sheets of such pictures."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from experiments.report.map_picture import COLORS, WIDTH, circles
from experiments.report.preview import automatic_exposure, contact_sheet, encoded
from renderer.image import write_jpeg
from samplers import EnvironmentMap, EnvlightError, Lighting

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


def write_sheet(path: Path, tiles: dict[str, Path], columns: int) -> None:
    """A labelled sheet of the PNG files that are there, by label; no file without any."""
    pictures = [(label, _bytes(file)) for label, file in tiles.items() if file.is_file()]
    if pictures:
        write_jpeg(path, contact_sheet(pictures, min(columns, len(pictures))))


def _bytes(file: Path) -> NDArray[np.uint8]:
    from PIL import Image, UnidentifiedImageError

    try:
        with Image.open(file) as picture:
            return np.array(picture.convert("RGB"))
    except (OSError, UnidentifiedImageError) as error:
        raise EnvlightError(f"{file}: not a readable picture ({error}); delete the file") from error


def enlarged(picture: NDArray[np.uint8], least_width: int = 240) -> NDArray[np.uint8]:
    """A picture repeated by a whole factor until it is at least this wide, for labels to fit."""
    factor = max(1, -(-least_width // picture.shape[1]))
    return picture.repeat(factor, axis=0).repeat(factor, axis=1)
