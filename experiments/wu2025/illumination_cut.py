"""The modified illumination cut of EnvIndirects against the original one, at the same budgets.

Reproduces Fig. 6 of Wu 2025. The original cut (Cheslack-Postava et al. 2008) splits by luminance
variance alone, w_V, w_D, w_E = 1, 0, 0 in Eq. 3; the modified one has 1, 5, 1. EnvDirects are the
same. Both are compared with and without upsampling, by errors and by false edges. The paper shows a
pair of images, says "fewer shadow artifacts" and that the original is worse with 8 to 32 lights; it
prints no figures.
"""

from collections.abc import Iterator
from dataclasses import replace

import pandas as pd

from experiments.report.case_figures import CaseImages, comparison_figures, found_in_images
from experiments.report.parts import Heading, Part, Table
from experiments.report.sections.ratios import ratios
from experiments.run.budget import Budget
from experiments.run.experiment import GridExperiment, PaperFigure, answer, experiment
from experiments.run.loaded_run import Run
from experiments.run.sampler_spec import SamplerSpec
from experiments.wu2025.glossy import foreground
from metrics.false_edges import false_edges

ORIGINAL = (("variance_weight", 1.0), ("extent_weight", 0.0), ("energy_weight", 0.0))
CONFIGURATIONS = {
    "modified": SamplerSpec("ours-no-upsampling"),
    "original": SamplerSpec("ours-no-upsampling", ORIGINAL),
    "modified, upsampled": SamplerSpec("ours"),
    "original, upsampled": SamplerSpec("ours", ORIGINAL),
}
NAMES = {spec.label: name for name, spec in CONFIGURATIONS.items()}
MODIFIED, *_ = NAMES
PAIRS = dict(zip(list(NAMES)[1::2], list(NAMES)[::2], strict=True))
"""By the original cut's label that of the modified one at the same resolution."""
LIGHTS = (8, 16, 32)
"""The numbers of lights for which the paper modified the cut."""
FORMATS = {
    "budget": "s", "configuration": "s", "false_edges": ".5f", "ratio": ".3f", "more_false": "d",
    "cases": "d",
}  # fmt: skip
CASE = ["scene", "environment"]


@experiment("illumination-cut")
def illumination_cut() -> GridExperiment:
    """The modified illumination cut against the original one, with false shadow edges."""
    return GridExperiment(
        title="Modified against original illumination cut (Wu 2025, Fig. 6)",
        sections=(
            ratios(NAMES, MODIFIED),
            false_edge_section,
            comparison_figures(
                part=shown,
                lines=lambda run, case: [f"false edges {edge:.5f}" for edge in edges_of(run, case)],
                names=NAMES,
            ),
        ),
        samplers=lambda: tuple(CONFIGURATIONS.values()),
        budgets=lambda scale: tuple(map(Budget, LIGHTS)),
        quick_scenes=2,
        quick_maps=2,
        figures=(PaperFigure("Fig. 6", "modified against original illumination cut", fewer),),
    )


def shown(run: Run) -> Run:
    """Both cuts at full resolution, at the middle budget where there is one."""
    middle = f"lights={LIGHTS[1]}"
    budgets = [middle] if middle in run.budgets else run.budgets[:1]
    labels = [next(iter(PAIRS)), MODIFIED]
    rows = run.rows[run.rows["budget"].isin(budgets) & run.rows["sampler"].isin(labels)]
    return replace(run, rows=rows, record={**run.record, "budgets": budgets, "samplers": labels})


def fewer(run: Run) -> tuple[str, str]:
    """In how many comparisons the modified cut has fewer false edges."""
    table = edge_table(false_edges_of(run), run.budgets)
    ratio = table["ratio"].dropna()
    more = int((ratio > 1.0).sum())
    return f"{answer(more, len(ratio))}: fewer edges in {more} of {len(ratio)}", told(table)


def false_edge_section(run: Run) -> Iterator[Part]:
    """False edges; nothing where no images are kept, nor were when the report was made before."""
    edges = false_edges_of(run)
    if edges.empty:
        return
    table = edge_table(edges, run.budgets)
    yield Heading("False edges")
    yield Table(
        "false_edge_means", table, FORMATS,
        caption="Mean over cases and foreground pixels of how much steeper the image is than its "
        "reference, per pixel, over the reference's mean luminance; both first averaged over the "
        "4 × 2 pixels of the interleaving pattern. `ratio` is to the other cut at the same "
        "resolution, `more false` the number of cases on which there are more than with it.",
    )  # fmt: skip


def false_edges_of(run: Run) -> pd.DataFrame:
    """Those of every image; those that were found before where no images are kept."""
    return found_in_images(
        run, "false_edges.csv", lambda run, case: case.names.assign(false_edges=edges_of(run, case))
    )


def edges_of(run: Run, case: CaseImages) -> list[float]:
    """The false edges of each image of a case."""
    mask = foreground(run, str(case.rows[0]["scene"]))
    return [false_edges(image, case.truth, mask) for image in case.images]


def edge_table(edges: pd.DataFrame, budgets: list[str]) -> pd.DataFrame:
    """Mean false edges by budget and configuration, over cases that all of them have."""
    lines = []
    for budget in budgets:
        part = edges[edges["budget"] == budget]
        values = part.pivot_table(index=CASE, columns="sampler", values="false_edges").dropna()
        means = values.mean()
        for label in [label for label in NAMES if label in values]:
            line = {"budget": budget, "configuration": NAMES[label], "false_edges": means[label]}
            other = PAIRS.get(label, "")
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
        "of the modified one."
    )
