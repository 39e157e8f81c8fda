"""The experiment end to end, with renderers of NumPy alone; one is missing and one breaks down."""

import sys
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from experiments.maps.sources import EnvironmentSource
from experiments.questions.production_renderers import (
    shots,
    study,
    tables,
    to_luxcore,
    written_scene,
)
from experiments.questions.production_renderers.shots import Contender, Effort, turned_away
from experiments.run.experiment import RunRequest
from renderer import scenes
from renderer.modelling import shade, sphere
from renderer.scene import Camera, Object, Scene
from renderer.scene.materials import Lambert
from tests.experiments.stored import run_into

WHITE = Lambert((1.0, 1.0, 1.0))
TINY = Effort(24, 18, ((1, 2), (4, 1)), 4, 4)
PROGRAM = """
import runpy
from pathlib import Path
import numpy as np

class Grey:
    def __init__(self, folder, threads):
        self.facts = {"renderer": "grey", "version": "1.5"}

    def render(self, samples, seed):
        if FAILS:
            raise MemoryError("no room")
        noise = np.random.default_rng(seed).standard_normal((18, 24, 3))
        self._image = (0.2 + 0.01 * noise / samples**0.5).astype(np.float32)
        return 0.25, {}

    def image(self):
        return self._image

here = Path(__file__).resolve().parent
runpy.run_path(str(here / "session.py"))["main"](Grey, here)
"""


def write(scene, environment, picture, folder, fails):
    command = to_luxcore.write(scene, environment, picture, folder)
    (folder / "render.py").write_text(f"FAILS = {fails}\n{PROGRAM}", encoding="utf-8")
    return command


def fakes() -> tuple[Contender, ...]:
    return (
        Contender("Grey", "numpy", "luxcore_program", partial(write, fails=False)),
        Contender("Broken", "numpy", "luxcore_program", partial(write, fails=True)),
        Contender("Absent", "no-such-one", "luxcore_program", partial(write, fails=False)),
    )


@pytest.fixture(scope="module")
def folder(tmp_path_factory, maps_folder) -> Path:
    place = tmp_path_factory.mktemp("production")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv(written_scene.VARIABLE, sys.executable)
        patch.setattr(study, "contenders", fakes)
        patch.setitem(study.EFFORTS, "quick", TINY)
        made = study.production_renderers.__wrapped__()
        made = study.replace(made, name="production-renderers")
        run_into(
            place, made, environments=str(maps_folder), maps=["noise"], scenes=["three-boxes"],
            samplers=["mis"],
        )  # fmt: skip
    return place


def test_a_renderer_that_fails_costs_its_own_rows_alone(folder):
    rows = pd.read_csv(folder / "measurements.csv")
    done = rows[rows["seconds"].notna()]
    assert set(done["renderer"]) == {"Grey", "envlight mis"}
    assert len(done) == 2 * 2 * 2  # materials, renderers, numbers of samples
    text = (folder / "report.md").read_text(encoding="utf-8")
    assert "Left out: Broken: its process ended with status 1: MemoryError: no room." in text
    assert "Left out: Absent: the package no-such-one is not installed" in text


def test_errors_are_against_a_renderers_own_mean(folder):
    rows = pd.read_csv(folder / "measurements.csv")
    grey = rows[(rows["renderer"] == "Grey") & (rows["materials"] == "lambert")]
    grey = grey.set_index("samples")
    # Noise of .01 at one sample in units of a mean of .2, which is exposed to .4; over 1296 values
    # a mean square is known to 4 %, and the converged one takes off as much noise as it adds.
    for samples in (1, 4):
        expected = 0.01 * 0.4 / 0.2 / np.sqrt(samples)
        assert np.sqrt(grey.loc[samples, "squared_error"]) == pytest.approx(expected, rel=0.1)
    efficiency = 1.0 / (grey["squared_error"] * grey["seconds"])
    np.testing.assert_allclose(grey["efficiency"], efficiency)
    assert (grey["seconds"] == 0.25).all() and (grey["version"].astype(str) == "1.5").all()
    # It renders grey and nothing of the scene, which agreement must show.
    assert (grey["block_z"] > 10.0).all()


def test_report_has_its_tables(folder):
    for name in ("noise", "agreement", "agreement_by_case", "efficiency_by_map", "speed"):
        assert len(pd.read_csv(folder / f"{name}.csv")) > 0
    assert (folder / "images_lambert.webp").is_file()


