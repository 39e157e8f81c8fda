"""What the first page is made from: the answers, and what its ranking opens with."""

import json
from collections.abc import Sequence
from typing import Any

from experiments.report.compared_cases import opening_budget
from experiments.report.sentences import counted
from experiments.report.site.publications import Publication
from experiments.report.site.questions import OTHERS, questions
from experiments.report.site.ranking_data import constants, entry
from experiments.report.site.report_blocks import table_block
from experiments.report.tables import text_of
from experiments.run.budget import sorted_budgets
from experiments.run.sampler_spec import family_of
from metrics.registry import ranked_metrics


def context(found: Sequence[Publication], ranked: Sequence[Publication]) -> dict[str, Any]:
    """What the template reads. ranked : the runs that rank samplers, the main one first"""
    answers = [
        {
            "question": one,
            "tables": [
                table_block(
                    text_of(table), f"{one.anchor}-table-{place + 1}", table.caption,
                    folded=table.stem == OTHERS,
                )
                for place, table in enumerate(one.tables)
            ],
        }
        for one in questions(found, ranked)
    ]  # fmt: skip
    return {"answers": answers, "catalogue": None} | (_ranking(ranked) if ranked else {})


def _ranking(ranked: Sequence[Publication]) -> dict[str, Any]:
    entries = [entry(one) for one in ranked]
    return {
        "catalogue": {
            "run": ranked[0].name,
            "budget": opening_budget(entries[0]["budgets"]),
            "budgets": sorted_budgets(list({name for one in entries for name in one["budgets"]})),
            "runs": entries,
        },
        "constants": json.dumps(constants(), ensure_ascii=False),
        "metrics": list(reversed(ranked_metrics())),
    }


def about(found: Sequence[Publication], maps: int) -> str:
    """What the site is made from, in one sentence."""
    ranked = [one for one in found if one.ranks]
    names = {str(name) for one in ranked for name in one.run.rows["sampler"].unique()}
    rows = sum(len(one.run.rows) for one in found)
    return (
        f"{counted(len({family_of(name) for name in names}), 'sampler')}, "
        f"{counted(maps, 'map')}, {rows:,} measurements in {counted(len(found), 'published run')}."
    )
