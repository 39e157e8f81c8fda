"""Suites of Poly Haven's maps are found whole, at one resolution, or not at all."""

import pytest

from experiments.maps.poly_haven import FOLDER_VARIABLE, SUITES, maps_folder
from experiments.maps.sources import find_environments
from samplers import EnvlightError

SUITE = "paper-named-12"


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.setenv(FOLDER_VARIABLE, str(tmp_path))
    return tmp_path


def make(folder, ending, ids=SUITES[SUITE]):
    for name in ids:
        (folder / f"{name}{ending}").touch()


def found(text):
    return [(source.name, source.path) for source in find_environments(text, [], 16)]


@pytest.mark.parametrize(("suite", "count"), [("poly-haven-32", 32), (SUITE, 12)])
def test_suites_hold_as_many_maps_as_they_say(suite, count):
    assert len(set(SUITES[suite])) == count
    assert list(SUITES[suite]) == sorted(SUITES[suite])


@pytest.mark.parametrize("ending", [".exr", ".hdr", "_1k.exr", "_1k.hdr", "_16k.EXR"])
def test_a_map_is_called_by_its_id_whatever_its_file_is_called(folder, ending):
    make(folder, ending)
    make(folder, ending, ["another_map", "red_wall_02"])
    assert found(SUITE) == [(name, str(folder / f"{name}{ending}")) for name in SUITES[SUITE]]


def test_missing_maps_are_named_with_the_command_that_downloads_them(folder):
    command = "download them by 'envlight fetch paper-named-12'"
    with pytest.raises(EnvlightError, match=f"of its 12 maps none in {folder}; {command}"):
        found(SUITE)
    make(folder, "_1k.exr", SUITES[SUITE][:-1])
    with pytest.raises(EnvlightError, match=f"of its 12 maps red_wall not in {folder}; {command}"):
        found(SUITE)
    with pytest.raises(EnvlightError, match=r"'envlight fetch paper-named-12 --resolution 2k'"):
        found(f"{SUITE}@2k")


def test_resolutions_are_never_mixed(folder):
    make(folder, "_1k.exr", SUITES[SUITE][:6])
    make(folder, "_2k.exr", SUITES[SUITE][6:])
    with pytest.raises(EnvlightError, match=r"kiara_1_dawn, .* and 2 more not in"):
        found(f"{SUITE}@1k")
    with pytest.raises(EnvlightError, match="of its 12 maps"):
        found(SUITE)
    make(folder, "_1k.exr", SUITES[SUITE][6:])
    assert {path[-6:] for _, path in found(SUITE)} == {"1k.exr"}
    make(folder, "_2k.hdr", SUITES[SUITE][:6])
    with pytest.raises(EnvlightError, match=f"several resolutions; write {SUITE}@1k or {SUITE}@2k"):
        found(SUITE)
    endings = {path[-6:] for _, path in found(f"{SUITE}@2k")}
    assert endings == {"2k.exr", "2k.hdr"}


def test_a_half_float_file_goes_before_one_of_shared_exponents(folder):
    make(folder, "_1k.hdr")
    make(folder, "_1k.exr", ["lapa"])
    assert [path for name, path in found(SUITE) if name == "lapa"] == [str(folder / "lapa_1k.exr")]


@pytest.mark.parametrize("text", ["poly-haven-32@", "poly-haven-32@3k", "poly-haven-32@1k@2k"])
def test_a_resolution_that_does_not_exist_is_refused(folder, text):
    with pytest.raises(EnvlightError, match="write poly-haven-32@1k, @2k or @4k"):
        found(text)


def test_without_the_variable_the_folder_is_the_users_own(monkeypatch):
    monkeypatch.delenv(FOLDER_VARIABLE, raising=False)
    assert maps_folder().is_absolute()
    assert maps_folder().parts[-2:] == ("envlight", "maps")
