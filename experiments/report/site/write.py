"""The writer of the site: one folder of pages that open from disk, without a network.

`index.html` answers first: who is best, in which rows, and the questions that readers bring; a page
per sampler, map and published run follows, with the published tables, plots and rows to download.
What is written depends on the published folders alone, and on runs' images where they are given.
"""

import importlib
import shutil
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from experiments.report import html
from experiments.report.across_runs import across_runs
from experiments.report.compared_cases import FOLDER as COMPARED
from experiments.report.previews import decoding_table
from experiments.report.publish import PICTURE, SUFFIXES, is_drawn_again
from experiments.report.run_data import slug
from experiments.report.sentences import counted
from experiments.report.site import experiment_pages, front_page, map_pages, sampler_pages
from experiments.report.site.cases import CaseSet, size_of, write_cases
from experiments.report.site.citation import FILE as CITATION
from experiments.report.site.citation import read_citation
from experiments.report.site.map_pages import map_names
from experiments.report.site.map_thumbnails import write_thumbnails
from experiments.report.site.publications import (
    Publication,
    all_leagues,
    all_looks,
    publications,
    ranking_runs,
)
from experiments.report.site.questions import PRODUCTION
from experiments.report.site.ranking_data import entry, script
from experiments.report.site.report_blocks import blocks
from experiments.report.template_pages import TEMPLATES, copy_assets, template_environment
from experiments.report.write import as_text
from experiments.run.experiment import ROOMS
from experiments.run.outputs import check_apart, mark, marked, renewed_folder
from experiments.run.record import RECORD, write_text
from metrics.registry import NEAR, metrics
from samplers import EnvlightError

HERE = Path(__file__).parent
MOST_BYTES = 60_000_000
"""What a site takes at most; pictures get what tables, plots and rows leave of it."""
MARK = "envlight-site.txt"
"""A file that lists what was made here, so that it may be replaced."""
RASTER = (".jpg", ".png")


