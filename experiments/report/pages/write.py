"""The one writer of pages, of one run or of many: a folder that opens from disk, without a network.

`index.html` answers first: who is best, in which rows, and the questions that readers bring; a page
per case, map, sampler and run follows, with tables, plots and rows to download. What is written
depends on the runs' folders alone. Pictures, lights and statistics are made on all cores; what the
pages had before and is still so is not made again.
"""

import shutil
import sys
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import Executor, Future
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from experiments.progress import Told, telling
from experiments.report.across_runs import elsewhere, openings
from experiments.report.pages import experiment_pages, subjects
from experiments.report.pages.cases import FOLDER as COMPARED
from experiments.report.pages.cases import (
    WIDTH,
    Case,
    case_of,
    cases_in_order,
    of_case,
    published_cases,
)
from experiments.report.pages.markdown import as_html, heading_html, inline, quoted, slug
from experiments.report.pages.pictures import (
    ERRORS,
    PREVIEWS,
    Pictures,
    case_pictures,
    decoding_table,
)
from experiments.report.pages.ranking import script
from experiments.report.pages.reported import (
    Reported,
    all_leagues,
    all_looks,
    at_hand,
    published,
    ranking_runs,
)
from experiments.report.parts import Part
from experiments.report.publish import SUFFIXES, is_drawn_again, light_files
from experiments.report.rankings import BudgetResult, results
from experiments.report.style import label_of
from experiments.report.write import as_text, write_report
from experiments.run.budget import opening_budget
from experiments.run.executors import ProcessExecutor, SerialExecutor
from experiments.run.experiment import findings_of
from experiments.run.loaded_run import RECORD, REPORT, ROWS, Run, write_text
from experiments.run.outputs import check_apart, mark, marked, renewed_folder
from experiments.run.registry import find_experiment
from experiments.run.sampler_spec import family_of
from experiments.run.store import is_run_folder
from metrics.registry import NEAR
from samplers import EnvlightError, sampler_class, sampler_names
from samplers.reference import Reference
from samplers.threads import core_count

HERE = Path(__file__).parent
CITATION = "CITATION.cff"
MOST_BYTES = 60_000_000
"""What a site takes at most; pictures get what tables, plots and rows leave of it."""
MARK = "envlight-site.txt"
"""A file that lists what was made here, so that it may be replaced."""
MOST_COLUMNS = 2048
MOST_SHOWN = 6
"""Cases on the first page of a site."""
WORKERS = core_count()
TOGETHER = 16
"""Cases of which pictures are made before it is asked whether there is room for more."""


@dataclass(frozen=True)
class Wanted:
    """What pages are to have.

    width : images that are wider are shown reduced to so many columns; 0: none are compared
    maps : folders or files in which map files are looked for
    every : whether every case and budget has a page, with links to the run's images; else those
        with images at the opening budget, as far as there is room
    room : bytes that all may take
    """

    width: int = MOST_COLUMNS
    maps: Sequence[Path] = ()
    every: bool = False
    room: int = sys.maxsize


def write_report_pages(folder: Path, images: bool = True, maps: Sequence[Path] = ()) -> Path:
    """Write the pages of a run into its folder `report`; returns their index.html.

    Its report is written, too, where the one there is not of its newest rows. EnvlightError where
    the run has no result.

    images : whether pages compare them
    maps : folders or files in which map files are looked for
    """
    wanted = Wanted(MOST_COLUMNS if images else 0, maps, every=True)
    one, target = at_hand(folder), folder / "report"
    own = marked(target, MARK) if (target / MARK).is_file() else []
    with renewed_folder(target, own) as place:
        pages = _Pages([one], {one.name: one}, place, target, wanted)
        pages.write(None)
        mark(place, MARK, "Made by envlight report, which replaces these files. Open index.html.")
    return target / "index.html"


def write_site(
    results: Path, folder: Path, runs: Path | None = None, maps: Sequence[Path] = ()
) -> Path:
    """Write the pages of the published runs in `results` into `folder`; returns their index.html.

    runs : a folder of runs under their published names; where one has its images, pages compare
        them
    maps : folders with the runs' map files, of which pages show small pictures; embedded maps and
        Poly Haven's where they are need none

    An earlier site in `folder` is replaced at once, but for files that are not its own;
    EnvlightError where it holds something else, where nothing is published, and where the site
    would take more than 60 MB.
    """
    found = published(results)
    own = _own_files(folder)
    check_apart(folder, [results, *([runs] if runs else []), *maps])
    there = {
        one.name: at_hand(runs / one.name)
        for one in found
        if runs is not None and one.is_grid and is_run_folder(runs / one.name)
    }
    with renewed_folder(folder, own) as place:
        wanted = Wanted(WIDTH, maps, room=MOST_BYTES)
        pages = _Pages(found, there, place, folder, wanted)
        pages.write(results.resolve().parent / CITATION)
        if size_of(place) > MOST_BYTES:
            raise EnvlightError(
                f"{folder}: the site takes {size_of(place) / 1e6:.0f} MB, more than "
                f"{MOST_BYTES / 1e6:.0f}; publish fewer runs"
            )
        mark(place, MARK, "Made by envlight site, which replaces these files. Open index.html.")
    return folder / "index.html"


