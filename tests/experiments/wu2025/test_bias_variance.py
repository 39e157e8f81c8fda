"""Images with a known bias and a known noise are split into what was put in."""

import numpy as np
import pandas as pd
import pytest

from experiments.run.loaded_run import Run
from experiments.wu2025.table1 import bias_and_variance, means, squared_errors
from renderer.image import write_exr

SHAPE, EXPOSURE, BIAS, NOISE, FLOOR = (40, 50, 3), 2.0, 0.3, 0.2, 0.05


@pytest.fixture
def run(tmp_path):
    """Two seeds of a noisy sampler with a bias, two of one without noise, one seed of a third."""
    rng = np.random.default_rng(3)
    truth = rng.random(SHAPE)
    reference = truth + FLOOR * rng.standard_normal(SHAPE)
    rows = []
    for sampler, noise, seeds in (("noisy", NOISE, 8), ("still", 0.0, 2), ("alone", 0.0, 1)):
        for seed in range(seeds):
            key = f"{sampler[0]}{seed:07d}"
            image = (truth + BIAS + noise * rng.standard_normal(SHAPE)).astype(np.float32)
            path = tmp_path / "images" / "vase" / "sun" / f"x_{key}.exr"
            path.parent.mkdir(parents=True, exist_ok=True)
            write_exr(path, image)
            rows.append({
                "key": key, "scene": "vase", "environment": "sun", "budget": "lights=8",
                "sampler": sampler, "seed": seed, "exposure": EXPOSURE,
                "rmse_measured": EXPOSURE * np.sqrt(np.mean((image - reference) ** 2)),
                "rmse_floor": EXPOSURE * FLOOR,
            })  # fmt: skip
    record = {"samplers": ["noisy", "still", "alone"], "budgets": ["lights=8"]}
    return Run(tmp_path, pd.DataFrame(rows), record)


def test_bias_and_variance_are_what_was_put_in(run):
    found = squared_errors(run).set_index("sampler")
    assert list(found.index) == ["noisy", "still"]
    # 6000 values, of which the variance of 8 seeds is averaged: its relative standard deviation is
    # √(2 / (7 · 6000)) = 0.7 %, that of the squared error as small; five of them.
    assert found.loc["noisy", "variance"] == pytest.approx((EXPOSURE * NOISE) ** 2, rel=0.035)
    assert found.loc["noisy", "bias"] == pytest.approx((EXPOSURE * BIAS) ** 2, rel=0.035)
    assert found.loc["still", "variance"] == 0.0
    assert found.loc["still", "bias"] == pytest.approx((EXPOSURE * BIAS) ** 2, rel=0.035)


def test_the_table_gives_roots_and_shares(run):
    table = means(squared_errors(run), run).set_index("sampler")
    share = BIAS**2 / (BIAS**2 + NOISE**2)
    assert list(table.index) == ["noisy", "still"]
    assert table["share"].to_list() == pytest.approx([share, 1.0], rel=0.05)
    assert table["mostly"].to_list() == [1, 1]


def test_a_published_folder_keeps_what_was_found(run):
    first = list(bias_and_variance(run))
    for image in run.folder.rglob("*.exr"):
        image.unlink()
    again = list(bias_and_variance(run))
    assert len(first) == 3 and first[1].rows.equals(again[1].rows)
