"""Questions that readers bring, each answered by rows: sentences, a table, and where to see more.

Which run answers is decided by what it holds, not by its name, and stands beside the answer. A
question that no run can answer is left out.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from urllib.parse import urlencode

from experiments.report.pages.names import slug
from experiments.report.pages.reported import Reported, of_class
from experiments.report.rankings import Ranking, results
from experiments.report.sentences import against, counted, listed, separates, verdict
from experiments.run.budget import Budget, opening_budget, sorted_budgets
from metrics.registry import leading_metric

NIGHT, LIGHTS = "night", "lights=16"
OURS, OTHER = "ours", "median-cut"
COMPENSATED = (("mis-compensated", "mis"), ("pbrt-v4", "pbrt-v4[compensation=False]"))
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
    makers = (
        _in_the_same_time(ranked), _best(ranked), _at_night(ranked), _ahead(ranked),
        _compensation(ranked), _latex(found), _elsewhere(found),
    )  # fmt: skip
    return [question for maker in makers for question in maker]


def view(one: Reported, budget: str, metric: str, to: str = "", group: str = "") -> str:
    """The address of the ranking with what is chosen there."""
    chosen = {"run": one.name, "budget": budget, "metric": metric, "to": to, "class": group}
    words = urlencode({name: value for name, value in chosen.items() if value}, safe="=")
    return f"index.html#{words}"


def _firsts(rankings: Sequence[Ranking]) -> tuple[tuple[str, str], ...]:
    """Who is first by each metric; nothing where a test separates nobody."""
    if not all(one.maps and separates(one) for one in rankings):
        return ()
    return tuple((one.metric.label, listed(one.leaders)) for one in rankings)


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
    if not ranked:
        return
    one = ranked[0]
    budget = opening_budget([result.budget for result in one.results])
    yield _ranked("which-is-best", f"Which sampler is best at {in_words(budget)}?", one, budget)


def _in_the_same_time(ranked: Sequence[Reported]) -> Iterator[Question]:
    """Of the run of the largest images that gives all the same time, at its shortest."""
    able = [one for one in ranked if timed_budgets(one)]
    if not able:
        return
    one = max(able, key=lambda one: (one.size, one.coverage, len(one.run.rows)))
    budget = timed_budgets(one)[0]
    text = f"Which sampler is best in the same time, {in_words(budget)}?"
    yield _ranked("same-time", text, one, budget)


def timed_budgets(one: Reported) -> list[str]:
    """Its budgets of seconds, the shortest first."""
    budgets = sorted_budgets(list(one.run.rows["budget"].unique()))
    return [budget for budget in budgets if Budget.parse(budget).timed]


def _kinds(one: Reported) -> set[str]:
    """The kinds of its budgets."""
    return {Budget.parse(budget).kind for budget in one.run.rows["budget"].unique()}


def _one_of_each_kind(budgets: list[str]) -> list[str]:
    """The budget that a run opens with, and the smallest of every other kind."""
    first = {Budget.parse(budget).kind: budget for budget in reversed(budgets)}
    opening = opening_budget(budgets)
    return sorted_budgets(list((first | {Budget.parse(opening).kind: opening}).values()))


def in_words(budget: str) -> str:
    """A budget as one says it."""
    return Budget.parse(budget).in_words


def _at_night(ranked: Sequence[Reported]) -> Iterator[Question]:
    def maps(one: Reported) -> int:
        return sum(group == NIGHT for group in one.classes.values())

    able = [one for one in ranked if maps(one) and LIGHTS in set(one.run.rows["budget"])]
    if not able:
        return
    one = max(able, key=lambda one: (one.pixels, maps(one), one.run.rows["sampler"].nunique()))
    rows = of_class(one.run.at(LIGHTS), one.classes, NIGHT)
    (result,) = results(rows)
    names = ", ".join(sorted(name for name, group in one.classes.items() if group == NIGHT))
    yield Question(
        "night", f"And for a night street, at {in_words(LIGHTS)}?",
        (*tuple(map(verdict, result.rankings)), f"The maps of this class: {names}."),
        _firsts(result.rankings),
        links=(
            (view(one, LIGHTS, leading_metric().name, group=NIGHT),
             f"The ranking over these maps ({measured_on(one)})"),
        ),
    )  # fmt: skip


def _ahead(ranked: Sequence[Reported]) -> Iterator[Question]:
    able = _with_both(ranked, OURS, OTHER)
    if not able:
        return
    one = max(able, key=lambda one: len(_kinds(one)))  # the first of several
    shown = _one_of_each_kind([result.budget for result in one.results])
    yield Question(
        "ours-and-median-cut", f"How far is {OURS} ahead of {OTHER}, and how surely?",
        tuple(sentence for budget in shown for sentence in _told(one, budget, OURS, OTHER)),
        links=tuple(
            (view(one, budget, leading_metric().name, OTHER),
             f"All samplers against {OTHER} at {in_words(budget)} ({measured_on(one)})")
            for budget in shown
        ),
    )  # fmt: skip


def _compensation(ranked: Sequence[Reported]) -> Iterator[Question]:
    sentences: list[str] = []
    links: list[tuple[str, str]] = []
    for sampler, other in COMPENSATED:
        able = _with_both(ranked, sampler, other)
        if able:
            one = max(able, key=lambda one: (len(one.classes), one.size))
            budget = opening_budget([result.budget for result in one.results])
            sentences += _told(one, budget, sampler, other)
            address = view(one, budget, leading_metric().name, other)
            links.append((address, f"{sampler} against {other} ({measured_on(one)})"))
    if sentences:
        yield Question(
            "compensation", "What is pbrt-v4's compensation worth?", tuple(sentences),
            links=tuple(links),
        )  # fmt: skip


def _with_both(ranked: Sequence[Reported], sampler: str, other: str) -> list[Reported]:
    return [one for one in ranked if {sampler, other} <= set(one.run.rows["sampler"])]


def _told(one: Reported, budget: str, sampler: str, other: str) -> Iterator[str]:
    """How a sampler compares with another by each metric, where both were measured."""
    for ranking in one.at(budget).rankings:
        if ranking.maps and {sampler, other} <= set(ranking.samplers):
            places = map(ranking.samplers.index, (sampler, other))
            name, maps = ranking.metric.label, counted(ranking.maps, "map")
            yield (
                f"At {in_words(budget)}, {sampler} against {other} by {name} over {maps}: "
                f"{against(ranking, *places)}."
            )


def _latex(found: Sequence[Reported]) -> Iterator[Question]:
    able = [one for one in found if one.experiment.name == TABLE1]
    if not able:
        return
    able.sort(key=lambda one: (-len(one.run.rows), one.name))
    yield Question(
        "latex-of-table-1", "Where is the LaTeX of Table 1?",
        ("Every experiment's page ends with its tables as LaTeX, to copy or to download.",),
        links=tuple(
            (f"experiments/{slug(one.name)}.html#latex-summary", f"{measured_on(one)}")
            for one in able
        ),
    )  # fmt: skip


def _elsewhere(found: Sequence[Reported]) -> Iterator[Question]:
    """What an experiment's own page answers."""
    known = (
        (CONVERGENCE, "time", "What does another millisecond, or another ray, buy?"),
        (PRODUCTION, "production", "And the renderer that I use?"),
    )
    for name, anchor, text in known:
        able = [one for one in found if one.experiment.name == name]
        if able:
            links = tuple(
                (f"experiments/{slug(one.name)}.html", f"{one.title} ({one.name})") for one in able
            )
            yield Question(
                anchor,
                text,
                able[0].findings[:MOST_FINDINGS] or (able[0].experiment.summary,),
                links=links,
            )
