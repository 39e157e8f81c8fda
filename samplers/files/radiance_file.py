"""Radiance pictures (.hdr): their header is read whole, their pixels from all three layouts.

A scan line is stored flat, in runs of pixels (the old way), or in runs of each component by itself.
A line tells the last by its first pixel; a flat file is told by its length where runs do not fit.

Source: Ward, "Real pixels", Graphics Gems II, 1991; Radiance's "File formats", section "Picture
files" (radsite.lbl.gov/radiance/refer/filefmts.pdf).
"""

import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from samplers.compiled import kernel
from samplers.errors import EnvlightError
from samplers.files.colours import XYZ, converted_from, to_rec709
from samplers.files.stored_image import StoredImage, check_size, one_line

MAGIC = b"#?"
RGBE, XYZE = "32-bit_rle_rgbe", "32-bit_rle_xyze"
LARGEST = 255.0 * 2.0**119
ROUNDING = 2.0**-7
"""Mantissas are cut off after eight bits, of which the largest has the first set."""
SCALES = np.ldexp(np.float32(1.0), np.arange(256, dtype=np.int32) - 136)
"""What a mantissa is multiplied with, by its exponent; 0 stands for black."""
SCALES[0] = 0.0
LONGEST_RUN = 127
SIZE_LINE = re.compile(r"\s*([+-][XY])\s+(\d{1,10})\s+([+-][XY])\s+(\d{1,10})", re.ASCII)


@kernel
def _components(data, place, width):
    """The width that a line begins with whose components are stored in runs each, -1 in others."""
    if not 8 <= width <= 0x7FFF or place + 4 > len(data):
        return -1
    length = (int(data[place + 2]) << 8) + int(data[place + 3])
    return length if data[place] == 2 and data[place + 1] == 2 and length <= 0x7FFF else -1


@kernel
def _runs_of_components(data, place, line):
    """Read one line (W, 4) whose components are stored one after the other; returns where it ends,
    or -1 where it is wrong."""
    width = len(line)
    for component in range(4):
        x = 0
        while x < width:
            if place + 1 >= len(data):
                return -1
            count = int(data[place])
            place += 1
            repeated = count > 128
            if repeated:
                count -= 128
            if count == 0 or x + count > width or place + (1 if repeated else count) > len(data):
                return -1
            for k in range(count):
                line[x + k, component] = data[place if repeated else place + k]
            x += count
            place += 1 if repeated else count
    return place


@kernel
def _runs_of_pixels(data, place, line):
    """Read one line (W, 4) in which (1, 1, 1, n) repeats the pixel before it n times, as does each
    further such pixel with n times 256, and so on; returns where it ends, or -1."""
    width, x, shift = len(line), 0, 0
    while x < width:
        if place + 4 > len(data):
            return -1
        if data[place] == 1 and data[place + 1] == 1 and data[place + 2] == 1:
            count = int(data[place + 3]) << shift
            if x == 0 or x + count > width or shift > 24:
                return -1
            for k in range(count):
                line[x + k] = line[x - 1]
            x += count
            shift += 8
        else:
            line[x] = data[place : place + 4]
            x += 1
            shift = 0
        place += 4
    return place


@kernel
def _decode(data, flat, scales, out):
    """Fill out (lines, W, 3); returns where the last line ends, or -1 - the first line that is not
    there."""
    width, place = out.shape[1], 0
    line = np.zeros((width, 4), np.uint8)
    for row in range(len(out)):
        if flat:
            for x in range(width):
                line[x] = data[place + 4 * x : place + 4 * x + 4]
            place += 4 * width
        elif _components(data, place, width) == width:
            place = _runs_of_components(data, place + 4, line)
        elif _components(data, place, width) >= 0 and _components(data, 0, width) == width:
            return -1 - row  # of another width, in a file that stores them so
        else:
            place = _runs_of_pixels(data, place, line)
        if place < 0:
            return -1 - row
        for x in range(width):
            scale = scales[line[x, 3]]
            for k in range(3):
                out[row, x, k] = line[x, k] * scale
    return place


def read_radiance_file(path: Path) -> StoredImage:
    """The pixels of a Radiance picture, exposure and colour correction undone, right way up.

    Raises EnvlightError for a size line that is none, for a fact of the header that changes what
    pixels mean and cannot be applied, and for a file cut short.
    """
    content = path.read_bytes()
    lines, size_line, start = _header(path, content)
    size = SIZE_LINE.fullmatch(size_line)
    if size is None or size[1][1] == size[3][1] or not int(size[2]) * int(size[4]):
        shown = one_line(size_line) if size_line else ""
        raise EnvlightError(f"{path}: its size line '{shown}' is no size; fetch it again")
    data = np.frombuffer(content, np.uint8, offset=start)
    count, length = int(size[2]), int(size[4])
    check_size(path, length, count, _most_pixels(data, length))
    scale, chromaticities, facts = _meaning(path, lines)
    pixels = _turned(_pixels(path, data, count, length), size[1], size[3])
    if (scale != 1.0).any():
        with np.errstate(over="ignore"):  # what overflows is refused as infinite, with its place
            pixels /= scale
    matrix = to_rec709(path, chromaticities) if chromaticities else None
    if matrix is not None:
        facts["colours"] = converted_from(chromaticities)
    return StoredImage(pixels, (LARGEST,) * 3, ROUNDING, matrix, facts)


