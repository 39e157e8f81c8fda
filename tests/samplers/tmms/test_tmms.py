"""Tone-mapped mean shift as a whole."""

import numpy as np
import pytest

from samplers import make_sampler
from samplers.environment import EnvironmentMap
from samplers.grids.reduced_map import reduce_map
from samplers.sphere import angular_distance, pixel_directions
from samplers.tmms import segments, tone_mapped


def street(height=32, seed=0, contrast=1e4):
    rng = np.random.default_rng(seed)
    radiance = rng.uniform(0.1, 1.0, (height, 2 * height, 3))
    radiance[height // 2 :] *= 0.1
    for _ in range(4):
        radiance[rng.integers(height), rng.integers(2 * height)] *= contrast
    return EnvironmentMap.from_array(radiance)


def lights_of(environment, count, **parameters):
    return make_sampler("tmms", **parameters).prepare(environment, count, np.random.default_rng(0))


def test_lit_pixels_far_apart_are_one_light_each():
    radiance = np.zeros((16, 32, 3))
    places = [(0, 1), (4, 31), (9, 9), (15, 20)]
    for place in places:
        radiance[place] = 1.0
    environment = EnvironmentMap.from_array(radiance)
    assert len(lights_of(environment, 9)) == 4
    assert len(lights_of(environment, 3)) == 3


def test_a_disc_is_one_segment():
    height = 48
    inside = angular_distance(pixel_directions(height), np.array([0.6, 0.0, 0.8])) < 0.3
    radiance = np.where(inside[..., None], [3.0] * 3, [0.05] * 3)
    grid = reduce_map(EnvironmentMap.from_array(radiance), height)
    label = segments(tone_mapped(grid, "photographic"), 0.15, 6.5, 0.5)
    label = label.reshape(inside.shape)
    assert len(np.unique(label[inside])) == 1
    assert not np.isin(label[~inside], label[inside]).any()


@pytest.mark.parametrize("operator", ["photographic", "log"])
def test_tone_mapping_keeps_the_order_and_the_range(operator):
    environment = street(16)
    tone = tone_mapped(reduce_map(environment, 16), operator)
    assert tone.min() >= 0.0 and tone.max() <= 100.0
    row = slice(32 * 7, 32 * 8)  # near the equator, where no cells are taken together
    order = np.argsort(environment.luminance.ravel()[row], kind="stable")
    assert (np.diff(tone.ravel()[row][order]) >= -1e-4).all()  # luminance is rounded to float32
