"""From the primaries and the white point that a file names to linear Rec. 709.

Chromaticities are (8,): x and y of red, green, blue and white. A white point other than Rec. 709's
is adapted by Bradford's transform, so that the file's white stays white.
"""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from samplers.errors import EnvlightError

REC709 = (0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290)
XYZ = (1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1 / 3, 1 / 3)
"""The primaries of CIE XYZ, in which equal values are the white E."""
AP0 = (0.7347, 0.2653, 0.0, 1.0, 0.0001, -0.077, 0.32168, 0.33767)
AP1 = (0.713, 0.293, 0.165, 0.830, 0.128, 0.044, 0.32168, 0.33767)
SPACES: dict[str, tuple[float, ...]] = {
    "lin_rec709": REC709, "lin_srgb": REC709, "linear": REC709, "scene_linear": REC709,
    "lin_ap0": AP0, "aces2065-1": AP0, "lin_ap1": AP1, "acescg": AP1, "unknown": (),
    "lin_rec2020": (0.708, 0.292, 0.170, 0.797, 0.131, 0.046, 0.3127, 0.3290),
    "lin_p3d65": (0.680, 0.320, 0.265, 0.690, 0.150, 0.060, 0.3127, 0.3290),
    "lin_adobergb": (0.64, 0.33, 0.21, 0.71, 0.15, 0.06, 0.3127, 0.3290),
}  # fmt: skip
"""Linear spaces as the Color Interop Forum, without "_scene", and OpenImageIO call them."""
ROUNDING = 1e-3
"""Files write the same chromaticities with three to seven digits."""


def to_rec709(path: Path, chromaticities: tuple[float, ...]) -> NDArray[np.float64] | None:
    """The (3, 3) matrix from linear RGB of such primaries to Rec. 709, None where it is that.

    Raises EnvlightError where no colours have these chromaticities.
    """
    if np.allclose(chromaticities, REC709, rtol=0.0, atol=ROUNDING):
        return None
    import colour

    points = np.array(chromaticities, np.float64).reshape(4, 2)
    known = np.isfinite(points).all() and (points[3] > 0.0).all() and points[3].sum() < 1.0
    if not known or abs(np.linalg.det(np.column_stack([points[:3], np.ones(3)]))) < ROUNDING:
        raise EnvlightError(
            f"{path}: its chromaticities {_in_words(chromaticities)} are those of no colours; "
            "save it as linear Rec. 709"
        )
    own, target = (
        colour.RGB_Colourspace(
            name, xy[:3], xy[3], use_derived_matrix_RGB_to_XYZ=True,
            use_derived_matrix_XYZ_to_RGB=True,
        )
        for name, xy in (("file", points), ("Rec. 709", np.reshape(REC709, (4, 2))))
    )  # fmt: skip
    matrix = colour.matrix_RGB_to_RGB(own, target, "Bradford")
    return np.asarray(matrix, np.float64)


def converted_from(chromaticities: tuple[float, ...]) -> str:
    """As "converted to Rec. 709 from red 0.64 0.33, green …"."""
    return f"converted to Rec. 709 from {_in_words(chromaticities)}"


def _in_words(chromaticities: tuple[float, ...]) -> str:
    """As "red 0.64 0.33, green …"."""
    names = ("red", "green", "blue", "white")
    points = zip(names, chromaticities[::2], chromaticities[1::2], strict=True)
    return ", ".join(f"{name} {x:.4g} {y:.4g}" for name, x, y in points)
