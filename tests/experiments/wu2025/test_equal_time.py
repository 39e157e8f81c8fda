"""Equal time: the budget follows the pixels, and the report holds means, hardest maps, strips."""

from pathlib import Path

import pandas as pd
import pytest

from experiments.run.loaded_run import Run
from experiments.run.scale import SCALES
from experiments.wu2025 import equal_time
from experiments.wu2025.table1 import PAPER
from tests.experiments.grid_rows import grid_run

SAMPLERS = tuple(spec.label for spec in equal_time.paper_samplers())


def errors(scene: str, environment: str, sampler: str, lights: int) -> tuple[float, float]:
    level = 3.0 if environment == "b" else 1.0
    return level * (1.0 + SAMPLERS.index(sampler)), 0.1 * level


def test_the_budget_is_the_papers_at_its_resolution():
    (budget,) = equal_time.seconds_budget(SCALES["paper"])
    assert str(budget) == "seconds=4"
    (budget,) = equal_time.seconds_budget(SCALES["quick"])
    assert budget.amount == pytest.approx(4.0 * 112 * 84 / (1600 * 1200), rel=1e-3)


def test_the_samplers_are_those_of_the_papers_table():
    assert set(SAMPLERS) == set(PAPER) and len(SAMPLERS) == 7


def test_means_and_the_hardest_map_are_those_of_the_rows(tmp_path):
    run = grid_run(tmp_path, ("vase", "teapot"), ("a", "b", "c"), SAMPLERS, errors)
    equal_time.report(run)
    table = pd.read_csv(tmp_path / "means.csv").set_index("sampler")
    assert table.loc[SAMPLERS[0], "rmse"] == pytest.approx(5.0 / 3.0)
    assert table.loc["ours", "paper_rmse"] == 0.0438
    assert table.loc["ours", "paper_flip"] == 0.0865
    assert table.loc["ours", "render_ms"] == pytest.approx(16.0)
    text = (tmp_path / "report.md").read_text(encoding="utf-8")
    assert "Hardest for every method: b, " in text
    assert "No images are kept with these rows" in text


def test_the_report_of_a_run_with_images_shows_strips_with_the_same_bytes(copied: Path):
    run = Run.load(copied)
    equal_time.report(run)
    files = [copied / "report.md", copied / "means.csv", *sorted(copied.glob("strips/*.jpg"))]
    assert len(files) == 2 + 5
    before = [file.read_bytes() for file in files]
    assert b"](strips/three-boxes_sun_lights=4.jpg)" in before[0]
    equal_time.report(run)
    assert [file.read_bytes() for file in files] == before
