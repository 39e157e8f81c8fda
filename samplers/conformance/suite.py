"""What every sampler owes: checks that run on any of them, those of other packages included.

A check takes a sampler and raises `Nonconformance` with what it saw. `exceptions.py` beside this
file lists, as data, which sampler may fail which check and why; a listed check that passes is
itself an error, so that the list stays true.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np
from numpy.typing import NDArray

from samplers.base import LightSampler
from samplers.conformance.basics import Nonconformance, check_form
from samplers.conformance.basics import require as _require
from samplers.conformance.once import Once
from samplers.conformance.open_surface import (
    OpenSurface,
    allowed_irradiance_error,
    irradiance_of,
    reflected,
    samples_of,
)
from samplers.conformance.stress_maps import SHAPES, STRESS_MAPS, stress_map
from samplers.conformance.texel_masses import integral_error, texel_masses
from samplers.environment import EnvironmentMap
from samplers.lighting import (
    DirectionalLights,
    DiscLights,
    LayeredLights,
    LightDistribution,
    SurfaceDistribution,
)
from samplers.sphere import (
    angular_distance,
    direction_from_uv,
    pixel_direction,
    pixel_of_direction,
    uv_from_direction,
)
from samplers.threads import set_thread_count, thread_count

COUNTS = (1, 2, 7, 16, 64, 300, 1024)
"""Up to twice the texels of a map of 16 rows, as most are."""
LARGEST_COUNT = 4096
LARGEST_COUNT_ON = ("sun-and-sky", "smallest")
"""The map of most texels, of which that is twice the number, and the map of fewest."""
USUAL_COUNT = 64
SEED = 3
SAMPLES = 1 << 17
LARGEST_U = np.float32(1.0 - 2.0**-24)
ENDS = 8
SURFACE_RUNS = 64
LIGHTS = (16, 64)
"""How many lights tell where they stand."""
PLANES = OpenSurface.turned(192)
CHI_SQUARE_RISK = 1e-4
"""Probability of a false alarm in each chi-square test; a fixed seed makes it all or nothing."""

Parts = list[tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]]


def parts_of(lighting: object) -> Parts:
    """(direction, irradiance, angle) of each set of lights; none for a distribution."""
    match lighting:
        case DirectionalLights():
            return [(lighting.direction, lighting.irradiance, lighting.extent)]
        case LayeredLights():
            return parts_of(lighting.direct) + parts_of(lighting.indirect)
        case DiscLights():
            return [(lighting.direction, lighting.irradiance, lighting.half_angle)]
    return []


def _sets_of(lighting: object) -> tuple:
    """The lighting, and the further sets of one that has them."""
    return lighting.sets if isinstance(lighting, DirectionalLights) else (lighting,)


def _fluxes_of(lighting: object) -> list[NDArray[np.float64]]:
    """All irradiance of each set of a lighting, with the ambient map of disc lights."""
    fluxes = []
    for lights in _sets_of(lighting):
        total = np.sum([irradiance.sum(axis=0) for _, irradiance, _ in parts_of(lights)], axis=0)
        fluxes.append(
            total + lights.ambient.total_flux if isinstance(lights, DiscLights) else total
        )
    return fluxes


def _prepare(sampler: LightSampler, environment: EnvironmentMap, count: int = USUAL_COUNT):
    count = max(count, sampler.minimum_count)
    return sampler.prepare(environment, count, np.random.default_rng(SEED))


_once = Once()


def _lighting(sampler: LightSampler, name: str, count: int = USUAL_COUNT):
    """The lighting of a stress map, which checks share."""
    return _once(sampler, (name, count), lambda: _prepare(sampler, stress_map(name), count))


def _counts(sampler: LightSampler, name: str) -> list[int]:
    counts = (*COUNTS, LARGEST_COUNT) if name in LARGEST_COUNT_ON else COUNTS
    return [count for count in counts if count >= sampler.minimum_count]


def check_lighting(sampler: LightSampler) -> None:
    """A frozen dataclass whose `prepare` returns one of the five kinds of lighting, well formed."""
    for name in ("noise", "sun-and-sky", "black"):
        try:
            check_form(sampler, _prepare(sampler, stress_map(name), 16))
        except Nonconformance as failure:
            raise Nonconformance(f"{name}: {failure}") from None


def check_every_map_and_count(sampler: LightSampler) -> None:
    """Finite, unit, not negative, within the budget, and dark only where the map is."""
    for name in STRESS_MAPS:
        environment = stress_map(name)
        for count in _counts(sampler, name):
            lighting = _lighting(sampler, name, count)
            if isinstance(lighting, LightDistribution | SurfaceDistribution):
                _require(lighting.count == count, f"{name}: count {lighting.count}, not {count}")
                if name != "noise":
                    break  # a table does not depend on the count
                continue
            for lights in _sets_of(lighting):
                parts = parts_of(lights)
                number = sum(len(direction) for direction, _, _ in parts)
                _require(number <= count, f"{name}: {number} lights for a budget of {count}")
                for _, irradiance, _ in parts:
                    lit = bool(irradiance.any(axis=1).all())
                    _require(lit, f"{name}, {count}: a light without energy")
                _require(
                    number > 0 or environment.is_black or isinstance(lights, DiscLights),
                    f"{name}, {count}: no light at all",
                )


def check_energy(sampler: LightSampler) -> None:
    """Lights (and an ambient map) carry the map's flux, per channel, to 10⁻⁶."""
    for name in STRESS_MAPS:
        environment = stress_map(name)
        for count in _counts(sampler, name):
            lighting = _lighting(sampler, name, count)
            if isinstance(lighting, LightDistribution):
                continue
            for flux in _fluxes_of(lighting):
                error = np.abs(flux - environment.total_flux)
                _require(
                    bool((error <= 1e-6 * environment.total_flux).all()),
                    f"{name}, {count} lights: flux off by {error} of {environment.total_flux}",
                )


