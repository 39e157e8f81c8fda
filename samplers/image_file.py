"""Reading high-dynamic-range images: OpenEXR by OpenEXR itself, Radiance .hdr by OpenImageIO."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from samplers.errors import EnvlightError

MAX_PIXELS = 32768 * 16384
"""Larger images are refused before memory is taken."""


def read_radiance(path: Path) -> NDArray[np.float32]:
    """Linear RGB pixels (H, W, 3) of an .exr or .hdr file.

    Raises EnvlightError with one sentence for anything that is not such an image.
    """
    if not path.is_file():
        raise EnvlightError(f"{path}: no such file; check the path")
    if path.stat().st_size == 0:
        raise EnvlightError(f"{path}: the file is empty; fetch it again")
    readers = {".exr": _read_exr, ".hdr": _read_hdr}
    reader = readers.get(path.suffix.lower())
    if reader is None:
        raise EnvlightError(
            f"{path}: not a high-dynamic-range format; give an .exr or .hdr file"
        )
    return reader(path)


def _check_size(path: Path, width: int, height: int) -> None:
    if width < 1 or height < 1:
        raise EnvlightError(f"{path}: the image is empty ({width}×{height}); fetch it again")
    if width * height > MAX_PIXELS:
        raise EnvlightError(
            f"{path}: {width}×{height} pixels are declared, more than the limit of "
            f"{MAX_PIXELS:,}; the header is damaged, or resample the map"
        )


def _exr_window(path: Path) -> tuple[int, int]:
    import OpenEXR

    with OpenEXR.File(str(path), header_only=True) as file:
        if len(file.parts) != 1:
            raise EnvlightError(f"{path}: {len(file.parts)} parts; save it as a single-part EXR")
        header = file.header()
        kind = header.get("type")
        if kind in (OpenEXR.deepscanline, OpenEXR.deeptile):
            raise EnvlightError(f"{path}: deep data; save it as a flat scan-line EXR")
        names = {channel.name for channel in header["channels"]}
        if not {"R", "G", "B"} <= names:
            raise EnvlightError(
                f"{path}: channels {', '.join(sorted(names))}; an environment map needs R, G and B"
            )
        low, high = header["dataWindow"]
        return int(high[0]) - int(low[0]) + 1, int(high[1]) - int(low[1]) + 1


def _read_exr(path: Path) -> NDArray[np.float32]:
    import OpenEXR

    try:
        width, height = _exr_window(path)
        _check_size(path, width, height)
        with OpenEXR.File(str(path), separate_channels=True) as file:
            channels = file.channels()
            planes = [channels[name].pixels for name in "RGB"]
    except EnvlightError:
        raise
    except Exception as error:  # the library raises bare RuntimeError, ValueError and TypeError
        raise EnvlightError(
            f"{path}: not a readable OpenEXR file ({_one_line(error)}); fetch it again"
        ) from error
    if any(plane.shape != (height, width) for plane in planes):
        raise EnvlightError(f"{path}: R, G and B differ in size; save them at full resolution")
    with np.errstate(over="ignore"):
        return np.stack([plane.astype(np.float32) for plane in planes], axis=-1)


def _read_hdr(path: Path) -> NDArray[np.float32]:
    import OpenImageIO

    file = OpenImageIO.ImageInput.open(str(path))
    if file is None:
        reason = _one_line(OpenImageIO.geterror())
        raise EnvlightError(f"{path}: not a readable Radiance file ({reason}); fetch it again")
    try:
        spec = file.spec()
        if file.format_name() != "hdr":
            raise EnvlightError(
                f"{path}: the content is {file.format_name()}, not Radiance; name it correctly"
            )
        _check_size(path, spec.width, spec.height)
        if spec.nchannels != 3:
            raise EnvlightError(f"{path}: {spec.nchannels} channels; an environment map needs RGB")
        pixels = file.read_image("float")
        if pixels is None:
            reason = _one_line(file.geterror())
            raise EnvlightError(f"{path}: damaged or cut short ({reason}); fetch it again")
    finally:
        file.close()
    return np.asarray(pixels, np.float32).reshape(spec.height, spec.width, 3)


def _one_line(error: object) -> str:
    return " ".join(str(error).split())[:200] or "no reason given"
