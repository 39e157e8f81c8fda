"""Throughput of the renderer: all tracers see the rays that the renderer counts, and agree."""

import numpy as np
import pandas as pd
import pytest

from experiments.questions.production_renderers import to_mitsuba
from renderer import scenes
from renderer.direct import interleaved, shade_directional
from renderer.geometry import geometry_of
from renderer.monte_carlo import SampleSplit, shade_distribution
from renderer.scene import Object, Scene
from renderer.view import View, make_view
from samplers import EnvironmentMap, make_sampler
from tests.benchmarks import renderer_throughput as benchmark
from tests.benchmarks.renderer_throughput import (
    PlainEmbree,
    Rays,
    global_rays,
    sampled_rays,
    trace_packets,
)
from tests.experiments.export import threejs

SCENE = scenes.make("three-boxes")


@pytest.fixture(scope="module")
def view() -> View:
    return make_view(SCENE, 48, 36, 4)


@pytest.fixture(scope="module")
def environment() -> EnvironmentMap:
    radiance = np.random.default_rng(2).uniform(0.1, 1.0, (16, 32, 3))
    return EnvironmentMap.from_array(radiance, "noise")


def test_listed_rays_are_as_many_as_the_renderer_traces(view, environment):
    rng = np.random.default_rng(0)
    lights = make_sampler("median-cut").prepare(environment, 8, rng)
    sets, irradiance = interleaved(lights, 8, rng)
    _, counted = shade_directional(view, sets, irradiance)
    # Cosines of grazing directions are rounded otherwise: one in ten thousand may differ.
    assert len(global_rays(view, sets)) == pytest.approx(counted.traced, rel=1e-4)
    sampled, split = make_sampler("mis").prepare(environment, 2, rng), SampleSplit(1, 1)
    _, counted = shade_distribution(view, environment, sampled, 3, split)
    assert len(sampled_rays(view, sampled, split, 3)) == pytest.approx(counted.traced, rel=1e-4)


def test_all_loops_over_embree_use_its_robust_tests():
    """From the middle of a box to its edges: the usual tests lose rays there."""
    (box,) = (item.mesh for item in SCENE.objects if item.name == "tall")
    scene = Scene("box", (Object("box", box, SCENE.objects[0].material),), SCENE.camera)
    rng = np.random.default_rng(0)
    ends = box.vertex[np.concatenate([box.triangle[:, :2], box.triangle[:, 1:]])]
    start, end = ends.swapaxes(0, 1)
    edge, share = rng.integers(0, len(start), 1 << 15), rng.uniform(0.01, 0.99, (1 << 15, 1))
    middle = 0.5 * (box.vertex.min(axis=0) + box.vertex.max(axis=0))
    origin = (middle + rng.uniform(-0.3, 0.3, (len(edge), 3))).astype(np.float32)
    way = start[edge] + share * (end - start)[edge] - origin
    rays = Rays(origin, np.ascontiguousarray(way, np.float32))
    assert PlainEmbree(scene).trace(rays) == len(rays)
    for coherent in (False, True):
        assert trace_packets(geometry_of(scene).embree, rays, coherent) == len(rays)


def test_every_kind_of_work_has_a_rate_or_a_time(monkeypatch):
    monkeypatch.setattr(benchmark, "MAP_HEIGHT", 32)
    monkeypatch.setattr(benchmark, "is_installed", lambda: False)
    rows = benchmark.rates("three-boxes", benchmark.Size(32, 24, 1, 4), rounds=1)
    # Two lists of rays by three methods, their images, the view, discs, and upsampling by two.
    assert len(rows) == 2 * (2 * 3 + 2 + 1 + 1 + 2)
    assert not rows.duplicated(["work", "method", "threads"]).any()
    assert (rows["value"] > 0.0).all()
    assert (rows["lower"] <= rows["value"]).all() and (rows["value"] <= rows["upper"]).all()
    assert set(rows.loc[rows["unit"] == "ms", "work"]) >= {"image, MIS", "upsampling"}


@pytest.mark.parametrize("unit", [benchmark.RAYS, benchmark.MS])
def test_threads_that_gain_more_than_their_number_are_told(unit):
    """22 million rays/s on one thread and 57 on two: something else ran beside the one."""
    one, two = (22.0, 57.0) if unit == benchmark.RAYS else (57.0, 22.0)
    rows = pd.DataFrame({
        "work": ["sound", "sound", "odd", "odd"], "method": "renderer", "threads": [1, 2, 1, 2],
        "value": [0.5 * (one + two), 0.5 * (one + two), one, two], "unit": unit, "rounds": 9,
        "spread": 0.05, "load_average": 1.0,
    })  # fmt: skip
    said = benchmark.told(rows)
    assert "renderer at odd;" in said and "sound" not in said
    assert "disturbed" not in benchmark.told(rows[:2])
    assert "noisy: in 1 of 2" in benchmark.told(rows[:2].assign(spread=[0.5, 0.1]))


def test_old_llvm_libraries_are_passed_over(tmp_path, monkeypatch):
    for name in ("libLLVM-14.so.1", "libLLVM-15.so", "libLLVM.so.19.1", "libLLVM-17.so"):
        (tmp_path / name).touch()
    monkeypatch.setattr(to_mitsuba, "LIBRARY_FOLDERS", (str(tmp_path)[1:],))
    monkeypatch.delenv("DRJIT_LIBLLVM_PATH", raising=False)
    assert to_mitsuba.llvm_library() == str(tmp_path / "libLLVM.so.19.1")
    (tmp_path / "libLLVM.so.19.1").unlink()
    (tmp_path / "libLLVM-17.so").unlink()
    assert to_mitsuba.llvm_library() is None
    monkeypatch.setenv("DRJIT_LIBLLVM_PATH", "named")
    assert to_mitsuba.llvm_library() == "named"


def test_lights_that_threejs_refuses_at_once_are_drawn_in_even_passes():
    def draw(file, size, texels, frames=0, most=99):
        assert min(file.count(b'"light":'), most) <= 5, "too many lights"
        return threejs.Drawn(np.zeros(3), [3.0, 1.0, 2.0], [0.5], f"{most} a pass", 8)

    rows = threejs.frames((4, 16), draw)
    assert list(rows["most_lights"]) == [5, 5] and list(rows["passes"]) == [1, 4]
    assert list(rows["webgl"]) == ["4 a pass"] * 2 and list(rows["ms"]) == [2000.0] * 2
