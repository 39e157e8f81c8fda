"""Writing images: OpenEXR for numbers, Radiance's .hdr for programs that read no other, PNG for
looking at. A file appears whole or not at all.
"""

import contextlib
import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from samplers.errors import EnvlightError

LARGEST_HALF = 65504.0


def write_whole(path: Path, write: Callable[[Path], object]) -> None:
    """Call write(temporary path) and move the result to `path` in one step.

    Missing folders are made. Raises EnvlightError where that or the writing fails.
    """
    temporary = path.with_name(f".{path.stem}.{os.getpid()}{path.suffix}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write(temporary)
        temporary.replace(path)
    except (OSError, RuntimeError) as error:
        raise EnvlightError(
            f"{path}: cannot be written ({error}); check the folder and the space left"
        ) from error
    finally:
        with contextlib.suppress(OSError):
            temporary.unlink(missing_ok=True)


def write_exr(path: Path, image: NDArray[np.float32], half: bool = False) -> None:
    """Write linear RGB (H, W, 3) as an OpenEXR file of 32-bit or, where `half`, 16-bit floats.

    Half floats end at 65504; larger values are clamped to it.
    """
    import OpenEXR

    pixels = np.ascontiguousarray(image, np.float32)
    if half:
        pixels = np.minimum(pixels, np.float32(LARGEST_HALF)).astype(np.float16)
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    write_whole(path, lambda target: OpenEXR.File(header, {"RGB": pixels}).write(str(target)))


def write_hdr(path: Path, image: NDArray[np.float32]) -> None:
    """Write linear RGB (H, W, 3) as a Radiance file: 8 bits of a channel, one exponent of a pixel.

    A channel is off by 1 / 256 of its pixel's largest at most, and by nothing in the mean: values
    are rounded here, as OpenImageIO cuts them off, which would lose .4 % of the energy.
    """
    import OpenImageIO

    def write(target: Path) -> None:
        spec = OpenImageIO.ImageSpec(image.shape[1], image.shape[0], 3, OpenImageIO.FLOAT)
        file = OpenImageIO.ImageOutput.create(str(target))
        if not (
            file and file.open(str(target), spec) and file.write_image(pixels) and file.close()
        ):
            raise OSError(OpenImageIO.geterror())

    largest = image.max(axis=2, keepdims=True)
    step = np.ldexp(np.float32(1.0), np.frexp(largest)[1] - 8)
    step *= np.where(np.rint(largest / step) == 256.0, np.float32(2.0), np.float32(1.0))
    pixels = np.ascontiguousarray(np.rint(image / step) * step, np.float32)
    write_whole(path, write)


def write_webp(path: Path, image: NDArray[np.uint8]) -> None:
    """Write sRGB bytes (H, W, 3) as a small WebP file: pictures to look at, not to measure."""
    _write_picture(path, image, "WEBP", quality=70)


def write_png(path: Path, image: NDArray[np.uint8]) -> None:
    """Write sRGB bytes (H, W, 3) as a PNG file."""
    _write_picture(path, image, "PNG")


def _write_picture(path: Path, image: NDArray[np.uint8], kind: str, **options: int) -> None:
    from PIL import Image

    picture = Image.fromarray(np.ascontiguousarray(image))
    write_whole(path, lambda target: picture.save(target, kind, **options))
