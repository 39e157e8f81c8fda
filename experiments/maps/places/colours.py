"""Colours of lights and skies, from colour-science, as linear Rec. 709.

The package takes a second to import. So what it says of the colours in the embedded maps stands in
a file, which a test makes anew; of others it is asked when they are.
"""

import json
from collections.abc import Callable
from functools import cache, wraps
from pathlib import Path

import numpy as np

from experiments.maps.places.shapes import Array

LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
KEPT = Path(__file__).parent / "data" / "colours.json"


@cache
def kept_colours() -> dict[str, list]:
    """Colours by the call that gives them."""
    found: dict[str, list] = json.loads(KEPT.read_text(encoding="utf-8"))
    return found


def kept(function: Callable[..., Array]) -> Callable[..., Array]:
    """A function of numbers whose values are looked up, where they are kept, and remembered."""

    @cache
    @wraps(function)
    def found(*numbers: float) -> Array:
        known = kept_colours().get(f"{function.__name__}{numbers}")
        colour = np.array(function(*numbers) if known is None else known)
        colour.flags.writeable = False
        return colour

    return found


@kept
def xyz_to_rec709() -> Array:
    """Matrix (3, 3) from CIE XYZ to linear Rec. 709."""
    import colour

    matrix = colour.RGB_COLOURSPACES["ITU-R BT.709"].matrix_XYZ_to_RGB
    return np.array(matrix, np.float64)


def _of_chromaticity(xy: Array) -> Array:
    x, y = xy
    rgb = np.maximum(xyz_to_rec709() @ np.array([x / y, 1.0, (1.0 - x - y) / y]), 0.0)
    return rgb / (rgb @ LUMINANCE)


@kept
def blackbody(kelvin: float) -> Array:
    """Colour (3,) of luminance 1 on the Planckian locus, 1667 to 25000 K."""
    import colour

    xy = colour.temperature.CCT_to_xy(kelvin, method="Kang 2002")
    return _of_chromaticity(np.asarray(xy, np.float64))


def balanced(kelvin: float, white: float) -> Array:
    """A black body's colour as a camera balanced for `white` kelvin records it, luminance 1."""
    rgb = blackbody(kelvin) / blackbody(white)
    return rgb / (rgb @ LUMINANCE)


@kept
def daylight(kelvin: float) -> Array:
    """Colour (3,) of luminance 1 on the CIE daylight locus, 4000 to 25000 K."""
    import colour

    xy = colour.temperature.CCT_to_xy(kelvin, method="CIE Illuminant D Series")
    return _of_chromaticity(np.asarray(xy, np.float64))


@kept
def spectral_line(nanometres: float, whiteness: float = 0.1) -> Array:
    """Colour (3,) of luminance 1 of a gas discharge at a wavelength, mixed with some white."""
    import colour

    xyz = colour.wavelength_to_XYZ(nanometres)
    xyz = xyz / xyz[1] * (1.0 - whiteness) + whiteness * np.array([0.9505, 1.0, 1.0891])
    return _of_chromaticity(xyz[:2] / xyz.sum())


@kept
def sunlight(elevation: float, turbidity: float) -> Array:
    """Colour (3,) of the sun at an elevation in degrees, luminance relative to that above the air.

    A black body of 5778 K behind Rayleigh scattering and Ångström's aerosol extinction, the two
    large terms in Preetham, Shirley & Smits, "A practical analytic model for daylight", SIGGRAPH
    1999, appendix 1; relative optical mass after Kasten (there too).
    """
    import colour

    matching = colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"]
    micron = np.asarray(matching.wavelengths) * 1e-3
    planck = micron**-5 / np.expm1(14387.77 / (micron * 5778.0))
    sine = np.sin(np.radians(elevation))
    mass = 1.0 / (sine + 0.15 * (elevation + 3.885) ** -1.253)
    haze = 0.04608 * turbidity - 0.04586
    optical_depth = 0.008735 * micron**-4.08 + haze * micron**-1.3
    values = np.asarray(matching.values)
    xyz = (planck * np.exp(-optical_depth * mass)) @ values / (planck @ values[:, 1])
    return np.maximum(xyz_to_rec709() @ xyz, 0.0)
