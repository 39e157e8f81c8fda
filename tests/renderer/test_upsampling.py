"""Joint bilateral upsampling: constants stay, edges stay sharp, small pictures stay in place."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from renderer.modelling import box, shade, sphere, square
from renderer.render import render
from renderer.scene import Camera, Object, Scene
from renderer.scene.materials import Lambert
from renderer.upsampling import (
    GUIDE_SIGMA,
    GUIDES,
    RADIUS,
    Guides,
    guides_of,
    split_guides_of,
    unsplit,
)
from renderer.upsampling import upsample as upsample_split
from renderer.view import View, make_view
from samplers.environment import EnvironmentMap
from samplers.lighting import DirectionalLights, LayeredLights
from tests.renderer import lab

ABOVE = Camera((0.0, 6.0, 0.1), (0.0, 0.0, 0.0), 40.0)
GREY = Lambert((0.6, 0.5, 0.4))
BLACK_MAP = EnvironmentMap.from_array(np.zeros((4, 8, 3)))


def upsample(small: NDArray, small_guides: Guides, guides: Guides) -> NDArray[np.float32]:
    """By the means of each pixel's guides."""
    return upsample_split(small, small_guides, unsplit(guides))


def guides(feature: NDArray, coverage: NDArray | None = None) -> Guides:
    """Guides of one varying feature (h, w)."""
    full = np.zeros((*feature.shape, GUIDES), np.float32)
    full[..., 0] = feature
    return Guides(full, np.ones(feature.shape) if coverage is None else coverage)


@pytest.mark.parametrize(("size", "factor"), [((12, 17), 2), ((7, 5), 4), ((9, 10), 3)])
def test_agrees_with_the_formula_summed_over_all_small_pixels(
    size: tuple[int, int], factor: int
) -> None:
    rng = np.random.default_rng(5)
    height, width = size[0] * factor - 1, size[1] * factor
    # Guides that differ by a few of their sigmas, so that many weights count.
    few = 2.0 * GUIDE_SIGMA
    low = Guides(
        (few * rng.random((*size, GUIDES))).astype(np.float32),
        np.where(rng.random(size) < 0.2, 0.0, rng.random(size)),
    )
    high = Guides(
        (few * rng.random((height, width, GUIDES))).astype(np.float32),
        np.where(rng.random((height, width)) < 0.2, 0.0, rng.random((height, width))),
    )
    small = rng.lognormal(0.0, 3.0, (*size, 3)).astype(np.float32)
    y = (np.arange(height) + 0.5) * size[0] / height - 0.5
    x = (np.arange(width) + 0.5) * size[1] / width - 0.5
    dy, dx = y[:, None] - np.arange(size[0]), x[:, None] - np.arange(size[1])
    near_y = np.abs(np.round(y)[:, None] - np.arange(size[0])) <= RADIUS
    near_x = np.abs(np.round(x)[:, None] - np.arange(size[1])) <= RADIUS
    used = near_y[:, None, :, None] & near_x[None, :, None, :] & (low.coverage > 0.0)
    space = np.exp(-0.5 * (dy[:, None, :, None] ** 2 + dx[None, :, None, :] ** 2))
    apart = (
        high.feature[:, :, None, None].astype(float) - low.feature[None, None].astype(float)
    ) / GUIDE_SIGMA
    weight = used * space * np.exp(-0.5 * (apart**2).sum(axis=4))
    expected = np.einsum("yxvu,vuc->yxc", weight, small.astype(float))
    total = weight.sum(axis=(2, 3))
    expected *= np.where(total > 0.0, high.coverage / np.maximum(total, 1e-300), 0.0)[..., None]
    # All in float64 but the result, which rounds to 2⁻²⁴; the exponential is good to 10⁻¹¹.
    np.testing.assert_allclose(upsample(small, low, high), expected, rtol=1e-7, atol=0.0)


@pytest.mark.parametrize("distance", [0.0, 1.0, 1e6, 1e18])
def test_weights_never_become_nan(distance: float) -> None:
    rng = np.random.default_rng(1)
    small = rng.random((6, 6, 3)).astype(np.float32)
    out = upsample(small, guides(np.zeros((6, 6))), guides(np.full((24, 24), distance)))
    assert np.isfinite(out).all()
    # A mean with positive weights never leaves the range of what it averages.
    assert out.min() >= small.min() and out.max() <= small.max() * (1.0 + 1e-6)


def test_pixels_without_surface_are_black_and_lend_nothing() -> None:
    coverage = np.ones((8, 8))
    coverage[:, 4:] = 0.0
    small = np.full((8, 8, 3), 2.0, np.float32)
    small[:, 4:] = np.nan  # must not be read
    full = np.repeat(np.repeat(coverage, 4, axis=0), 4, axis=1) * 0.25
    zero = np.zeros((8, 8))
    out = upsample(small, guides(zero, coverage), guides(np.zeros((32, 32)), full))
    np.testing.assert_allclose(out, np.tile(full[..., None] * 2.0, (1, 1, 3)), rtol=1e-6)
    lonely = np.ones((32, 32))
    out = upsample(small, guides(zero, coverage), guides(np.zeros((32, 32)), lonely))
    assert (out[:, (4 + RADIUS + 1) * 4 :] == 0.0).all() and np.isfinite(out).all()


