"""Questions that readers bring besides which sampler is best, and where rows answer them.

Which run answers is decided by what it holds, not by its name, and stands beside the answer. A
question that no run can answer is left out.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from urllib.parse import urlencode

from experiments.report.pages.names import slug
from experiments.report.pages.reported import Reported
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
    sentences : the answer
    links : addresses from the first page on and what they are called
    """

    anchor: str
    text: str
    sentences: tuple[str, ...]
    links: tuple[tuple[str, str], ...] = ()


def questions(found: Sequence[Reported], ranked: Sequence[Reported]) -> list[Question]:
    """Those that the published runs answer.

    ranked : the runs that rank samplers, the main one first
    """
    return [*_elsewhere(found), *_views(found, ranked)]


def view(one: Reported, budget: str, metric: str, to: str = "", group: str = "") -> str:
    """The address of the ranking with what is chosen there."""
    chosen = {"run": one.name, "budget": budget, "metric": metric, "to": to, "class": group}
    words = urlencode({name: value for name, value in chosen.items() if value}, safe="=")
    return f"index.html#{words}"


def _measured_on(one: Reported) -> str:
    """Where rows come from, in brackets."""
    width, height = one.size
    return f"({one.name}, {width}×{height} pixels)"


def _opening(one: Reported) -> str:
    return opening_budget([result.budget for result in one.results])


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
    if ranked:
        budget = _opening(ranked[0])
        words = f"All samplers at {Budget.parse(budget).in_words} {_measured_on(ranked[0])}"
        links.append((view(ranked[0], budget, lead), words))
    night = next((one for one in ranked if NIGHT in one.classes.values()), None)
    if night:
        address = view(night, _opening(night), lead, group=NIGHT)
        links.append((address, f"Night {_measured_on(night)}"))
    for sampler, other in DUELS:
        both = (one for one in ranked if {sampler, other} <= set(one.run.rows["sampler"]))
        if one := next(both, None):
            words = f"{sampler} against {other} {_measured_on(one)}"
            links.append((view(one, _opening(one), lead, other), words))
    tables = [one for one in found if one.experiment.name == TABLE1]
    links += [
        (
            f"experiments/{slug(one.name)}.html#latex-summary",
            f"LaTeX of Table 1 {_measured_on(one)}",
        )
        for one in sorted(tables, key=lambda one: (-len(one.run.rows), one.name))
    ]
    if links:
        yield Question("views", "Other views of the rows", (), links=tuple(links))
