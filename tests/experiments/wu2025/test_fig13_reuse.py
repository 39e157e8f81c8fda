"""What reuse does to noise: ratios by both metrics from rows, and the grain of an error."""

import numpy as np
import pandas as pd
import pytest
from scipy.ndimage import gaussian_filter

from experiments.report.parts import Table, Text
from experiments.wu2025 import fig13_reuse
from experiments.wu2025.fig13_reuse import by_scene, gained, grain, reuse, sentences
from tests.experiments.report.ranking_rows import rows_of


class Found:
    """A run of rows alone."""

    def __init__(self, rows: pd.DataFrame) -> None:
        self.rows = rows


def rows():
    """On every map restir has half the RMSE of ris, and by FLIP eight tenths of it."""
    alone = 0.1 + 0.01 * np.arange(6)
    found = rows_of({"ris": alone, "restir": 0.5 * alone, "mis": 3.0 * alone})
    reusing = found["sampler"] == "restir"
    found.loc[reusing, "flip"] = 1.6 * found.loc[reusing, "flip"]
    return found


def test_gains_are_ratios_over_the_same_maps():
    table = gained(rows(), "restir", "ris").set_index("metric")
    assert table.loc["RMSE", ["ratio", "low", "high"]].tolist() == pytest.approx([0.5] * 3)
    assert table.loc["FLIP", ["ratio", "low", "high"]].tolist() == pytest.approx([0.8] * 3)
    assert (table[["smaller", "maps"]] == 6).all().all()


def test_errors_by_scene_are_geometric_means_over_maps():
    found = by_scene(Found(rows_of({"mis": [0.1, 0.4]}, scenes=("vase", "glossy"))))
    tables = [part.rows for part in found if isinstance(part, Table)]
    assert len(tables) == 2
    for table in tables:
        assert table.loc[0, ["vase", "glossy"]].tolist() == pytest.approx([0.2, 0.4])


def test_the_sentence_is_made_from_the_rows():
    (told,) = sentences(Found(rows()))
    assert told.endswith(
        "6 maps: ReSTIR (Bitterli 2020) has 0.50 times the RMSE and 0.80 times the FLIP of "
        "RIS (Talbot 2005); RMSE says more for it."
    )
    for how in ("denoise=True", "frames=4"):
        named = {"ris": "restir", "restir": f"restir[{how}]"}
        (told,) = sentences(Found(rows().replace({"sampler": named})))
        assert f"[{how}] has 0.50 times the RMSE and 0.80 times the FLIP of ReSTIR" in told
    assert "nothing is told" in sentences(Found(rows_of({"mis": [0.1]})))[0]


def test_white_noise_has_a_grain_of_one_whatever_its_size_from_place_to_place():
    """The square of the blur of n independent numbers has a relative deviation of about
    √(2 · 4π · 2² / n), which 60000 make 4 %: the root's is 2 %, of which five are allowed."""
    noise = np.random.default_rng(3).normal(size=(100, 200, 3)) * np.linspace(1, 3, 200)[:, None]
    assert grain(noise) == pytest.approx(1.0, abs=0.1)


def test_a_blurred_error_and_a_bias_have_larger_grains():
    noise = np.random.default_rng(4).normal(size=(100, 200, 3))
    smooth = gaussian_filter(noise, (1.5, 1.5, 0.0))
    assert 1.2 < grain(smooth) < grain(np.ones_like(noise))
    assert np.isnan(grain(np.zeros((8, 8, 3))))


def test_the_denoised_take_part_where_the_package_is_there(monkeypatch):
    labels = [spec.label for spec in reuse().samplers()]
    assert {*fig13_reuse.SAMPLERS, "restir[frames=4]"} <= set(labels)
    for there in (None, object()):
        monkeypatch.setattr(fig13_reuse, "find_spec", lambda name, there=there: there)
        labels = [spec.label for spec in fig13_reuse.contenders()]
        assert ("restir[denoise=True]" in labels) == (there is not None)


def test_how_white_the_noise_of_reuse_is_stands_in_a_sentence(monkeypatch):
    table = rows().query("sampler == 'restir'").assign(grain=np.linspace(1.0, 1.25, 6))
    monkeypatch.setattr(fig13_reuse, "found_in_images", lambda *_: table)
    *_, told = fig13_reuse.grains(Found(table))
    wanted = "Grain over all cases and budgets: ReSTIR (Bitterli 2020) 1.00 to 1.25."
    assert told == Text(wanted)