def test_of_many_maps_one_of_every_kind_is_taken():
    names = ["noon_grass", "dikhololo_night", "moonless_golf", "spree_bank", "comfy_cafe"]
    others = [f"unknown_{k}" for k in range(8)]
    sources = [EnvironmentSource(name, f"{name}.exr") for name in [*names, *others]]
    found = [source.name for source in study.of_every_kind(sources)]
    assert found == ["noon_grass", "dikhololo_night", "spree_bank", "comfy_cafe"]
    assert study.of_every_kind(sources[:3]) == sources[:3]
    assert study.of_every_kind(sources[5:] + sources[5:]) == sources[5:]


def row(renderer: str, environment: str, difference: float, error: float, **more) -> dict:
    return {
        "materials": "lambert", "scene": "vase", "environment": environment, "renderer": renderer,
        "samples": 4, "difference": difference, "difference_error": error,
        "block_difference": abs(difference), "block_noise": error, "block_z": 1.0, **more,
    }  # fmt: skip


def test_the_table_of_agreement_says_what_the_rows_say():
    rows = pd.DataFrame(
        [
            row("A", "one", 1e-3, 1e-4), row("A", "two", -4e-3, 1e-4),
            row("A", "three", 5e-3, 4e-3),
            row("B", "one", 1e-4, 1e-4), row("envlight mis", "one", 0.0, 0.0),
        ]
    )  # fmt: skip
    table = tables.agreement_by_renderer(tables.agreeing(rows)).set_index("renderer")
    assert list(table["cases"]) == [3, 1] and list(table["beyond"]) == [1, 0]
    assert list(table["largest"]) == [5e-3, 1e-4] and list(table["error"]) == [4e-3, 1e-4]
    assert list(table["where"]) == ["vase, three", "vase, one"]


def test_mitsuba_without_its_fast_variant_is_told_before_and_after(monkeypatch, capsys):
    request = RunRequest("production-renderers", maps=["noon-desert"], scenes=["vase"])
    monkeypatch.setattr(shots, "llvm_library", lambda: "libLLVM.so")
    assert study.groups(request) and not capsys.readouterr().err
    monkeypatch.setattr(shots, "llvm_library", lambda: None)
    assert study.groups(request)
    told = capsys.readouterr().err.strip()
    assert told.startswith("envlight: Mitsuba 3 and Mitsuba 3, compensated: variant scalar_rgb")
    named = (("Mitsuba 3", "scalar_rgb"), ("Mitsuba 3, compensated", "scalar_rgb"), ("Cycles", ""))
    rows = pd.DataFrame(
        [{"renderer": name, "settings": f'{{"variant": "{variant}"}}'} for name, variant in named]
    )
    assert tables.slower_variants(rows) == [told.removeprefix("envlight: ")]
    assert tables.slower_variants(rows.iloc[2:]) == []


def test_light_from_where_normals_face_away_is_found(environments):
    environment = environments[0].load()
    noise = next(source for source in environments if source.name == "noise").load()
    coarse, fine = (
        Scene(
            "ball",
            (Object("ball", shade(sphere(1.0, n), 180.0), WHITE),),
            Camera((0, 0, 6), (0, 0, 0)),
        )
        for n in (4, 24)
    )
    # Facets of 15° at the rim, seen by pixels of half a degree; of 4° none is turned that far.
    larger = replace(TINY, width=160, height=120)
    assert 0.0 < turned_away(coarse, noise, larger) < 0.1
    assert turned_away(fine, noise, larger) == 0.0
    assert turned_away(scenes.make("three-boxes"), noise, TINY) == 0.0
    assert environment.is_black and turned_away(coarse, environment, larger) == 0.0


def test_speed_is_that_of_a_line_through_two_times():
    rows = pd.DataFrame(
        [
            row("A", "one", 0.0, 0.0, width=10, height=10, seconds=0.5 + 0.25 * n, mean_samples=n)
            | {"samples": n}
            for n in (1, 4, 16)
        ]
    )
    (line,) = tables.speeds(rows).to_dict("records")
    assert line["per_sample_ms"] == pytest.approx(250.0)
    assert line["fixed_ms"] == pytest.approx(500.0)
    assert line["million"] == pytest.approx(100 / 0.25 / 1e6)
