"""What published runs say together: do papers' tables come out, and do orders hold elsewhere?

Each table and figure of a paper has a verdict, which the experiment that makes it gives.

Whether an order holds on other maps, scenes or in other image sizes: two selections of rows at one
budget stand side by side, which differ in one of these. Mean ranks of the methods that both have
are compared.
"""

import importlib
import re
from collections.abc import Callable, Iterator, Sequence
from itertools import combinations, product
from pathlib import Path

import pandas as pd

from experiments.report.parts import Heading, Part, Table, Text
from experiments.report.sections.ranks import LEAST_FOR_ORDER
from experiments.report.style import label_of
from experiments.report.suite import together
from experiments.report.summary import both_errors, compared
from experiments.run.budget import Budget
from experiments.run.experiment import GridExperiment
from experiments.run.loaded_run import REPORT, Run
from experiments.run.registry import ROOMS, experiments_in, find_experiment
from metrics.ranking import mean_ranks
from metrics.registry import Metric, ranked_metrics

KINDS = ("Table", "Fig.", "§")
"""In which order what a paper has is told."""
ELSEWHERE = {
    "between": "s", "metric": "s", "runs": "d", "compared": "d", "median": ".2f", "least": ".2f",
    "of": "s", "same_first": "d", "moved": "s",
}  # fmt: skip
ELSEWHERE_HEADINGS = {
    "runs": "pairs of runs", "compared": "orders compared", "median": "median Spearman",
    "least": "least", "of": "of the runs", "same_first": "same first", "moved": "moves most",
}  # fmt: skip
Selections = Iterator[tuple[pd.DataFrame, pd.DataFrame]]


def openings(runs: Sequence[Run]) -> Iterator[tuple[Run, list[Part]]]:
    """What experiments want said first, each of its run with the largest images."""
    for name, run in sorted(largest_of(runs).items()):
        found = find_experiment(name)
        if isinstance(found, GridExperiment) and found.opening is not None:
            yield run, list(found.opening(run))


def across_runs(runs: Sequence[Run]) -> Iterator[Part]:
    """Sentences and tables under headings of their own."""
    for _, parts in openings(runs):
        yield from parts
    yield from elsewhere(runs)


def largest_of(runs: Sequence[Run]) -> dict[str, Run]:
    """Of each experiment the run with the largest images."""
    by_width = sorted(runs, key=lambda run: run.record.get("scale", {}).get("width", 0))
    return {run.record["experiment"]: run for run in by_width}


def link_to(run: Run, folder: Path) -> str:
    """A link to the report of a run that stands in the folder of all, as Markdown."""
    place = run.folder.relative_to(folder).as_posix()
    return f"[{run.folder.name}]({place}/{REPORT})"


def figures_of_papers(runs: Sequence[Run], folder: Path) -> Iterator[str]:
    """A line for each table and figure of the papers: the verdict and why, command and report."""
    largest = largest_of(runs)
    for room in ROOMS:
        module = importlib.import_module(f"experiments.{room}")
        paper = getattr(module, "PAPER", "")
        if not paper:
            continue
        lines = {
            number: f"{shows}: **not made**. {_sentence(why)}"
            for number, (shows, why) in getattr(module, "NOT_MADE", {}).items()
        }
        for name in experiments_in(room):
            for one in find_experiment(name).figures:
                told = f"{one.shows}: **not measured here**. `envlight run {name}`"
                if run := largest.get(name):
                    words, why = one.told(run)
                    told = f"{one.shows}: **{words}**. {_sentence(why)} `envlight run {name}`, "
                    told += link_to(run, folder)
                lines[one.number] = told
        for number in sorted(lines, key=_place):
            yield f"{paper}, {number}: {lines[number]}"


def _sentence(words: str) -> str:
    return f"{words[:1].upper()}{words[1:].rstrip('.')}."


def _place(number: str) -> tuple[int, float]:
    """Where a table or figure stands among those of its paper."""
    kind = next(place for place, kind in enumerate(KINDS) if number.startswith(kind))
    return kind, float(re.findall(r"[\d.]*\d", number)[0])


def both_ranks(rows: pd.DataFrame, others: pd.DataFrame, metric: Metric) -> pd.DataFrame | None:
    """Mean ranks by one metric of the methods that two selections of rows share, methods × (rows,
    others); None where these are too few, or one selection has no order.
    """
    if metric.name not in rows or metric.name not in others:
        return None
    samplers = sorted(set(rows["sampler"]) & set(others["sampler"]))
    if len(samplers) < LEAST_FOR_ORDER:
        return None
    found = [mean_ranks(both_errors(part, metric, samplers)[1]) for part in (rows, others)]
    told = all(len(set(one)) > 1 for one in found)
    return pd.DataFrame(dict(enumerate(found)), samplers) if told else None


