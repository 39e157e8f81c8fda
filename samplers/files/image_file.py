"""Reading high-dynamic-range images: .exr pixels by OpenEXR, .hdr pixels by OpenImageIO.

OpenImageIO looks at the header of both first: it keeps the messages of the libraries below it to
itself and refuses a header that claims far more pixels than its file can hold, so that a damaged
file is refused before memory is taken. OpenEXR writes warnings of its own to the process's standard
streams; they are held back, since the sentence raised says what matters.
"""

import ctypes
import io
import os
import sys
import threading
from collections.abc import Callable
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
    return _read_openexr(path) if path.suffix.lower() == ".exr" else _read_hdr(path, file)


_redirection = threading.Lock()


def _quietly(work: Callable[[], Any]) -> Any:
    """work(), while what is written to the standard streams goes nowhere; one thread at a time.

    The library writes to C's streams and to Python's, which differ where Python's are replaced. No
    context manager, since an interrupt on the way out of one would leave the process mute.
    """
    with _redirection:
        sys.stdout.flush()
        sys.stderr.flush()
        before = sys.stdout
        kept = [os.dup(stream) for stream in (1, 2)]
        nowhere = os.open(os.devnull, os.O_WRONLY)
        try:
            sys.stdout = io.StringIO()
            for stream in (1, 2):
                os.dup2(nowhere, stream)
            return work()
        finally:
            sys.stdout = before
            try:
                if os.name == "posix":
                    ctypes.CDLL(None).fflush(None)  # what C still has in its buffers
                _point_back(kept)
            except BaseException:  # an interrupt, after which there is something to be said
                _point_back(kept)
                raise
            finally:
                for file in (*kept, nowhere):
                    os.close(file)


def _point_back(kept: list[int]) -> None:
    for stream, copy in zip((1, 2), kept, strict=True):
        os.dup2(copy, stream)


def _read_openexr(path: Path) -> NDArray[np.float32]:
    import OpenEXR

    def planes_of() -> list[NDArray]:
        with OpenEXR.File(str(path), separate_channels=True) as file:
            channels = file.channels()
            return [channels[name].pixels for name in "RGB"]

    try:
        planes = _quietly(planes_of)
    except Exception as error:  # the binding raises bare RuntimeError, ValueError and TypeError
        raise EnvlightError(
            f"{path}: damaged or cut short ({_one_line(error)}); fetch it again"
        ) from error
    if len({plane.shape for plane in planes}) != 1:
        raise EnvlightError(f"{path}: R, G and B differ in size; save them at full resolution")
    return np.stack([plane.astype(np.float32) for plane in planes], axis=-1)


def _read_hdr(path: Path, file: Any) -> NDArray[np.float32]:
    pixels = file.read_image(0, 0, 0, 3, "float")
    if pixels is None:
        raise EnvlightError(
            f"{path}: damaged or cut short ({_one_line(file.geterror())}); fetch it again"
        )
    return np.ascontiguousarray(pixels, np.float32)


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


def _one_line(error: object) -> str:
    text = " ".join(str(error).split())[:200].rstrip(".") or "no reason given"
    return "".join(letter if letter.isprintable() else "?" for letter in text)
