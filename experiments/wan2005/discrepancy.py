"""How evenly five patterns of directions cover the sphere, against their number of points.

Reproduces Figure 4 of Wan 2005: the generalised discrepancy D(N) of a latitude-longitude lattice, a
cube map, a divided icosahedron, Hammersley's points and HEALPix. The paper finds HEALPix lowest for
all N, the lattice highest and hardly falling, the cube map in between and saturating.

All but Hammersley's exist only for certain numbers of points, so each takes the nearest one:
lattices of n × 2n points, 6 n² texels of a cube, 10 n² + 2 vertices of a divided icosahedron, 12 n²
quads.
"""

import math
from collections.abc import Callable, Iterator
from functools import partial

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from experiments.report.figures import line_plot
from experiments.report.parts import Part, Plot, Table
from experiments.run.experiment import (
    Group,
    PaperFigure,
    Row,
    RunRequest,
    Study,
    answer,
    experiment,
)
from experiments.run.loaded_run import Run
from experiments.run.scale import of_scale
from metrics.discrepancy import generalized_discrepancy
from samplers.grids.healpix_quads import quad_points
from samplers.sphere import pixel_directions

MOST_POINTS = {"quick": 3072, "standard": 12288, "paper": 12288}
HIGHEST_LEVEL = 16
HEALPIX = "HEALPix"
FORMATS = {"pattern": "s", "points": ",d", "discrepancy": ".6f", "random": ".6f", "ratio": ".3f"}
Points = NDArray[np.float64]


@experiment("discrepancy")
def discrepancy() -> Study:
    """Generalised spherical discrepancy of five patterns of directions."""
    return Study(
        title="Generalised spherical discrepancy (Wan, Wong and Leung 2005, Fig. 4)",
        sections=(curves,),
        groups=groups,
        sources=(__name__, "experiments.wan2005.discrepancy", "metrics.discrepancy"),
        timed=False,
        figures=(PaperFigure("Fig. 4", "discrepancy of five patterns", lowest),),
    )


def groups(request: RunRequest) -> list[Group]:
    """A group per pattern, at HEALPix' own numbers of points, 12 · 4^k, and twice those."""
    most, powers = of_scale(MOST_POINTS, request.scale), (12 * 4**k for k in range(HIGHEST_LEVEL))
    counts = [count for n in powers for count in (n, 2 * n) if count <= most]
    return [_group(pattern, counts) for pattern in PATTERNS]


def _group(pattern: str, counts: list[int]) -> Group:
    # Patterns exist for certain numbers only, so that several wanted numbers can give the same.
    made = {len(points): points for points in map(PATTERNS[pattern], counts)}
    asked: Iterator[tuple[Row, Row, Points]] = (({"points": n}, {}, made[n]) for n in sorted(made))

    def measure(work: list[Points]) -> Iterator[Row]:
        return ({"discrepancy": generalized_discrepancy(points)} for points in work)

    return Group(pattern, asked, measure, {"pattern": pattern})


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


def lowest(run: Run) -> tuple[str, str]:
    """At how many of its numbers of points HEALPix is lowest, which the paper finds at all."""
    own = run.rows[run.rows["pattern"] == HEALPIX]
    others = run.rows[run.rows["pattern"] != HEALPIX]
    times = 0
    for points, value in zip(own["points"], own["discrepancy"], strict=True):
        ratio = np.log(others["points"] / points).abs()
        nearest = others.loc[ratio.groupby(others["pattern"]).idxmin(), "discrepancy"]
        times += int(value < nearest.min())
    return (
        f"{answer(times, len(own))}: HEALPix lowest at {times} of {len(own)}",
        "Of its numbers of points, each compared with the others' nearest; the paper finds it "
        "lowest at all.",
    )


def _slopes(rows: pd.DataFrame) -> str:
    """The exponent of each pattern's D(N), by least squares."""
    slopes = [
        f"{pattern} {np.polyfit(np.log(part['points']), np.log(part['discrepancy']), 1)[0]:.2f}"
        for pattern, part in rows.groupby("pattern", sort=False)
        if len(part) > 1
    ]
    return ", ".join(slopes)


def _nearest(count: int, size: Callable[[int], int], first: int = 1) -> int:
    """The n ≥ first whose size(n) is closest to `count`."""
    n = first
    while size(n + 1) <= count:
        n += 1
    return n if abs(size(n) - count) <= abs(size(n + 1) - count) else n + 1


def lattice(count: int) -> Points:
    """Centres of a grid of n × 2n cells, equal in latitude and longitude."""
    return pixel_directions(_nearest(count, lambda n: 2 * n * n)).reshape(-1, 3)


def cube_map(count: int) -> Points:
    """Centres of the texels of the six faces of a cube, n × n each, on the sphere."""
    n = _nearest(count, lambda n: 6 * n * n)
    side = (2.0 * np.arange(n) + 1.0) / n - 1.0
    a, b = (grid.reshape(-1) for grid in np.meshgrid(side, side))
    one = np.ones_like(a)
    faces = [
        np.roll(np.stack([sign * one, a, b], axis=1), axis, axis=1)
        for axis in range(3)
        for sign in (1.0, -1.0)
    ]
    return _unit(np.concatenate(faces))


def icosahedron(count: int) -> Points:
    """Vertices of the icosahedron whose triangles are cut into n² each, pushed to the sphere."""
    from scipy.spatial import ConvexHull

    n = _nearest(count, lambda n: 10 * n * n + 2)
    golden = (1.0 + math.sqrt(5.0)) / 2.0
    corners = np.array([(0.0, s, t * golden) for s in (-1.0, 1.0) for t in (-1.0, 1.0)])
    vertex = np.concatenate([np.roll(corners, axis, axis=1) for axis in range(3)])
    steps = [(i, j, n - i - j) for i in range(n + 1) for j in range(n + 1 - i)]
    weight = np.array(steps, np.float64) / n
    points = np.concatenate([weight @ vertex[face] for face in ConvexHull(vertex).simplices])
    # Neighbouring triangles share the points of their common edges.
    _, first = np.unique(np.round(points, 9) + 0.0, axis=0, return_index=True)
    return _unit(points[np.sort(first)])


def hammersley(count: int) -> Points:
    """Hammersley's points in base 2: heights (i + ½)/N, azimuths the bit-reversed i."""
    index = np.arange(count)
    azimuth, digit, rest = np.zeros(count), 0.5, index.copy()
    while rest.any():
        azimuth += digit * (rest & 1)
        digit, rest = digit / 2.0, rest >> 1
    z = 1.0 - (2.0 * index + 1.0) / count
    radius, phi = np.sqrt((1.0 - z) * (1.0 + z)), 2.0 * math.pi * azimuth
    return np.stack([radius * np.cos(phi), z, radius * np.sin(phi)], axis=1)


def healpix(count: int) -> Points:
    """Centres of HEALPix' 12 n² quads; n a power of two, as in a quad-tree."""
    level = _nearest(count, lambda k: 12 * 4**k, first=0)
    side = np.arange(2**level)
    grid = np.meshgrid([level], np.arange(12), side, side, indexing="ij")
    quad = np.stack(grid, axis=-1).reshape(-1, 4).astype(np.int64)
    return quad_points(quad, np.zeros(quad.shape))


def _unit(points: Points) -> Points:
    return points / np.linalg.norm(points, axis=1, keepdims=True)


PATTERNS: dict[str, Callable[[int], Points]] = {
    "lat-long lattice": lattice,
    "cube map": cube_map,
    "icosahedron": icosahedron,
    "Hammersley base 2": hammersley,
    HEALPIX: healpix,
}