def _own_files(folder: Path) -> list[str] | None:
    """The files of the earlier site in a folder, all where it does not list them; EnvlightError
    where the folder holds something else.
    """
    if not folder.exists() or (folder.is_dir() and not any(folder.iterdir())):
        return []
    if not (folder / MARK).is_file():
        raise EnvlightError(
            f"{folder}: it holds something, but no site made here; give another folder"
        )
    return marked(folder, MARK)


def size_of(folder: Path) -> int:
    """Bytes of the files in a folder."""
    return sum(file.stat().st_size for file in folder.rglob("*") if file.is_file())


class _Pages:
    """Writes pages; what all of them share is found once.

    there : runs whose store is at hand, by name
    old : the folder that `folder` is to replace
    """

    def __init__(
        self, found: list[Reported], there: dict[str, Reported], folder: Path, old: Path,
        wanted: Wanted,
    ) -> None:  # fmt: skip
        self.found, self.there = found, there
        self.folder, self.old, self.wanted = folder, old, wanted
        self.ranked = ranking_runs(found)
        self.looks, self.leagues = all_looks(found), all_leagues(found)
        self.files: dict[str, list[str]] = {}
        self._told = Told("pages")

    def write(self, citation: Path | None) -> None:
        """All pages. citation : a file, which need not be there"""
        with telling("pages") as self._told:
            with workers(WORKERS) as executor:
                found = self._found_out(executor)
            self._wait_for("writing them", ())
            self._write_pages(citation, *found)

    def _wait_for(self, what: str, futures: Sequence[Future]) -> None:
        """Wait for all, and tell how many are there."""
        self._told.working_on(f"pages: {what}")
        self._told.done, self._told.total = 0, len(futures)
        for future in futures:
            future.result()
            self._told.advance()

    def _found_out(self, executor: Executor) -> tuple[Any, ...]:
        """What takes long: cases with how many had no room, pictures of maps, and what the runs say
        together.
        """
        submit, wanted = executor.submit, self.wanted
        reports = [submit(_renewed_report, *one) for one in self._stale_reports()]
        sources = subjects.map_sources(subjects.map_classes(self.found), wanted.maps)
        together = submit(_together, [one.run for one in self.found] if len(self.found) > 1 else [])
        ranked = [submit(_results, one.run) for one in self.ranked]
        findings = [submit(_findings, one.experiment.name, one.run) for one in self.found
                    if not one.incomplete]  # fmt: skip
        pictures = {
            name: submit(subjects.write_thumbnail, name, source, self.folder)
            for name, source in sources.items()
        }
        self._wait_for("reports", reports)
        for one in self.found:
            self.files[one.name] = _copied(one, self.folder)
        self._wait_for("rankings", ranked)
        for one, future in zip(self.ranked, ranked, strict=True):
            one.results = future.result()
            rows = script(one, self.looks, self.leagues)
            write_text(self.folder / f"data/{slug(one.name)}.js", rows)
        shutil.copytree(HERE / "assets", self.folder / "assets")
        self._wait_for("findings", [*findings, together])
        for one in self.found:
            one.findings = () if one.incomplete else findings.pop(0).result()
        self._wait_for("pictures of maps", list(pictures.values()))
        cases, skipped = self._cases(executor)
        shown = {name: future.result() for name, future in pictures.items()}
        return cases, skipped, shown, *together.result()

    def _stale_reports(self) -> Iterator[tuple[str, Run]]:
        """Runs at work whose report is not of their newest rows; what was published stays."""
        for one in self.there.values():
            report, rows = one.run.folder / REPORT, one.run.folder / ROWS
            new = report.is_file() and rows.is_file()
            new = new and report.stat().st_mtime_ns >= rows.stat().st_mtime_ns
            new = new and len(one.run.rows) == len(Run.load(one.run.folder).rows)
            if one in self.found and not one.run.packed and not new:
                yield one.experiment.name, one.run

    def _cases(self, executor: Executor) -> tuple[dict[str, list[Case]], int]:
        """The cases that have pages, by run, and how many had no room."""
        # The pages of maps, samplers and experiments, made afterwards, take the other half.
        room = (self.wanted.room - size_of(self.folder)) // 2
        found: dict[str, list[Case]] = {}
        skipped = 0
        for one in self.found if self.wanted.every else self.ranked:
            if one.name not in self.there and (cases := published_cases(one.run)):
                place = self.folder / "runs" / one.name
                for name in (PREVIEWS, ERRORS):
                    shutil.copytree(one.run.folder / COMPARED / name, place / name)
                found[one.name] = cases
                room -= size_of(place)
        for one in self.there.values():
            if one.is_grid:
                cases, left = self._cases_of(one, executor, room)
                skipped += left
                if cases:
                    found[one.name] = cases
                    room -= size_of(self.folder / "runs" / one.name)
        return found, skipped

    def _cases_of(self, one: Reported, executor: Executor, room: int) -> tuple[list[Case], int]:
        """The cases of a run at hand, as many as fit into the room; and how many do not."""
        run, wanted, part = one.run, self.wanted, Path("runs") / one.name
        width = wanted.width
        if not wanted.every:
            run = replace(run, rows=run.at(opening_budget(run.rows["budget"])))
        parts = [of_case(run, *case) for case in cases_in_order(run.rows)]
        if not wanted.every:
            parts = [one for one in parts if _has_images(one)]
        place, old = self.folder / part, self.old / part
        made: list[Case] = []
        for begun in range(0, len(parts), TOGETHER):
            some = parts[begun : begun + TOGETHER]
            futures = [
                executor.submit(case_pictures, one, place, old, width, wanted.every)
                for one in (some if width else ())
            ]
            self._wait_for(f"pictures of cases, {begun} of {len(parts)} done", futures)
            results = [future.result() for future in futures] or [({}, [])] * len(some)
            for case, (pictures, wrong) in zip(some, results, strict=True):
                for sentence in wrong:
                    print(f"envlight: {sentence}; no picture has it", file=sys.stderr)
                files = [place / name for name in _names(pictures.values())]
                room -= sum(file.stat().st_size for file in files)
                if room >= 0:
                    made.append(case_of(case, pictures, wanted.width))
                for file in files if room < 0 else ():
                    file.unlink()
            if room < 0:
                break
        if not made:
            shutil.rmtree(place, ignore_errors=True)
        return sorted(made, key=lambda case: case.title), len(parts) - len(made)

    def _write_pages(
        self, citation: Path | None, cases: dict[str, list[Case]], skipped: int,
        pictures: dict[str, str], openings: list[tuple[str, str]], together: str,
    ) -> None:  # fmt: skip
        linked = [_linked(name, case) for name, many in cases.items() for case in many]
        runs = [
            experiment_pages.context(one, self.files[one.name], self.folder) for one in self.found
        ]
        maps = subjects.map_contexts(self.found, linked, pictures)
        grids = [*self.ranked, *(one for one in self.found if one not in self.ranked)]
        samplers = subjects.sampler_contexts(grids, self.looks, self.leagues, linked)
        cited = citation if citation and citation.is_file() else None
        self._begin(len(maps), cases, skipped, runs, bool(cited))
        for name, many in cases.items():
            for case in many:
                file = f"runs/{name}/cases/{case.file}"
                self._page(file, "case.html", case=case, cases=many, run=name)
        for context in runs:
            own = [case for case in linked if case["run"] == context["name"]]
            self._page(
                f"experiments/{context['file']}",
                "experiment.html",
                experiment=context,
                compared=own,
            )
        for context in maps:
            self._page(f"maps/{context['file']}", "map.html", map=context)
        for context in samplers:
            self._page(f"samplers/{context['file']}", "sampler.html", sampler=context)
        self._page("samplers.html", "samplers.html", samplers=samplers)
        classes: dict[str, list[dict[str, Any]]] = {}
        for one in maps:
            classes.setdefault(one["class"], []).append(one)
        self._page("maps.html", "maps.html", classes=classes)
        if len(self.found) > 1:
            rooms = experiment_pages.rooms(self.found, runs)
            self._page(
                "experiments.html", "experiments.html", rooms=rooms, orders=as_html(together).html
            )
        self._page("downloads.html", "downloads.html", experiments=runs)
        if cited:
            shutil.copyfile(cited, self.folder / CITATION)
            self._page("cite.html", "cite.html", sources=_references(self.looks))
        front = experiment_pages.front(self.found, self.ranked)
        shown = linked if self.wanted.every else _most_pixels(linked)
        first = [(as_html(text).html, f"experiments/{slug(name)}.html") for name, text in openings]
        self._page("index.html", "front.html", **front, openings=first, cases=shown)

    def _begin(
        self, maps: int, cases: dict[str, list[Case]], skipped: int, runs: list[dict[str, Any]],
        cited: bool,
    ) -> None:  # fmt: skip
        """The templates, what they can call, and what all pages share."""
        environment = Environment(
            loader=FileSystemLoader(HERE / "templates"), autoescape=True,
            undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True,
            keep_trailing_newline=True,
        )  # fmt: skip
        environment.filters |= {
            "url": quoted,
            "slug": slug,
            "inline": inline,
            "family": family_of,
            "labelled": label_of,
        }
        environment.globals |= experiment_pages.shared(self.found, maps) | {
            "near": f"{NEAR:g}",
            "heading": heading_html,
            "decoding": " ".join(f"{value:g}" for value in decoding_table()),
            "looks": self.looks,
            "links": experiment_pages.links(self.found, runs, cited),
            "several": len(self.found) > 1,
            "incomplete": self.found[0].incomplete if len(self.found) == 1 else "",
            "without_pictures": experiment_pages.pictures_said(cases, skipped),
        }
        self._environment = environment

    def _page(self, name: str, template: str, **context: Any) -> None:
        text = self._environment.get_template(template).render(
            root="../" * name.count("/"), page=name, **context
        )
        write_text(self.folder / name, text)


