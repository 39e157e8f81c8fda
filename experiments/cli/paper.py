"""What a paper needs: `envlight cite`, its references, and `envlight table`, a table of a run."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from collections.abc import Sequence

    import pandas as pd

    from experiments.report.parts import Table
    from metrics.registry import Better

COLUMNS = "flip,flip_rank,rmse,rmse_rank"
"""What stands in a table beside the sampler, unless columns are chosen."""
NARROW = "@{{}}l*{{{}}}{{r}}@{{}}"
"""LaTeX's columns, so many beside the sampler's, without room at the edges."""


def cite(
    samplers: Annotated[
        list[str] | None,
        typer.Argument(help="Names or patterns; commas or several. All without any."),
    ] = None,
    words: Annotated[
        bool, typer.Option("--words", help="A list in Markdown instead of BibTeX.")
    ] = False,
) -> None:
    """Print the references of samplers as BibTeX."""
    from experiments.maps.patterns import select
    from samplers import sampler_class, sampler_names

    chosen = select(sampler_names(), samplers or [], "sampler")
    if words:
        print("\n".join(map(in_words, chosen)))
        return
    entries = [one for name in chosen for one in sampler_class(name).references]
    print("\n\n".join(dict.fromkeys(one.bibtex for one in entries)))


def in_words(name: str) -> str:
    """A sampler's line of the list of methods."""
    from samplers import sampler_class

    found = sampler_class(name)
    told = " · ".join(one.words for one in found.references) or "equal cells, no paper's."
    return f"- `{name}`, **{found.label}**: {told}"


def table(
    run: Annotated[Path, typer.Argument(help="A run's folder, or one made by publish.")],
    columns: Annotated[
        str, typer.Option(help="Columns of its summary.csv, with commas between.")
    ] = COLUMNS,
    samplers: Annotated[
        list[str] | None, typer.Option(help="Names or patterns; commas or repeatable.")
    ] = None,
    budget: Annotated[str, typer.Option(help="One of the run's, e.g. lights=16.")] = "",
    output: Annotated[Path | None, typer.Option(help="Write it here, else print it.")] = None,
) -> None:
    """Write a LaTeX table of a run for one column of an article."""
    from experiments.maps.patterns import select, split_list
    from experiments.report.tables import as_latex
    from experiments.report.write import NEEDS
    from experiments.run.budget import opening_budget, sorted_budgets
    from experiments.run.loaded_run import Run, write_text
    from experiments.run.outputs import Kind, check_output
    from samplers import EnvlightError

    rows = Run.load(run).rows
    if "sampler" not in rows or "budget" not in rows:
        raise EnvlightError(f"{run}: its rows are not of samplers at budgets; give another run")
    budgets = sorted_budgets(list(rows["budget"].unique()))
    (at,) = select(budgets, [budget or opening_budget(rows["budget"])], "budget")[:1]
    part = rows[rows["budget"] == at]
    names = select(sorted(part["sampler"].unique()), samplers or [], "sampler")
    made = paper_table(part[part["sampler"].isin(names)], split_list([columns]))
    text = NEEDS + as_latex(made, NARROW.format(len(made.formats) - 1))
    if output is None:
        print(text)
        return
    check_output(output, Kind("a table in LaTeX", (NEEDS.encode(),)), "the table")
    write_text(output, text)
    print(output)


def paper_table(rows: "pd.DataFrame", columns: list[str]) -> "Table":
    """The summary of one budget's rows in some columns, under a caption that says what it is over.

    The first of a ranking is bold where the test separates it from all others, if its mean is the
    best, too; else those that tie with it are marked. Raises EnvlightError for a column that the
    summary does not have.
    """
    import pandas as pd

    from experiments.report.parts import Table
    from experiments.report.rankings import results
    from experiments.report.sentences import counted
    from experiments.report.summary import ALIKE, rank_column, summary_columns
    from experiments.run.budget import Budget
    from samplers import EnvlightError

    (result,) = results(rows)
    summary = result.table
    baselines = {ranking.metric.name: ranking.baseline for ranking in result.rankings}
    known = {one.name: one for one in summary_columns(summary, baselines) if one.format}
    for name in columns:
        if name not in known:
            raise EnvlightError(f"no column is called '{name}'; there are {', '.join(known)}")
    shown = [known[name] for name in dict.fromkeys(["sampler", *columns])]
    found = pd.DataFrame({one.name: one.values(summary) for one in shown})
    formats = {one.name: one.format for one in shown}
    best: dict[str, Better | Sequence[bool]] = {}
    tied = False
    for ranking in result.rankings:
        separated = len(ranking.like_first) > 1 and not any(ranking.like_first[1:])
        alike = {s for s, same in zip(ranking.samplers, ranking.like_first, strict=True) if same}
        told = [
            one for one in (ranking.metric.name, rank_column(ranking.metric.name)) if one in found
        ]
        for name in told if separated else told[:1]:
            column = known[name]
            if separated:
                values = found[name] if column.better == "less" else -found[name]
                leads = found["sampler"].iloc[int(values.argmin())] == ranking.winner
                if leads and column.better:
                    best[name] = column.better
                continue
            tied = True
            marks = [ALIKE if sampler in alike else "" for sampler in found["sampler"]]
            texts = map(column.text, found[name])
            found[name] = [text + mark for text, mark in zip(texts, marks, strict=True)]
            formats[name] = "s"
    seeds = int(rows.groupby(["scene", "environment", "sampler"])["seed"].nunique().max())
    caption = (
        f"Means over {counted(int(summary['maps'].iloc[0]), 'map')}, "
        f"{counted(rows['scene'].nunique(), 'scene')} and {counted(seeds, 'seed')}, at "
        f"{Budget.parse(result.budget).in_words}; ranks are by map."
    )
    caption += f" {ALIKE}: not significantly different from the first." if tied else ""
    caption += " Bold: significantly better than all others." if best else ""
    return Table("paper", found, formats, {one.name: one.heading for one in shown}, best, caption)
