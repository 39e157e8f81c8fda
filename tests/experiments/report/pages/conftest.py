"""A site of two published runs: a tiny one with its images, and rows that are hard to rank."""

import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest
from PIL import Image

from experiments.report.pages.write import write_site
from experiments.report.publish import publish
from experiments.run.loaded_run import read_run, write_run
from tests.experiments.report.pages.site_rows import HARD, TINY, hard_rows


@pytest.fixture(scope="session")
def published(finished: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A project's folder with `results`, of two runs, `runs` with one of them, and CITATION.cff."""
    folder = tmp_path_factory.mktemp("project")
    shutil.copytree(finished, folder / "runs" / TINY)
    publish(folder / "runs" / TINY, folder / "results" / TINY)
    tiny, record = read_run(finished)
    rows = hard_rows()
    for name in set(tiny) - set(rows):
        rows[name] = tiny[name].iloc[0]
    facts = {name: value for name, value in record.items() if name != "types"} | {
        "samplers": sorted(rows["sampler"].unique()), "budgets": ["lights=16", "rays=4"],
        "planned": len(rows),
    }  # fmt: skip
    hard = folder / "results" / HARD
    hard.mkdir()
    write_run(hard, rows, facts)
    (hard / "summary.tex").write_text("\\begin{table} a & b < c\n", encoding="utf-8")
    with Image.open(next((finished / "montages").iterdir())) as picture:
        picture.convert("RGB").save(hard / "vase_dikhololo_night_lights=16.webp")
    shutil.copyfile(Path(__file__).parents[4] / "CITATION.cff", folder / "CITATION.cff")
    return folder


@pytest.fixture(scope="session")
def site(published: Path, maps_folder: Path) -> Path:
    """The folder of a site with pages that compare images and show maps."""
    return write_site(
        published / "results", published / "site", published / "runs", [maps_folder]
    ).parent


@pytest.fixture(scope="session")
def browser() -> Iterator:
    """Chromium without a screen; tests are skipped where it or playwright is not installed."""
    reason = "playwright is not installed"
    playwright = pytest.importorskip("playwright.sync_api", reason=reason)
    found = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "chrome"))), None)
    if found is None:
        pytest.skip("no chromium is installed")
    with playwright.sync_playwright() as started:
        opened = started.chromium.launch(executable_path=found, args=["--no-sandbox"])
        yield opened
        opened.close()
