"""Maps through zonal kernels are the sums over their texels, but for the harmonics cut off."""

import numpy as np
import pytest
from threadpoolctl import threadpool_limits

from renderer.convolution import convolve, zonal_coefficients
from samplers.sphere import pixel_directions, row_solid_angle

HEIGHT = 12
KERNELS = {
    "cosine": lambda cosine: cosine,
    "square": lambda cosine: cosine**2,
    "coat": lambda cosine: cosine * (1.0 - (1.0 - cosine) ** 5),
}


def test_the_cosine_has_its_known_coefficients() -> None:
    found = zonal_coefficients(KERNELS["cosine"], 6)
    # Ramamoorthi and Hanrahan, SIGGRAPH 2001, equation 8: A_l / √((2l + 1)/4π) in their terms.
    known = np.pi * np.array([1.0, 2.0 / 3.0, 1.0 / 4.0, 0.0, -1.0 / 24.0, 0.0, 1.0 / 64.0])
    np.testing.assert_allclose(found, known, atol=1e-14)


@pytest.fixture(scope="module")
def radiance() -> np.ndarray:
    rng = np.random.default_rng(5)
    radiance = rng.uniform(0.0, 1.0, (16, 32, 3))
    radiance[4, 21] = (1e4, 3e3, 1e3)
    return radiance


@pytest.mark.parametrize("name", KERNELS)
@pytest.mark.parametrize("degree", [40, 160])
def test_a_convolution_is_the_sum_over_texels(radiance: np.ndarray, name: str, degree: int) -> None:
    """What is cut off lies at a kernel's edge, where its slope k′ steps from 0: it falls as 1/l.

    There Σ over l > L of (2l + 1)/4π · K_l P_l(0), whose terms are k′ (2/π)/l² · O(1): below 1/L of
    the kernel's greatest slope, 1 for the cosine; less than that elsewhere."""
    kernel = KERNELS[name]
    found = convolve(radiance, zonal_coefficients(kernel, degree)[None], HEIGHT)[0]
    cosine = pixel_directions(HEIGHT).reshape(-1, 3) @ pixel_directions(16).reshape(-1, 3).T
    weight = np.where(cosine > 0.0, kernel(np.maximum(cosine, 0.0)), 0.0)
    flux = radiance * row_solid_angle(16, 32)[:, None, None]
    truth = (weight @ flux.reshape(-1, 3)).reshape(found.shape)
    error = np.abs(found - truth) / flux.sum(axis=(0, 1))
    assert error.max() < 1.0 / degree
    assert np.sqrt((error**2).mean()) < 0.1 / degree


def test_harmonics_beyond_the_columns_of_a_map_are_those_of_its_points() -> None:
    """A map of few texels has as many harmonics as one of many: all of a point's."""
    coarse = np.zeros((2, 4, 3))
    coarse[0, 1] = 1.0 / row_solid_angle(2, 4)[0]
    fine = np.zeros((6, 12, 3))
    fine[1, 4] = 1.0 / row_solid_angle(6, 12)[1]
    # The same place: (0 + ½)/2 = (1 + ½)/6 and (1 + ½)/4 = (4 + ½)/12.
    coefficients = zonal_coefficients(KERNELS["cosine"], 30)[None]
    np.testing.assert_allclose(
        convolve(coarse, coefficients, 5), convolve(fine, coefficients, 5), atol=1e-12
    )


def test_a_map_is_the_same_whatever_the_threads() -> None:
    """Sums of a product that threads share out are added in another order: of so large ones."""
    radiance = np.random.default_rng(1).exponential(1.0, (512, 1024, 3))
    coefficients = zonal_coefficients(KERNELS["coat"], 255)[None]
    found = []
    for threads in (1, 2):
        with threadpool_limits(threads):
            found.append(convolve(radiance, coefficients, 256))
    np.testing.assert_array_equal(*found)
