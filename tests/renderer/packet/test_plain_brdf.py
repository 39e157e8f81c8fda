"""Reflectance is reciprocal, keeps energy, and is drawn with exactly the density it claims.

Shown of the plain formulas; `test_reflectance.py` holds the renderer's to them.
"""

import math

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import quad
from scipy.stats import chi2

from renderer.packet.material_table import ALPHA_X, ALPHA_Y, pack
from renderer.scene.materials import Coated, Conductor, Lambert, Material, Ward
from samplers.compiled import kernel
from tests.renderer.packet import plain_brdf as brdf

ALPHAS = (1e-4, 1e-3, 0.01, 0.05, 0.1, 0.2, 0.3, 0.5, 1.0)
VIEW_COSINES = (1.0, 0.9, 0.7, 0.5, 0.3, 0.1, 0.03, 1e-2, 1e-4)
BLACK = (0.0, 0.0, 0.0)
WHITE = (1.0, 1.0, 1.0)
BRUSHED = Ward(BLACK, WHITE, 0.5, 1e-3)
SMOOTH_MATERIALS = {
    "lambert": Lambert((0.8, 0.4, 0.2)), "coated": Coated((0.8, 0.4, 0.2), 0.3),
    "coated-glass": Coated((0.8, 0.4, 0.2), 0.02), "coated-black": Coated(BLACK, 0.5, 1.8),
    "conductor": Conductor((0.9, 0.6, 0.3), 0.4),
    "conductor-rough": Conductor((0.9, 0.6, 0.3), 1.0),
    "conductor-mirror": Conductor((0.9, 0.6, 0.3), 1e-3),
    "ward": Ward((0.2, 0.3, 0.1), (0.3, 0.2, 0.1), 0.3, 0.3),
    "ward-anisotropic": Ward(BLACK, (0.3, 0.2, 0.1), 0.4, 0.05), "ward-brushed": BRUSHED,
}  # fmt: skip


def row_of(material: Material) -> NDArray[np.float64]:
    return pack([material])[0]


def upper_directions(count: int, seed: int) -> NDArray[np.float64]:
    """Directions (count, 3) around +Z, half of them within 0.05 of the horizon."""
    rng = np.random.default_rng(seed)
    z = rng.uniform(0.0, 1.0, count)
    z[::2] *= 0.05
    phi = rng.uniform(0.0, 2.0 * math.pi, count)
    sine = np.sqrt(1.0 - z * z)
    return np.stack([sine * np.cos(phi), sine * np.sin(phi), z], axis=1)


@kernel
def evaluate_all(row, normal, v, d):
    out = np.empty((len(v), 3))
    for i in range(len(v)):
        out[i] = brdf.evaluate(row, normal, v[i], d[i])
    return out


Z = np.array([0.0, 0.0, 1.0])


@pytest.mark.parametrize("name", SMOOTH_MATERIALS)
def test_light_and_eye_may_be_exchanged(name: str) -> None:
    row = row_of(SMOOTH_MATERIALS[name])
    v, d = upper_directions(2000, 1), upper_directions(2000, 2)
    v[:500] = d[:500] * (-1.0, -1.0, 1.0) + 0.3 * row[ALPHA_Y] * v[:500]
    v /= np.linalg.norm(v, axis=1, keepdims=True)
    v[:, 2] = np.abs(v[:, 2])
    there, back = evaluate_all(row, Z, v, d), evaluate_all(row, Z, d, v)
    # Rounding of the half vector, 1e-16, counts 4/α times in the lobe and exp(−x) has x < 700:
    # 4e-12 and 700 · 2 · 1e-16/α² = 1.4e-7 for Ward's α of 1e-3, where values are e⁻⁷⁰⁰ of a peak.
    np.testing.assert_allclose(there, back, rtol=1e-9, atol=1e-12 * there.max())
    assert np.isfinite(there).all() and there.max() > 0.0


@pytest.mark.parametrize("alpha", ALPHAS)
def test_microfacets_follow_the_textbook(alpha: float) -> None:
    """Against D, Λ and F written out: f = D F / (4 nl nv (1 + Λ(v) + Λ(d)))."""
    f0 = np.array([0.9, 0.6, 0.3])
    v, d = upper_directions(500, 3), upper_directions(500, 4)
    v[:250] = d[:250] * (-1.0, -1.0, 1.0) + alpha * v[:250]
    v /= np.linalg.norm(v, axis=1, keepdims=True)
    half = v + d
    half /= np.linalg.norm(half, axis=1, keepdims=True)
    tan2_h = (half[:, 0] ** 2 + half[:, 1] ** 2) / half[:, 2] ** 2
    density = 1.0 / (math.pi * alpha**2 * half[:, 2] ** 4 * (1.0 + tan2_h / alpha**2) ** 2)

    def smith(d: NDArray[np.float64]) -> NDArray[np.float64]:
        tan2 = (d[:, 0] ** 2 + d[:, 1] ** 2) / d[:, 2] ** 2
        return 0.5 * (np.sqrt(1.0 + alpha**2 * tan2) - 1.0)

    schlick = f0 + (1.0 - f0) * (1.0 - (half * v).sum(axis=1))[:, None] ** 5
    expected = density / (4.0 * v[:, 2] * d[:, 2] * (1.0 + smith(v) + smith(d)))
    got = evaluate_all(row_of(Conductor(tuple(f0), alpha)), Z, v, d)
    # Rounding of the half vector counts 4/α times; the formula above loses another digit or two.
    np.testing.assert_allclose(got, expected[:, None] * schlick, rtol=1e-13 / alpha + 1e-11)


