"""Suites of maps: what is found, what is refused, and the nearest names."""

import os

import numpy as np
import pytest

from experiments.maps.patterns import select
from experiments.maps.sources import (
    EMBEDDED,
    EnvironmentSource,
    check_environments,
    clipping_sentence,
    find_environments,
    repair_sentence,
    single_environment,
)
from renderer.image import write_exr
from samplers import EnvironmentMap, EnvlightError


def names(sources):
    return [source.name for source in sources]


def test_a_folder_gives_its_maps_in_order_and_nothing_else(tmp_path):
    for name in ("b.exr", "a.HDR", "notes.txt", "c.png", ".hidden.exr", "._b.exr"):
        (tmp_path / name).touch()
    (tmp_path / "folder.exr").mkdir()
    assert names(find_environments(str(tmp_path), [], 16)) == ["a", "b"]


def test_a_file_is_a_suite_of_one_and_embedded_maps_have_the_height_that_is_asked_for(maps_folder):
    for suite, name, height in (
        (str(maps_folder / "sun.exr"), "sun", 16),
        (EMBEDDED, "constant", 32),
    ):
        (source,) = find_environments(suite, [name], 32)
        assert source.name == name and source.load().height == height


def test_patterns_choose_in_the_order_of_the_suite(maps_folder):
    found = find_environments(str(maps_folder), ["s*", "b*", "black"], 16)
    assert names(found) == ["black", "sun"]


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        ((), "holds no .exr or .hdr file"),
        (("a.txt",), "holds no .exr or .hdr file"),
        (("a.exr", "a.hdr"), "two maps are called 'a'"),
        (None, "no such folder or file"),
    ],
)
def test_a_folder_that_is_no_suite_is_named(tmp_path, content, sentence):
    for name in content or ():
        (tmp_path / name).touch()
    with pytest.raises(EnvlightError, match=sentence):
        find_environments(str(tmp_path if content is not None else tmp_path / "nowhere"), [], 16)


def test_a_pattern_without_a_match_gives_the_nearest_names(maps_folder):
    with pytest.raises(EnvlightError, match="no environment matches 'nois'; did you mean noise"):
        find_environments(str(maps_folder), ["nois"], 16)
    with pytest.raises(EnvlightError, match=r"there are black, constant, noise, other, sun$"):
        find_environments(str(maps_folder), ["zzz"], 16)
    with pytest.raises(EnvlightError, match=r"no thing matches 'zzz'; there are 0, .* and 88 more"):
        select(list(range(100)), ["zzz"], "thing")
    assert select([1, 2], [""], "thing") == [1, 2]


def test_one_map_is_found_by_its_name_or_its_path(maps_folder, tmp_path):
    assert single_environment("constant", 32) == EnvironmentSource("constant", height=32)
    path = maps_folder / "constant.exr"
    assert single_environment(str(path), 32).load().height == 16
    (tmp_path / "bare").write_bytes(path.read_bytes())
    for text in (str(tmp_path / "bare"), str(tmp_path / "none.exr"), "no-such-map"):
        with pytest.raises(EnvlightError):
            single_environment(text, 32).load()


@pytest.fixture
def mixed(tmp_path):
    """A folder with two good maps, one of bad values, and one that is no image."""
    radiance = np.ones((4, 8, 3), np.float32)
    write_exr(tmp_path / "good.exr", radiance)
    write_exr(tmp_path / "also.exr", radiance)
    radiance[1, 2] = np.nan, -1.0, np.inf
    write_exr(tmp_path / "values.exr", radiance)
    (tmp_path / "garbage.hdr").write_bytes(b"no image")
    return str(tmp_path)


def test_good_maps_go_on_without_the_bad_and_the_reasons_are_told(mixed):
    checked = check_environments(find_environments(mixed, [], 16))
    assert names(checked.good) == ["also", "good"]
    assert list(checked.bad) == ["garbage", "values"]
    assert "radiance has 1 NaN" in checked.bad["values"]
    assert all("\n" not in reason for reason in checked.bad.values())


def test_repairs_are_counted_and_told(mixed):
    checked = check_environments(find_environments(mixed, ["values", "good"], 16, repair=True))
    (told,) = (repair_sentence(*one) for one in checked.repaired.items())
    assert told.startswith("map 'values': 3 values changed: 1 infinite became 3.40282e+38, 1 NaN")
    assert names(checked.good) == ["good", "values"]
    assert not checked.bad


