"""How evenly five patterns of directions cover the sphere, against their number of points.

Reproduces Figure 4 of Wan, Wong and Leung, "Spherical Q²-tree for sampling dynamic environment
sequences", EGSR 2005: the generalised discrepancy D(N) of a latitude-longitude lattice, a cube map,
a divided icosahedron, Hammersley's points and HEALPix. The paper finds HEALPix lowest for all N,
the lattice highest and hardly falling, the cube map in between and saturating. Deterministic.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from experiments.run.study import Group, Job, Row, Study, run_study
from experiments.wan2005.point_patterns import PATTERNS
from metrics.discrepancy import generalized_discrepancy

if TYPE_CHECKING:
    from experiments.cli.commands import RunRequest

NAME = "discrepancy"
TITLE = "Generalised spherical discrepancy"
MOST_POINTS = {"quick": 3072, "standard": 12288, "paper": 12288}
LEAST_POINTS = 12
HIGHEST_LEVEL = 16
FORMATS = {"pattern": "s", "points": ",d", "discrepancy": ".6f", "random": ".6f", "ratio": ".3f"}


def run(request: "RunRequest", dry_run: bool) -> int:
    """Run the experiment; returns the exit status."""
    most = MOST_POINTS.get(request.scale, max(MOST_POINTS.values()))
    counts = point_counts(most)
    groups = [_group(pattern, counts) for pattern in PATTERNS]
    sources = (
        "experiments.wan2005.discrepancy",
        "experiments.wan2005.point_patterns",
        "metrics.discrepancy",
    )
    return run_study(Study(NAME, sources, groups, report, timed=False), request, dry_run)


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


def report(rows: pd.DataFrame, folder: Path) -> list[Path]:
    """Table and plot of D against N, beside random points."""
    from experiments.report.frames import present
    from experiments.report.line_plot import write_lines

    rows = rows.assign(random=np.sqrt(1.0 / (4.0 * np.pi * rows["points"])))
    rows["ratio"] = rows["discrepancy"] / rows["random"]
    notes = [
        "`random` is the root mean square of D over random points, √(1 / 4πN); `ratio` is D over "
        "it. Lower is more even. Slopes of ln D against ln N: " + _slopes(rows) + ".",
    ]
    title = f"{TITLE} (Wan, Wong and Leung 2005, Fig. 4)"
    files = present(folder, "discrepancy", rows, FORMATS, title, notes)
    random = rows[["points", "random"]].drop_duplicates("points")
    random = random.rename(columns={"random": "discrepancy"}).assign(pattern="random (expected)")
    curves = pd.concat([rows[["pattern", "points", "discrepancy"]], random])
    axes = ("number of points N", "discrepancy D(N)")
    return files + write_lines(
        folder, "discrepancy", curves, "points", "discrepancy", "pattern", axes
    )


def _slopes(rows: pd.DataFrame) -> str:
    """The exponent of each pattern's D(N), by least squares."""
    slopes = [
        f"{pattern} {np.polyfit(np.log(part['points']), np.log(part['discrepancy']), 1)[0]:.2f}"
        for pattern, part in rows.groupby("pattern", sort=False)
        if len(part) > 1
    ]
    return ", ".join(slopes)
