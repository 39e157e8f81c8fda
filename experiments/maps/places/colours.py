"""Colours of lights and skies, as linear Rec. 709.

They need five formulas and a table: colour-science, which has all of them, takes longer to import
than a small map to make. It is the tests' oracle, and tells the colours of spectral lines.
"""

from functools import cache
from pathlib import Path

import numpy as np

from experiments.maps.places.shapes import Array

LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
XYZ_TO_REC709 = np.array(
    [
        [3.2409699419045226, -1.537383177570094, -0.49861076029300344],
        [-0.9692436362808798, 1.8759675015077206, 0.04155505740717563],
        [0.05563007969699364, -0.20397695888897655, 1.0569715142428786],
    ]
)
"""From CIE XYZ to linear Rec. 709: the inverse of what ITU-R BT.709 gives by its primaries."""
MATCHING = Path(__file__).parent / "data" / "cie_1931.csv"
"""Wavelength in nanometres, x̄, ȳ, z̄ of the CIE 1931 2° standard observer."""


def _of_chromaticity(x: float, y: float) -> Array:
    rgb = np.maximum(XYZ_TO_REC709 @ np.array([x / y, 1.0, (1.0 - x - y) / y]), 0.0)
    rgb = rgb / (rgb @ LUMINANCE)
    rgb.flags.writeable = False
    return rgb


@cache
def blackbody(kelvin: float) -> Array:
    """Colour (3,) of luminance 1 on the Planckian locus, 1667 to 25000 K.

    Kang et al., "Design of advanced color temperature control system for HDTV applications",
    J. Korean Phys. Soc. 41, 2002.
    """
    if kelvin <= 4000.0:
        x = _in_reciprocal(kelvin, -0.2661239, -0.2343589, 0.8776956, 0.179910)
    else:
        x = _in_reciprocal(kelvin, -3.0258469, 2.1070379, 0.2226347, 0.24039)
    if kelvin <= 2222.0:
        y = -1.1063814 * np.power(x, 3) - 1.34811020 * x**2 + 2.18555832 * x - 0.20219683
    elif kelvin <= 4000.0:
        y = -0.9549476 * np.power(x, 3) - 1.37418593 * x**2 + 2.09137015 * x - 0.16748867
    else:
        y = 3.0817580 * np.power(x, 3) - 5.8733867 * x**2 + 3.75112997 * x - 0.37001483
    return _of_chromaticity(x, y)


def _in_reciprocal(kelvin: float, *factors: float) -> float:
    """A polynomial of 1000 / kelvin, from the third power down."""
    cubic, square, linear, constant = factors
    large = cubic * 10**9 / np.power(kelvin, 3) + square * 10**6 / kelvin**2
    return large + linear * 10**3 / kelvin + constant


def balanced(kelvin: float, white: float) -> Array:
    """A black body's colour as a camera balanced for `white` kelvin records it, luminance 1."""
    rgb = blackbody(kelvin) / blackbody(white)
    return rgb / (rgb @ LUMINANCE)


@cache
def daylight(kelvin: float) -> Array:
    """Colour (3,) of luminance 1 on the CIE daylight locus, 4000 to 25000 K (CIE 15)."""
    if kelvin <= 7000.0:
        x = _in_reciprocal(kelvin, -4.607, 2.9678, 0.09911, 0.244063)
    else:
        x = _in_reciprocal(kelvin, -2.0064, 1.9018, 0.24748, 0.23704)
    return _of_chromaticity(x, -3.000 * x**2 + 2.870 * x - 0.275)


@cache
def spectral_line(nanometres: float, whiteness: float = 0.1) -> Array:
    """Colour (3,) of luminance 1 of a gas discharge at a wavelength, mixed with some white."""
    import colour

    xyz = colour.wavelength_to_XYZ(nanometres)
    xyz = xyz / xyz[1] * (1.0 - whiteness) + whiteness * np.array([0.9505, 1.0, 1.0891])
    return _of_chromaticity(*(xyz[:2] / xyz.sum()))


@cache
def sunlight(elevation: float, turbidity: float) -> Array:
    """Colour (3,) of the sun at an elevation in degrees, luminance relative to that above the air.

    A black body of 5778 K behind Rayleigh scattering and Ångström's aerosol extinction, the two
    large terms in Preetham, Shirley & Smits, "A practical analytic model for daylight", SIGGRAPH
    1999, appendix 1; relative optical mass after Kasten (there too).
    """
    table = np.loadtxt(MATCHING, delimiter=",")
    # In one piece: products of strided arrays are summed in another order.
    micron, values = table[:, 0] * 1e-3, np.ascontiguousarray(table[:, 1:])
    planck = micron**-5 / np.expm1(14387.77 / (micron * 5778.0))
    sine = np.sin(np.radians(elevation))
    mass = 1.0 / (sine + 0.15 * (elevation + 3.885) ** -1.253)
    haze = 0.04608 * turbidity - 0.04586
    optical_depth = 0.008735 * micron**-4.08 + haze * micron**-1.3
    xyz = (planck * np.exp(-optical_depth * mass)) @ values / (planck @ values[:, 1])
    rgb = np.maximum(XYZ_TO_REC709 @ xyz, 0.0)
    rgb.flags.writeable = False
    return rgb
