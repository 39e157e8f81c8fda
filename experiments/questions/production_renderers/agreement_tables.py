"""The report's part on agreement: converged means against this project's, and why they differ."""

from collections.abc import Iterator

import pandas as pd

from experiments.questions.production_renderers.noise_tables import CASE, measured
from experiments.questions.production_renderers.shots import CONVERGED_BY, OWN
from experiments.questions.production_renderers.written_scene import CONDUCTOR, LAMBERT
from experiments.report.parts import Heading, Items, Part, Table, Text
from experiments.run.loaded_run import Run

WANTED = 2e-3
"""How far the mean of an image of diffuse surfaces may lie from this project's."""
AGREEMENT_FORMATS = {
    "materials": "s", "renderer": "s", "cases": "d", "median": ".2e", "largest": ".2e",
    "where": "s", "error": ".1e", "beyond": "d", "blocks_median": ".2e", "blocks_largest": ".2e",
}  # fmt: skip
AGREEMENT_HEADINGS = {
    "median": "median difference", "largest": "largest", "error": "its standard error",
    "beyond": f"beyond {WANTED:g} and 3 errors", "blocks_median": "blocks, median",
    "blocks_largest": "blocks, largest",
}  # fmt: skip
CASE_FORMATS = {
    "materials": "s", "scene": "s", "environment": "s", "renderer": "s", "difference": "+.2e",
    "difference_error": ".1e", "block_difference": ".2e", "block_noise": ".1e", "block_z": ".2f",
}  # fmt: skip


def agreement(run: Run) -> Iterator[Part]:
    """Converged means against this project's: by renderer, then every case."""
    rows = agreeing(measured(run))
    if rows.empty:
        return
    yield Heading("Agreement of converged means")
    table = agreement_by_renderer(rows)
    yield Table("agreement", table, AGREEMENT_FORMATS, AGREEMENT_HEADINGS)
    yield Text(
        "Differences of the image's mean, over pixels and channels, from that of "
        f"{OWN} {CONVERGED_BY}, as shares of it. Blocks are of 8×8 pixels; theirs is the root mean "
        "square over blocks, in the same unit, without what noise alone gives. A converged mean is "
        f"that of {int(rows['runs'].iloc[0])} independent runs, whose deviation gives the "
        "standard errors. Every case stands in agreement_by_case.csv."
    )
    yield Items((*agreement_sentences(rows), *reasons(rows)))
    yield Table("agreement_by_case", rows, CASE_FORMATS, shown=False)


def agreeing(rows: pd.DataFrame) -> pd.DataFrame:
    """One row per case and production renderer, of those that agree in all their rows."""
    if rows.empty:
        return rows
    theirs = rows[~rows["renderer"].str.startswith(f"{OWN} ")]
    return theirs.drop_duplicates([*CASE, "renderer"])


def beyond(rows: pd.DataFrame) -> pd.Series:
    """Whether a mean lies farther off than is wanted, and than three of its standard errors."""
    far = rows["difference"].abs()
    return (far > WANTED) & (far > 3.0 * rows["difference_error"])


def agreement_by_renderer(rows: pd.DataFrame) -> pd.DataFrame:
    """A line per materials and renderer."""
    found = []
    for (materials, renderer), part in rows.groupby(["materials", "renderer"], sort=False):
        far = part["difference"].abs()
        worst = part.iloc[int(far.argmax())]
        found.append(
            {
                "materials": materials, "renderer": renderer, "cases": len(part),
                "median": far.median(), "largest": far.max(),
                "where": f"{worst['scene']}, {worst['environment']}",
                "error": worst["difference_error"], "beyond": int(beyond(part).sum()),
                "blocks_median": part["block_difference"].median(),
                "blocks_largest": part["block_difference"].max(),
            }
        )  # fmt: skip
    return pd.DataFrame(found)


def agreement_sentences(rows: pd.DataFrame) -> list[str]:
    """Per materials and renderer, in how many cases the mean agrees, and the largest difference."""
    found = []
    for line in agreement_by_renderer(rows).to_dict("records"):
        within = line["cases"] - line["beyond"]
        found.append(
            f"{line['materials']}, {line['renderer']}: the mean agrees to {WANTED:g}, or to three "
            f"standard errors where these are more, in {within} of {line['cases']} cases; the "
            f"largest difference is {100.0 * line['largest']:.2f} ± "
            f"{100.0 * line['error']:.2f} % ({line['where']})."
        )
    return found


def reasons(rows: pd.DataFrame) -> list[str]:
    """Why means differ, and by how much by the rows: normals; masking and a density of metals."""
    found = []
    diffuse = rows[rows["materials"] == LAMBERT]
    if len(diffuse):
        worst = diffuse.loc[diffuse["turned_away"] == diffuse["turned_away"].max()]
        case = worst.iloc[0]
        differences = ", ".join(
            f"{line['renderer']} by {100.0 * line['difference']:+.2f} %"
            for line in worst[worst["environment"] == case["environment"]].to_dict("records")
        )
        found.append(
            f"Diffuse surfaces: where a smooth normal faces away from the eye {OWN} and Cycles "
            "shade, Mitsuba 3 and LuxCore show black. Such points carry at most "
            f"{100.0 * case['turned_away']:.2f} % of the light ({case['scene']}, "
            f"{case['environment']}); there the means differ, of {differences}."
        )
    metals = rows[rows["materials"] == CONDUCTOR]
    medians = {
        str(name): f"{100.0 * part['difference'].median():+.2f} %"
        for name, part in metals.groupby("renderer", sort=False)
    }
    mitsuba = next((name for name in medians if name.startswith("Mitsuba")), None)
    if mitsuba is not None:
        found.append(
            f"Metals: {OWN} and Cycles mask by Smith's height-correlated function, Mitsuba 3 by "
            f"the separable one, which is darker at grazing angles; its mean differs by "
            f"{medians[mitsuba]} (median over cases)"
            + (f", that of Cycles by {medians['Cycles']}." if "Cycles" in medians else ".")
        )
    if "LuxCore" in medians:
        found.append(
            "Metals: LuxCore masks by Schlick's approximation, by which more leaves a surface at "
            "grazing angles than arrives, and the density of its BSDF samples lacks the cosine of "
            "the half vector, which darkens the others; its mean differs by "
            f"{medians['LuxCore']} (median over cases)."
        )
    return found
