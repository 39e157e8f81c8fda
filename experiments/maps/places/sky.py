"""Skies by day: the clear sky and its sun, the overcast sky, and clouds.

The clear sky is the Perez distribution with the coefficients of turbidity of Preetham, Shirley &
Smits, "A practical analytic model for daylight", SIGGRAPH 1999, appendix 2. The overcast sky is the
CIE standard one, L(γ) = L_zenith (1 + 2 sin γ)/3. Clouds are fractal noise on a spherical shell
that the sun lights through: thin parts scatter its light forwards, thick ones are grey underneath.

A radiance of 1 stands for 10 kcd·m⁻², which puts a clear sky near ½ and the sun at 10⁵.
"""

import math
from dataclasses import dataclass

import numpy as np

from experiments.maps.places.colours import daylight, sunlight, xyz_to_rec709
from experiments.maps.places.emitters import Emitter, disc
from experiments.maps.places.noise import fractal, mix, smoothstep
from experiments.maps.places.shapes import Array

KILOCANDELA = 0.1
SUN_HALF_ANGLE = math.radians(0.53 / 2.0)
SUN_RADIANCE = 1.9e6 * KILOCANDELA
"""Of the sun above the air: 128 klx over the solid angle of its disc."""


def towards(azimuth: float, elevation: float) -> Array:
    """Unit direction (3,) from degrees; azimuth 0 is the middle of the map, 90 right of it."""
    a, e = math.radians(azimuth + 180.0), math.radians(elevation)
    return np.array([math.sin(a) * math.cos(e), math.sin(e), -math.cos(a) * math.cos(e)])


@dataclass(frozen=True, eq=False)
class Sun:
    """direction : (3,) unit; radiance : (3,) of its disc."""

    direction: Array
    radiance: Array
    half_angle: float = SUN_HALF_ANGLE

    @property
    def irradiance(self) -> Array:
        """On a plane that faces it, (3,)."""
        return self.radiance * (2.0 * math.pi * (1.0 - math.cos(self.half_angle)))

    @property
    def emitter(self) -> Emitter:
        return disc(self.direction, self.half_angle, self.radiance)


def sun(azimuth: float, elevation: float, turbidity: float) -> Sun:
    """The sun behind clear air of a turbidity."""
    return Sun(towards(azimuth, elevation), SUN_RADIANCE * sunlight(elevation, turbidity))


PEREZ_SLOPE = np.array(
    [
        [0.1787, -0.3554, -0.0227, 0.1206, -0.0670],
        [-0.0193, -0.0665, -0.0004, -0.0641, -0.0033],
        [-0.0167, -0.0950, -0.0079, -0.0441, -0.0109],
    ]
)
PEREZ_OFFSET = np.array(
    [
        [-1.4630, 0.4275, 5.3251, -2.5771, 0.3703],
        [-0.2592, 0.0008, 0.2125, -0.8989, 0.0452],
        [-0.2608, 0.0092, 0.2102, -1.6537, 0.0529],
    ]
)
"""Coefficients A to E for Y, x and y: slope × turbidity + offset."""
ZENITH_X = np.array(
    [
        [0.00166, -0.00375, 0.00209, 0.0],
        [-0.02903, 0.06377, -0.03202, 0.00394],
        [0.11693, -0.21196, 0.06052, 0.25886],
    ]
)
ZENITH_Y = np.array(
    [
        [0.00275, -0.00610, 0.00317, 0.0],
        [-0.04214, 0.08970, -0.04153, 0.00516],
        [0.15346, -0.26756, 0.06670, 0.26688],
    ]
)


