"""Light of a map through a zonal kernel, about all directions: by spherical harmonics.

    (k * L)(n) = ∫ k(n·ω) L(ω) dω = Σ_lm K_l L_lm Y_lm(n),   K_l = 2π ∫ k(t) P_l(t) dt

by the theorem of Funk and Hecke. Maps have bright texels that are points for these kernels, so that
harmonics of the map are sums over all texels, none averaged; what is cut off is the kernel's.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from samplers.sphere import row_solid_angle

Kernel = Callable[[NDArray[np.float64]], NDArray[np.float64]]
ROWS_AT_ONCE = 64
"""Of a map, in float64 and transformed; only as many harmonics are kept as are asked for."""


def zonal_coefficients(kernel: Kernel, degree: int) -> NDArray[np.float64]:
    """K_0 … K_degree of a polynomial of the cosine, of degree 9 at most, that is 0 below it."""
    from scipy.special import eval_legendre, roots_legendre

    node, weight = roots_legendre(degree // 2 + 6)
    cosine = 0.5 * (node + 1.0)
    legendre = eval_legendre(np.arange(degree + 1)[:, None], cosine)
    coefficients: NDArray[np.float64] = np.pi * (legendre @ (weight * kernel(cosine)))
    return coefficients


def _legendre(m: int, degree: int, cosine: NDArray[np.float64]) -> NDArray[np.float64]:
    """Normalised associated Legendre functions of orders m and degrees m … degree, (l, n)."""
    factor = np.arange(1, m + 1)
    first = np.sqrt((2 * m + 1) / (4.0 * np.pi) * np.prod((2.0 * factor - 1.0) / (2.0 * factor)))
    out = np.zeros((degree + 1 - m, len(cosine)))
    # Far from the equator a high power of the sine is 0 in float64, as are these functions there.
    out[0] = first * (1.0 - cosine**2) ** (0.5 * m)
    if m < degree:
        out[1] = np.sqrt(2.0 * m + 3.0) * cosine * out[0]
    for i in range(2, degree + 1 - m):
        square, before = float(m + i) ** 2, float(m + i - 1) ** 2
        a = np.sqrt((4.0 * square - 1.0) / (square - m * m))
        b = np.sqrt((before - m * m) / (4.0 * before - 1.0))
        out[i] = a * (cosine * out[i - 1] - b * out[i - 2])
    return out


def _row_cosines(height: int) -> NDArray[np.float64]:
    return np.cos(np.pi * (np.arange(height) + 0.5) / height)


def _fourier(radiance: NDArray, degree: int) -> NDArray[np.complex128]:
    """Σ_j flux e^{−imφ_j} of each row, (m, h, 3), φ_j in the middle of column j."""
    height, width = radiance.shape[:2]
    solid_angle = row_solid_angle(height, width)[:, None, None]
    order = np.arange(degree + 1)
    out = np.empty((degree + 1, height, 3), np.complex128)
    for start in range(0, height, ROWS_AT_ONCE):
        rows = slice(start, start + ROWS_AT_ONCE)
        flux = radiance[rows] * solid_angle[rows]
        out[:, rows] = np.fft.fft(flux, axis=1)[:, order % width].transpose(1, 0, 2)
    return out * np.exp(-1j * np.pi * order / width)[:, None, None]


def convolve(
    radiance: NDArray, coefficients: NDArray[np.float64], height: int
) -> NDArray[np.float64]:
    """Each kernel's map (k, height, 2 · height, 3), at the middles of its pixels.

    radiance : (h, 2h, 3); the light of a texel lies in its middle
    coefficients : (k, degree + 1), `zonal_coefficients` of each kernel
    """
    degree, width = coefficients.shape[1] - 1, 2 * height
    moments = _fourier(radiance, degree)
    spectrum = np.zeros((len(coefficients), height, width, 3), np.complex128)
    cosines = np.concatenate([_row_cosines(len(radiance)), _row_cosines(height)])
    with threadpool_limits(1):  # sums do not depend on threads, which only wait here
        for m in range(degree + 1):
            here, there = np.split(_legendre(m, degree, cosines), [len(radiance)], axis=1)
            harmonics = (here @ moments[m]) * np.exp(1j * np.pi * m / width)
            for kernel, out in zip(coefficients, spectrum, strict=True):
                # A real map: order −m is the conjugate of order m.
                twice = kernel[m:, None] if m == 0 else 2.0 * kernel[m:, None]
                wave = there.T @ (twice * harmonics)
                out[:, m % width] += wave
    maps: NDArray[np.float64] = width * np.fft.ifft(spectrum, axis=2).real
    return maps
