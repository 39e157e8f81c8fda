"""Reading high-dynamic-range images: OpenEXR (.exr) and Radiance (.hdr), both by OpenImageIO.

OpenImageIO keeps the messages of the libraries below it to itself, refuses a header that claims far
more pixels than its file can hold, and reports a file that is cut short at whatever byte.
"""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from samplers.errors import EnvlightError

FORMATS = {".exr": "openexr", ".hdr": "hdr"}
"""The library's name of the format that a suffix promises."""
MAX_PIXELS = 32768 * 16384
"""Larger images are refused before memory is taken."""
HEADER_BYTES = 4096


def read_radiance(path: Path) -> NDArray[np.float32]:
    """Linear RGB pixels (H, W, 3) of an .exr or .hdr file.

    Raises EnvlightError with one sentence for anything that is not such an image.
    """
    expected = FORMATS.get(path.suffix.lower())
    if expected is None:
        raise EnvlightError(f"{path}: not a high-dynamic-range format; give an .exr or .hdr file")
    head = _first_bytes(path)
    if not head:
        raise EnvlightError(f"{path}: the file is empty; fetch it again")
    if expected == "hdr" and b"32-bit_rle_xyze" in head:
        raise EnvlightError(f"{path}: its colours are CIE XYZ; convert it to linear RGB")
    try:
        return _open_and_read(path, expected)
    except UnicodeDecodeError as error:  # the library decodes what stands in a damaged header
        raise EnvlightError(f"{path}: its header is damaged; fetch it again") from error


def _first_bytes(path: Path) -> bytes:
    if not path.is_file():
        what = "a folder, not a map" if path.is_dir() else "no such file"
        raise EnvlightError(f"{path}: {what}; check the path")
    try:
        with path.open("rb") as file:
            return file.read(HEADER_BYTES)
    except OSError as error:
        raise EnvlightError(
            f"{path}: cannot be read ({error.strerror}); check the file and its permissions"
        ) from error


def _open_and_read(path: Path, expected: str) -> NDArray[np.float32]:
    import OpenImageIO

    file = OpenImageIO.ImageInput.open(str(path))
    if file is None:
        reason = _one_line(OpenImageIO.geterror())
        raise EnvlightError(f"{path}: not a readable {path.suffix} file ({reason}); fetch it again")
    try:
        if file.format_name() != expected:
            raise EnvlightError(
                f"{path}: its content is {file.format_name()}, not {expected}; give an OpenEXR or "
                "Radiance file under its own suffix"
            )
        return _read(path, file)
    finally:
        file.close()


def _read(path: Path, file: Any) -> NDArray[np.float32]:
    """The pixels of an open image, its header checked first."""
    spec = file.spec()
    _check_header(path, spec)
    if file.seek_subimage(1, 0):
        raise EnvlightError(f"{path}: it has several parts; save the map alone as one part")
    file.seek_subimage(0, 0)
    channels = [spec.channelnames.index(name) for name in "RGB"]
    # Integers read as "float" would be scaled to [0, 1].
    kinds = ["uint" if "uint" in str(spec.channelformat(k)) else "float" for k in channels]
    if channels == [0, 1, 2] and "uint" not in kinds:
        return np.ascontiguousarray(_pixels(path, file, 0, 3, "float"), np.float32)
    planes = [
        _pixels(path, file, channel, channel + 1, kind).astype(np.float32)
        for channel, kind in zip(channels, kinds, strict=True)
    ]
    return np.concatenate(planes, axis=2)


def _check_header(path: Path, spec: Any) -> None:
    width, height = spec.width, spec.height
    if width * height > MAX_PIXELS:
        raise EnvlightError(
            f"{path}: {width}×{height} pixels are declared, more than the limit of "
            f"{MAX_PIXELS:,}; the header is damaged, or resample the map"
        )
    if spec.deep:
        raise EnvlightError(f"{path}: deep data; save it as a flat image")
    if not {"R", "G", "B"} <= set(spec.channelnames):
        raise EnvlightError(
            f"{path}: channels {_one_line(', '.join(spec.channelnames))}; an environment map needs "
            "R, G and B"
        )
    if (width, height) != (spec.full_width, spec.full_height):
        raise EnvlightError(
            f"{path}: {width}×{height} of {spec.full_width}×{spec.full_height} pixels are stored; "
            "save the whole map"
        )
    if spec.get_int_attribute("Orientation", 1) != 1:
        raise EnvlightError(
            f"{path}: its rows or columns are stored turned or mirrored; save it from the top "
            "left (a Radiance file's size line is then -Y H +X W)"
        )


def _pixels(path: Path, file: Any, first: int, last: int, kind: str) -> NDArray:
    """Channels [first, last) as (H, W, channels)."""
    pixels = file.read_image(0, 0, first, last, kind)
    if pixels is None:
        raise EnvlightError(
            f"{path}: damaged or cut short ({_one_line(file.geterror())}); fetch it again"
        )
    return pixels if pixels.ndim == 3 else pixels[..., None]


def _one_line(error: object) -> str:
    text = " ".join(str(error).split())[:200].rstrip(".") or "no reason given"
    return "".join(letter if letter.isprintable() else "?" for letter in text)