@dataclass(frozen=True, eq=False)
class ClearSky:
    """Radiance of cloudless air; callable on directions (n, 3), below the horizon as at it."""

    sun: Sun
    turbidity: float

    def __call__(self, direction: Array) -> Array:
        t = self.turbidity
        a, b, c, d, e = (PEREZ_SLOPE * t + PEREZ_OFFSET).T[:, :, None]
        cosine = np.maximum(direction[:, 1], 0.01)
        cos_gamma = np.clip(direction @ self.sun.direction, -1.0, 1.0)
        gamma = np.arccos(cos_gamma)
        zenith_angle = math.acos(self.sun.direction[1])
        perez = (1.0 + a * np.exp(b / cosine)) * (1.0 + c * np.exp(d * gamma) + e * cos_gamma**2)
        scale = (1.0 + a * np.exp(b)) * (
            1.0 + c * np.exp(d * zenith_angle) + e * math.cos(zenith_angle) ** 2
        )
        luminance, x, y = perez / scale * self._zenith(zenith_angle)[:, None]
        xyz = np.stack([x / y, np.ones_like(x), (1.0 - x - y) / y]) * luminance
        return np.maximum(xyz.T @ xyz_to_rec709().T, 0.0) * KILOCANDELA

    def _zenith(self, angle: float) -> Array:
        """Luminance in kcd·m⁻² and chromaticity x, y of the zenith."""
        t = self.turbidity
        chi = (4.0 / 9.0 - t / 120.0) * (math.pi - 2.0 * angle)
        luminance = (4.0453 * t - 4.9710) * math.tan(chi) - 0.2155 * t + 2.4192
        powers_t, powers_a = np.array([t * t, t, 1.0]), angle ** np.array([3.0, 2.0, 1.0, 0.0])
        return np.array([luminance, powers_t @ ZENITH_X @ powers_a, powers_t @ ZENITH_Y @ powers_a])


def shell_point(direction: Array, width: float, altitude: float) -> tuple[Array, Array]:
    """Where rays meet a layer of clouds, in units of its altitude, and how wide a sample is there.

    The layer is a sphere that holds the ground 1 below it; `altitude` is its height relative to
    the planet's radius and decides how far away the layer meets the horizon.
    """
    y = np.maximum(direction[:, 1], 0.0)
    radius = 1.0 / altitude
    distance = np.sqrt((radius * y) ** 2 + 2.0 * radius + 1.0) - radius * y
    slant = np.maximum(np.sqrt(1.0 - ((radius / (radius + 1.0)) ** 2) * (1.0 - y * y)), 0.02)
    return direction * distance[:, None], distance * width / slant


@dataclass(frozen=True)
class Clouds:
    """A layer of clouds; cover is 0 to 1 of the sky, size is that of a cloud in altitudes."""

    cover: float
    size: float = 1.6
    thickness: float = 2.5
    seed: int = 11

    def optical_depth(self, direction: Array, width: float) -> Array:
        """(n,), 0 between the clouds."""
        point, spread = shell_point(direction, width, 4e-3)
        flat = point * np.array([1.0, 0.6, 1.0])
        shape = fractal(flat, spread, self.size, 8, 0.52, self.seed)
        patch = fractal(flat, spread, 4.0 * self.size, 2, 0.5, self.seed + 50)
        density = shape + 0.6 * patch + 1.1 * (self.cover - 0.5)
        return self.thickness * np.maximum(density, 0.0) * 4.0


def clouded(
    sky: ClearSky, clouds: Clouds, direction: Array, width: float, haze: float = 0.10
) -> Array:
    """Radiance of a clear sky with clouds before it, fading into the haze of the horizon."""
    clear = sky(direction)
    depth = clouds.optical_depth(direction, width)
    veil = 1.0 - np.exp(-depth)
    cos_gamma = np.clip(direction @ sky.sun.direction, -1.0, 1.0)
    forward = 0.035 + 0.55 * np.exp(-(1.0 - cos_gamma) * 14.0) + 0.05 * (0.5 + 0.5 * cos_gamma)
    lit = np.exp(-0.35 * depth)
    sunlit = sky.sun.irradiance * (forward * (0.25 + 0.75 * lit))[:, None]
    under = sky(np.array([[0.0, 1.0, 0.0]]))[0]
    base = (0.55 * under + 0.014 * sky.sun.irradiance) * (0.4 + 0.6 * lit)[:, None]
    cloud = sunlit + base
    far = smoothstep(0.0, haze, direction[:, 1])
    return mix(clear, cloud, veil * (0.25 + 0.75 * far))


def overcast(
    direction: Array, width: float, zenith: float = 0.9, contrast: float = 0.35, seed: int = 3
) -> Array:
    """The CIE overcast sky with the folds of its clouds."""
    point, spread = shell_point(direction, width, 4e-3)
    folds = fractal(point, spread, (2.2, 2.2, 1.4), 7, 0.5, seed)
    broad = fractal(point, spread, 7.0, 2, 0.5, seed + 40)
    standard = zenith * (1.0 + 2.0 * np.maximum(direction[:, 1], 0.0)) / 3.0
    shade = standard * np.exp(contrast * (1.6 * folds + 1.4 * broad))
    tint = mix(daylight(7200.0), daylight(5800.0), np.clip(0.5 + folds, 0.0, 1.0))
    return shade[:, None] * tint
