"""What is measured of a sampler on a map: each property one number.

Every property compares with a sum over all texels, with the same sampler on a map that is the same
up to a factor or a turn, or with a second run. What a sampler raises is kept as a word.
"""

import gc
import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from experiments.questions.stability.brute_force import (
    Probes,
    irradiance_error,
    map_irradiance,
    total_flux,
    unreached_flux,
)
from samplers import (
    DiscLights,
    EnvironmentMap,
    LightDistribution,
    Lighting,
    LightSampler,
    SurfaceDistribution,
)
from samplers.conformance.open_surface import OpenSurface, samples_of
from samplers.conformance.suite import CHI_SQUARE_RISK, Parts, parts_of, pooled_chi_square
from samplers.conformance.texel_masses import FINE, integral_error, texel_masses
from samplers.sphere import (
    angular_distance,
    direction_from_uv,
    pixel_of_direction,
    uv_from_direction,
)
from samplers.threads import set_thread_count, thread_count

COUNT = 64
SEED = 3
SAMPLES = 1 << 17
PROBES = 4096
SURFACE_POINTS = 64
"""Where samples are drawn of a distribution that sees the surface."""
BINS = 32
"""Rows of bins, at most, into which samples are counted."""
LEAST_FINE, FINE_ROWS = 2, 512
"""Midpoints along each side of a texel by which a density is integrated: at least, and in all down
the map of those that have fewer rows."""
MISMATCH = 1e-4
POWER, FRACTION = 1024.0, 1000.0 / 3.0
"""Factors of the scaled maps: a power of two, which rounds nothing, and one that rounds."""
TURNED = 5
"""Columns of 32 by which a map is turned: whole cells of any coarser grid."""
ERROR = "error"
Figures = dict[str, float | int | str | None]


@dataclass(frozen=True)
class Property:
    """title : heading; tolerance : from where on it is a failure, None where it is a matter of
    accuracy; check : the conformance check whose exceptions apply; least : small values are bad
    """

    title: str
    tolerance: float | None
    check: str = ""
    least: bool = False

    def exceeds(self, value: float) -> bool:
        """Whether the value is a failure."""
        if self.tolerance is None or math.isnan(value):
            return False
        return value < self.tolerance if self.least else value > self.tolerance

    def worst(self, values: NDArray[np.float64]) -> float:
        """The worst of the values that are there, NaN without any."""
        present = values[~np.isnan(values)]
        if not len(present):
            return float("nan")
        return float(present.min() if self.least else present.max())


PROPERTIES: dict[str, Property] = {
    "nonfinite": Property("not finite", 0.0, "every-map-and-count"),
    "negative": Property("negative", 0.0, "every-map-and-count"),
    "unit_error": Property("length", 1e-6, "every-map-and-count"),
    "energy_error": Property("energy", 1e-6, "energy"),
    "unreached": Property("never drawn", None),
    "pdf_integral_error": Property("pdf integral", 1e-4, "pdf-integral"),
    "pdf_mismatch": Property("pdf of samples", 0.0, "pdf-of-samples"),
    "chi_square_p": Property("chi-square p", CHI_SQUARE_RISK, "chi-square", least=True),
    "differing_bytes": Property("bytes", 0.0, "determinism"),
    "power_deviation": Property("× 2^k", 1e-9, "scale-invariance"),
    "fraction_moved": Property("× 1000/3", 1e-6, "scale-invariance"),
    "rotation_moved": Property("turned", 1e-6, "rotation"),
    "plate_error": Property("irradiance", None),
}
"""In the order of tables. Tolerances are those of the conformance checks."""


@dataclass(frozen=True, eq=False)
class Observation:
    """What is left of a lighting once it is gone.

    arrays : all that must be the same bits in another run
    parts : lights; empty for a distribution
    ambient : (3,) flux of an ambient map
    density, solid_angle : (n,) at the probes and in sr; empty for lights
    samples : directions (n, 3) and weights (n,) at an open surface, of a distribution that sees it
    """

    arrays: list[NDArray[np.uint8]]
    parts: Parts
    ambient: NDArray[np.float64]
    density: NDArray[np.float64]
    solid_angle: NDArray[np.float64]
    samples: tuple[NDArray[np.float32], NDArray[np.float64]] | None = None


def observe(lighting: Lighting, height: int, turn: float = 0.0) -> Observation:
    """turn : of the probes of a density, to the right, in units of a full one."""
    parts: Parts = parts_of(lighting)
    arrays: list[NDArray] = []
    ambient, density, samples = np.zeros(3), np.empty(0), None
    probes = Probes.of(height, PROBES)
    if isinstance(lighting, SurfaceDistribution):
        arrays = list(samples := _surface_samples(lighting))
    if isinstance(lighting, LightDistribution):
        u = np.random.default_rng(1).random((PROBES, 3), np.float32)
        density = lighting.pdf(probes.directions(turn)).astype(np.float64)
        arrays = [*lighting.sample(u), density]
    for part in parts:
        arrays += list(part)
    if isinstance(lighting, DiscLights):
        ambient = lighting.ambient.total_flux
        arrays.append(np.frombuffer(bytes.fromhex(lighting.ambient.digest), np.uint8))
    raw = [np.frombuffer(np.ascontiguousarray(array).tobytes(), np.uint8) for array in arrays]
    return Observation(raw, parts, ambient, density, probes.solid_angle, samples)