@kernel
def directional_albedo(row, cosine, side, lobes=8, azimuth=0.3):
    """∫ f cos θ dω per channel, over a side² × lobes grid of the random numbers."""
    sine = math.sqrt(1.0 - cosine * cosine)
    # The normal is +X, where the tangent around +Y is well defined.
    n, v = (1.0, 0.0, 0.0), (cosine, sine * math.cos(azimuth), sine * math.sin(azimuth))
    total = np.zeros(3)
    for i in range(side):
        for j in range(side):
            for k in range(lobes):
                u = ((i + 0.5) / side, (j + 0.5) / side, (k + 0.5) / lobes)
                d, density = brdf.sample(row, n, v, u)
                if density > 0.0 and d[0] > 0.0:
                    f = brdf.evaluate(row, n, v, d)
                    for c in range(3):
                        total[c] += f[c] * d[0] / density
    return total / (side * side * lobes)


@pytest.mark.parametrize("alpha", ALPHAS)
def test_a_conductor_never_reflects_more_than_arrives(alpha: float) -> None:
    row = row_of(Conductor(WHITE, alpha))
    albedo = [directional_albedo(row, cosine, 48, 1)[0] for cosine in VIEW_COSINES]
    # Each sample weighs F · G2/G1 ≤ 1, so the sum cannot exceed 1 but for rounding.
    assert max(albedo) <= 1.0 + 1e-12
    assert min(albedo) > 0.25
    if alpha <= 0.01:  # single scattering loses of the order of α, and half beside the horizon
        assert min(albedo[:5]) > 1.0 - 3.0 * alpha


@kernel
def base_albedo(coated, coat, cosine, side):
    """∫ (f of the coated surface − f of its coat alone) cos θ dω, first channel."""
    n, v, total = (0.0, 0.0, 1.0), (math.sqrt(1.0 - cosine * cosine), 0.0, cosine), 0.0
    for i in range(side):
        z = math.sqrt((i + 0.5) / side)
        for j in range(side):
            flat, turn = math.sqrt(1.0 - z * z), 2.0 * math.pi * (j + 0.5) / side
            d = (flat * math.cos(turn), flat * math.sin(turn), z)
            total += brdf.evaluate(coated, n, v, d)[0] - brdf.evaluate(coat, n, v, d)[0]
    return total * math.pi / side**2


@pytest.mark.parametrize("ior", [1.1, 1.5, 2.0, 3.0, 10.0])
def test_a_coated_surface_never_reflects_more_than_arrives(ior: float) -> None:
    """The coat reflects F averaged over its lobe and lets 1 − F at the lobe's centre through.

    F is convex, so the average over a lobe may be larger than the value at its centre, which
    masking outweighs but for lobes narrower than about 0.2: there a white base gives up to 0.3 %
    too much."""
    for alpha in ALPHAS:
        coated, coat = row_of(Coated(WHITE, alpha, ior)), row_of(Coated(BLACK, alpha, ior))
        for cosine in VIEW_COSINES:
            base = base_albedo(coated, coat, cosine, 64)
            albedo = base + directional_albedo(coat, cosine, 40, 1)[0]
            assert 0.0 <= base <= 1.0
            assert albedo <= 1.0 + 3e-3, (alpha, cosine, albedo)


def test_ward_albedo_at_normal_incidence() -> None:
    """In slopes r of the half vector: ρ ∫ 2r/α² exp(−r²/α²) √(1 − r²) (1 + r²)^−5/2 dr."""
    for alpha in (0.5, 0.2, 0.05, 1e-3):

        def integrand(t: float, alpha: float = alpha) -> float:
            r = alpha * t
            return 2.0 * t * math.exp(-t * t) * math.sqrt(1.0 - r * r) * (1.0 + r * r) ** -2.5

        expected = quad(integrand, 0.0, min(1.0 / alpha, 8.0), epsabs=1e-12)[0]
        got = directional_albedo(row_of(Ward(BLACK, WHITE, alpha, alpha)), 1.0, 64, 1)
        # The midpoint rule over u, with a logarithm at its end: about (1/64) α²-sized differences.
        np.testing.assert_allclose(got, expected, atol=0.02 * alpha**2 + 1e-9)


