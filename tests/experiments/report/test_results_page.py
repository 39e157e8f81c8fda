"""The page of the published runs is what the command makes of their rows, and nothing else."""

import shutil
from pathlib import Path

import pytest

from experiments.report.publish import publish
from experiments.report.results_page import PAGE, results_page, write_results_page
from experiments.run.loaded_run import Run
from metrics.registry import ranked_metrics
from samplers import EnvlightError

RESULTS = Path(__file__).parents[3] / "results"


def test_the_published_page_is_what_the_command_makes():
    made = (RESULTS / PAGE).read_text(encoding="utf-8")
    assert made == results_page(RESULTS), "make it again: envlight results-page results"


def test_the_page_names_who_has_least_error(copied, tmp_path):
    publish(copied, tmp_path / "results" / "tiny")
    text = write_results_page(tmp_path / "results").read_text(encoding="utf-8")
    assert "## tiny" in text and "(tiny/report.md)" in text
    rows = Run.load(copied).rows
    assert f"{len(rows)} of {len(rows)} measurements, 5 maps" in text
    for metric in ranked_metrics():
        assert f"mean rank by {metric.label}" in text


def test_a_folder_without_published_runs_is_told(tmp_path):
    shutil.rmtree(tmp_path, ignore_errors=True)
    tmp_path.mkdir()
    with pytest.raises(EnvlightError, match="no published run is there"):
        results_page(tmp_path)