def _renewed_report(experiment: str, run: Run) -> None:
    write_report(find_experiment(experiment), run)


def _together(runs: list[Run]) -> tuple[list[tuple[str, str]], str]:
    """What some runs want said first, by name, and what all say together, in Markdown."""
    first = [(run.folder.name, _as_text(parts)) for run, parts in openings(runs)]
    return first, _as_text(elsewhere(runs))


def _as_text(parts: Iterable[Part]) -> str:
    return "\n\n".join(map(as_text, parts))


def _references(samplers: Iterable[str]) -> list[Reference]:
    """What the samplers are cited by, each once."""
    known = [name for name in sampler_names() if name in set(map(family_of, samplers))]
    return list(dict.fromkeys(one for name in known for one in sampler_class(name).references))


def _has_images(case: Run) -> bool:
    """Whether a case has its reference and an image."""
    rows = [row for _, row in case.rows.iterrows()]
    return case.kept_reference(rows[0]) is not None and any(map(case.kept_image, rows))


def _findings(experiment: str, run: Run) -> tuple[str, ...]:
    return findings_of(find_experiment(experiment), run)


def _results(run: Run) -> list[BudgetResult]:
    """The rankings of a run, with all their pairs."""
    found = results(run.rows)
    for result in found:
        for ranking in result.rankings:
            if ranking.maps:
                ranking.pairs  # noqa: B018  # is kept with it
    return found


