"""An image as its file holds it, and what is checked of every file before its pixels are read."""

import os
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from samplers.errors import EnvlightError

MAX_PIXELS = 32768 * 16384
"""Larger images are refused before memory is taken."""
PIXEL_BYTES = 12
"""Of three float32."""
MEMORY = Path("/proc/meminfo")
ROWS = 64
"""Rows that are worked on at once, so that passes over an image need no copy of it."""


OTHERS = {
    b"\x1f\x8b": "compressed by gzip; unpack it",
    b"PK\x03\x04": "a ZIP archive; unpack it",
    **dict.fromkeys((b"\xfd7zXZ", b"BZh", b"(\xb5/\xfd", b"7z\xbc\xaf"), "an archive; unpack it"),
    b"version https://git-lfs": "a pointer of Git LFS; run `git lfs pull`",
    b"/annex/": "a pointer of git-annex; run `git annex get`",
    b"<": "a web page or XML; fetch the file itself",
    b"ENVI": "a header of ENVI's, not a Radiance picture; give the map itself",
}
"""What files are that other programs leave in a file's place, by how they begin."""


@dataclass(frozen=True, eq=False)
class StoredImage:
    """Linear pixels in the colours of the file, and what its header says of them.

    pixels : (H, W, 3) float32, row 0 at the top
    largest : the largest finite value that the file can hold, of each channel
    rounding : how far a stored value may be off, as a share of its pixel's largest
    to_rec709 : (3, 3) matrix that takes the colours to Rec. 709; None where they are that
    facts : what of the header was applied, in words by name
    """

    pixels: NDArray[np.float32]
    largest: tuple[float, float, float]
    rounding: float = 2.0**-24
    to_rec709: NDArray[np.float64] | None = None
    facts: dict[str, str] = field(default_factory=dict)

    def radiance(self) -> NDArray[np.float32]:
        """The pixels in linear Rec. 709; they are changed in place."""
        if self.to_rec709 is not None:
            for start in range(0, len(self.pixels), ROWS):
                rows = self.pixels[start : start + ROWS]
                rows[:] = self.converted(rows)
        return self.pixels

    def converted(self, rows: NDArray[np.float32]) -> NDArray:
        """Rows of the pixels in linear Rec. 709.

        What is negative by less than the rounding of stored values explains is 0: a saturated
        colour of Rec. 709 that went through other primaries comes back so.
        """
        if self.to_rec709 is None:
            return rows
        found = rows @ self.to_rec709.T
        error = self.rounding * np.abs(self.to_rec709).sum(axis=1)
        found[(found < 0.0) & (found >= -error * rows.max(axis=2, keepdims=True))] = 0.0
        return found


def as_text(name: str) -> str:
    """A file's name as text that can be written, whatever its bytes and the locale."""
    return os.fsencode(name).decode(errors="backslashreplace")


def for_libraries(path: Path) -> str:
    """A path in UTF-8, as libraries take it, whatever the locale; EnvlightError where it is not."""
    try:
        return os.fsencode(path).decode()
    except UnicodeDecodeError:
        raise EnvlightError(f"{as_text(str(path))}: its name is not UTF-8; rename it") from None


def one_line(text: object) -> str:
    """What somebody else's program or file says, fit for a sentence."""
    short = " ".join(str(text).split())[:200].rstrip(".") or "no reason given"
    return "".join(letter if letter.isprintable() else "?" for letter in short)


def refuse_others(path: Path, content: bytes) -> None:
    """EnvlightError for what other programs leave in a file's place."""
    for sign, what in OTHERS.items():
        if content.startswith(sign):
            raise EnvlightError(f"{path}: it is {what}")


def check_size(path: Path, width: int, height: int, most_pixels: float) -> None:
    """Refuse a size before memory is taken for it.

    most_pixels : how many at most the bytes of the file can stand for
    """
    size = f"{width}×{height} pixels"
    if width * height > most_pixels:
        raise EnvlightError(
            f"{path}: {size} are declared, more than its {path.stat().st_size:,} bytes can hold; "
            "fetch it again"
        )
    if width * height > MAX_PIXELS:
        raise EnvlightError(
            f"{path}: {size} are declared, more than the limit of {MAX_PIXELS:,}; resample the map"
        )
    needed, free = width * height * PIXEL_BYTES, available_memory()
    if free is not None and needed > free:
        raise EnvlightError(
            f"{path}: {size} need {needed / 1e9:.1f} GB of memory and {free / 1e9:.1f} GB are "
            "free; resample the map, or read it on a larger machine"
        )


def available_memory() -> int | None:
    """Bytes that can be taken without swapping, None where the system does not say (not Linux)."""
    try:
        lines = MEMORY.read_text(encoding="ascii").splitlines()
    except OSError:
        return None
    found = [line.split()[1] for line in lines if line.startswith("MemAvailable:")]
    return 1024 * int(found[0]) if found else None
