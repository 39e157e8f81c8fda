"""Environment maps and the tables derived from them that samplers share."""

import hashlib
import math
import threading
from collections.abc import Callable
from dataclasses import dataclass, field
from fractions import Fraction
from functools import wraps
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from samplers.errors import EnvlightError
from samplers.files.image_file import read_image
from samplers.files.stored_image import ROWS, StoredImage, as_text
from samplers.grids.map_kernels import (
    band_sums,
    flux_of,
    luminance_of,
    summed_flux,
    summed_moments,
    summed_pixel_moments,
    summed_squares,
    total_rgb_flux,
)
from samplers.preview import thumbnail
from samplers.sphere import pixel_of_direction, row_solid_angle

LUMINANCE_WEIGHTS = np.array([0.2126, 0.7152, 0.0722])
"""Rec. 709 luminance of linear RGB."""

CUBE = "a cube map"
PROJECTIONS = {
    Fraction(1): "an angular map, a mirror ball or an octahedral map",
    **dict.fromkeys(map(Fraction, ("4/3", "3/4", "6", "1/6", "3/2", "2/3")), CUBE),
}
"""What images of other shapes are as a rule, by width over height."""

Table = TypeVar("Table")


def _shared_table(build: Callable[[Any], Table]) -> property:
    """A read-only property built on first use, once per map, whatever the number of threads."""

    @wraps(build)
    def get(self: "EnvironmentMap") -> Table:
        tables = self._tables
        if build.__name__ not in tables:
            with self._lock:
                if build.__name__ not in tables:
                    table: Any = build(self)
                    tables[build.__name__] = (
                        _sealed(table) if isinstance(table, np.ndarray) else table
                    )
        return tables[build.__name__]

    return property(get)


@dataclass(frozen=True)
class Repair:
    """What was done to values that no radiance has, counted by kind.

    largest : what infinity became; NaN and negative values became 0
    change : ∫ Y dω afterwards over that of the finite values before, less 1; NaN where these have
        none
    """

    nan: int
    infinite: int
    negative: int
    largest: float
    change: float

    @property
    def count(self) -> int:
        return self.nan + self.infinite + self.negative

    def __str__(self) -> str:
        kinds = [
            f"{self.infinite} infinite became {self.largest:.6g}" if self.infinite else "",
            f"{self.nan} NaN became 0" if self.nan else "",
            f"{self.negative} negative became 0" if self.negative else "",
        ]
        told = f"{self.count} values changed: {', '.join(filter(None, kinds))}"
        if not np.isfinite(self.change):
            return f"{told}; the finite ones had no flux"
        return f"{told}; the flux is {100.0 * self.change:+.3g} % against the finite ones alone"


