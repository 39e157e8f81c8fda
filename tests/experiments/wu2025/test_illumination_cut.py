"""The two cuts: parameters, false edges by case, and a report with and without images."""

from pathlib import Path

import pandas as pd
import pytest

from experiments.report.write import write_report
from experiments.wu2025.illumination_cut import CONFIGURATIONS, edge_table, illumination_cut, told
from tests.experiments.grid_rows import grid_run
from tests.experiments.stored import run_into

LABELS = {name: spec.label for name, spec in CONFIGURATIONS.items()}


def test_the_original_cut_splits_by_variance_alone():
    rules = {n: s.sampler.cut_rule() for n, s in CONFIGURATIONS.items()}
    for name, rule in rules.items():
        weights = (rule.variance_weight, rule.extent_weight, rule.energy_weight)
        assert weights == ((1.0, 0.0, 0.0) if name.startswith("original") else (1.0, 5.0, 1.0))
    factors = {n: s.sampler.upsampling for n, s in CONFIGURATIONS.items()}
    assert {name for name, factor in factors.items() if factor > 1} == {
        "modified, upsampled", "original, upsampled",
    }  # fmt: skip


def test_false_edges_are_compared_at_the_same_resolution():
    values = {"modified": (1.0, 3.0), "original": (2.0, 2.5), "modified, upsampled": (1.0, 1.0),
              "original, upsampled": (4.0, 2.0)}  # fmt: skip
    edges = pd.DataFrame(
        [
            {"scene": "vase", "environment": f"map{k}", "budget": "lights=8",
             "sampler": LABELS[name], "false_edges": value}
            for name, pair in values.items()
            for k, value in enumerate(pair)
        ]
    )  # fmt: skip
    table = edge_table(edges, ["lights=8", "lights=16"])
    found = table.set_index("configuration")
    assert found.loc["original", "ratio"] == pytest.approx(4.5 / 4.0)
    assert found.loc["original", "more_false"] == 1
    assert found.loc["original, upsampled", "ratio"] == pytest.approx(3.0)
    assert found.loc["original, upsampled", "more_false"] == 2
    assert pd.isna(found.loc["modified", "ratio"]) and set(found["cases"]) == {2}
    # 4.5 / 4 and 3.
    assert "in 2 of 2 comparisons" in told(table) and "1.12 to 3.00 times" in told(table)
    alone = edge_table(edges[edges["sampler"] == LABELS["modified"]], ["lights=8"])
    assert "nothing is compared" in told(alone)


def test_rows_without_images_have_errors_but_no_false_edges(tmp_path: Path):
    run = grid_run(
        tmp_path, ("vase",), ("a", "b"), tuple(LABELS.values()),
        lambda scene, environment, sampler, lights: (1.0 + ("0.0" in sampler), 0.1), (8, 16),
    )  # fmt: skip
    write_report(illumination_cut(), run)
    text = (tmp_path / "report.md").read_text(encoding="utf-8")
    table = pd.read_csv(tmp_path / "ratios.csv").set_index(["budget", "configuration"])
    assert table.loc[("lights=8", "original"), "rmse_ratio"] == pytest.approx(2.0)
    assert "False edges" not in text and "No images are kept" in text


def test_a_small_run_measures_both_and_shows_the_pair(tmp_path: Path):
    options = {"maps": ["moonlit-hills"], "scenes": ["three-boxes"], "budgets": ["8"]}
    run_into(tmp_path, illumination_cut(), samplers=["ours-no-upsampling*"], **options)
    edges = pd.read_csv(tmp_path / "false_edges.csv")
    assert len(edges) == 2 and (edges["false_edges"] > 0.0).all()
    assert (tmp_path / "figures" / "three-boxes_moonlit-hills_lights=8.webp").is_file()
    assert "| original" in (tmp_path / "report.md").read_text(encoding="utf-8")
