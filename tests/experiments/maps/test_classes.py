"""Every map has a class: by name where it is known, by contrast where it is not."""

import numpy as np
import pytest

from experiments.maps import places as embedded
from experiments.maps.classes import (
    NAMED,
    PHOTOGRAPHED,
    STRONGEST,
    contrast_class,
    map_class,
    representatives,
)
from experiments.maps.poly_haven import SUITES
from experiments.maps.sources import EnvironmentSource
from renderer.image import write_exr


def test_the_list_holds_the_suite_once():
    listed = [name for names in PHOTOGRAPHED.values() for name in names]
    assert sorted(listed) == sorted(SUITES["poly-haven-32"])
    assert set(PHOTOGRAPHED[NAMED]) < set(SUITES["paper-named-12"])


def test_names_decide_with_and_without_a_resolution():
    assert map_class(EnvironmentSource("red_wall", "/nowhere.exr")) == NAMED
    assert map_class(EnvironmentSource("noon_grass_2k", "/nowhere.exr")) == "sun"
    assert map_class(EnvironmentSource("gothic-church", height=16)) == "interior"


@pytest.mark.parametrize(
    ("peak", "expected"), [(1.0, "contrast below 10²"), (1e9, "contrast 10² to 10⁴")]
)
def test_other_maps_are_classed_by_contrast(tmp_path, peak, expected):
    radiance = np.ones((16, 32, 3), np.float32)
    # One of 512 texels cannot be brighter than the mean by much more than 512.
    radiance[8, 3] = peak
    write_exr(tmp_path / "mine.exr", radiance)
    assert map_class(EnvironmentSource("mine", str(tmp_path / "mine.exr"))) == expected


def test_a_sun_has_the_strongest_contrast():
    assert contrast_class(1e5) == STRONGEST


def test_representatives_span_all_kinds():
    assert {embedded.kind(name) for name in representatives(1)} == {
        embedded.kind(name) for name in embedded.names()
    }
    assert len(representatives(1)) == len({embedded.kind(name) for name in embedded.names()})
