"""How evenly five patterns of directions cover the sphere, against their number of points.

Reproduces Figure 4 of Wan, Wong and Leung, "Spherical Q²-tree for sampling dynamic environment
sequences", EGSR 2005: the generalised discrepancy D(N) of a latitude-longitude lattice, a cube map,
a divided icosahedron, Hammersley's points and HEALPix. The paper finds HEALPix lowest for all N,
the lattice highest and hardly falling, the cube map in between and saturating. Deterministic.
"""

from collections.abc import Iterator, Sequence
from functools import partial

import numpy as np
import pandas as pd

from experiments.report.line_plot import line_plot
from experiments.report.parts import Part, Plot, Table
from experiments.run.experiment import Group, Job, Row, Study, experiment
from experiments.run.loaded_run import Run
from experiments.run.request import RunRequest
from experiments.wan2005.point_patterns import PATTERNS
from metrics.discrepancy import generalized_discrepancy

MOST_POINTS = {"quick": 3072, "standard": 12288, "paper": 12288}
LEAST_POINTS = 12
HIGHEST_LEVEL = 16
FORMATS = {"pattern": "s", "points": ",d", "discrepancy": ".6f", "random": ".6f", "ratio": ".3f"}


@experiment("discrepancy")
def discrepancy() -> Study:
    """Generalised spherical discrepancy of five patterns of directions."""
    return Study(
        title="Generalised spherical discrepancy (Wan, Wong and Leung 2005, Fig. 4)",
        sections=(curves,),
        groups=groups,
        sources=(__name__, "experiments.wan2005.point_patterns", "metrics.discrepancy"),
        timed=False,
    )


def groups(request: RunRequest) -> list[Group]:
    """A group per pattern."""
    counts = point_counts(MOST_POINTS.get(request.scale, max(MOST_POINTS.values())))
    return [_group(pattern, counts) for pattern in PATTERNS]


def point_counts(most: int) -> list[int]:
    """Wanted numbers of points: HEALPix' own 12 · 4^k up to `most`, and what lies between."""
    powers = [LEAST_POINTS * 4**k for k in range(HIGHEST_LEVEL)]
    return [count for n in powers for count in (n, 2 * n) if count <= most]


def _group(pattern: str, counts: list[int]) -> Group:
    # Patterns exist for certain numbers only, so that several wanted numbers can give the same.
    made = {len(points): points for points in map(PATTERNS[pattern], counts)}
    jobs = {str(n): Job({"pattern": pattern, "points": n}) for n in sorted(made)}

    def measure(names: Sequence[str]) -> dict[str, Row]:
        return {name: {"discrepancy": generalized_discrepancy(made[int(name)])} for name in names}

    return Group(pattern, jobs, measure)


def curves(run: Run) -> Iterator[Part]:
    """Table and plot of D against N, beside random points."""
    rows = run.rows.assign(random=np.sqrt(1.0 / (4.0 * np.pi * run.rows["points"])))
    rows["ratio"] = rows["discrepancy"] / rows["random"]
    caption = (
        "`random` is the root mean square of D over random points, √(1 / 4πN); `ratio` is D over "
        f"it. Lower is more even. Slopes of ln D against ln N: {_slopes(rows)}."
    )
    yield Table("discrepancy", rows, FORMATS, caption=caption)
    expected = rows[["points", "random"]].drop_duplicates("points")
    expected = expected.rename(columns={"random": "discrepancy"}).assign(
        pattern="random (expected)"
    )
    lines = pd.concat([rows[["pattern", "points", "discrepancy"]], expected])
    axes = ("number of points N", "discrepancy D(N)")
    draw = partial(line_plot, lines, "points", "discrepancy", "pattern", axes)
    yield Plot("discrepancy", draw, "Discrepancy against number of points.")


def _slopes(rows: pd.DataFrame) -> str:
    """The exponent of each pattern's D(N), by least squares."""
    slopes = [
        f"{pattern} {np.polyfit(np.log(part['points']), np.log(part['discrepancy']), 1)[0]:.2f}"
        for pattern, part in rows.groupby("pattern", sort=False)
        if len(part) > 1
    ]
    return ", ".join(slopes)