def sky(sun, texels):
    radiance = np.random.default_rng(0).uniform(0.5, 1.0, (8, 16, 3))
    radiance[2, 3 : 3 + texels] = sun
    return EnvironmentMap.from_array(radiance, "sky")


def test_many_equal_brightest_texels_are_told_with_their_share():
    environment = sky(1e3, 4)
    told = clipping_sentence(environment)
    flux = environment.flux[2, 3:7].sum() / environment.flux.sum()
    assert "its 4 brightest texels are equal, luminance 1000" in told
    assert f"give {100.0 * flux:.3g} % of the flux" in told


def test_a_sun_that_is_clipped_in_two_channels_is_told():
    blue = np.linspace(500.0, 600.0, 5)
    told = clipping_sentence(sky(np.stack([np.full(5, 1e3), np.full(5, 1e3), blue], 1), 5))
    assert "its 5 brightest texels are equal in two channels, luminance 971.1" in told
    red = np.stack([np.full(5, 1e3), blue, blue], 1)
    assert clipping_sentence(sky(red, 5)) is None  # one channel's may agree by chance


HUGE = EnvironmentMap.from_array(np.full((8, 16, 3), 3e38), "huge")


@pytest.mark.parametrize("environment", [sky(1e3, 3), sky(1.0, 0), sky(2.0, 8), HUGE])
def test_few_or_dim_equal_texels_are_not_told(environment):
    with np.errstate(all="raise"):
        assert clipping_sentence(environment) is None


def test_a_map_that_memory_does_not_hold_is_a_bad_map(mixed, monkeypatch):
    def too_large(*words):
        raise MemoryError

    load = EnvironmentMap.from_file
    monkeypatch.setattr(
        EnvironmentMap, "from_file",
        lambda path, repair: too_large() if "also" in path else load(path, repair),
    )  # fmt: skip
    checked = check_environments(find_environments(mixed, ["good", "also"], 16))
    assert names(checked.good) == ["good"]
    assert "not enough memory" in checked.bad["also"]


@pytest.mark.skipif(os.name != "posix", reason="names of files are bytes on POSIX alone")
@pytest.mark.parametrize("suffix", [".exr", ".hdr"])
def test_a_name_that_is_not_utf_8_is_a_bad_map_in_words_that_can_be_written(
    mixed, tmp_path, suffix
):
    name = os.fsdecode(b"sky\xff")
    (tmp_path / f"{name}{suffix}").write_bytes((tmp_path / "good.exr").read_bytes())
    checked = check_environments(find_environments(mixed, ["good", "sky*"], 16))
    assert names(checked.good) == ["good"]
    assert list(checked.bad) == ["sky\\xff"]
    assert "its name is not UTF-8; rename it" in checked.bad["sky\\xff"]
    assert str(checked.bad).encode()


def test_a_name_too_long_for_what_is_called_by_it_is_a_bad_map(mixed, tmp_path):
    (tmp_path / f"{'x' * 121}.exr").write_bytes((tmp_path / "good.exr").read_bytes())
    (tmp_path / f"{'y' * 120}.exr").write_bytes((tmp_path / "good.exr").read_bytes())
    checked = check_environments(find_environments(mixed, ["x*", "y*"], 16))
    assert names(checked.good) == ["y" * 120]
    assert "its name is too long; shorten it" in checked.bad["x" * 121]


def test_strictness_refuses_the_whole_and_names_all_that_is_bad(mixed):
    with pytest.raises(EnvlightError, match=r"garbage.*; no good either: values$"):
        check_environments(find_environments(mixed, [], 16), strict=True)
    good = find_environments(mixed, ["good", "also"], 16)
    assert check_environments(good, strict=True).good == tuple(good)


def test_nothing_good_is_refused_in_any_case(mixed):
    with pytest.raises(EnvlightError, match="map 'values': radiance has 1 NaN"):
        check_environments(find_environments(mixed, ["values"], 16))


def test_embedded_maps_need_no_check():
    sources = find_environments("embedded", ["constant", "neon*"], 4096)
    assert check_environments(sources).good == tuple(sources)