def check_luminous_energy(sampler: LightSampler) -> None:
    """Lights carry the map's luminous flux to 10⁻⁶, whatever their colours."""
    weights = np.array([0.2126, 0.7152, 0.0722])
    for name in STRESS_MAPS:
        environment = stress_map(name)
        lighting = _lighting(sampler, name)
        if isinstance(lighting, LightDistribution):
            continue
        wanted = environment.luminous_flux
        for flux in _fluxes_of(lighting):
            seen = flux @ weights
            _require(abs(seen - wanted) <= 1e-6 * wanted, f"{name}: {seen} instead of {wanted}")


def _fingerprint(lighting: object) -> list[bytes]:
    if isinstance(lighting, SurfaceDistribution):
        samples = samples_of(lighting, OpenSurface.turned(64), np.random.default_rng(1))
        return [samples.direction.tobytes(), samples.weight.tobytes()]
    if isinstance(lighting, LightDistribution):
        u = np.random.default_rng(1).random((4096, 3), np.float32)
        direction, pdf = lighting.sample(u)
        return [direction.tobytes(), pdf.tobytes(), lighting.pdf(direction).tobytes()]
    arrays = [
        array.tobytes()
        for lights in _sets_of(lighting)
        for part in parts_of(lights)
        for array in part
    ]
    if isinstance(lighting, DiscLights):
        arrays.append(lighting.ambient.radiance.tobytes())
    return arrays


def check_determinism(sampler: LightSampler) -> None:
    """The same seed gives the same bits, on one thread and on four."""
    before = thread_count()
    try:
        for name in ("noise", "sun-and-sky", "constant"):
            seen = []
            for threads in (1, 4, 4):
                set_thread_count(threads)
                seen.append(_fingerprint(_prepare(sampler, stress_map(name))))
            _require(seen[0] == seen[1] == seen[2], f"{name}: two runs differ")
    finally:
        set_thread_count(before)


def check_scale_invariance(sampler: LightSampler) -> None:
    """A map 2¹⁰ times as bright gives the same directions, 2¹⁰ times as bright."""
    factor = 1024.0
    for name in ("noise", "sun-and-sky", "constant", "odd-height", "contrast-1e6"):
        once = _lighting(sampler, name)
        brighter = EnvironmentMap.from_array(STRESS_MAPS[name]() * factor)
        scaled = _prepare(sampler, brighter)
        if isinstance(once, LightDistribution | SurfaceDistribution):
            _require(_fingerprint(once) == _fingerprint(scaled), f"{name}: samples moved")
            continue
        for (d0, e0, a0), (d1, e1, a1) in zip(parts_of(once), parts_of(scaled), strict=True):
            same = d0.shape == d1.shape and np.array_equal(d0, d1) and np.array_equal(a0, a1)
            _require(same, f"{name}: lights moved")
            _require(bool(np.allclose(e0 * factor, e1, rtol=1e-9, atol=0.0)), f"{name}: not scaled")


def _rolled(environment: EnvironmentMap, columns: int) -> EnvironmentMap:
    return EnvironmentMap(np.roll(environment.radiance, columns, axis=1))