def _surface_samples(
    lighting: SurfaceDistribution,
) -> tuple[NDArray[np.float32], NDArray[np.float64]]:
    """Directions (n, 3) and weights (n,) of the samples at open surfaces turned all ways."""
    surface = OpenSurface.turned(SURFACE_POINTS)
    found = samples_of(lighting, surface, np.random.default_rng(1))
    return found.direction.reshape(-1, 3), found.weight.astype(np.float64).reshape(-1)


def differing_bytes(a: Observation, b: Observation) -> int:
    """How many bytes are not the same; all of an array whose length is another."""
    return sum(
        int((x != y).sum()) if len(x) == len(y) else max(len(x), len(y))
        for x, y in zip(a.arrays, b.arrays, strict=True)
    )


def scale_deviation(a: Observation, b: Observation, factor: float) -> float:
    """Largest angle in rad or relative difference of irradiance or density, light by light.

    Infinite where the number of lights is another. What sees the surface is compared by samples.
    """
    if len(a.density):
        return _relative(a.density, b.density)
    if a.samples is not None and b.samples is not None:
        angle = angular_distance(a.samples[0].astype(float), b.samples[0].astype(float))
        return max(float(angle.max()), _relative(a.samples[1], b.samples[1]))
    largest = _relative(a.ambient * factor, b.ambient)
    for (d0, e0, a0), (d1, e1, a1) in zip(a.parts, b.parts, strict=True):
        if len(d0) != len(d1):
            return math.inf
        if len(d0):
            relative = np.abs(e1 / factor - e0) / e0.max(axis=1, keepdims=True)
            found = (angular_distance(d0, d1).max(), np.abs(a0 - a1).max(), relative.max())
            largest = max(largest, *map(float, found))
    return largest


def _relative(a: NDArray[np.float64], b: NDArray[np.float64]) -> float:
    size = np.maximum(np.abs(a), np.abs(b))
    return float((np.abs(a - b) / np.where(size > 0.0, size, 1.0)).max(initial=0.0))


def moved(a: Observation, b: Observation, turn: float = 0.0) -> float:
    """How far lights are from where the turn takes them: mean angle in rad, weighted by energy.

    Each light goes to the nearest of the other set, from either side; the larger mean counts. Of a
    density, the share of the probability that is elsewhere (total variation distance), by probes.
    NaN for what sees the surface, which does not turn.

    turn : of the second map, in units of a full one
    """
    if len(a.density):
        both = float(a.solid_angle @ (a.density + b.density))
        return float(a.solid_angle @ np.abs(a.density - b.density)) / both if both > 0.0 else 0.0
    if a.samples is not None:
        return math.nan
    d0, e0 = _all_lights(a)
    d1, e1 = _all_lights(b)
    if len(d0) == 0 or len(d1) == 0:
        return 0.0 if len(d0) == len(d1) else math.pi
    u, v = uv_from_direction(d0)
    distance = angular_distance(direction_from_uv(u + turn, v)[:, None], d1[None])
    means = [
        float(distance.min(axis=1) @ e0 / e0.sum()),
        float(distance.min(axis=0) @ e1 / e1.sum()),
    ]
    return max(means)


def _all_lights(a: Observation) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    direction = np.concatenate([part[0] for part in a.parts])
    return direction, np.concatenate([part[1].sum(axis=1) for part in a.parts])


def figures_of(
    lighting: Lighting, environment: EnvironmentMap, flux: NDArray[np.float64],
    plates: NDArray[np.float64],
) -> Figures:  # fmt: skip
    """What can be said of one lighting alone."""
    if isinstance(lighting, SurfaceDistribution):
        direction, weight = _surface_samples(lighting)
        negative = int((weight < 0.0).sum())
        drawn = weight != 0.0
        values = _of_values(direction[drawn], direction[~drawn], weight)
        return {"lights": lighting.count, "negative": negative, **values}
    plate_error = irradiance_error(lighting, environment, plates)
    if isinstance(lighting, LightDistribution):
        return {"lights": lighting.count, "plate_error": plate_error} | _of_distribution(
            lighting, environment
        )
    parts = parts_of(lighting)
    total = np.sum([part[1].sum(axis=0) for part in parts], axis=0)
    if isinstance(lighting, DiscLights):
        total = total + lighting.ambient.total_flux
    direction = np.concatenate([part[0] for part in parts])
    lit = flux > 0.0
    return {
        "lights": len(direction),
        "plate_error": plate_error,
        **_of_values(direction, *(array for part in parts for array in part[1:])),
        "negative": sum(int((part[1] < 0.0).sum()) for part in parts),
        "energy_error": float((np.abs(total - flux)[lit] / flux[lit]).max(initial=0.0)),
    }


