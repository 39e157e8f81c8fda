"""The modified illumination cut of EnvIndirects against the original one, at the same budgets.

Reproduces Fig. 6 of Wu, "Efficient environment map rendering based on decomposition", 2025. The
original cut (Cheslack-Postava et al. 2008) splits by luminance variance alone, w_V, w_D, w_E =
1, 0, 0 in Eq. 3; the modified one has 1, 5, 1. EnvDirects are the same. Both are compared with and
without upsampling, by errors and by false edges. The paper shows a pair of images, says "fewer
shadow artifacts" and that the original is worse with 8 to 32 lights; it prints no figures.
"""

from collections.abc import Iterator, Mapping
from dataclasses import replace

import pandas as pd

from experiments.report.case_figures import CaseImages, comparison_figures, found_in_images
from experiments.report.parts import Heading, Part, Table, Text
from experiments.report.sections.ratios import ratios
from experiments.run.budget import Budget
from experiments.run.experiment import GridExperiment, Section, experiment
from experiments.run.foreground import foreground
from experiments.run.loaded_run import Run
from experiments.run.sampler_spec import SamplerSpec
from metrics.false_edges import false_edges

ORIGINAL = (("variance_weight", 1.0), ("extent_weight", 0.0), ("energy_weight", 0.0))
CONFIGURATIONS = {
    "modified": SamplerSpec("ours-no-upsampling"),
    "original": SamplerSpec("ours-no-upsampling", ORIGINAL),
    "modified, upsampled": SamplerSpec("ours"),
    "original, upsampled": SamplerSpec("ours", ORIGINAL),
}
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
    names = {spec.label: name for name, spec in CONFIGURATIONS.items()}
    modified, original, *upsampled = names
    pairs = {original: modified, upsampled[1]: upsampled[0]}

    def shown(run: Run) -> Run:
        """Both cuts at full resolution, at the middle budget where there is one."""
        middle = f"lights={LIGHTS[1]}"
        budgets = [middle] if middle in run.budgets else run.budgets[:1]
        labels = [original, modified]
        rows = run.rows[run.rows["budget"].isin(budgets) & run.rows["sampler"].isin(labels)]
        return replace(
            run, rows=rows, record={**run.record, "budgets": budgets, "samplers": labels}
        )

    return GridExperiment(
        title="Modified against original illumination cut (Wu 2025, Fig. 6)",
        sections=(
            ratios(names, modified),
            false_edge_section(pairs, names),
            comparison_figures(part=shown, lines=edge_lines, names=names),
        ),
        samplers=lambda: tuple(CONFIGURATIONS.values()),
        budgets=lambda scale: tuple(map(Budget, LIGHTS)),
        quick_scenes=2,
        quick_maps=2,
    )


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
