"""Reading high-dynamic-range images, .exr and .hdr, as linear Rec. 709.

What a header says of its pixels is applied, or the file is refused by the name of that fact. A
failure is told for what it is: a file that is whole is not called damaged.
"""

from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from samplers.errors import EnvlightError
from samplers.files import openexr_file, radiance_file
from samplers.files.stored_image import StoredImage, for_libraries, one_line, refuse_others

FORMATS: dict[str, tuple[str, bytes, Callable[[Path], StoredImage]]] = {
    ".exr": ("openexr", openexr_file.MAGIC, openexr_file.read_openexr_file),
    ".hdr": ("hdr", radiance_file.MAGIC, radiance_file.read_radiance_file),
}
"""By suffix: the format's name, how its files begin, and what reads it."""


def read_radiance(path: Path) -> NDArray[np.float32]:
    """Linear RGB pixels (H, W, 3) of an .exr or .hdr file.

    Raises EnvlightError with one sentence for anything that is not such an image.
    """
    return read_image(path).radiance()


def read_image(path: Path) -> StoredImage:
    """An .exr or .hdr file as it is stored; raises EnvlightError as `read_radiance` does."""
    if path.suffix.lower() not in FORMATS:
        raise EnvlightError(f"{path}: a map is an .exr or .hdr file; save it as one")
    expected, magic, read = FORMATS[path.suffix.lower()]
    if not path.is_file():
        what = "no such file" if not path.exists() else "not a file"
        raise EnvlightError(f"{path}: {what}; check the path")
    for_libraries(path)
    try:
        with path.open("rb") as file:
            begins = file.read(100)
        if not begins:
            raise EnvlightError(f"{path}: the file is empty; fetch it again")
        refuse_others(path, begins)
        if not begins.startswith(magic):
            raise EnvlightError(f"{path}: {_other_content(path, expected)}")
        return read(path)
    except OSError as error:
        raise EnvlightError(
            f"{path}: cannot be read ({error.strerror}); check the file and its permissions"
        ) from error
    except MemoryError as error:
        raise EnvlightError(
            f"{path}: there is not enough memory to read it; resample the map"
        ) from error
    except UnicodeDecodeError as error:  # the library decodes what stands in a damaged header
        raise EnvlightError(f"{path}: its header is damaged; fetch it again") from error


def _other_content(path: Path, expected: str) -> str:
    """What a file is that does not begin as its suffix promises."""
    import OpenImageIO

    file = OpenImageIO.ImageInput.open(for_libraries(path))
    if file is None:
        reason = one_line(OpenImageIO.geterror())
        return f"not a readable {path.suffix} file ({reason}); fetch it again"
    found = file.format_name()
    file.close()
    if found == expected:
        return f"it does not begin as {path.suffix} files do; save it anew"
    return (
        f"its content is {found}, not {expected}; give an OpenEXR or Radiance file under its own "
        "suffix"
    )
