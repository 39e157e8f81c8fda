"""Every map has a class: by name where it is known, by contrast where it is not."""

from experiments.maps import places as embedded
from experiments.maps.classes import STRONGEST, contrast_class, named_class, representatives
from experiments.maps.poly_haven import NAMED, PHOTOGRAPHED, SUITES


def test_names_decide_with_and_without_a_resolution():
    assert set(PHOTOGRAPHED[NAMED]) < set(SUITES["paper-named-12"])
    assert named_class("red_wall") == NAMED
    assert named_class("noon_grass_2k") == "sun"
    assert named_class("gothic-church") == "interior"
    assert named_class("mine") is None


def test_other_maps_are_classed_by_contrast():
    told = [contrast_class(peak) for peak in (1.0, 1e3, 1e5)]
    assert told == ["contrast below 10²", "contrast 10² to 10⁴", STRONGEST]


def test_representatives_span_all_kinds():
    assert {embedded.kind(name) for name in representatives(1)} == {
        embedded.kind(name) for name in embedded.names()
    }
    assert len(representatives(1)) == len({embedded.kind(name) for name in embedded.names()})