def elsewhere(runs: Sequence[Run]) -> Iterator[Part]:
    """The heading, a sentence and the table; nothing where nothing can be compared."""
    grids = [one for run in runs for one in together(run) if "planned" in one.record]
    lines = [line for between in SELECTIONS for line in _lines(between, grids)]
    if lines:
        yield Heading("The same on other maps, scenes and image sizes")
        yield Text(
            "Mean ranks of the methods that two selections of measurements share, at the same "
            "budget, where the two differ in one thing: Spearman's correlation of the two orders, "
            "how often the same method is first, and the method that moves most, with its two mean "
            "ranks."
        )
        yield Table("elsewhere", pd.DataFrame(lines), ELSEWHERE, ELSEWHERE_HEADINGS)


def _lines(between: str, grids: Sequence[Run]) -> Iterator[dict[str, object]]:
    """A line per metric."""
    pairs = [(run, run) for run in grids] + list(combinations(grids, 2))
    selected = [
        (", ".join(dict.fromkeys(run.folder.name for run in (one, two))), selection)
        for one, two in pairs
        for budget in one.budgets
        if budget in two.budgets
        for selection in SELECTIONS[between](one, two, budget)
    ]
    for metric in ranked_metrics():
        tried = [(names, both_ranks(*selection, metric)) for names, selection in selected]
        if found := [(names, ranks) for names, ranks in tried if ranks is not None]:
            spearman = pd.Series([ranks[0].corr(ranks[1], "spearman") for _, ranks in found])
            same = [(ranks == ranks.min()).all(axis=1).any() for _, ranks in found]
            moves = pd.concat([ranks for _, ranks in found])
            place = int((moves[1] - moves[0]).abs().argmax())
            yield {
                "between": between,
                "metric": metric.label,
                "runs": len({names for names, _ in found}),
                "compared": len(found),
                "median": spearman.median(),
                "least": spearman.min(),
                "of": found[int(spearman.argmin())][0],
                "same_first": int(sum(same)),
                "moved": "{} ({:.1f}, {:.1f})".format(
                    label_of(moves.index[place]), *moves.iloc[place]
                ),
            }


def _other_maps(one: Run, two: Run, budget: str) -> Selections:
    """Of two runs that share no map, what they have on the scenes that both have."""
    apart = set(one.rows["environment"]).isdisjoint(two.rows["environment"])
    if apart and one.image_size == two.image_size:
        yield _shared(one.at(budget), two.at(budget), "scene")


def _other_scenes(one: Run, two: Run, budget: str) -> Selections:
    """Of each two scenes of a run, or of two runs of one experiment that share no scene."""
    scenes, others = (sorted(set(run.rows["scene"])) for run in (one, two))
    alike = [(run.record["experiment"], run.image_size) for run in (one, two)]
    if one is not two and not (set(scenes).isdisjoint(others) and alike[0] == alike[1]):
        return
    here, there = one.at(budget), two.at(budget)
    for scene, other in combinations(scenes, 2) if one is two else product(scenes, others):
        yield _shared(here[here["scene"] == scene], there[there["scene"] == other], "environment")


def _other_sizes(one: Run, two: Run, budget: str) -> Selections:
    """Of two runs with images of two sizes, cases and methods that both have, the smaller first.

    A budget of seconds is left out: it allows fewer lights in a larger image.
    """
    if one.image_size == two.image_size or Budget.parse(budget).timed:
        return
    small, large = sorted((one, two), key=lambda run: run.size)
    rows, others = small.at(budget), large.at(budget)
    for name in ("sampler", "scene", "environment"):
        common = set(rows[name]) & set(others[name])
        rows, others = rows[rows[name].isin(common)], others[others[name].isin(common)]
    mine, theirs = compared(rows), compared(others)
    case = ["scene", "environment"]
    cases = mine[case].merge(theirs[case]).drop_duplicates()
    yield mine.merge(cases), theirs.merge(cases)


def _shared(
    rows: pd.DataFrame, others: pd.DataFrame, name: str
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """What can be compared of both, on the scenes or the maps that both have."""
    common = set(rows[name]) & set(others[name])
    mine, theirs = (compared(part[part[name].isin(common)]) for part in (rows, others))
    common = set(mine[name]) & set(theirs[name])
    return mine[mine[name].isin(common)], theirs[theirs[name].isin(common)]


SELECTIONS: dict[str, Callable[[Run, Run, str], Selections]] = {
    "maps": _other_maps,
    "scenes": _other_scenes,
    "image sizes": _other_sizes,
}
"""By what the two differ in, the selections of two runs at a budget; a run may be both."""
