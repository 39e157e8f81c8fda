"""Throughput of the renderer: all tracers see the rays that the renderer counts, and agree."""

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from experiments.cli.commands import finish_study
from experiments.questions.renderer_throughput import mitsuba_peer
from experiments.questions.renderer_throughput import study as experiment
from experiments.questions.renderer_throughput.ray_lists import (
    PlainEmbree,
    Rays,
    global_rays,
    sampled_rays,
    trace_bare,
    trace_packets,
)
from experiments.questions.renderer_throughput.stages import STAGES, shade_to_stage
from experiments.questions.renderer_throughput.study import against_targets
from experiments.questions.renderer_throughput.tasks import DISCS, UPSAMPLING
from experiments.run.loaded_run import Run
from experiments.run.request import RunRequest
from experiments.run.study_run import run_study
from renderer import scenes
from renderer.direct import interleaved, shade_directional
from renderer.geometry import geometry_of
from renderer.monte_carlo import SampleSplit, shade_distribution
from renderer.scene import Object, Scene
from renderer.view import View, make_view
from samplers import EnvironmentMap, EnvlightError, make_sampler

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
    assert len(global_rays(view, sets)) == counted.traced
    sampled, split = make_sampler("mis").prepare(environment, 2, rng), SampleSplit(1, 1)
    _, counted = shade_distribution(view, environment, sampled, 3, split)
    # Cosines of grazing samples are rounded otherwise: one in ten thousand may differ.
    assert len(sampled_rays(view, sampled, split, 3)) == pytest.approx(counted.traced, rel=1e-4)


def test_both_loops_over_embree_find_the_same_hits(view, environment):
    lights = make_sampler("median-cut").prepare(environment, 8, np.random.default_rng(0))
    rays = global_rays(view, lights.direction[None])
    bare, plain = trace_bare(view.embree, rays), PlainEmbree(SCENE).trace(rays)
    assert 0 < bare < len(rays)
    # One ray at a time and eight at a time round differently along edges.
    assert plain == pytest.approx(bare, abs=1e-4 * len(rays))
    for coherent in (False, True):
        hits = trace_packets(view.embree, rays, coherent)
        assert hits == pytest.approx(bare, abs=1e-4 * len(rays))


def test_all_loops_over_embree_use_its_robust_tests():
    """From the middle of a box to its edges: the usual tests lose rays there."""
    (box,) = (item.mesh for item in SCENE.objects if item.name == "tall")
    scene = Scene("box", (Object("box", box, SCENE.objects[0].material),), SCENE.camera)
    rng = np.random.default_rng(0)
    start, end = box.vertex[np.concatenate([box.triangle[:, :2], box.triangle[:, 1:]])].swapaxes(
        0, 1
    )
    edge, share = rng.integers(0, len(start), 1 << 15), rng.uniform(0.01, 0.99, (1 << 15, 1))
    middle = 0.5 * (box.vertex.min(axis=0) + box.vertex.max(axis=0))
    origin = (middle + rng.uniform(-0.3, 0.3, (len(edge), 3))).astype(np.float32)
    way = start[edge] + share * (end - start)[edge] - origin
    rays = Rays(origin, np.ascontiguousarray(way, np.float32))
    embree = geometry_of(scene).embree
    usual = SimpleNamespace(handle=embree.usual)
    assert trace_bare(embree, rays) == PlainEmbree(scene).trace(rays) == len(rays)
    assert trace_bare(usual, rays) < len(rays)
    for coherent in (False, True):
        assert trace_packets(embree, rays, coherent) == len(rays)


def test_the_loop_that_is_timed_by_stage_is_the_renderers(view, environment):
    sampled = make_sampler("mis").prepare(environment, 2, np.random.default_rng(0))
    staged = shade_to_stage(view, environment, sampled, len(STAGES) - 1)
    image, _ = shade_distribution(view, environment, sampled, 0, SampleSplit(1, 1))
    np.testing.assert_array_equal(staged, image)
    assert not shade_to_stage(view, environment, sampled, len(STAGES) - 2).any()


def test_several_maps_are_refused(tmp_path):
    request = RunRequest(
        "renderer-throughput", "quick", "embedded", ["constant", "noon-desert"], ["three-boxes"],
        [], [], tmp_path, False, True, 0,
    )  # fmt: skip
    with pytest.raises(EnvlightError, match="measures under one map, not 2; give --maps NAME"):
        experiment.groups(request)