@dataclass(frozen=True, eq=False)
class EnvironmentMap:
    """Distant radiance in the latitude-longitude format, constant over each pixel.

    radiance : (H, 2H, 3) float32, linear Rec. 709, finite, not negative; row 0 is +Y. The map
        takes the array over and makes it read-only; `from_array` copies it.
    name : what tables and files call the map
    repair : what `repair=True` of `from_array` or `from_file` changed, None where that was nothing:
        NaN and negative values are set to 0, infinity to the largest value of the file's format
    facts : what the file's header said and was applied, in words by name

    Raises EnvlightError for every other array.
    """

    radiance: NDArray[np.float32]
    name: str = "unnamed"
    repair: Repair | None = None
    facts: dict[str, str] = field(default_factory=dict)
    _tables: dict[str, Any] = field(default_factory=dict, init=False, repr=False)
    _lock: Any = field(default_factory=threading.RLock, init=False, repr=False)

    def __post_init__(self) -> None:
        radiance = _checked_shape(self.radiance, self.name)
        _refuse_bad_values(radiance, self.name, self.facts)
        object.__setattr__(self, "radiance", _sealed(radiance))

    def __reduce__(self) -> tuple:
        return EnvironmentMap, (self.radiance, self.name, self.repair, self.facts)

    @classmethod
    def from_array(
        cls, radiance: ArrayLike, name: str = "unnamed", repair: bool = False
    ) -> "EnvironmentMap":
        """The map with the given radiance (H, 2H, 3); see the class for what is refused."""
        given = np.asarray(radiance)
        array = _checked_shape(given, name)
        if np.may_share_memory(array, given):
            array = array.copy()
        if not repair:
            return cls(array, name)
        kind = given.dtype if given.dtype == np.float16 else np.float32
        largest = float(np.finfo(kind).max)
        return cls(array, name, _mend(StoredImage(array, (largest,) * 3)))

    @classmethod
    def from_file(cls, path: str | Path, repair: bool = False) -> "EnvironmentMap":
        """The map in an OpenEXR (.exr) or Radiance (.hdr) file, named after the file."""
        path = Path(path)
        name = as_text(path.stem)
        image = read_image(path)
        _checked_shape(image.pixels, name)
        if repair:
            done = _mend(image)
            return cls(image.pixels, name, done, image.facts)
        if image.to_rec709 is not None:
            _refuse_bad_values(image.pixels, name, {}, ("NaN", "infinite"))
        return cls(image.radiance(), name, None, image.facts)

    def __repr__(self) -> str:
        return f"EnvironmentMap({self.name!r}, {self.width}×{self.height})"

    def _repr_png_(self) -> bytes:
        return thumbnail(self.radiance)

    @property
    def repaired(self) -> int:
        """How many values were repaired."""
        return self.repair.count if self.repair else 0

    @property
    def height(self) -> int:
        return self.radiance.shape[0]

    @property
    def width(self) -> int:
        return self.radiance.shape[1]

    @property
    def built(self) -> frozenset[str]:
        """Names of the tables that somebody asked for."""
        return frozenset(self._tables)

    @_shared_table
    def digest(self) -> str:
        """Hash of the radiance alone, in hexadecimal; two maps with equal pixels share it."""
        hasher = hashlib.blake2b(repr(self.radiance.shape).encode(), digest_size=16)
        hasher.update(self.radiance.data)
        return hasher.hexdigest()

    @_shared_table
    def luminance(self) -> NDArray[np.float32]:
        """Rec. 709 luminance, (H, W)."""
        return luminance_of(self.radiance)

    @_shared_table
    def row_solid_angle(self) -> NDArray[np.float64]:
        """Solid angle of a pixel of each row in sr, (H,)."""
        return row_solid_angle(self.height, self.width)

    @_shared_table
    def total_flux(self) -> NDArray[np.float64]:
        """∫ L dω over the sphere per channel, (3,)."""
        return total_rgb_flux(self.radiance, self.row_solid_angle)

    @_shared_table
    def flux(self) -> NDArray[np.float64]:
        """Luminance × solid angle of each pixel, (H, W)."""
        return flux_of(self.luminance, self.row_solid_angle)

    @_shared_table
    def flux_table(self) -> NDArray[np.float64]:
        """Summed-area table of `flux` with a leading row and column of zeros, (H+1, W+1)."""
        return summed_flux(self.radiance, self.row_solid_angle)

    @_shared_table
    def square_table(self) -> NDArray[np.float64]:
        """Summed-area table of luminance² × solid angle, (H+1, W+1)."""
        return summed_squares(self.radiance, self.row_solid_angle)

    @_shared_table
    def band_table(self) -> NDArray[np.float64]:
        """Running sums along columns over bands of rows, (bands, W+1, 6); see `band_sums`."""
        return band_sums(self.radiance, self.row_solid_angle)

    @_shared_table
    def moment_table(self) -> NDArray[np.float64]:
        """Summed-area table of `flux` × direction of the pixel's centre, (H+1, W+1, 3)."""
        return summed_moments(self.radiance, self.row_solid_angle)

    @_shared_table
    def pixel_moment_table(self) -> NDArray[np.float64]:
        """Summed-area table of `flux` × (x, y, x² + y²), (H+1, W+1, 3).

        x, y : column and row of the pixel's centre, counted from the middle of the map
        """
        return summed_pixel_moments(self.radiance, self.row_solid_angle)

    @property
    def luminous_flux(self) -> float:
        """∫ Y dω over the sphere."""
        return float(self.total_flux @ LUMINANCE_WEIGHTS)

    @property
    def is_black(self) -> bool:
        return not self.total_flux.any()

    def lookup(self, direction: ArrayLike) -> NDArray[np.float32]:
        """Radiance (..., 3) from the directions (..., 3)."""
        return self.radiance[pixel_of_direction(direction, self.height)]


