"""Errors over glossy objects are those of their pixels alone."""

import numpy as np
import pandas as pd
import pytest

from experiments.report.case_figures import CaseImages
from experiments.report.write import write_report
from experiments.run.loaded_run import Run, write_csv
from experiments.wu2025.glossy import (
    SAMPLERS,
    foreground,
    glossy,
    glossy_errors,
    glossy_means,
    glossy_pixels,
    told,
)
from tests.experiments.grid_rows import grid_run


def errors(scene: str, environment: str, sampler: str, lights: int) -> tuple[float, float]:
    return 0.1, 0.2


@pytest.fixture
def run(tmp_path) -> Run:
    return grid_run(tmp_path, ("glossy",), ("a",), SAMPLERS, errors)


def glossy_rows(flips: dict[str, tuple[float, float]]) -> pd.DataFrame:
    """Rows of two maps, by sampler their FLIP over glossy objects."""
    return pd.DataFrame(
        [
            {"scene": "glossy", "environment": f"map{k}", "budget": "seconds=1", "sampler": name,
             "rmse": 1.0, "rmse_glossy": 0.2345, "flip": 0.1, "flip_glossy": value}
            for name, values in flips.items()
            for k, value in enumerate(values)
        ]
    )  # fmt: skip


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
    case = CaseImages([run.rows.iloc[0]], truth, [image])
    found = glossy_errors(case, mask).iloc[0]
    # Half of the pixels are off by 0.5.
    assert found["rmse_glossy"] == 0.0
    assert found["rmse"] == pytest.approx(0.5 / np.sqrt(2.0), rel=1e-6)
    swapped = glossy_errors(case, ~mask).iloc[0]
    assert swapped["rmse_glossy"] == pytest.approx(0.5, rel=1e-6)
    assert swapped["flip_glossy"] > swapped["flip"] > found["flip_glossy"]
    nothing = glossy_errors(case, mask & ~mask).iloc[0]
    assert np.isnan(nothing["rmse_glossy"]) and np.isnan(nothing["flip_glossy"])


def test_rows_without_images_still_have_a_report(run):
    write_report(glossy(), run)
    text = (run.folder / "report.md").read_text(encoding="utf-8")
    assert "| Ours (Wu 2025)" in text and "No images are kept" in text and "Over glossy" not in text


def test_a_run_without_images_keeps_what_was_found_from_them(run):
    write_csv(run.folder / "glossy.csv", glossy_rows(dict.fromkeys(SAMPLERS, (0.3, 0.3))))
    before = (run.folder / "glossy.csv").read_bytes()
    write_report(glossy(), run)
    assert "0.2345" in (run.folder / "report.md").read_text(encoding="utf-8")
    assert (run.folder / "glossy.csv").read_bytes() == before


def test_means_stand_in_the_figures_order_and_wins_are_counted():
    flips = {"ours": (0.2, 0.2), "tmms": (0.3, 0.1), "mis": (0.1, 0.1), "median-cut": (0.3, 0.3)}
    rows = glossy_rows(flips)
    table = glossy_means(rows, list(SAMPLERS))
    assert list(table["sampler"]) == list(SAMPLERS) and list(table["cases"]) == [2] * 4
    assert table.set_index("sampler").loc["tmms", "flip_glossy"] == pytest.approx(0.2)
    assert "nothing is compared" in told(rows[rows["sampler"] == "ours"])
