"""The HTML report: one folder of pages that open from disk, without a network.

`index.html` says who won, by how much and where not; a page per scene and map compares images, a
page per map shows where lights lie, a page per sampler says what it is. Tables and statistics are
made anew each time; pictures that are there already are kept.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from experiments.report import case_pages, index_page, sampler_pages
from experiments.report.index_page import save_figures
from experiments.report.light_maps import MapPage, recorded_places, write_map_pages
from experiments.report.parts import Part
from experiments.report.rankings import BudgetResult, results
from experiments.report.run_data import RunData, load_run, slug
from experiments.report.sections.ranks import ranked_table
from experiments.report.style import looks
from experiments.report.summary import leagues_of
from experiments.report.tables import as_markdown
from experiments.report.template_pages import TEMPLATES, copy_assets, template_environment
from experiments.report.write import write_tables
from experiments.run.experiment import Published
from experiments.run.outputs import remove_listed
from experiments.run.record import write_csv, write_text
from metrics.registry import NEAR, metrics
from samplers import sampler_class

ASSETS = Path(__file__).parent / "assets"
MOST_COLUMNS = 2048
LIST = "pages.txt"
"""The pages that the report's writer made, so that another report may remove them."""


def write_html(
    run: Path,
    *,
    images: bool = True,
    lights: bool = True,
    width: int = MOST_COLUMNS,
    maps: Sequence[Path] = (),
    samplers: Sequence[str] = (),
    published: Published | None = None,
) -> Path:
    """Write RUN/report and return its index.html; EnvlightError where the run has no result.

    images : make the comparison pages, too; lights : the pages that show lights on maps
    width : images that are wider are shown reduced to so many columns
    maps : folders or files in which a run's map files are looked for; where there is none, the
        place that the run's command names
    samplers : FILE:CLASS of samplers that are not installed
    published : a paper's figures to stand beside ours
    """
    files = {cls.name: name for name in samplers for cls in [sampler_class(name)]}
    data = load_run(run)
    found = results(data.rows)
    folder = run / "report"
    _write_tables(folder / "tables", data, found)
    look = looks(sorted(data.rows["sampler"].unique()), leagues_of(data.rows))
    figures = save_figures(folder / "figures", found, look)
    copy_assets(ASSETS, folder / "assets")
    pages = _Pages(folder, data)
    cases = case_pages.contexts(data, look, folder, width if images else 0)
    drawn: list[MapPage] = []
    if lights:
        drawn = write_map_pages(data, folder, maps or recorded_places(data), files)
    own = sampler_pages.contexts(data, found, look, files)
    for case in cases:
        pages.write(f"cases/{case.file}", "case.html", case=case, cases=cases)
    for page in drawn:
        pages.write(f"maps/{slug(page.name)}.html", "map.html", page=page, maps=drawn, looks=look)
    for sampler in own:
        pages.write(f"samplers/{sampler['file']}", "sampler.html", sampler=sampler)
    index = index_page.context(data, found, look, figures, cases, published)
    pages.remove_stale()
    return pages.write(
        "index.html", "index.html", index=index, cases=cases, maps=drawn, samplers=own
    )


def _write_tables(folder: Path, data: RunData, found: list[BudgetResult]) -> None:
    """The report's tables as CSV, Markdown and LaTeX; the same rows give the same bytes."""
    tables: list[Part] = [ranked_table(result) for result in found]
    write_csv(folder / "measurements.csv", data.rows)
    write_tables(tables, folder)
    lines = [f"### {result.budget}\n\n{as_markdown(ranked_table(result))}\n" for result in found]
    write_text(folder / "summary.md", "\n".join(lines))


class _Pages:
    """Renders templates into the report's folder."""

    def __init__(self, folder: Path, data: RunData) -> None:
        self._folder = folder
        self._environment = template_environment(TEMPLATES)
        self._environment.globals.update(
            missing=data.missing, planned=data.planned, finished=len(data.rows), near=f"{NEAR:g}",
            labels={metric.name: metric.label for metric in metrics()},
        )  # fmt: skip
        self._written: list[str] = []

    def write(self, name: str, template: str, **context: Any) -> Path:
        path = self._folder / name
        text = self._environment.get_template(template).render(root="../" * name.count("/"),
                                                               **context)  # fmt: skip
        write_text(path, text)
        self._written.append(name)
        return path

    def remove_stale(self) -> None:
        """Remove pages of cases, maps and samplers that an earlier report lists."""
        place = self._folder / LIST
        before = place.read_text(encoding="utf-8").splitlines() if place.is_file() else []
        remove_listed(self._folder, set(before) - set(self._written))
        write_text(place, "\n".join([*self._written, ""]))
