"""The site of this project's own published runs: all kinds of reports that there are get a page."""

from pathlib import Path

from experiments.report.pages.write import MOST_BYTES, write_site
from experiments.report.publish import published_runs

RESULTS = Path(__file__).parents[4] / "results"


def test_every_published_run_has_its_page(tmp_path):
    index = write_site(RESULTS, tmp_path / "site")
    pages = {page.stem for page in (index.parent / "experiments").glob("*.html")}
    assert {run.folder.name for run in published_runs(RESULTS)} <= pages
    orders = (index.parent / "experiments.html").read_text(encoding="utf-8")
    assert "The same on other maps, scenes and image sizes" in orders
    files = (file for file in index.parent.rglob("*") if file.is_file())
    assert sum(file.stat().st_size for file in files) < MOST_BYTES
