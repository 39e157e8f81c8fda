"""What a paper needs: `envlight cite`, its references, and `envlight table`, a table of a run."""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from experiments.progress import telling

if TYPE_CHECKING:
    import pandas as pd

    from experiments.report.parts import Table

COLUMNS = "flip,flip_rank,rmse,rmse_rank"
"""What stands in a table beside the sampler, unless columns are chosen."""
NARROW = "@{{}}{}*{{{}}}{{r}}@{{}}"
"""LaTeX's columns: the sampler's, and so many beside it, without room at the edges."""
WRAPPED = r">{\raggedright}p{.47\columnwidth}"


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
) -> None:
    """Write a LaTeX table of a run for one column of an article."""
    with telling(f"reading {run}"):
        found = _article_table(run, columns, samplers or [], budget)
    print(found)


def _article_table(run: Path, columns: str, samplers: list[str], budget: str) -> str:
    from experiments.maps.patterns import select, split_list
    from experiments.report.tables import as_latex, text_of
    from experiments.report.write import NEEDS
    from experiments.run.budget import opening_budget, sorted_budgets
    from experiments.run.loaded_run import Run
    from samplers import EnvlightError

    rows = Run.load(run).rows
    if "sampler" not in rows or "budget" not in rows:
        raise EnvlightError(f"{run}: its rows are not of samplers at budgets; give another run")
    budgets = sorted_budgets(list(rows["budget"].unique()))
    (at,) = select(budgets, [budget or opening_budget(rows["budget"])], "budget")[:1]
    part = rows[rows["budget"] == at]
    names = select(sorted(part["sampler"].unique()), samplers, "sampler")
    made = paper_table(part[part["sampler"].isin(names)], split_list([columns]))
    wide = text_of(made)["sampler"].str.len().max() > 32  # no line of a column holds more
    set_in = as_latex(made, NARROW.format(WRAPPED if wide else "l", len(made.formats) - 1))
    return NEEDS.replace("booktabs", "array,booktabs") + set_in


def paper_table(rows: "pd.DataFrame", columns: list[str]) -> "Table":
    """The summary of one budget's rows in some columns, under a caption that says what it is over.

    Bold are who is first and who ties with it, but where the test separates nobody.
    """
    from experiments.maps.patterns import select
    from experiments.report.parts import counted
    from experiments.report.rankings import results
    from experiments.report.sections.ranks import ranked_table
    from experiments.report.summary import MOST_SPENT, unranked
    from experiments.run.budget import Budget

    (result,) = results(rows)
    whole = ranked_table(result)
    chosen = (select(list(whole.formats), [name], "column") for name in ["sampler", *columns])
    formats = {name: whole.formats[name] for names in chosen for name in names}
    seeds = int(rows.groupby(["scene", "environment", "sampler"])["seed"].nunique().max())
    caption = (
        f"Means over {counted(int(result.table['maps'].iloc[0]), 'map')}, "
        f"{counted(rows['scene'].nunique(), 'scene')} and {counted(seeds, 'seed')}, at "
        f"{Budget.parse(result.budget).in_words}; ranks are by map. "
    )
    if whole.best.keys() & formats:
        caption += "Bold: first, or not significantly different from the first."
    elif len(whole.rows) > 1:
        caption += "No sampler is significantly different from the first."
    if unranked(result.table):
        caption += f" Without a rank: more than {100 * (MOST_SPENT - 1):.0f} % over the budget."
    return replace(whole, formats=formats, caption=caption.strip())