def check_rotation(sampler: LightSampler) -> None:
    """A map turned by whole columns gives the same lights, turned; a distribution turns too."""
    for name in ("noise", "sun-and-sky", "contrast-1e3", "constant"):
        environment = stress_map(name)
        columns = 5
        once = _lighting(sampler, name)
        if name == "constant" and not isinstance(once, LightDistribution):
            continue  # turned, it is the same map: no finite set of lights can turn with it
        turned = _prepare(sampler, _rolled(environment, columns))
        if isinstance(once, LightDistribution):
            at = np.random.default_rng(2).random((1000, 2))
            before = direction_from_uv(at[:, 0], at[:, 1])
            after = direction_from_uv(at[:, 0] + columns / environment.width, at[:, 1])
            p0 = once.pdf(before.astype(np.float32))
            p1 = turned.pdf(after.astype(np.float32))
            close = np.isclose(p0, p1, rtol=1e-3)
            # Directions that round across a texel's edge are the only ones that may differ.
            _require(
                close.mean() > 0.99, f"{name}: pdf differs at {100 * (1 - close.mean()):.1f} %"
            )
            continue
        for (d0, e0, _), (d1, e1, _) in zip(parts_of(once), parts_of(turned), strict=True):
            _require(len(d0) == len(d1), f"{name}: {len(d0)} lights became {len(d1)}")
            if len(d0) == 0:
                continue
            u, v = uv_from_direction(d0)
            wanted = direction_from_uv(u + columns / environment.width, v)
            distance = angular_distance(wanted[:, None], d1[None])
            nearest = distance.argmin(axis=1)
            _require(
                bool((distance.min(axis=1) < 1e-6).all()),
                f"{name}: lights are up to {distance.min(axis=1).max():.2g} rad off",
            )
            _require(
                bool(np.allclose(e1[nearest], e0, rtol=1e-6)),
                f"{name}: lights in the same places, turned, with other irradiance",
            )


def check_single_texel(sampler: LightSampler) -> None:
    """One lit texel, also on the seam and at the poles, is where the light comes from."""
    for name in (
        "one-texel",
        "one-texel-on-the-seam",
        "one-texel-at-the-top",
        "one-texel-at-the-bottom",
    ):
        environment = stress_map(name)
        row, column = np.unravel_index(environment.luminance.argmax(), environment.luminance.shape)
        centre = pixel_direction(row, column, environment.height)
        lighting = _lighting(sampler, name)
        if isinstance(lighting, LightDistribution):
            samples, pdf = lighting.sample(_random_numbers())
            _require(bool((pdf > 0.0).all()), f"{name}: a sample of density 0")
            at = pixel_of_direction(samples, environment.height)
            _require(bool(((at[0] == row) & (at[1] == column)).all()), f"{name}: a sample outside")
            continue
        allowed = math.pi / environment.height  # half the diagonal of a texel is 0.71 of its side
        for direction, _, _ in parts_of(lighting):
            distance = angular_distance(direction, centre)
            _require(
                bool((distance <= allowed).all()),
                f"{name}: {distance.max(initial=0.0):.3g} rad off",
            )


def check_seam(sampler: LightSampler) -> None:
    """Two lit texels that touch over the seam give no light on the far side of the sphere."""
    name = "two-texels-over-the-seam"
    environment, lighting = stress_map(name), _lighting(sampler, name)
    centre = direction_from_uv(0.0, (7 + 0.5) / environment.height)
    for direction, _, _ in parts_of(lighting):
        distance = angular_distance(direction, centre)
        _require(
            bool((distance <= 2.0 * math.pi / environment.height).all()),
            f"a light {distance.max(initial=0.0):.3g} rad from the two texels",
        )


def check_black(sampler: LightSampler) -> None:
    """A black map gives no lights, a density that is uniform, or samples without radiance."""
    lighting = _lighting(sampler, "black")
    if isinstance(lighting, SurfaceDistribution):
        samples = samples_of(lighting, OpenSurface.turned(64), np.random.default_rng(1))
        own = samples.radiance
        _require(own is None or not own.any(), "radiance under a black map")
        return
    if isinstance(lighting, LightDistribution):
        direction, pdf = lighting.sample(_random_numbers())
        _require(bool(np.allclose(pdf, 1.0 / (4.0 * math.pi), rtol=1e-5)), "pdf is not uniform")
        _require(bool(np.isfinite(direction).all()), "a direction is not finite")
        return
    number = sum(len(direction) for direction, _, _ in parts_of(lighting))
    _require(number == 0, f"{number} lights")


@cache
def _irradiance(name: str) -> NDArray[np.float64]:
    """Green irradiance (p,) of the `PLANES` under a stress map."""
    return irradiance_of(stress_map(name), PLANES.normal)[:, 1]


