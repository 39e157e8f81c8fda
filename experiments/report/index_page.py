"""What the first page says: winners, margins, losses, plots, and how it was all measured."""

from dataclasses import dataclass

from experiments.report.case_pages import CasePage
from experiments.report.full_table import full_table
from experiments.report.links import slug
from experiments.report.palette import Look
from experiments.report.previews import decoding_table
from experiments.report.ranking_table import RankingTable, ranking_table
from experiments.report.rankings import BudgetResult
from experiments.report.run_data import RunData

BUSY = 1.25
"""A load above this many times the cores at the start makes times doubtful."""


@dataclass(frozen=True)
class BudgetView:
    name: str
    anchor: str
    maps: int
    tables: list[RankingTable]
    headings: list[str]
    rows: list[list[str]]
    figures: dict[str, str]


@dataclass(frozen=True)
class IndexPage:
    budgets: list[BudgetView]
    figures: dict[str, str]
    facts: dict[str, str]
    versions: dict[str, str]
    notes: list[str]
    summary: str
    winners: dict[str, str]
    decoding: str


def context(
    data: RunData,
    found: list[BudgetResult],
    looks: dict[str, Look],
    figures: dict[str, dict[str, str]],
    cases: list[CasePage],
) -> IndexPage:
    """Everything that the first page's template reads."""
    files = {(case.scene, case.environment): f"cases/{case.file}" for case in cases}
    width, height, subpixels = data.view
    scenes = sorted(data.rows["scene"].unique())
    maps = data.rows["environment"].nunique()
    return IndexPage(
        [_budget(result, looks, figures[result.budget], files) for result in found],
        figures[""],
        _facts(data),
        data.sessions[-1]["versions"] if data.sessions else {},
        _notes(data),
        f"{data.rows['sampler'].nunique()} samplers, {maps} environment maps, "
        f"{len(scenes)} scenes ({', '.join(scenes)}), budgets {', '.join(data.budgets)}. "
        f"Scale {data.scale}: images of {width}×{height} pixels with {subpixels} sub-pixels.",
        {case.file: next(iter(case.budgets.values()))[0].label for case in cases},
        " ".join(f"{value:g}" for value in decoding_table()),
    )


def _budget(
    result: BudgetResult,
    looks: dict[str, Look],
    figures: dict[str, str],
    files: dict[tuple[str, str], str],
) -> BudgetView:
    text = full_table(result.table, paper=True)
    return BudgetView(
        result.budget,
        slug(result.budget),
        len(result.flip.per_map),
        [ranking_table(result, ranking, looks, files) for ranking in result.rankings],
        [str(column) for column in text.columns],
        [[str(value) for value in row] for row in text.itertuples(index=False)],
        figures,
    )


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
    rows = data.rows
    near = rows[rows["near_noise_floor"].astype(bool)]
    notes = []
    if near.empty:
        notes.append("No measurement's error lies within 3 times its reference's noise floor.")
    else:
        counts = near["sampler"].value_counts().sort_index()
        who = ", ".join(f"{name} ({count})" for name, count in counts.items())
        notes.append(
            f"{len(near)} of {len(rows)} measurements have an RMSE within 3 times the noise "
            "floor of "
            f"their reference, so part of it is the reference's own noise: {who}. The pages of "
            "scenes and maps mark them."
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
