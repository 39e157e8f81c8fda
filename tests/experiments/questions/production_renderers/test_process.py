"""Renderers in processes of their own: what they report, and what becomes of those that fail."""

import shutil
import sys
from pathlib import Path

import numpy as np
import pytest

from experiments.questions.production_renderers import programs, written_scene
from experiments.questions.production_renderers.written_scene import Render, render_scene, require
from samplers import EnvlightError

PROGRAM = """
import os, runpy, sys
from pathlib import Path
import numpy as np

class Grey:
    def __init__(self, folder, threads):
        self.facts = {"renderer": "grey", "version": "1", "threads": threads}

    def render(self, samples, seed):
        if samples == 13:
            os.abort()
        if samples == 14:
            raise ValueError("no such number")
        self._image = np.random.default_rng(seed).random((2, 3, 3), np.float32) / samples
        return 0.5, {"mean_samples": samples + 0.25}

    def image(self):
        return self._image

here = Path(__file__).resolve().parent
runpy.run_path(str(here / "session.py"))["main"](Grey, here)
"""


@pytest.fixture
def folder(tmp_path, monkeypatch) -> Path:
    """A written scene of a renderer that is made of NumPy alone."""
    monkeypatch.setenv(written_scene.VARIABLE, sys.executable)
    (tmp_path / "render.py").write_text(PROGRAM, encoding="utf-8")
    shutil.copy(Path(programs.__file__).parent / "session.py", tmp_path)
    return tmp_path


def test_all_renderings_of_a_plan_are_made_in_one_process(folder):
    plan = [Render(4, 1, str(folder / "a.npy")), Render(8, 2, str(folder / "b.npy"))]
    report = render_scene(folder, plan, "grey", 3)
    assert report["facts"]["threads"] == 3 and report["facts"]["version"] == "1"
    assert [one["samples"] for one in report["renders"]] == [4, 8]
    assert [one["mean_samples"] for one in report["renders"]] == [4.25, 8.25]
    assert all(one["seconds"] == 0.5 for one in report["renders"])
    image = np.random.default_rng(2).random((2, 3, 3), np.float32) / 8
    np.testing.assert_array_equal(np.load(folder / "b.npy"), image)


@pytest.mark.parametrize(("samples", "words"), [(13, "signal 6"), (14, "no such number")])
def test_a_process_that_fails_is_told_in_its_own_words(folder, samples, words):
    plan = [Render(4, 1, str(folder / "a.npy")), Render(samples, 2, str(folder / "b.npy"))]
    with pytest.raises(EnvlightError, match=words):
        render_scene(folder, plan, "grey", 1)


def test_a_missing_package_is_told_with_its_remedy(monkeypatch):
    monkeypatch.setenv(written_scene.VARIABLE, sys.executable)
    with pytest.raises(EnvlightError, match=r"Grey: the package no-such-one.*make renderers"):
        require("no-such-one", "Grey")
    assert require("numpy", "NumPy") == np.__version__
    monkeypatch.setenv(written_scene.VARIABLE, "no/such/python")
    with pytest.raises(EnvlightError, match="does not work as a Python"):
        require("numpy", "NumPy")