def check_surface_mean(sampler: LightSampler) -> None:
    """A surface in the open reflects what reaches it, also by the fewest samples there can be.

    The truth is a sum over the map, each texel cut into 64; points are means over all normals, and
    the error allowed is that of the samples' mean. A distribution is met by BRDF samples, as the
    renderer does, so a density that leaves light out to them needs one at least.
    """
    for name in ("noise", "sun-and-sky", "one-texel"):
        environment, truth = stress_map(name), float(_irradiance(name).mean()) / math.pi
        for count in sorted({sampler.minimum_count, max(8, sampler.minimum_count)}):
            lighting, rng = _lighting(sampler, name, count), np.random.default_rng(SEED)
            means = [
                float(reflected(lighting, environment, PLANES, rng)[:, 1].mean())
                for _ in range(SURFACE_RUNS)
            ]
            mean, error = float(np.mean(means)), float(np.std(means, ddof=1))
            # Student's t with 63 degrees of freedom exceeds 5 once in 2·10⁵; 1e-3 is the sum's own.
            _require(
                abs(mean - truth) <= 5.0 * error / math.sqrt(SURFACE_RUNS) + 1e-3 * truth,
                f"{name}, {count} samples: mean {mean:.4g}, not {truth:.4g}",
            )


def check_irradiance(sampler: LightSampler) -> str | None:
    """Lights stand where light comes from: planes of all normals get the irradiance of the map.

    The error allowed follows from the number of lights. It is a share of a plane's irradiance, or
    of the mean over all planes where that is more. Returns a sentence where there are fewer lights
    than asked for, which is no failure.
    """
    normal = PLANES.normal.astype(np.float64)
    fewer: dict[str, list[str]] = {}
    for name in (*SHAPES, "smallest"):
        truth, mean = _irradiance(name), 0.25 * float(stress_map(name).total_flux[1])
        for count in (max(few, sampler.minimum_count) for few in LIGHTS):
            parts = parts_of(_lighting(sampler, name, count))
            number = sum(len(direction) for direction, _, _ in parts)
            if number < count:
                fewer.setdefault(f"{number} lights of {count}", []).append(name)
            if name not in SHAPES:
                continue
            seen = sum(np.maximum(normal @ way.T, 0.0) @ flux[:, 1] for way, flux, _ in parts)
            off = float((np.abs(seen - truth) / np.maximum(truth, mean)).max())
            allowed = allowed_irradiance_error(count)
            _require(
                off <= allowed,
                f"{name}, {count} lights: a plane's irradiance is off by {off:.0%}, over "
                f"{allowed:.0%}",
            )
    told = (f"{number} on {', '.join(names)}" for number, names in fewer.items())
    return f"fewer than asked for: {'; '.join(told)}" if fewer else None


def _random_numbers(count: int = SAMPLES) -> NDArray[np.float32]:
    """Random numbers, with the ends of their range among them: the first `ENDS`."""
    u = np.random.default_rng(SEED).random((count, 3), np.float32)
    u[:ENDS] = np.array(np.meshgrid(*[[0.0, LARGEST_U]] * 3), np.float32).reshape(3, ENDS).T
    return u