def test_experiment_writes_rates_and_ratios(tmp_path, monkeypatch):
    monkeypatch.setitem(experiment.SIZES, "quick", experiment.Size(32, 24, 1, 4, 2))
    monkeypatch.setattr(experiment, "MAP_HEIGHT", 32)
    monkeypatch.setattr(experiment, "is_installed", lambda: False)
    request = RunRequest(
        "renderer-throughput", "quick", "embedded", ["constant"], ["three-boxes"], [], [],
        tmp_path, False, True, 0,
    )  # fmt: skip
    assert run_study(experiment.renderer_throughput(), request, False, finish_study) == 0
    rows = pd.read_csv(tmp_path / "renderer_throughput.csv")
    # Two ray lists by four methods, the view, discs, upsampling and what it is compared with, and
    # three images with and without their view.
    assert len(rows) == 2 * (2 * 4 + 1 + 1 + 2 + 3 * 2)
    # A constant map has no disc lights.
    assert (rows.loc[~rows["work"].isin([UPSAMPLING, DISCS]), "rays"] > 0).all()
    bare = rows[rows["method"] == "bare Embree"]
    assert len(bare) == 4 and (bare["ratio"] == 1.0).all()
    stages = pd.read_csv(tmp_path / "renderer_throughput_stages.csv")
    assert list(stages["stage"]) == [*STAGES, "all"]
    assert stages["ns"].iloc[:-1].sum() == pytest.approx(stages["ns"].iloc[-1])
    targets = pd.read_csv(tmp_path / "renderer_throughput_targets.csv")
    # Two of global lights and upsampling on either number of threads, and two of scaling.
    assert len(targets) == 8 and (targets["reached"] > 0.0).all()
    assert list(targets["threads"]) == [1, 2, 1, 2, 1, 2, 2, 2]
    assert "not installed" in (tmp_path / "report.md").read_text(encoding="utf-8")
    told = experiment.findings(Run.load(tmp_path))
    assert len(told) == targets["target"].nunique() == 5
    for name, part in targets.groupby("target"):
        (line,) = (line for line in told if line.startswith(f"three-boxes, {name}: "))
        assert all(f"{value:.2f} on " in line for value in part["reached"])
        assert line.endswith(f"; wanted {part['wanted'].iloc[0]:.2f}.")


def test_targets_say_what_is_met_and_by_how_much_not():
    times = [
        ("global lights", "renderer", 1.0), ("global lights", "embreex", 1.5),
        ("image, MIS 1+1", "renderer", 1.0), ("image, MIS 1+1", "Mitsuba scalar_rgb", 5.0),
        ("global lights", "packets of 16", 0.8), ("disc lights", "renderer", 0.8),
        ("global lights", "bare Embree", 1.1),
    ]  # fmt: skip
    rows = pd.DataFrame(times, columns=["work", "method", "seconds"]).assign(scene="a", threads=2)
    rows["rays"] = [30, 30, 30, 30, 30, 10, 30]
    found = against_targets(rows).set_index("target")
    slow, fast = (
        "global lights: speed over embreex",
        "image, MIS 1+1: speed over Mitsuba scalar_rgb",
    )
    # The faster of the two ways in which Embree alone traces these rays is what can be reached.
    why = (
        "Embree alone takes 80 % of its time on the same shadow rays; with no other work the ratio "
        f"would be {1.5 / 0.8:.2f}"
    )
    assert found.loc[slow, "verdict"] == f"missed by a factor of 1.33: {why}"
    assert found.loc[fast, "verdict"] == "met" and found.loc[fast, "reached"] == 5.0
    name = "disc lights with the ambient map: speed a ray over packets of 16 of global lights"
    discs = found.loc[name]
    assert discs["reached"] == pytest.approx(1.0 / 3.0)  # a third of the rays in as much time


def test_old_llvm_libraries_are_passed_over(tmp_path, monkeypatch):
    for name in ("libLLVM-14.so.1", "libLLVM-15.so", "libLLVM.so.19.1", "libLLVM-17.so"):
        (tmp_path / name).touch()
    monkeypatch.setattr(mitsuba_peer, "LIBRARY_FOLDERS", (str(tmp_path)[1:],))
    monkeypatch.delenv("DRJIT_LIBLLVM_PATH", raising=False)
    assert mitsuba_peer.llvm_library() == str(tmp_path / "libLLVM.so.19.1")
    (tmp_path / "libLLVM.so.19.1").unlink()
    (tmp_path / "libLLVM-17.so").unlink()
    assert mitsuba_peer.llvm_library() is None
    monkeypatch.setenv("DRJIT_LIBLLVM_PATH", "named")
    assert mitsuba_peer.llvm_library() == "named"
