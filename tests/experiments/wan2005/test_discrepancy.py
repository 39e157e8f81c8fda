"""Patterns of directions are what they claim to be, and rank as published."""

import numpy as np
import pytest

from experiments.cli.commands import finish
from experiments.report import figures
from experiments.run.experiment import RunRequest
from experiments.run.start import run_experiment
from experiments.wan2005 import discrepancy
from experiments.wan2005.discrepancy import PATTERNS
from metrics.discrepancy import generalized_discrepancy

SIZES = {
    "lat-long lattice": {2 * n * n for n in range(1, 60)},
    "cube map": {6 * n * n for n in range(1, 40)},
    "icosahedron": {10 * n * n + 2 for n in range(1, 30)},
    "Hammersley base 2": set(range(1, 4000)),
    "HEALPix": {12 * 4**k for k in range(6)},
}


@pytest.mark.parametrize("pattern", PATTERNS)
@pytest.mark.parametrize("count", [12, 100, 1000])
def test_points_are_distinct_unit_vectors_of_an_allowed_number(pattern, count):
    points = PATTERNS[pattern](count)
    assert len(points) in SIZES[pattern]
    allowed = np.array(sorted(SIZES[pattern]))
    assert abs(len(points) - count) == np.abs(allowed - count).min()
    assert np.abs(np.linalg.norm(points, axis=1) - 1.0).max() < 1e-12
    gap = np.linalg.norm(points[:, None] - points[None], axis=2) + 9.0 * np.eye(len(points))
    # Points at the lattice's poles are closest, 0.01 apart; the same point twice differs by 1e-15.
    assert gap.min() > 1e-3


@pytest.mark.parametrize("pattern", PATTERNS)
def test_points_have_no_preferred_side(pattern):
    # All but Hammersley's are symmetric about the centre; its mean is of the order 1/N.
    points = PATTERNS[pattern](768)
    assert np.abs(points.mean(axis=0)).max() < 2.0 / 768


def test_patterns_rank_as_published():
    at = {name: generalized_discrepancy(make(768)) for name, make in PATTERNS.items()}
    order = ["HEALPix", "Hammersley base 2", "icosahedron", "cube map", "lat-long lattice"]
    assert sorted(at, key=lambda name: at[name]) == order


def test_experiment_writes_tables_and_plots(tmp_path, monkeypatch, suffixes_of_plots):
    monkeypatch.setattr(figures, "SUFFIXES", suffixes_of_plots)
    monkeypatch.setitem(discrepancy.MOST_POINTS, "quick", 48)
    request = RunRequest("discrepancy", output=tmp_path)
    assert run_experiment(discrepancy.discrepancy(), request, False, finish) == 0
    assert set(suffixes_of_plots) == {"svg", "pdf", "png"}
    kinds = ("csv", "tex", *suffixes_of_plots)
    files = [tmp_path / "report.md", *(tmp_path / f"discrepancy.{kind}" for kind in kinds)]
    first = [file.read_bytes() for file in files]
    assert all(first) and ">20<" in files[3].read_text(encoding="utf-8")  # not 2 × 10¹
    assert run_experiment(discrepancy.discrepancy(), request, False, finish) == 0
    assert [file.read_bytes() for file in files] == first