def _sealed(array: NDArray) -> NDArray:
    """The array, read-only, and through it nobody can write again: samplers share maps."""
    array.flags.writeable = False
    whole = np.ascontiguousarray(array)
    return np.frombuffer(whole.data.toreadonly(), whole.dtype).reshape(whole.shape)


def _checked_shape(array: NDArray, name: str) -> NDArray[np.float32]:
    if array.ndim != 3 or array.shape[2] != 3:
        raise EnvlightError(
            f"map '{name}': an array of shape {array.shape}; wanted (H, W, 3), linear RGB"
        )
    height, width = array.shape[:2]
    if height == 0 or width == 0:
        raise EnvlightError(f"map '{name}': it is empty ({width}×{height}); give at least 2×1")
    if width != 2 * height:
        other = PROJECTIONS.get(Fraction(width, height))
        advice = f"this may be {other}: " if other else ""
        raise EnvlightError(
            f"map '{name}': {width}×{height} pixels; a latitude-longitude map is twice as wide "
            f"as high; {advice}`envlight new-map` makes one of other projections and sizes"
        )
    if array.dtype.kind not in "fiu":
        raise EnvlightError(f"map '{name}': values of type {array.dtype}; wanted real numbers")
    with np.errstate(over="ignore"):  # what overflows is refused as infinite, with its place
        return np.ascontiguousarray(array, np.float32)


def _bad_values(radiance: NDArray[np.float32]) -> list[tuple[str, NDArray[np.bool_]]]:
    return [
        ("NaN", np.isnan(radiance)),
        ("infinite", np.isinf(radiance)),
        ("negative", radiance < 0.0),
    ]


def _refuse_bad_values(
    radiance: NDArray[np.float32],
    name: str,
    facts: dict[str, str],
    kinds: tuple[str, ...] = ("NaN", "infinite", "negative"),
) -> None:
    low, high = radiance.min(), radiance.max()
    if low >= 0.0 and np.isfinite(high):  # neither holds of a NaN
        return
    found = []
    for kind, mask in _bad_values(radiance):
        count = int(mask.sum())
        if count and kind in kinds:
            row, column, channel = np.unravel_index(int(mask.argmax()), mask.shape)
            found.append(
                f"{count} {kind} (first in row {row}, column {column}, channel {'RGB'[channel]})"
            )
    if not found:
        return
    colours = f", its colours {facts['colours']}" if "colours" in facts else ""
    raise EnvlightError(
        f"map '{name}': radiance has {' and '.join(found)}{colours}; mend the file or let "
        "--repair clamp it"
    )


def _mend(image: StoredImage) -> Repair | None:
    """Make an image's pixels the radiance of a map, in place; None where no value was wrong.

    Infinity is replaced before colours are converted, which would make NaN of it; what is negative
    in the colours of the file may be none in Rec. 709, and the other way round.
    """
    pixels, matrix = image.pixels, np.eye(3) if image.to_rec709 is None else image.to_rec709
    solid_angle, largest = row_solid_angle(*pixels.shape[:2]), np.array(image.largest, np.float32)
    nan = infinite = negative = 0
    before = after = 0.0
    for start in range(0, len(pixels), ROWS):
        rows = slice(start, start + ROWS)
        part, finite = pixels[rows], np.isfinite(pixels[rows])
        seen = np.where(finite, part, 0.0).sum(axis=1, dtype=np.float64)
        before += float(solid_angle[rows] @ (seen @ (LUMINANCE_WEIGHTS @ matrix)))
        nan += int(np.isnan(part).sum())
        infinite += int(np.isposinf(part).sum())
        negative += int(np.isneginf(part).sum())
        part[~finite] = np.where(part > 0.0, largest, np.float32(0.0))[~finite]
        part[:] = np.minimum(image.converted(part), np.finfo(np.float32).max)
        negative += int((part < 0.0).sum())
        np.maximum(part, 0.0, out=part)
        after += float(solid_angle[rows] @ (part.sum(axis=1, dtype=np.float64) @ LUMINANCE_WEIGHTS))
    if not nan + infinite + negative:
        return None
    change = after / before - 1.0 if before > 0.0 else math.nan
    return Repair(nan, infinite, negative, max(image.largest), change)
