"""The ablation: ratios are those of the errors, the paper's stand beside them, bytes repeat."""

import pandas as pd
import pytest

from experiments.report.write import write_report
from experiments.wu2025.table2 import CONFIGURATIONS, table2
from tests.experiments.grid_rows import grid_run

LABELS = tuple(spec.label for spec in CONFIGURATIONS.values())
MAPS = ("a", "b", "c")


def errors(scene: str, environment: str, sampler: str, lights: int) -> tuple[float, float]:
    """Every step that is missing doubles the RMSE on all maps; FLIP differs on one map alone."""
    missing = sampler.count("False")
    level = 1.0 + MAPS.index(environment)
    return level * 2.0**missing, 1.0 + (missing if environment == "a" else 0.0)


def run_in(folder):
    folder.mkdir()
    return grid_run(folder, ("vase", "teapot"), MAPS, LABELS, errors, lights=(8, 16))


def test_ratios_are_those_of_the_errors(tmp_path):
    run = run_in(tmp_path / "run")
    write_report(table2(), run)
    table = pd.read_csv(run.folder / "ratios.csv").set_index(["budget", "configuration"])
    at = table.loc["lights=8"]
    assert list(at["rmse_ratio"]) == pytest.approx([4.0, 2.0, 2.0, 1.0])
    assert list(at["rmse_geometric"]) == pytest.approx([4.0, 2.0, 2.0, 1.0])
    # Three maps, one of which has three times the FLIP: ratio of means 5/3, geometric 3^(1/3).
    assert at.loc["IS only", "flip_ratio"] == pytest.approx(5.0 / 3.0)
    assert at.loc["IS only", "flip_geometric"] == pytest.approx(3.0 ** (1.0 / 3.0))
    assert at.loc["IS only", "paper_rmse"] == 0.0599
    assert at.loc["IS only", "paper_rmse_ratio"] == pytest.approx(0.0599 / 0.0438)
    text = (run.folder / "report.md").read_text()
    assert "| 0.0599 |" in " ".join(text.split()) and "lights=16" in text


def test_a_run_without_the_whole_method_has_no_ratios(tmp_path):
    tmp_path.joinpath("run").mkdir()
    run = grid_run(tmp_path / "run", ("vase",), MAPS, LABELS[:2], errors)
    write_report(table2(), run)
    assert pd.read_csv(run.folder / "ratios.csv")["rmse_ratio"].isna().all()
