"""Comparison figures: a reference and the methods' images in columns, with insets and error maps.

Each column holds, from top to bottom, the method's name, its image with the insets' frames, its
numbers, the insets enlarged, and its FLIP map. Small images are enlarged by whole factors without
smoothing, large ones box-filtered. Insets are the windows with the largest mean error over all
methods, so that none is favoured.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from samplers.preview import encoded, reduced

PANEL = 320
"""Columns of a picture at most."""
LEAST_PANEL = 220
"""Smaller pictures are enlarged up to this, or beyond by less than a factor of two."""
INSET_SHARE = 0.2
"""Side of an inset in units of the image's."""
FRAMES = ((255, 80, 60), (60, 200, 255))
GAP, LINE, MARGIN = 4, 15, 6
BACKGROUND, INK, FAINT = (255, 255, 255), (0, 0, 0), (90, 90, 90)


@dataclass(frozen=True, eq=False)
class Column:
    """One column.

    image : (H, W, 3) exposed linear radiance; error_map : (H, W) in [0, 1], None for the reference
    lines : below the image, such as its numbers
    """

    label: str
    image: NDArray[np.float32]
    error_map: NDArray[np.float32] | None
    lines: tuple[str, ...]


@dataclass(frozen=True)
class Window:
    """A part of an image, in pixels."""

    top: int
    left: int
    height: int
    width: int

    @property
    def slices(self) -> tuple[slice, slice]:
        return slice(self.top, self.top + self.height), slice(self.left, self.left + self.width)


def worst_windows(error: NDArray[np.float32], count: int = len(FRAMES)) -> list[Window]:
    """The windows of largest mean error (H, W), largest first, that do not overlap."""
    height, width = (max(1, round(INSET_SHARE * side)) for side in error.shape)
    table = np.zeros((error.shape[0] + 1, error.shape[1] + 1))
    table[1:, 1:] = error.cumsum(axis=0, dtype=np.float64).cumsum(axis=1)
    total = (
        table[height:, width:] - table[:-height, width:] - table[height:, :-width]
        + table[:-height, :-width]
    )  # fmt: skip
    found: list[Window] = []
    for _ in range(count):
        best = int(total.argmax())
        top, left = divmod(best, total.shape[1])
        if not np.isfinite(total[top, left]):
            break
        found.append(Window(top, left, height, width))
        total[
            max(0, top - height + 1) : top + height, max(0, left - width + 1) : left + width
        ] = -math.inf
    return found


def comparison_figure(
    pictures: list[Column], windows: list[Window], title: str, columns: int
) -> NDArray[np.uint8]:
    """The columns side by side, in rows of at most `columns`, under a title; (H, W, 3)."""
    from PIL import Image, ImageDraw, ImageFont

    tiles = [_column(picture, windows[: len(FRAMES)]) for picture in pictures]
    width, height = tiles[0].width, max(tile.height for tile in tiles)
    columns = min(columns, len(tiles))
    rows = math.ceil(len(tiles) / columns)
    top = LINE + 2 * MARGIN
    size = columns * (width + GAP) - GAP + 2 * MARGIN, rows * (height + MARGIN) + top
    sheet = Image.new("RGB", size, BACKGROUND)
    ImageDraw.Draw(sheet).text((MARGIN, MARGIN), title, INK, ImageFont.load_default(13))
    for index, tile in enumerate(tiles):
        row, column = divmod(index, columns)
        sheet.paste(tile, (MARGIN + column * (width + GAP), top + row * (height + MARGIN)))
    return np.array(sheet)


def _column(picture: Column, windows: list[Window]):
    from PIL import Image, ImageDraw, ImageFont

    shown, scale = _fitted(picture.image)
    height, width = shown.shape[:2]
    inset = round((width - GAP) / 2 * _aspect(picture.image))
    lines = 2 * LINE
    total = LINE + height + lines + inset + GAP + height
    tile = Image.new("RGB", (width, total), BACKGROUND)
    draw, font = ImageDraw.Draw(tile), ImageFont.load_default(12)
    draw.text((0, 0), picture.label, INK, font)
    tile.paste(Image.fromarray(encoded(shown)), (0, LINE))
    for frame, window in zip(FRAMES, windows, strict=False):
        left, top = round(window.left * scale), LINE + round(window.top * scale)
        right = left + round(window.width * scale) - 1
        draw.rectangle((left, top, right, top + round(window.height * scale) - 1), outline=frame)
    y = LINE + height
    for k, line in enumerate(picture.lines[:2]):
        draw.text((0, y + k * LINE), line, FAINT if k else INK, font)
    y += lines
    half = (width - GAP) // 2
    for k, (frame, window) in enumerate(zip(FRAMES, windows, strict=False)):
        part = Image.fromarray(encoded(picture.image[window.slices]))
        smooth = Image.Resampling.BOX if part.width > half else Image.Resampling.NEAREST
        box = (k * (half + GAP), y)
        tile.paste(part.resize((half, inset), smooth), box)
        corner = (box[0] + half - 1, y + inset - 1)
        draw.rectangle((*box, *corner), outline=frame)
    y += inset + GAP
    if picture.error_map is None:
        _scale_bar(draw, font, y, width)
    else:
        error, _ = _fitted(picture.error_map)
        tile.paste(Image.fromarray(flip_colors(error)), (0, y))
    return tile


def _aspect(image: NDArray[np.float32]) -> float:
    """Height over width, which insets share with their image."""
    return image.shape[0] / image.shape[1]


def _fitted(image: NDArray[np.float32]) -> tuple[NDArray[np.float32], float]:
    """The image at the panel's size, and how many of its pixels one of the image's becomes."""
    width = image.shape[1]
    if width > PANEL:
        return reduced(image, PANEL), PANEL / width
    factor = max(1, math.ceil(LEAST_PANEL / width))
    return image.repeat(factor, axis=0).repeat(factor, axis=1), float(factor)


def flip_colors(error: NDArray[np.float32]) -> NDArray[np.uint8]:
    """Errors in [0, 1] in the "magma" colours that FLIP's authors use, (H, W, 3)."""
    import matplotlib as mpl

    table = mpl.colormaps["magma"](np.arange(256), bytes=True)[:, :3]
    colors: NDArray[np.uint8] = table[np.round(np.clip(error, 0.0, 1.0) * 255.0).astype(np.intp)]
    return colors


def _scale_bar(draw, font, y: int, width: int) -> None:
    """Under the reference: which colour is which FLIP error."""
    bar = flip_colors(np.linspace(0.0, 1.0, width, dtype=np.float32)[None, :])[0]
    for x in range(width):
        draw.line((x, y + LINE, x, y + 2 * LINE), fill=tuple(int(c) for c in bar[x]))
    draw.text((0, y), "FLIP error", INK, font)
    draw.text((0, y + 2 * LINE + 1), "0", INK, font)
    draw.text((width - 8, y + 2 * LINE + 1), "1", INK, font)
