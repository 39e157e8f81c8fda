"""Suites of maps: what is found, what is refused, and the nearest names."""

import numpy as np
import pytest

from experiments.maps.sources import (
    EnvironmentSource,
    check_environments,
    find_environments,
    select,
    single_environment,
)
from renderer.image import write_exr
from samplers import EnvlightError


def names(sources):
    return [source.name for source in sources]


def test_a_folder_gives_its_maps_in_order_and_nothing_else(tmp_path):
    for name in ("b.exr", "a.HDR", "notes.txt", "c.png", ".hidden.exr", "._b.exr"):
        (tmp_path / name).touch()
    (tmp_path / "folder.exr").mkdir()
    assert names(find_environments(str(tmp_path), [], 16)) == ["a", "b"]


def test_a_file_is_a_suite_of_one(maps_folder):
    source = find_environments(str(maps_folder / "sun.exr"), [], 16)
    assert names(source) == ["sun"]
    assert source[0].load().height == 16


def test_embedded_maps_have_the_height_that_is_asked_for():
    (source,) = find_environments("embedded", ["constant"], 32)
    assert source.load().height == 32


def test_patterns_choose_in_the_order_of_the_suite(maps_folder):
    found = find_environments(str(maps_folder), ["s*", "b*", "black"], 16)
    assert names(found) == ["black", "sun"]


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        ((), "holds no .exr or .hdr file"),
        (("a.txt",), "holds no .exr or .hdr file"),
        (("a.exr", "a.hdr"), "two maps are called 'a'"),
    ],
)
def test_a_folder_that_is_no_suite_is_named(tmp_path, content, sentence):
    for name in content:
        (tmp_path / name).touch()
    with pytest.raises(EnvlightError, match=sentence):
        find_environments(str(tmp_path), [], 16)


def test_a_missing_folder_is_named(tmp_path):
    with pytest.raises(EnvlightError, match="no such folder or file"):
        find_environments(str(tmp_path / "nowhere"), [], 16)


def test_a_pattern_without_a_match_gives_the_nearest_names(maps_folder):
    with pytest.raises(EnvlightError, match="no environment matches 'nois'; did you mean noise"):
        find_environments(str(maps_folder), ["nois"], 16)
    with pytest.raises(EnvlightError, match=r"there are black, constant, noise, other, sun$"):
        find_environments(str(maps_folder), ["zzz"], 16)
    with pytest.raises(EnvlightError, match=r"no thing matches 'zzz'; there are 0, .* and 88 more"):
        select(list(range(100)), ["zzz"], "thing")


def test_one_map_is_found_by_its_name_or_its_path(maps_folder, tmp_path):
    assert single_environment("constant", 32) == EnvironmentSource("constant", height=32)
    path = maps_folder / "constant.exr"
    assert single_environment(str(path), 32).load().height == 16
    (tmp_path / "bare").write_bytes(path.read_bytes())
    for text in (str(tmp_path / "bare"), str(tmp_path / "none.exr"), "no-such-map"):
        with pytest.raises(EnvlightError):
            single_environment(text, 32).load()


def test_bad_maps_are_found_before_a_run_and_repairs_are_counted(tmp_path):
    radiance = np.ones((4, 8, 3), np.float32)
    write_exr(tmp_path / "good.exr", radiance)
    radiance[1, 2] = np.nan, -1.0, np.inf
    write_exr(tmp_path / "bad.exr", radiance)
    with pytest.raises(EnvlightError, match="map 'bad': radiance has 1 NaN"):
        check_environments(find_environments(str(tmp_path), [], 16))
    repaired = check_environments(find_environments(str(tmp_path), [], 16, repair=True))
    assert repaired == {"bad": 3}
