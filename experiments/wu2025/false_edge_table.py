"""False edges of a run's kept images: shadow boundaries that the reference does not have."""

from collections.abc import Iterator, Mapping

import pandas as pd

from experiments.report.case_figures import CaseImages, found_in_images
from experiments.report.parts import Heading, Part, Table, Text
from experiments.run.experiment import Section
from experiments.run.foreground import foreground
from experiments.run.loaded_run import Run
from metrics.false_edges import false_edges

FORMATS = {
    "budget": "s", "configuration": "s", "false_edges": ".5f", "ratio": ".3f", "more_false": "d",
    "cases": "d",
}  # fmt: skip
CASE = ["scene", "environment"]


def false_edge_section(pairs: Mapping[str, str], names: Mapping[str, str]) -> Section:
    """The section; nothing where no images are kept and none were when the report was made before.

    pairs : by a sampler's label that of the one it is compared with
    names : what samplers are called, by their labels
    """

    def section(run: Run) -> Iterator[Part]:
        edges = found_in_images(
            run,
            "false_edges.csv",
            lambda run, case: case.names.assign(false_edges=edges_of(run, case)),
        )
        if edges.empty:
            return
        table = edge_table(edges, run.budgets, pairs, names)
        yield Heading("False edges")
        yield Table(
            "false_edge_means", table, FORMATS,
            caption="Mean over cases and foreground pixels of how much steeper the image is than "
            "its reference, per pixel, over the reference's mean luminance; both first averaged "
            "over the 4 × 2 pixels of the interleaving pattern. `ratio` is to the other cut at the "
            "same resolution, `more false` the number of cases on which there are more than with "
            "it.",
        )  # fmt: skip
        yield Text(told(table))

    return section


def edges_of(run: Run, case: CaseImages) -> list[float]:
    """The false edges of each image of a case."""
    mask = foreground(run, str(case.rows[0]["scene"]))
    return [false_edges(image, case.truth, mask) for image in case.images]


def edge_lines(run: Run, case: CaseImages) -> list[str]:
    """What stands under the images of a case."""
    return [f"false edges {value:.5f}" for value in edges_of(run, case)]


def edge_table(
    edges: pd.DataFrame, budgets: list[str], pairs: Mapping[str, str], names: Mapping[str, str]
) -> pd.DataFrame:
    """Mean false edges by budget and configuration, over cases that all of them have."""
    lines = []
    for budget in budgets:
        part = edges[edges["budget"] == budget]
        values = part.pivot_table(index=CASE, columns="sampler", values="false_edges").dropna()
        means = values.mean()
        for label in [label for label in names if label in values]:
            line = {"budget": budget, "configuration": names[label], "false_edges": means[label]}
            other = pairs.get(label, "")
            if other in values:
                line["ratio"] = means[label] / means[other]
                line["more_false"] = int((values[label] > values[other]).sum())
            lines.append({**line, "cases": len(values)})
    table = pd.DataFrame(lines, columns=list(FORMATS))
    return table.astype({"more_false": "Int64"})


def told(table: pd.DataFrame) -> str:
    """In how many comparisons the original cut has more false edges, and by how much."""
    compared = table[table["ratio"].notna()]
    if compared.empty:
        return "One of the two cuts was not run, so nothing is compared."
    more, least, most = (compared["ratio"] > 1.0).sum(), *compared["ratio"].agg(["min", "max"])
    return (
        f"The original cut has more false edges on average in {more} of {len(compared)} "
        f"comparisons (budget, with and without upsampling): {least:.2f} to {most:.2f} times those "
        "of the modified one. The paper says that the modified cut has fewer shadow artifacts."
    )