def write_site(
    results: Path, folder: Path, runs: Path | None = None, maps: Sequence[Path] = ()
) -> Path:
    """Write the site of the published runs in `results` into `folder`; returns its index.html.

    runs : a folder of runs under their published names; where one has its images, pages compare
        them
    maps : folders with the runs' map files, of which pages show small pictures; embedded maps and
        Poly Haven's where they are need none

    An earlier site in `folder` is replaced at once, but for files that are not its own;
    EnvlightError where it holds something else, where
    nothing is published, and where the site would take more than 60 MB.
    """
    found = publications(results)
    own = _own_files(folder)
    check_apart(folder, [results, *([runs] if runs else []), *maps])
    with renewed_folder(folder, own) as place:
        site = _Site(place, found, {one.name: _copied(one.run.folder, place) for one in found})
        site.write_rows()
        copy_assets(html.ASSETS, place / "assets")
        copy_assets(HERE / "assets", place / "assets")
        thumbnails = write_thumbnails(map_names(found), place, maps)
        room = MOST_BYTES - size_of(place.rglob("*"))
        sets = write_cases(site.ranked, runs, place, site.looks, room * 9 // 10)
        index = site.write_pages(sets, thumbnails, results.resolve().parent / CITATION)
        used = size_of(place.rglob("*"))
        if used > MOST_BYTES:
            raise EnvlightError(
                f"{folder}: the site takes {used / 1e6:.0f} MB, more than {MOST_BYTES / 1e6:.0f}; "
                "publish fewer runs"
            )
        mark(place, MARK, "Made by envlight site, which replaces these files. Open index.html.")
    return folder / index.name


def _own_files(folder: Path) -> list[str] | None:
    """The files of the earlier site in a folder, all where it does not list them; EnvlightError
    where the folder holds something else."""
    if not folder.exists() or (folder.is_dir() and not any(folder.iterdir())):
        return []
    if not (folder / MARK).is_file():
        raise EnvlightError(
            f"{folder}: it holds something, but no site made here; give another folder"
        )
    return marked(folder, MARK)


def _copied(source: Path, site: Path) -> list[str]:
    """Copy what was published; returns relative paths.

    Plots that are there as SVG go as that alone; pictures to be compared are not among the files.
    """
    target, chosen = site / "files" / source.name, []
    for file in sorted(source.rglob("*")):
        inside = file.relative_to(source)
        wanted = file.suffix in SUFFIXES and not is_drawn_again(file)
        if file.is_file() and wanted and inside.parts[0] != COMPARED:
            chosen.append(inside.as_posix())
    for name in chosen:
        (target / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(source / name, target / name)
    return sorted(chosen, key=lambda name: (name != RECORD, Path(name).suffix, name))


class _Site:
    """Writes pages; what all of them share is found once. files : what was copied, by run"""

    def __init__(self, folder: Path, found: list[Publication], files: dict[str, list[str]]) -> None:
        self.folder, self.found, self.files = folder, found, files
        self.ranked = ranking_runs(found)
        self.looks, self.leagues = all_looks(found), all_leagues(found)
        self._environment = template_environment(HERE / "templates", TEMPLATES)

    def write_rows(self) -> None:
        """The rows that the ranking reads."""
        for one in self.ranked:
            write_text(self.folder / entry(one)["file"], script(one, self.looks, self.leagues))

    def write_pages(self, sets: list[CaseSet], thumbnails: dict[str, str], citation: Path) -> Path:
        """All pages; returns the first one. thumbnails : of maps; citation : a file, or nothing"""
        cases = [_case(one, page) for one in sets for page in one.pages]
        pictures = {
            name: [file for file in names if Path(file).suffix in RASTER]
            for name, names in self.files.items()
        }
        experiments = [experiment_pages.context(one, self.files[one.name]) for one in self.found]
        maps = map_pages.contexts(self.found, pictures, cases, thumbnails)
        montages = {name for name, names in pictures.items() if PICTURE in names}
        samplers = sampler_pages.contexts(self.ranked, self.looks, self.leagues, cases, montages)
        cited = read_citation(citation) if citation.is_file() else []
        self._share(len(maps), sets, bool(cited))
        for one in sets:
            for page in one.pages:
                file = f"{one.folder}/cases/{page.file}"
                self._write(file, "case.html", case=page, cases=one.pages)
        for context in experiments:
            own = [case for case in cases if case["run"] == context["name"]]
            file = f"experiments/{context['file']}"
            self._write(file, "experiment.html", experiment=context, compared=own)
        for context in maps:
            self._write(f"maps/{context['file']}", "one_map.html", map=context)
        for context in samplers:
            self._write(f"samplers/{context['file']}", "one_sampler.html", sampler=context)
        self._write("samplers.html", "samplers.html", samplers=samplers)
        self._write("maps.html", "maps.html", classes=_grouped(maps))
        runs = [one.run for one in self.found]
        orders = "\n\n".join(map(as_text, across_runs(runs)))
        rooms = _rooms(self.found, experiments)
        self._write(
            "experiments.html", "experiments.html", rooms=rooms, orders=blocks(orders, set())
        )
        self._write("downloads.html", "downloads.html", experiments=experiments)
        if cited:
            shutil.copyfile(citation, self.folder / CITATION)
            self._write("cite.html", "cite.html", sources=cited)
        front = front_page.context(self.found, self.ranked)
        return self._write("index.html", "front.html", **front)

    def _share(self, maps: int, sets: list[CaseSet], cited: bool) -> None:
        """Tell all pages what they share."""
        production = (one.name for one in self.found if one.experiment.name == PRODUCTION)
        self._environment.globals.update(
            near=f"{NEAR:g}",
            labels={metric.name: metric.label for metric in metrics()},
            decoding=" ".join(f"{value:g}" for value in decoding_table()),
            about=front_page.about(self.found, maps),
            cited=cited,
            without_pictures=_pictures_said(sets),
            production=next((f"experiments/{slug(name)}.html" for name in production), ""),
        )

    def _write(self, name: str, template: str, **context: Any) -> Path:
        text = self._environment.get_template(template).render(
            root="../" * name.count("/"), page=name, **context
        )
        write_text(self.folder / name, text)
        return self.folder / name


def _case(one: CaseSet, page: Any) -> dict[str, Any]:
    """A page that compares images, as others link to it."""
    return {
        "run": one.name, "title": page.title, "environment": page.environment,
        "file": f"{one.folder}/cases/{page.file}",
        "thumbnail": f"{one.folder}/{page.thumbnail}", "size": page.size,
        "samplers": [method.label for methods in page.budgets.values() for method in methods],
    }  # fmt: skip


def _pictures_said(sets: Sequence[CaseSet]) -> str:
    """Which images can be compared, or that none can."""
    if not sets:
        return (
            "No images to be compared were published or given to this site; the pictures that were "
            "published stand with their runs."
        )
    skipped = sum(one.skipped for one in sets)
    shown = sum(len(one.pages) for one in sets)
    names = ", ".join(one.name for one in sets)
    more = f"; {counted(skipped, 'case')} more had no room" if skipped else ""
    return f"Images of {counted(shown, 'case')} can be compared, of {names}{more}."


def _grouped(maps: Iterable[dict[str, Any]]) -> dict[str, list[dict[str, Any]]]:
    groups: dict[str, list[dict[str, Any]]] = {}
    for one in maps:
        groups.setdefault(one["class"], []).append(one)
    return groups


def _rooms(
    found: Sequence[Publication], contexts: Sequence[dict[str, Any]]
) -> list[dict[str, Any]]:
    """The published runs under what their room says of itself, in the order of the rooms."""
    by_room: dict[str, list[dict[str, Any]]] = {}
    for one, context in zip(found, contexts, strict=True):
        by_room.setdefault(one.room, []).append(context)
    return [
        {
            "title": (importlib.import_module(f"experiments.{room}").__doc__ or room).strip(" .\n"),
            "experiments": by_room[room],
        }
        for room in ROOMS
        if room in by_room
    ]
