"""What the first page says: winners, margins, losses, plots, and how it was all measured."""

from collections.abc import Iterable
from dataclasses import dataclass

from experiments.report.case_pages import CasePage
from experiments.report.links import slug
from experiments.report.palette import Look
from experiments.report.parts import Part, Table, Text
from experiments.report.plots import CAPTIONS
from experiments.report.previews import decoding_table
from experiments.report.ranking_table import RankingTable, ranking_table
from experiments.report.rankings import BudgetResult
from experiments.report.run_data import RunData
from experiments.report.sections.ranks import KEY, beside_paper, ranked_table
from experiments.report.tables import text_of
from experiments.run.experiment import Published
from metrics.registry import NEAR, find_metric, leading_metric, ranked_metrics

BUSY = 1.25
"""A load above this many times the cores at the start makes times doubtful."""
WIDE = "rank"
"""The kind of plot that has the page's whole width."""


@dataclass(frozen=True)
class TextTable:
    """A table as text: headings and rows."""

    headings: list[str]
    rows: list[list[str]]


@dataclass(frozen=True)
class Figure:
    """A plot's kind, the stem of its files, and what is said below it."""

    kind: str
    stem: str
    caption: str

    @property
    def wide(self) -> bool:
        return self.kind == WIDE


@dataclass(frozen=True)
class BudgetView:
    """tables : a ranking by each metric; numbers : the report's table

    paper : what a paper printed, as paragraphs and tables
    """

    name: str
    anchor: str
    maps: int
    tables: list[RankingTable]
    numbers: TextTable
    paper: list[str | TextTable]
    figures: list[Figure]


@dataclass(frozen=True)
class IndexPage:
    """winners : the sampler of least error in a case, by its file; leading : by this metric"""

    budgets: list[BudgetView]
    figures: list[Figure]
    facts: dict[str, str]
    versions: dict[str, str]
    notes: list[str]
    summary: str
    winners: dict[str, str]
    leading: str
    key: str
    decoding: str


def context(
    data: RunData,
    found: list[BudgetResult],
    looks: dict[str, Look],
    figures: dict[str, dict[tuple[str, str], str]],
    cases: list[CasePage],
    published: Published | None = None,
) -> IndexPage:
    """Everything that the first page's template reads."""
    files = {(case.scene, case.environment): f"cases/{case.file}" for case in cases}
    width, height, subpixels = data.view
    scenes = sorted(data.rows["scene"].unique())
    maps = data.rows["environment"].nunique()
    return IndexPage(
        [_budget(result, looks, figures[result.budget], files, published) for result in found],
        _figures(figures[""]),
        _facts(data),
        data.sessions[-1]["versions"] if data.sessions else {},
        _notes(data),
        f"{data.rows['sampler'].nunique()} samplers, {maps} environment maps, "
        f"{len(scenes)} scenes ({', '.join(scenes)}), budgets {', '.join(data.budgets)}. "
        f"Scale {data.scale}: images of {width}×{height} pixels with {subpixels} sub-pixels.",
        {case.file: next(iter(case.budgets.values()))[0].label for case in cases},
        leading_metric().label,
        KEY,
        " ".join(f"{value:g}" for value in decoding_table()),
    )


def _budget(
    result: BudgetResult,
    looks: dict[str, Look],
    figures: dict[tuple[str, str], str],
    files: dict[tuple[str, str], str],
    published: Published | None,
) -> BudgetView:
    return BudgetView(
        result.budget,
        slug(result.budget),
        result.rankings[0].maps,
        [ranking_table(result, ranking, looks, files) for ranking in result.rankings],
        _as_text(ranked_table(result)),
        list(_shown(beside_paper(result, published))) if published else [],
        _figures(figures),
    )


def _as_text(table: Table) -> TextTable:
    text = text_of(table)
    return TextTable(
        [str(column).strip() for column in text.columns],
        [[str(value) for value in row] for row in text.itertuples(index=False)],
    )


def _shown(parts: Iterable[Part]) -> Iterable[str | TextTable]:
    """Paragraphs and tables as the page prints them."""
    for part in parts:
        if isinstance(part, Text):
            yield part.text
        elif isinstance(part, Table):
            yield _as_text(part)


def _figures(stems: dict[tuple[str, str], str]) -> list[Figure]:
    return [
        Figure(kind, stem, CAPTIONS[kind].format(find_metric(name).label))
        for (kind, name), stem in sorted(
            stems.items(), key=lambda item: [*CAPTIONS].index(item[0][0])
        )
    ]


def _facts(data: RunData) -> dict[str, str]:
    if not data.sessions:
        return {}
    session = data.sessions[-1]
    return {
        "started": str(session["started"]),
        "command": str(session["command"]),
        "commit": str(session["commit"] or "unknown"),
        "processor": f"{session['processor']}, {session['cores']} cores, "
        f"{session['threads']} threads",
        "system": str(session["system"]),
        "python": str(session["python"]),
        "starts": str(len(data.sessions)),
    }


def _notes(data: RunData) -> list[str]:
    """What a reader has to bear in mind about noise."""
    rows, notes = data.rows, []
    for metric in ranked_metrics():
        if metric.near_column not in rows:
            continue
        near = rows[rows[metric.near_column].astype(bool)]
        if near.empty:
            notes.append(
                f"By {metric.label}, no measurement lies within {NEAR:g}× of what its reference's "
                "own noise gives."
            )
            continue
        counts = near["sampler"].value_counts().sort_index()
        who = ", ".join(f"{name} ({count})" for name, count in counts.items())
        notes.append(
            f"By {metric.label}, {len(near)} of {len(rows)} measurements lie within {NEAR:g}× of "
            f"what their reference's own noise gives: {who}. The pages of scenes and maps mark "
            "them."
        )
    loads = [
        session["load_average"] / session["cores"]
        for session in data.sessions
        if session.get("load_average") is not None and session.get("cores")
    ]
    if loads and max(loads) > BUSY:
        notes.append(
            f"Others used the machine, too: at a start {max(loads):.1f} processes waited for each "
            "core. Take times as rough."
        )
    if data.rows["environment"].nunique() < 10:
        notes.append(
            "There are few maps: ranks tell only large differences apart, and intervals are "
            "themselves uncertain."
        )
    return notes
