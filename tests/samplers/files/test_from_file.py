"""Samplers in files of the user's own: loaded by path, and errors that say what is wrong where."""

import textwrap
from pathlib import Path

import numpy as np
import pytest

from samplers import EnvironmentMap, EnvlightError, make_sampler, sampler_class, sampler_names
from samplers.files.from_file import is_file_reference

GOOD = """
    from dataclasses import dataclass

    from samplers import DirectionalLights, LightSampler


    @dataclass(frozen=True)
    class OneLight(LightSampler):
        height: float = 1.0

        def _prepare(self, environment, count, rng):
            return DirectionalLights([[0, self.height, 0]], [environment.total_flux], [0.0])
"""
MAP = EnvironmentMap.from_array(np.ones((2, 4, 3)))


@pytest.fixture
def write(tmp_path: Path):
    def write(text: str, name: str = "mine.py") -> Path:
        path = tmp_path / name
        path.write_text(textwrap.dedent(text), encoding="utf-8")
        return path

    return write


def test_a_class_in_a_file_is_a_sampler(write):
    sampler = make_sampler(f"{write(GOOD)}:OneLight")
    assert sampler.name == "one-light"
    lights = sampler.prepare(MAP, 4, np.random.default_rng(0))
    assert np.array_equal(lights.irradiance, [MAP.total_flux])


def test_paths_may_be_relative_to_the_current_folder(write, monkeypatch):
    monkeypatch.chdir(write(GOOD).parent)
    assert sampler_class("mine.py:OneLight") is sampler_class("./mine.py:OneLight")


def test_parameters_are_checked_as_those_of_any_sampler(write):
    reference = f"{write(GOOD)}:OneLight"
    assert make_sampler(reference, height=1).height == 1.0
    with pytest.raises(EnvlightError, match="use a number"):
        make_sampler(reference, height="high")


@pytest.mark.parametrize(
    ("field", "said"),
    [
        ("minimum_count = None", "its minimum_count is no whole number; give one"),
        ("height: float", "parameter 'height' has no default; give one"),
    ],
)
def test_fields_that_are_no_parameters_are_refused(write, field, said):
    path = write(GOOD.replace("height: float = 1.0", field))
    with pytest.raises(EnvlightError, match=said):
        make_sampler(f"{path}:OneLight")


def test_the_registered_name_counts_where_there_is_one(write):
    text = GOOD.replace("LightSampler\n", "LightSampler, register\n", 1)
    text = text.replace("    @dataclass", '    @register("mine")\n    @dataclass')
    assert sampler_class(f"{write(text)}:OneLight").name == "mine"


def test_a_file_does_not_change_what_is_registered(write):
    before = sampler_names()
    sampler_class(f"{write(GOOD)}:OneLight")
    assert sampler_names() == before


def test_an_edited_file_is_loaded_anew(write):
    first = sampler_class(f"{write(GOOD)}:OneLight")
    again = sampler_class(f"{write(GOOD)}:OneLight")
    edited = sampler_class(f"{write(GOOD.replace('1.0', '2.0'))}:OneLight")
    assert first is again
    assert edited is not first and edited().height == 2.0


def test_files_beside_it_can_be_imported(write):
    write("HEIGHT = 1.0", "beside_the_sampler.py")
    text = "\n    from beside_the_sampler import HEIGHT" + GOOD.replace("= 1.0", "= HEIGHT")
    assert make_sampler(f"{write(text)}:OneLight").height == 1.0


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("class Other: pass", r"it has no class 'OneLight'; its classes: Other$"),
        ("x = 1", r"it has no class 'OneLight'; its classes: none$"),
        ("class OneLight: pass", r"'OneLight' is not a LightSampler; derive it"),
        ("OneLight = 3", r"'OneLight' is not a LightSampler; derive it"),
        ("from samplers import LightSampler as OneLight", r"'OneLight' is not a LightSampler"),
        ("a = 1\nimport no_such_package", r"line 2: ModuleNotFoundError: No module named 'no_su"),
        ("a = 1\n\nb = a / 0", r"line 3: ZeroDivisionError: division by zero; correct the line$"),
        ("raise SystemExit", r"line 1: SystemExit; correct the line$"),
        ("a = 1\ndef f(:\n", r"line 2: invalid syntax; correct the line$"),
        ("a = 1\n\0", r"SyntaxError: source code string cannot contain null bytes; correct the "),
        (
            "from samplers import LightSampler\nclass OneLight(LightSampler): pass",
            r"class 'OneLight' has no method _prepare; write it$",
        ),
        (
            "from samplers import register, LightSampler\n@register('a b')\n"
            "class OneLight(LightSampler): pass",
            r"'a b' cannot be a sampler's name; use letters",
        ),
        (
            "from samplers import register, LightSampler\n@register('ours')\n"
            "class OneLight(LightSampler): pass",
            r"two samplers are called 'ours': .* register one under another name$",
        ),
    ],
)
def test_what_is_wrong_is_one_sentence(write, text, said):
    path = write(text)
    with pytest.raises(EnvlightError, match=said) as caught:
        sampler_class(f"{path}:OneLight")
    assert str(caught.value).startswith(f"{path}: ")
    assert "\n" not in str(caught.value)


def test_a_class_named_like_a_registered_sampler_is_refused(write):
    path = write(GOOD.replace("OneLight", "Uniform"))
    with pytest.raises(EnvlightError, match="two samplers are called 'uniform'"):
        sampler_class(f"{path}:Uniform")


def test_a_missing_file_and_a_missing_class_name_are_told(write, tmp_path):
    with pytest.raises(EnvlightError, match=r"nowhere.py is no file; give the path"):
        sampler_class(f"{tmp_path}/nowhere.py:OneLight")
    with pytest.raises(EnvlightError, match=r"name the class too, as in .*mine.py:OneLight$"):
        sampler_class(str(write(GOOD)))


@pytest.mark.parametrize(
    ("text", "meant"),
    [("a.py:A", True), ("/x/a.py:A", True), ("a.py", True), ("ours", False), ("a:b", False)],
)
def test_what_is_meant_as_a_file(text, meant):
    assert is_file_reference(text) is meant
