"""Frames a second by number of lights, as the table tells them."""

import pandas as pd

from experiments.export.gltf import as_gltf
from experiments.questions import real_time
from metrics.registry import leading_metric
from renderer.scene.load import load_scene
from tests.experiments.stored import run_into


def test_study_times_frames_with_and_without_upsampling(tmp_path, monkeypatch):
    monkeypatch.setitem(real_time.SIZES, "quick", (64, 48))
    monkeypatch.setitem(real_time.HEIGHTS, "quick", 32)
    monkeypatch.setattr(real_time, "COUNTS", (4, 16))
    own = tmp_path / "own.glb"
    own.write_bytes(as_gltf(None, load_scene("three-boxes")))
    run_into(tmp_path, real_time.real_time(), maps=["noon-desert"], scenes=[str(own)])
    rows = pd.read_csv(tmp_path / "real_time.csv")
    assert set(rows["scene"]) == {"own"}
    assert list(rows["sampler"].unique()) == real_time.SAMPLERS and len(rows) == 6
    assert (rows["frames"] * rows["seconds_frame"]).round(9).eq(1.0).all()
    rays = rows.set_index(["sampler", "count"])["rays"]
    for count in (4, 16):  # what is upsampled is traced at fewer points
        assert rays["ours", count] < rays["ours-no-upsampling", count]
    # Sixteen lights are nearer to the map than four, under a sun and a sky.
    error = rows.set_index(["sampler", "count"])[leading_metric().name]
    assert error["median-cut", 16] < error["median-cut", 4]
