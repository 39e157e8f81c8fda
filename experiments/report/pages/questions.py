"""Questions that readers bring, each answered by rows: sentences, a table, and where to see more.

Which run answers is decided by what it holds, not by its name, and stands beside the answer. A
question that no run can answer is left out.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from urllib.parse import urlencode

from experiments.report.pages.names import slug
from experiments.report.pages.reported import Reported
from experiments.report.rankings import Ranking
from experiments.report.sentences import listed, separates, verdict
from experiments.run.budget import Budget, opening_budget, sorted_budgets
from metrics.registry import leading_metric

NIGHT = "night"
DUELS = (
    ("ours", "median-cut"), ("mis-compensated", "mis"), ("pbrt-v4", "pbrt-v4[compensation=False]"),
)  # fmt: skip
"""Samplers that readers ask to see side by side."""
MOST_FINDINGS = 2
"""Sentences of an experiment that stand on the first page."""
TABLE1, PRODUCTION, CONVERGENCE = "table1", "production-renderers", "convergence"


@dataclass(frozen=True, eq=False)
class Question:
    """A question with its answer.

    anchor : its place on the first page
    sentences : the answer; those that `firsts` go with come first
    firsts : who is first, by the metrics' labels
    links : addresses from the first page on and what they are called
    """

    anchor: str
    text: str
    sentences: tuple[str, ...]
    firsts: tuple[tuple[str, str], ...] = ()
    links: tuple[tuple[str, str], ...] = ()


def questions(found: Sequence[Reported], ranked: Sequence[Reported]) -> list[Question]:
    """Those that the published runs answer.

    ranked : the runs that rank samplers, the main one first
    """
    return [*_in_the_same_time(ranked), *_best(ranked), *_elsewhere(found), *_views(found, ranked)]


def view(one: Reported, budget: str, metric: str, to: str = "", group: str = "") -> str:
    """The address of the ranking with what is chosen there."""
    chosen = {"run": one.name, "budget": budget, "metric": metric, "to": to, "class": group}
    words = urlencode({name: value for name, value in chosen.items() if value}, safe="=")
    return f"index.html#{words}"


def _firsts(rankings: Sequence[Ranking]) -> tuple[tuple[str, str], ...]:
    """Who is first by each metric, or ties for it; nothing where a test separates nobody."""
    if not all(one.maps and separates(one) for one in rankings):
        return ()
    return tuple((one.metric.label, listed(one.tied)) for one in rankings)


def measured_on(one: Reported) -> str:
    """Where a sentence comes from, in brackets."""
    width, height = one.size
    return f"{one.name}, {width}×{height} pixels"


def _ranked(anchor: str, text: str, one: Reported, budget: str) -> Question:
    """The question that a run's ranking at a budget answers."""
    rankings = one.at(budget).rankings
    where = view(one, budget, leading_metric().name), f"The ranking ({measured_on(one)})"
    return Question(anchor, text, tuple(map(verdict, rankings)), _firsts(rankings), links=(where,))


def _best(ranked: Sequence[Reported]) -> Iterator[Question]:
    if ranked:
        budget = _opening(ranked[0])
        text = f"Which sampler is best at {Budget.parse(budget).in_words}?"
        yield _ranked("which-is-best", text, ranked[0], budget)


def _opening(one: Reported) -> str:
    return opening_budget([result.budget for result in one.results])


def _in_the_same_time(ranked: Sequence[Reported]) -> Iterator[Question]:
    """Of the run of the largest images that gives all the same time, at its shortest."""
    able = [one for one in ranked if timed_budgets(one)]
    if not able:
        return
    one = max(able, key=lambda one: (one.size, one.coverage, len(one.run.rows)))
    budget = timed_budgets(one)[0]
    text = f"Which sampler is best in the same time, {Budget.parse(budget).in_words}?"
    yield _ranked("same-time", text, one, budget)


def timed_budgets(one: Reported) -> list[str]:
    """Its budgets of seconds, the shortest first."""
    budgets = sorted_budgets(list(one.run.rows["budget"].unique()))
    return [budget for budget in budgets if Budget.parse(budget).timed]


def _elsewhere(found: Sequence[Reported]) -> Iterator[Question]:
    """What an experiment's own page answers."""
    known = (
        (CONVERGENCE, "time", "What does another millisecond, or another ray, buy?"),
        (PRODUCTION, "production", "And the renderer that I use?"),
    )
    for name, anchor, text in known:
        able = [one for one in found if one.experiment.name == name]
        if able:
            said = able[0].findings[:MOST_FINDINGS] or (able[0].experiment.summary,)
            pages = [(one, f"experiments/{slug(one.name)}.html") for one in able]
            links = tuple((page, f"{one.title} ({one.name})") for one, page in pages)
            yield Question(anchor, text, said, links=links)


def _views(found: Sequence[Reported], ranked: Sequence[Reported]) -> Iterator[Question]:
    """Other rankings that readers ask for, as links that choose them."""
    lead, links = leading_metric().name, []
    for one in [one for one in ranked if NIGHT in one.classes.values()][:1]:
        links.append((view(one, _opening(one), lead, group=NIGHT), f"Night ({measured_on(one)})"))
    for sampler, other in DUELS:
        able = [one for one in ranked if {sampler, other} <= set(one.run.rows["sampler"])]
        for one in able[:1]:
            words = f"{sampler} against {other} ({measured_on(one)})"
            links.append((view(one, _opening(one), lead, other), words))
    tables = [one for one in found if one.experiment.name == TABLE1]
    for one in sorted(tables, key=lambda one: (-len(one.run.rows), one.name)):
        address = f"experiments/{slug(one.name)}.html#latex-summary"
        links.append((address, f"LaTeX of Table 1 ({measured_on(one)})"))
    if links:
        yield Question("views", "Other views of the rows", (), links=tuple(links))