def _copied(one: Reported, site: Path) -> list[str]:
    """Copy what is published of a run, or what its report is made of; returns relative paths.

    Plots that are there as SVG go as that alone where they are published; pictures to be compared
    are not among the files.
    """
    source, target = one.run.folder, site / "files" / one.name
    plots = not one.run.packed
    chosen = [
        file.relative_to(source)
        for file in light_files(source)
        if file.suffix in (*SUFFIXES, ".pdf") and (plots or not is_drawn_again(file))
    ]
    names = [name.as_posix() for name in chosen if name.parts[0] != COMPARED]
    for name in names:
        (target / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(source / name, target / name)
    return sorted(names, key=lambda name: (name != RECORD, Path(name).suffix, name))


def _names(pictures: Iterable[Pictures]) -> set[str]:
    """The files of pictures."""
    named = ((one.preview, one.thumbnail, *one.errors.values()) for one in pictures)
    return {name for names in named for name in names if name}


def _most_pixels(cases: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """The few that a site's first page shows: of the largest images, a case a map."""
    largest = max((case["size"] for case in cases), default=None)
    by_map = {case["environment"]: case for case in cases if case["size"] == largest}
    return list(by_map.values())[:MOST_SHOWN]


def _linked(run: str, case: Case) -> dict[str, Any]:
    """A page that compares images, as others link to it."""
    place, numbers = f"runs/{run}", case.numbers
    shown = numbers[opening_budget(list(numbers))]
    return {
        "run": run, "title": case.title, "environment": case.environment,
        "file": f"{place}/cases/{case.file}", "size": case.size, "samplers": case.samplers,
        "thumbnail": f"{place}/{case.thumbnail}" if case.thumbnail else "",
        "first": shown["sampler"].iloc[0],
    }  # fmt: skip


@contextmanager
def workers(count: int) -> Iterator[Executor]:
    """Processes with a thread each; for 1 this one, which works as it is asked."""
    if count == 1:
        yield SerialExecutor()
        return
    with ProcessExecutor(count, threads=1) as executor:
        yield executor