def _header(path: Path, content: bytes) -> tuple[list[str], str, int]:
    """The header's lines, the size line that follows an empty one, and where pixels begin.

    A line that is indented tells of a picture that this one was made from: its blanks stay, so that
    it is none of this one's.
    """
    lines: list[str] = []
    start, ended = 0, False
    while (end := content.find(b"\n", start)) >= 0:
        line = content[start:end].decode("latin-1").rstrip()
        start = end + 1
        if ended:
            return lines, line, start
        ended = not line
        lines.append(line)
    raise EnvlightError(f"{path}: its header has no end; fetch it again")


def _most_pixels(data: NDArray[np.uint8], length: int) -> int:
    """How many pixels the bytes can stand for in lines of so many."""
    if _components(data, 0, length) == length:
        least = 4 + 8 * -(-length // LONGEST_RUN)
    else:
        least = min(4 * length, 8)
    return len(data) // least * length


def _meaning(
    path: Path, lines: list[str]
) -> tuple[NDArray[np.float64], tuple[float, ...], dict[str, str]]:
    """What pixels are divided by, (3,); their chromaticities, none for Rec. 709; what to tell."""
    scale, facts = np.ones(3), {}
    chromaticities: tuple[float, ...] = ()
    layout = RGBE
    for line in lines:
        name, _, value = line.partition("=")
        name, value, what = name.rstrip().upper(), value.strip(), f"{path}: {one_line(line)}"
        match name:
            case "EXPOSURE" | "COLORCORR":
                factors = _numbers(what, value, 1 if name == "EXPOSURE" else 3)
                scale = scale * factors
                if not ((factors > 0.0) & (scale > 0.0) & np.isfinite(scale)).all():
                    raise EnvlightError(f"{what}: pixels cannot be divided by it; correct the line")
            case "PRIMARIES":
                chromaticities = tuple(_numbers(what, value, 8).tolist())
            case "FORMAT":
                layout = value
                if layout not in (RGBE, XYZE):
                    raise EnvlightError(f"{what} is not read; save it as {RGBE}")
            case "GAMMA" if _numbers(what, value, 1)[0] != 1.0:
                raise EnvlightError(f"{what}: its values are not linear; save it with GAMMA=1")
            case "PIXASPECT" if _numbers(what, value, 1)[0] != 1.0:
                raise EnvlightError(f"{what}: its pixels are not square; resample it")
            case "VIEW" if not _is_panorama(value):
                raise EnvlightError(
                    f"{what} is not the whole sphere, 360° × 180°; give a latitude-longitude map"
                )
    if (scale != 1.0).any():
        shown = scale[:1] if scale.min() == scale.max() else scale
        by = " ".join(f"{factor:.6g}" for factor in shown)
        facts["exposure"] = f"divided by {by} (EXPOSURE, COLORCORR)"
    if layout == XYZE:
        chromaticities = XYZ
    return scale, chromaticities if any(chromaticities) else (), facts  # zeros: "not known"


def _is_panorama(view: str) -> bool:
    """Whether the angles of a view, 45° where it has none, are those of the whole sphere.

    Parallel and angular views of as many units are none of it, nor are views that are shifted.
    """
    if re.search(r"-vt[al]|-v[sl]\s+-?[0.]*[1-9]", view):
        return False
    stated = dict(re.findall(r"-(v[hv])\s+(\d+\.?\d*)", view))
    return float(stated.get("vh", 45)) == 360.0 and float(stated.get("vv", 45)) == 180.0


def _numbers(what: str, value: str, count: int) -> NDArray[np.float64]:
    try:
        found = np.array([float(word) for word in value.replace("_", "?").split()])
    except ValueError:
        found = np.empty(0)
    if len(found) != count or not np.isfinite(found).all():
        wanted = "a number was" if count == 1 else f"{count} numbers were"
        raise EnvlightError(f"{what}: {wanted} expected; correct the line")
    return found


def _pixels(path: Path, data: NDArray[np.uint8], count: int, length: int) -> NDArray[np.float32]:
    """The lines in their order, (count, length, 3)."""
    pixels = np.empty((count, length, 3), np.float32)
    end = _decode(data, False, SCALES, pixels)
    # Runs of components cut short can have the length of a flat file as well.
    if end != len(data) == 4 * count * length and _components(data, 0, length) != length:
        end = _decode(data, True, SCALES, pixels)
    if end < 0:
        raise EnvlightError(
            f"{path}: line {-end} of {count} is cut short or damaged; fetch it again"
        )
    return pixels


def _turned(pixels: NDArray[np.float32], first: str, second: str) -> NDArray[np.float32]:
    """Row 0 at the top and column 0 at the left, whatever the size line says of the order."""
    down, right = ("-Y", "+X") if first[1] == "Y" else ("+X", "-Y")
    if first != down:
        pixels = pixels[::-1]
    if second != right:
        pixels = pixels[:, ::-1]
    return np.ascontiguousarray(pixels if first[1] == "Y" else pixels.transpose(1, 0, 2))