def _of_values(direction: NDArray, *others: NDArray) -> Figures:
    length = np.linalg.norm(direction.astype(np.float64), axis=1)
    return {
        "nonfinite": sum(int((~np.isfinite(value)).sum()) for value in (direction, *others)),
        "unit_error": float(np.abs(length - 1.0).max(initial=0.0)),
    }


def _of_distribution(lighting: LightDistribution, environment: EnvironmentMap) -> Figures:
    from scipy.stats import chi2

    height = environment.height
    direction, pdf = lighting.sample(np.random.default_rng(SEED).random((SAMPLES, 3), np.float32))
    again = lighting.pdf(direction)
    fine = max(LEAST_FINE, min(FINE, FINE_ROWS // height))
    mass, error = texel_masses(lighting.pdf, height, direction, again, fine)
    step = -(-height // BINS)
    expected, variance = SAMPLES * _binned(mass, step), SAMPLES**2 * _binned(error**2, step)
    row, column = pixel_of_direction(direction, height)
    where = (row // step) * expected.shape[1] + column // step
    seen = np.bincount(where, minlength=expected.size)
    statistic, cells = pooled_chi_square(seen, expected.reshape(-1), variance.reshape(-1))
    return {
        **_of_values(direction, pdf),
        "negative": int((pdf <= 0.0).sum()) + int((~(mass >= 0.0) | np.isinf(mass)).sum()),
        "unreached": unreached_flux(environment, mass),
        "pdf_integral_error": integral_error(mass, error),
        "pdf_mismatch": int((~np.isclose(again, pdf, rtol=MISMATCH, atol=0.0)).sum()),
        "chi_square_p": float(chi2.sf(statistic, cells - 1)) if cells > 1 else None,
    }


def _binned(values: NDArray[np.float64], step: int) -> NDArray[np.float64]:
    """Sums over bins of `step` × `step` texels."""
    down = np.add.reduceat(values, np.arange(0, values.shape[0], step), axis=0)
    return np.add.reduceat(down, np.arange(0, values.shape[1], step), axis=1)


def factors(radiance: NDArray[np.float32]) -> tuple[float, float]:
    """By how much the map is scaled: up, or down where it would overflow."""
    up = float(radiance.max()) * POWER < float(np.finfo(np.float32).max)
    return (POWER, FRACTION) if up else (1.0 / POWER, 1.0 / FRACTION)


def measure_samplers(
    radiance: NDArray[np.float32], samplers: Mapping[str, LightSampler]
) -> dict[str, Figures]:
    """All figures of all samplers on one map (H, 2H, 3).

    Variants of the map come one after another, so that only one has its tables in memory.
    """
    height, width = radiance.shape[:2]
    rows: dict[str, Figures] = {name: {} for name in samplers}
    first: dict[str, Observation] = {}
    flux, plates = total_flux(radiance), map_irradiance(radiance)
    turn, (power, fraction) = max(1, width * TURNED // 32), factors(radiance)

    def prepared(name: str, environment: EnvironmentMap) -> Lighting | None:
        """The lighting; None where the sampler fails now or failed before."""
        if ERROR in rows[name]:
            return None
        sampler = samplers[name]
        count = max(COUNT, sampler.minimum_count)
        try:
            return sampler.prepare(environment, count, np.random.default_rng(SEED))
        except Exception as error:  # whatever it is, it is a result
            rows[name] = {ERROR: f"{type(error).__name__}: {error}"}
            return None

    def variant(column: str, changed: NDArray[np.float32], moved: float, compare) -> None:
        environment = EnvironmentMap(changed)
        for name in samplers:
            lighting = prepared(name, environment)
            if lighting is not None:
                rows[name][column] = compare(first[name], observe(lighting, height, moved))
            del lighting
        del environment
        gc.collect()

    threads = thread_count()
    try:
        set_thread_count(1)
        environment = EnvironmentMap(radiance.copy())
        for name in samplers:
            lighting = prepared(name, environment)
            if lighting is not None:
                first[name] = observe(lighting, height)
                rows[name] |= figures_of(lighting, environment, flux, plates)
            del lighting
        del environment
        set_thread_count(4)
        variant("differing_bytes", radiance.copy(), 0.0, differing_bytes)
    finally:
        set_thread_count(threads)
    scaled = (radiance * np.float64(power)).astype(np.float32)
    variant("power_deviation", scaled, 0.0, lambda a, b: scale_deviation(a, b, power))
    scaled = (radiance * np.float64(fraction)).astype(np.float32)
    variant("fraction_moved", scaled, 0.0, moved)
    del scaled
    turned = np.roll(radiance, turn, axis=1)
    same = np.array_equal(turned, radiance)

    def turned_with(a: Observation, b: Observation) -> float:
        # No finite set of lights can turn with a map that turns into itself.
        return math.nan if same and not len(a.density) else moved(a, b, turn / width)

    variant("rotation_moved", turned, turn / width, turned_with)
    return rows
