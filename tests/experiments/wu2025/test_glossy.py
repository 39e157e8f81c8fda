"""Errors over glossy objects are those of their pixels alone."""

import numpy as np
import pandas as pd
import pytest

from experiments.report.case_figures import CaseImages
from experiments.run.foreground import foreground, glossy_pixels
from experiments.run.loaded_run import Run
from experiments.run.record import write_csv
from experiments.wu2025 import glossy
from tests.experiments.grid_rows import grid_run


def errors(scene: str, environment: str, sampler: str, lights: int) -> tuple[float, float]:
    return 0.1, 0.2


@pytest.fixture
def run(tmp_path) -> Run:
    return grid_run(tmp_path, ("glossy",), ("a",), glossy.SAMPLERS, errors)


def test_glossy_pixels_are_a_part_of_the_foreground(run):
    seen, shiny = foreground(run, "glossy"), glossy_pixels(run, "glossy")
    assert shiny.shape == (84, 112)
    assert 0 < shiny.sum() < seen.sum() and not (shiny & ~seen).any()
    assert not glossy_pixels(run, "rubiks-cube").all()


def test_errors_over_a_mask_are_those_inside_it(run):
    rng = np.random.default_rng(0)
    truth = rng.random((40, 50, 3), np.float32)
    image = truth.copy()
    mask = np.zeros((40, 50), bool)
    mask[:, :25] = True
    image[:, 25:] += 0.5
    rows = [run.rows.iloc[0]]
    found = glossy.glossy_errors(CaseImages(truth, rows, [image]), mask).iloc[0]
    assert found["rmse_glossy"] == 0.0 and found["rmse"] == 0.1
    swapped = glossy.glossy_errors(CaseImages(truth, rows, [image]), ~mask).iloc[0]
    assert swapped["rmse_glossy"] == pytest.approx(0.5, rel=1e-6)
    assert swapped["flip_glossy"] > found["flip_glossy"]
    nothing = glossy.glossy_errors(CaseImages(truth, rows, [image]), mask & ~mask).iloc[0]
    assert np.isnan(nothing["rmse_glossy"]) and np.isnan(nothing["flip_glossy"])


def test_rows_without_images_still_have_a_report(run):
    (path, *others) = glossy.report(run)
    text = path.read_text(encoding="utf-8")
    assert "| ours" in text and "No images are kept" in text and not others


def test_a_run_without_images_keeps_what_was_found_from_them(run):
    kept = run.rows[["scene", "environment", "budget", "sampler", "rmse", "flip", "noise_floor"]]
    write_csv(run.folder / "glossy.csv", kept.assign(rmse_glossy=0.2345, flip_glossy=0.3))
    before = (run.folder / "glossy.csv").read_bytes()
    path, *others = glossy.report(run)
    assert "0.2345" in path.read_text(encoding="utf-8")
    assert others == [run.folder / "glossy.csv"] and others[0].read_bytes() == before


def test_means_stand_in_the_figures_order():
    rows = pd.DataFrame(
        [
            {"budget": "seconds=1", "sampler": name, "rmse": 1.0, "rmse_glossy": 2.0, "flip": 0.1,
             "flip_glossy": 0.2, "environment": "a"}
            for name in sorted(glossy.SAMPLERS)
        ]
    )  # fmt: skip
    assert list(glossy._means(rows, list(glossy.SAMPLERS))["sampler"]) == list(glossy.SAMPLERS)
