"""The registry: names, nearest names, parameters and their types, plug-ins."""

from dataclasses import dataclass, fields
from importlib.metadata import EntryPoint

import numpy as np
import pytest

from samplers import (
    DirectionalLights,
    EnvironmentMap,
    EnvlightError,
    LightSampler,
    make_sampler,
    register,
    registry,
    sampler_class,
    sampler_names,
)
from samplers.base import REGISTERED

MAP = EnvironmentMap.from_array(np.ones((2, 4, 3)))


@pytest.fixture
def restored():
    """The registry, as it was before afterwards."""
    sampler_names()
    before = dict(REGISTERED)
    yield
    REGISTERED.clear()
    REGISTERED.update(before)


def nothing(self, environment, count, rng):
    return DirectionalLights.none()


def test_names_are_sorted_and_belong_to_their_classes():
    names = sampler_names()
    assert names == sorted(names)
    assert {"median-cut", "mis", "uniform"} <= set(names)
    for name in names:
        assert sampler_class(name).name == name
        assert make_sampler(name) == sampler_class(name)()


def test_a_new_sampler_is_one_class(restored):
    @register("dark")
    @dataclass(frozen=True)
    class Dark(LightSampler):
        _prepare = nothing

    assert "dark" in sampler_names()
    assert len(make_sampler("dark").prepare(MAP, 3, np.random.default_rng(0))) == 0


def test_a_name_is_taken_once(restored):
    first = type("First", (LightSampler,), {"_prepare": nothing})
    second = type("Second", (LightSampler,), {"_prepare": nothing})
    register("twice")(first)
    register("twice")(first)
    with pytest.raises(EnvlightError, match="two samplers are called 'twice'"):
        register("twice")(second)


@pytest.fixture
def announced(restored, monkeypatch):
    """Has one plug-in announced, and what was loaded forgotten."""

    def announce(name, value):
        point = EntryPoint(name, value, "envlight.samplers")
        monkeypatch.setattr(registry, "entry_points", lambda group: [point][: group == point.group])
        registry._load_all.cache_clear()

    yield announce
    registry._load_all.cache_clear()


def test_plug_ins_announce_themselves(announced, monkeypatch):
    monkeypatch.setattr(sampler_class("uniform"), "name", "uniform")
    announced("from-elsewhere", "samplers.uniform:Uniform")
    assert "from-elsewhere" in sampler_names()


def test_a_plug_in_that_ends_the_program_is_told(announced, monkeypatch, tmp_path):
    (tmp_path / "ends_the_program.py").write_text("raise SystemExit(0)\n", encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    announced("ends", "ends_the_program:Sampler")
    with pytest.raises(EnvlightError, match=r"ends_the_program:Sampler cannot be loaded \(Sys"):
        sampler_names()


def test_an_unknown_name_gives_the_nearest():
    with pytest.raises(
        EnvlightError, match="no sampler is called 'mediancut'; did you mean median-"
    ):
        make_sampler("mediancut")


def test_an_unknown_parameter_gives_the_known_ones():
    with pytest.raises(
        EnvlightError, match=r"'ordre'; it has order, position, aspect, light_extent, sets$"
    ):
        make_sampler("median-cut", ordre="heap")
    with pytest.raises(EnvlightError, match=r"'order'; it has light_extent, sets$"):
        make_sampler("uniform", order="heap")


@dataclass(frozen=True)
class Typed(LightSampler):
    whole: int = 3
    number: float = 0.5
    maybe: float | None = None
    switch: bool = True
    text: str = "a"
    _prepare = nothing


@pytest.fixture
def typed(restored):
    return register("typed")(Typed)


@pytest.mark.parametrize(
    ("given", "kept"),
    [
        ({"whole": 7}, 7),
        ({"whole": np.int64(7)}, 7),
        ({"number": 2}, 2.0),
        ({"number": np.float32(0.25)}, 0.25),
        ({"maybe": None}, None),
        ({"maybe": 1}, 1.0),
        ({"switch": False}, False),
        ({"text": "b"}, "b"),
    ],
)
def test_values_of_the_right_type_are_kept(typed, given, kept):
    (name,) = given
    value = getattr(make_sampler("typed", **given), name)
    assert (value, type(value)) == (kept, type(kept))


@pytest.mark.parametrize(
    ("name", "value", "wanted"),
    [("whole", 1.5, "a whole number"), ("whole", True, "a whole number"),
     ("whole", "3", "a whole number"), ("number", "x", "a number"), ("number", True, "a number"),
     ("number", float("nan"), "a number"), ("number", float("inf"), "a number"),
     ("maybe", "x", "a number or None"), ("switch", 1, "True or False"),
     ("switch", "yes", "True or False"), ("text", 1, "str")],
)  # fmt: skip
def test_values_of_the_wrong_type_are_named(typed, name, value, wanted):
    with pytest.raises(EnvlightError) as caught:
        make_sampler("typed", **{name: value})
    assert str(caught.value) == f"sampler 'typed': {name}={value!r}; use {wanted}"


@pytest.mark.parametrize(
    ("sampler", "name", "value"),
    [
        ("cycles", "least_width", 3), ("falcor", "side", 0), ("kd-tree", "blocks", 0),
        ("lightgen", "searches", 0), ("mis-compensated", "share", 0.0),
        ("mis-compensated", "share", 1.5), ("ours", "energy_weight", -1.0),
        ("q2-tree", "power", 0.0), ("ris", "candidates", 1), ("ris-stratified", "candidates", 1),
        ("restir", "candidates", 1), ("restir", "frames", 0), ("restir", "radius", -1.0),
        ("restir", "normal", 181.0), ("product", "widening", 0.0), ("sun-and-sh", "threshold", 0.0),
        ("product", "brdf_samples", 0), ("product", "brdf_share", 0.0),
        ("structured", "useful_solid_angle", -1.0),
        ("tmms", "useful_solid_angle", 0.0), ("tmms", "spatial_bandwidth", -1.0),
        ("tmms", "mode_reach", -1.0),
    ],
)  # fmt: skip
def test_numbers_out_of_range_are_named(sampler, name, value):
    with pytest.raises(EnvlightError, match="weight" if "weight" in name else name):
        make_sampler(sampler, **{name: value})


@pytest.mark.parametrize("sampler", sampler_names())
def test_no_parameter_of_any_sampler_takes_nonsense(sampler):
    for field in fields(sampler_class(sampler)):
        for value in ("foo", [1], {}, b"x", float("nan")):
            with pytest.raises(EnvlightError, match=field.name):
                make_sampler(sampler, **{field.name: value})


def test_a_budget_below_the_least_is_named(typed, monkeypatch):
    monkeypatch.setattr(Typed, "minimum_count", 4)
    with pytest.raises(EnvlightError, match="typed: a budget of 3; use at least 4"):
        make_sampler("typed").prepare(MAP, 3, np.random.default_rng(0))
    make_sampler("typed").prepare(MAP, 4, np.random.default_rng(0))