@pytest.mark.parametrize("cosine", [0.9, 0.5, 0.2])
@pytest.mark.parametrize("alphas", [(1e-3, 1e-3), (5e-3, 1e-3)])
def test_narrow_ward_lobes_reflect_specular_times_cosine(
    cosine: float, alphas: tuple[float, float]
) -> None:
    """Without Dür's correction Ward's lobe keeps v·h of its energy: ρ (n·v) as α goes to 0."""
    got = directional_albedo(row_of(Ward(BLACK, WHITE, *alphas)), cosine, 32, 1)
    # The next term is quadratic in the lobe's width over the height above the horizon.
    np.testing.assert_allclose(got, cosine, rtol=4.0 * (max(alphas) / cosine) ** 2 + 1e-6)


RADIAL, ANGULAR, FINE = 48, 40, 12


@kernel
def slope_of(row, v, d):
    """Half-vector slopes of d in units of the roughness, as log radius and angle in turns."""
    height = v[2] + d[2]
    x, y = (v[0] + d[0]) / (height * row[ALPHA_X]), (v[1] + d[1]) / (height * row[ALPHA_Y])
    return 0.5 * math.log(x * x + y * y + 1e-300), math.atan2(y, x) / (2.0 * math.pi) % 1.0


@kernel
def expected_cells(row, v, low, high):
    """∫ pdf over cells of the log radius and angle of slopes, and which cells meet the horizon.

    The normal is +Z, for which Ward's tangent is +X."""
    out = np.zeros((RADIAL, ANGULAR))
    cut = np.zeros((RADIAL, ANGULAR), np.bool_)
    step = (high - low) / (RADIAL * FINE)
    for i in range(RADIAL * FINE):
        r = math.exp(low + (i + 0.5) * step)
        for j in range(ANGULAR * FINE):
            turn = 2.0 * math.pi * (j + 0.5) / (ANGULAR * FINE)
            x, y = r * math.cos(turn) * row[ALPHA_X], r * math.sin(turn) * row[ALPHA_Y]
            h = np.array([x, y, 1.0]) / math.sqrt(1.0 + x * x + y * y)
            vh = v[0] * h[0] + v[1] * h[1] + v[2] * h[2]
            d = 2.0 * vh * h - v
            if vh <= 0.0 or d[2] <= 0.0:
                cut[i // FINE, j // FINE] = True
                continue
            density = brdf.pdf(row, np.array([0.0, 0.0, 1.0]), v, d)
            # dω_l = 4 (v·h) dω_h, dω_h = n·h³ dslope, and dslope = αx αy r² dlog r dangle.
            jacobian = 4.0 * vh * h[2] ** 3 * row[ALPHA_X] * row[ALPHA_Y] * r * r
            out[i // FINE, j // FINE] += (
                density * jacobian * step * 2.0 * math.pi / (ANGULAR * FINE)
            )
    return out, cut


@kernel
def drawn_cells(row, v, u, low, high):
    """Samples above the surface by cell."""
    out = np.zeros((RADIAL, ANGULAR))
    for k in range(len(u)):
        d, density = brdf.sample(row, np.array([0.0, 0.0, 1.0]), v, u[k])
        if density > 0.0:
            radius, turn = slope_of(row, v, d)
            i = math.floor((radius - low) / (high - low) * RADIAL)
            if 0 <= i < RADIAL:
                out[i, min(int(turn * ANGULAR), ANGULAR - 1)] += 1
    return out


CHI_CASES = [(name, cosine) for name in SMOOTH_MATERIALS for cosine in (1.0, 0.6, 0.05)]


@pytest.mark.parametrize(("name", "cosine"), CHI_CASES)
def test_samples_follow_the_density(name: str, cosine: float) -> None:
    """Chi-square over cells of the half vector's slopes, which resolve lobes of any width.

    Cells that the horizon cuts are pooled with the rest of the plane and with samples below the
    surface: their expectation is one minus that of the whole cells, without any rule's error."""
    row = row_of(SMOOTH_MATERIALS[name])
    if name == "lambert":  # slopes as they are
        row[ALPHA_X] = row[ALPHA_Y] = 1.0
    sine = math.sqrt(1.0 - cosine * cosine)
    v = np.array([sine * math.cos(0.3), sine * math.sin(0.3), cosine])
    low, high = -7.0, math.log(1e3 / min(row[ALPHA_X], row[ALPHA_Y]))
    count = 200_000
    probability, cut = expected_cells(row, v, low, high)
    # A rule of 12 × 12 points gets a cut cell wrong by 1/24 at most; they hold less than 0.1.
    assert probability.sum() <= 1.0 + 0.1 / 24.0
    u = np.random.default_rng(11).random((count, 3))
    expected, found = probability * count, drawn_cells(row, v, u, low, high)
    whole = ~cut & (expected >= 10.0)
    e = np.append(expected[whole], count - expected[whole].sum())
    f = np.append(found[whole], count - found[whole].sum())
    assert len(e) > 50
    statistic = ((f - e) ** 2 / np.maximum(e, 1.0)).sum()
    limit = 1.0 - (1.0 - 0.01) ** (1.0 / len(CHI_CASES))  # Šidák
    assert chi2.sf(statistic, len(e) - 1) > limit