def soft_lights() -> DirectionalLights:
    """Sixty lights of a white sky: shadows without hard edges."""
    rng = np.random.default_rng(3)
    direction = rng.normal(size=(60, 3))
    direction[:, 1] = np.abs(direction[:, 1])
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    return DirectionalLights(direction, np.full((60, 3), 0.05), np.zeros(60))


def room() -> Scene:
    parts = {
        "ground": square(16.0),
        "box": box((1.0, 1.0, 1.0)).moved(-1.0, 0.5, 0.0),
        "ball": sphere(0.6, 24).moved(1.0, 0.6, 0.0),
    }
    objects = tuple(Object(name, shade(shape), lab.GREY) for name, shape in parts.items())
    return Scene("room", objects, Camera((1.0, 3.0, 6.0), (0.0, 0.5, 0.0), 30.0))


@pytest.mark.parametrize("size", [(96, 64), (97, 65)])
def test_the_error_falls_with_the_factor(size: tuple[int, int]) -> None:
    view = make_view(room(), *size, 4)
    lights = soft_lights()
    exact = render(view, lights, BLACK_MAP, sets=1).image
    errors = []
    for factor in (4, 2, 1):
        layered = LayeredLights(DirectionalLights.none(), lights, factor)
        image = render(view, layered, BLACK_MAP, sets=1).image
        assert np.isfinite(image).all()
        errors.append(float(np.sqrt(((image - exact) ** 2).mean()) / exact.mean()))
    assert errors[0] > errors[1] > errors[2] == 0.0
    # Contact shadows are blurred over 2.5 small pixels; there were 5.7 % and 2.5 %, seen to depend
    # little on the size.
    assert errors[0] < 0.1 and errors[1] < 0.06


def scaled_guides(view: View) -> Guides:
    return guides_of(view, (float(view.depth.min()), float(view.depth.max())))


def test_guides_are_means_over_the_surface() -> None:
    view = make_view(room(), 40, 30, 4)
    made = scaled_guides(view)
    assert made.feature.shape == (30, 40, GUIDES) and np.isfinite(made.feature).all()
    whole = view.coverage == 1.0
    assert np.abs(made.feature[whole]).max() <= 1.0 + 1e-6
    np.testing.assert_allclose(
        made.feature[whole][:, 4:], np.tile(lab.GREY.albedo, (whole.sum(), 1))
    )
    assert GUIDE_SIGMA == 0.005  # as published
    assert scaled_guides(view) is made  # found once


def test_a_mixed_pixel_is_the_mean_of_its_sub_pixels() -> None:
    """As if each sub-pixel were a pixel of its own; pixels of one surface stay as they were."""
    view = make_view(room(), 40, 30, 4)
    depth_range = (float(view.depth.min()), float(view.depth.max()))
    means, split = guides_of(view, depth_range), split_guides_of(view, depth_range)
    counts = np.diff(split.first)
    covered = np.bincount(view.pixel, minlength=1200)
    mixed = counts != 1
    assert 0.05 < mixed[covered > 0].mean() < 0.9
    np.testing.assert_array_equal(counts[mixed], covered[mixed])
    whole = split.feature[split.first[:-1][~mixed]]
    np.testing.assert_array_equal(whole, means.feature.reshape(-1, GUIDES)[~mixed])
    sums = np.add.reduceat(split.feature, split.first[:-1])[mixed]
    expected = means.feature.reshape(-1, GUIDES)[mixed]
    # Sums of four float32 numbers up to 1, against one rounding.
    np.testing.assert_allclose(sums / counts[mixed, None], expected, atol=4 * 2.0**-24)

    small_view = view.reduced(2)
    low = guides_of(small_view, depth_range)
    small = np.random.default_rng(2).random((15, 20, 3)).astype(np.float32)
    out = upsample_split(small, low, split).reshape(-1, 3)
    pixel = np.flatnonzero(mixed)[7]
    parts = []
    for feature in split.feature[split.first[pixel] : split.first[pixel + 1]]:
        alone = means.feature.copy()
        alone.reshape(-1, GUIDES)[pixel] = feature
        parts.append(upsample(small, low, replace(means, feature=alone)).reshape(-1, 3)[pixel])
    np.testing.assert_allclose(out[pixel], np.mean(parts, axis=0), rtol=1e-6)
    same = upsample(small, low, means).reshape(-1, 3)
    np.testing.assert_array_equal(out[~mixed], same[~mixed])
    assert split_guides_of(view, depth_range) is split  # found once


def test_depths_that_are_all_equal_guide_nothing() -> None:
    """Points of one depth, or of depths that only round differently, are one flat surface."""
    far = np.float32(7.3)
    for depth in (np.full(16, far), far + far * np.float32(2.0**-23) * np.arange(16)):
        view = make_view(
            Scene("flat", (Object("ground", shade(square(16.0)), GREY),), ABOVE), 4, 4, 1
        )
        equal = replace(view, depth=depth.astype(np.float32))
        near, beyond = float(equal.depth.min()), float(equal.depth.max())
        low, high = guides_of(equal, (near, beyond)), guides_of(view, (near, beyond))
        out = upsample(np.ones((4, 4, 3), np.float32), low, high)
        np.testing.assert_allclose(out, 1.0, rtol=1e-6)