@dataclass(frozen=True, eq=False)
class _Drawn:
    """A distribution over a stress map of `height` rows, and what is drawn from it.

    direction, pdf : (SAMPLES, 3) and (SAMPLES,), by `sample`
    again : (SAMPLES,), `pdf` of the directions
    """

    name: str
    height: int
    lighting: LightDistribution
    direction: NDArray[np.float32]
    pdf: NDArray[np.float32]
    again: NDArray[np.float32]

    @cached_property
    def texel_masses(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """∫ pdf dω over each texel (H, 2H), and how far it may be off."""
        return texel_masses(self.lighting.pdf, self.height, self.direction, self.again)


def _distributions(sampler: LightSampler) -> list[_Drawn]:
    """A distribution for each stress map, which checks share; none of other lightings."""
    return _once(sampler, "distributions", lambda: list(_drawn(sampler)))


def _drawn(sampler: LightSampler) -> Iterator[_Drawn]:
    for name in STRESS_MAPS:
        lighting = _lighting(sampler, name)
        if isinstance(lighting, LightDistribution):
            direction, pdf = lighting.sample(_random_numbers())
            again = lighting.pdf(direction)
            yield _Drawn(name, stress_map(name).height, lighting, direction, pdf, again)


def check_pdf_integral(sampler: LightSampler) -> None:
    """The density integrates to one: neither more nor less."""
    for drawn in _distributions(sampler):
        name, (mass, error) = drawn.name, drawn.texel_masses
        _require(bool((mass >= 0.0).all()), f"{name}: a negative or undefined density")
        # Ample for float32 rounding and for midpoints of what is smooth.
        off = integral_error(mass, error)
        _require(off < 1e-4, f"{name}: the integral is {float(mass.sum()):.6g}")


def check_pdf_of_samples(sampler: LightSampler) -> None:
    """`pdf` agrees with the density that comes with a sample, which is positive and unit."""
    for drawn in _distributions(sampler):
        name, direction, pdf = drawn.name, drawn.direction, drawn.pdf
        _require(bool(np.isfinite(direction).all()), f"{name}: a direction is not finite")
        _require(
            bool((np.abs(np.linalg.norm(direction, axis=1) - 1.0) < 1e-5).all()),
            f"{name}: a direction is not unit",
        )
        _require(bool((pdf > 0.0).all() and np.isfinite(pdf).all()), f"{name}: a density ≤ 0")
        off = ~np.isclose(drawn.again, pdf, rtol=1e-4)
        _require(not off.any(), f"{name}: {int(off.sum())} of {len(pdf)} densities disagree")


def check_chi_square(sampler: LightSampler) -> None:
    """Samples fall as the density says, by a chi-square test over texels."""
    from scipy.stats import chi2

    for drawn in _distributions(sampler):
        name, height = drawn.name, drawn.height
        # The first were chosen, not drawn.
        direction, pdf = drawn.direction[ENDS:], drawn.again[ENDS:]
        _require(bool((pdf > 0.0).all()), f"{name}: a sample of density 0")
        row, column = pixel_of_direction(direction, height)
        seen = np.bincount(row * 2 * height + column, minlength=2 * height * height)
        mass, error = (len(pdf) * values.reshape(-1) for values in drawn.texel_masses)
        statistic, cells = pooled_chi_square(seen, mass, error**2)
        if cells < 2:
            continue
        p_value = float(chi2.sf(statistic, cells - 1))
        _require(p_value > CHI_SQUARE_RISK, f"{name}: χ² = {statistic:.1f} over {cells} cells")


def pooled_chi_square(
    seen: NDArray[np.int64],
    expected: NDArray[np.float64],
    variance: NDArray[np.float64] | float = 0.0,
) -> tuple[float, int]:
    """χ² and the number of cells, those that expect fewer than five samples put together.

    variance : of `expected` itself, where it is not exact
    """
    variance = np.broadcast_to(variance, expected.shape)
    order = np.argsort(expected)
    seen, expected, variance = seen[order], expected[order], variance[order]
    few = expected < 5.0
    pooled_seen, pooled_expected, pooled_variance = (
        np.append(values[~few], values[few].sum()) for values in (seen, expected, variance)
    )
    used = pooled_expected >= 5.0
    if not used[-1] and pooled_expected[-1] > 0.0 and used.sum():
        first = int(np.argmax(used))
        for values in (pooled_seen, pooled_expected, pooled_variance):
            values[first] += values[-1]
    e, s, v = pooled_expected[used], pooled_seen[used], pooled_variance[used]
    return float(((s - e) ** 2 / (e + v)).sum()), len(e)


FOR_DISTRIBUTIONS = ("pdf-integral", "pdf-of-samples", "chi-square")
"""Checks that say nothing of global sets of lights."""
FOR_LIGHTS = ("energy", "irradiance", "luminous-energy", "seam")
"""Checks that say nothing of distributions."""
ESTIMATES = ("surface-mean",)
"""Checks of what is drawn afresh at each shading point."""
OF_DIRECTIONS = ("rotation", "single-texel")
"""Checks of where light comes from whatever the surface is."""


def applies(check: str, sampler: LightSampler) -> bool:
    """Whether a check can fail for this sampler, by what it returns."""
    lighting = _lighting(sampler, "noise")
    if isinstance(lighting, SurfaceDistribution):
        return check not in FOR_LIGHTS + FOR_DISTRIBUTIONS + OF_DIRECTIONS
    if isinstance(lighting, LightDistribution):
        return check not in FOR_LIGHTS
    if isinstance(lighting, DiscLights) and check == "irradiance":
        return False  # how many there are, and how large, is the map's matter
    return check not in FOR_DISTRIBUTIONS + ESTIMATES


CHECKS: dict[str, Callable[[LightSampler], str | None]] = {
    "lighting": check_lighting,
    **{
        name.removeprefix("check_").replace("_", "-"): value
        for name, value in sorted(globals().items())
        if name.startswith("check_") and name != "check_form"
    },
}
"""All checks by name; the first is the one that the others build on. One that is passed may return
a sentence worth knowing."""
