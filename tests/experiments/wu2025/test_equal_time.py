"""Equal time: the budget follows the pixels, and the hardest maps are those of the rows."""

from pathlib import Path

import pandas as pd
import pytest

from experiments.report.write import write_report
from experiments.run.loaded_run import Run
from experiments.run.scale import SCALES
from experiments.wu2025.equal_time import equal_time
from experiments.wu2025.published import seconds_budget
from tests.experiments.grid_rows import grid_run

SAMPLERS = tuple(spec.label for spec in equal_time().samplers())


def errors(scene: str, environment: str, sampler: str, lights: int) -> tuple[float, float]:
    level = 3.0 if environment == "b" else 1.0
    return level * (1.0 + SAMPLERS.index(sampler)), 0.1 * level * (8.0 - SAMPLERS.index(sampler))


def test_the_budget_is_the_papers_at_its_resolution():
    (budget,) = seconds_budget(SCALES["paper"])
    assert str(budget) == "seconds=4"
    (budget,) = seconds_budget(SCALES["quick"])
    # Four digits are kept.
    pixels = SCALES["quick"].width * SCALES["quick"].height
    assert budget.amount == pytest.approx(4.0 * pixels / (1600 * 1200), rel=5e-4)


def test_means_and_the_hardest_maps_are_those_of_the_rows(tmp_path):
    run = grid_run(tmp_path, ("vase", "teapot"), ("a", "b", "c"), SAMPLERS, errors)
    write_report(equal_time(), run)
    table = pd.read_csv(tmp_path / "summary.csv").set_index("sampler")
    assert table.loc[SAMPLERS[0], "rmse"] == pytest.approx(5.0 / 3.0)
    paper = pd.read_csv(tmp_path / "beside_paper.csv").set_index("sampler")
    assert paper.loc["ours", "paper_rmse"].startswith("0.0438")
    hard = pd.read_csv(tmp_path / "hardest.csv").set_index("sampler")
    assert hard.loc[SAMPLERS[1], "b_rmse"] == pytest.approx(6.0)
    assert list(hard) == ["b_rmse", "b_flip", "a_rmse", "a_flip"]
    text = (tmp_path / "report.md").read_text(encoding="utf-8")
    assert "No images are kept with these rows" in text


def test_the_report_of_a_run_with_images_shows_figures(copied: Path):
    run = Run.load(copied)
    write_report(equal_time(), run)
    assert len(list(copied.glob("figures/*.webp"))) == 5
    text = (copied / "report.md").read_text(encoding="utf-8")
    assert "](figures/three-boxes_sun_lights=4.webp)" in text
