"""Product sampling: directions in proportion to the map's light times the surface's BRDF.

At each shading point a few BRDF samples, which trace no ray, say where the surface looks. Each
stands for the part of the sphere around it, 1/(n p), and picks the cell of that size in the map's
hierarchy of sums of four. A cell weighs what the sample reflects times the cell's mean light; one
is drawn, and in it a direction by the map's own light, down the hierarchy. So light is sought where
the BRDF is large, as finely as the BRDF's samples are dense: in a small part of the map for a
polished surface, all over for a dull one.

    w_j    = f_j cos θ_j / p_j · F_j / Ω_j                 BRDF sample j, its cell's flux and size
    p(ω)   = Σ_j w_j / Σ w · [ω in cell j] L(ω) / F_j
    E      = mean of L f_r cos θ V / ((1 − c) p + c p_BRDF)

One cell more is the whole map, with a fixed share of all w: a sun that no cell holds is not left to
chance. A share c of the samples comes from the BRDF itself, as reflections are not where the map is
bright alone.

Source: Clarberg and Akenine-Möller, "Practical product importance sampling for direct
illumination", Eurographics 2008, who gather BRDF samples in a quadtree, multiply it with the map's
mip levels and warp samples down the product; Clarberg, Jarosz, Akenine-Möller and Jensen, "Wavelet
importance sampling", SIGGRAPH 2005, for the way down; Cline, Egbert, Talbot and Cardon, "Two stage
importance sampling for direct lighting", EGSR 2006, for a first stage that divides the map by both
factors and a second that draws by the map alone. Here cells of all sizes stand side by side instead
of in one tree, so that nothing is built at a point, and a density is a sum over n cells.

Building costs the hierarchy, 4/3 of the map in float64; a point n draws of its BRDF, and a sample n
comparisons. All cells are of the latitude-longitude plane. Unbiased.

Parameters
    brdf_samples : 16 (default), n
    widening : 4 (default) times what a BRDF sample stands for is the size of its cell
    brdf_share : 0.25 (default), c
"""

import math
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from samplers.base import LightSampler, register
from samplers.compiled import kernel
from samplers.environment import LUMINANCE_WEIGHTS, EnvironmentMap
from samplers.errors import EnvlightError
from samplers.grids.mip_table import MipTable, descend_from
from samplers.grids.tabulated import INSET
from samplers.lighting import Surface, SurfaceDistribution, SurfaceSamples
from samplers.reference import Reference
from samplers.sphere import pixels_of, sine_cosine

LEVEL, ROW, COLUMN = range(3)
MAP_SHARE = 0.25
"""Of the directions that the cells draw, those of the whole map."""


@kernel
def _pick_cells(direction, value, pdf, table, edge, widening, cell, flux, weight):
    """The cells (n, p, 3), their flux and w of BRDF samples (n, p).

    value : luminance of f_r · cos; table : sums, starts and widths of a `MipTable`
    edge : (H + 1,), cos θ of the rows' edges
    """
    sums, start, width = table
    height, levels = len(edge) - 1, len(start)
    count, points = value.shape
    row, column = np.empty(points, np.int32), np.empty(points, np.int32)
    across = math.pi / height
    for j in range(count):
        pixels_of(direction[j], height, row, column)
        for p in range(points):
            weight[j, p] = flux[j, p] = 0.0
            if not pdf[j, p] > 0.0:
                continue
            texel = across * (edge[row[p]] - edge[row[p] + 1])
            size = widening / (count * np.float64(pdf[j, p]) * texel)
            level = min(max(int(np.floor(0.5 * math.log2(size) + 0.5)), 0), levels - 1)
            r, c = row[p] >> level, column[p] >> level
            cell[j, p, LEVEL], cell[j, p, ROW], cell[j, p, COLUMN] = level, r, c
            top, bottom = r << level, min((r + 1) << level, height)
            columns = min((c + 1) << level, 2 * height) - (c << level)
            flux[j, p] = sums[start[level] + r * width[level] + c]
            solid_angle = columns * across * (edge[top] - edge[bottom])
            weight[j, p] = np.float64(value[j, p]) / pdf[j, p] * (flux[j, p] / solid_angle)


@kernel
def _draw(u, chosen_by, share, cell, weight, table, edge, direction):
    """Replace directions (k, p, 3) by such of the product, all but a share of them.

    u : (k, p, 3); chosen_by : (p,), by which samples are shared out among BRDF and cells
    """
    sums, start, width = table
    height = len(edge) - 1
    count, points, _ = direction.shape
    for p in range(points):
        total, last = 0.0, 0
        for j in range(len(weight)):
            total += weight[j, p]
            last = j if weight[j, p] > 0.0 else last
        for s in range(count):
            place = (s + np.float64(chosen_by[p])) / count
            if not total > 0.0 or place < share:  # a BRDF sample, as it stands there
                continue
            passed = total * np.float64(u[s, p, 2])
            j, below = 0, weight[0, p]
            while j < last and below <= passed:
                j += 1
                below += weight[j, p]
            row, column, x, y = descend_from(
                sums, start, width, cell[j, p, LEVEL], cell[j, p, ROW], cell[j, p, COLUMN],
                np.float64(u[s, p, 0]), np.float64(u[s, p, 1]),
            )  # fmt: skip
            x, y = min(max(x, INSET), 1.0 - INSET), min(max(y, INSET), 1.0 - INSET)
            sine, cosine = sine_cosine((column + x) / (2 * height))
            up = edge[row] + y * (edge[row + 1] - edge[row])
            sin_theta = math.sqrt(max(0.0, (1.0 - up) * (1.0 + up)))
            direction[s, p, 0], direction[s, p, 1] = sine * sin_theta, up
            direction[s, p, 2] = -cosine * sin_theta


@kernel
def _densities(direction, cell, flux, weight, table, edge, density):
    """p of directions (k, p, 3) into density (k, p), 0 under a black map."""
    sums, _, width = table
    height = len(edge) - 1
    count, points = density.shape
    row, column = np.empty(points, np.int32), np.empty(points, np.int32)
    for s in range(count):
        pixels_of(direction[s], height, row, column)
        for p in range(points):
            total, found = 0.0, 0.0
            for j in range(len(weight)):
                if not weight[j, p] > 0.0:
                    continue
                total += weight[j, p]
                level = cell[j, p, LEVEL]
                if row[p] >> level == cell[j, p, ROW] and column[p] >> level == cell[j, p, COLUMN]:
                    found += weight[j, p] / flux[j, p]
            texel = math.pi / height * (edge[row[p]] - edge[row[p] + 1])
            light = sums[row[p] * width[0] + column[p]] / texel
            density[s, p] = found * light / total if total > 0.0 else 0.0


@dataclass(frozen=True, eq=False, repr=False)
class ProductLight:
    """`count` directions by the product of a map's light and the BRDF, at each shading point.

    edge : (H + 1,), cos θ of the map's rows' edges
    """

    of: "ProductSampling"
    table: MipTable
    edge: NDArray[np.float64]
    count: int

    @property
    def draws(self) -> tuple[int, ...]:
        return self.of.brdf_samples, self.count, self.count, 1

    def densities(
        self, direction: NDArray[np.float32], cells: tuple[NDArray, NDArray, NDArray]
    ) -> NDArray[np.float64]:
        """p of directions (k, p, 3), 0 under a black map."""
        density = np.empty(direction.shape[:2])
        _densities(direction, *cells, self._sums, self.edge, density)
        return density

    def cells(
        self, surface: Surface, u: NDArray[np.float32]
    ) -> tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.float64]]:
        """Cells (n + 1, p, 3), their flux and w (n + 1, p), by the numbers u (n, p, 3)."""
        direction = surface.draw(u)
        reflected, pdf = surface.reflect(direction)
        value = reflected @ LUMINANCE_WEIGHTS
        count, points = pdf.shape
        cell = np.zeros((count + 1, points, 3), np.int64)
        flux, weight = np.empty((2, count + 1, points))
        _pick_cells(
            direction, value, pdf, self._sums, self.edge, self.of.widening, cell, flux, weight
        )
        # The last is all of the map.
        cell[-1, :, LEVEL], flux[-1] = len(self.table.start), self.table.total
        picked = weight[:-1].sum(axis=0)
        weight[-1] = np.where(picked > 0.0, picked * MAP_SHARE / (1.0 - MAP_SHARE), flux[-1])
        return cell, flux, weight

    @property
    def _sums(self) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.int64]]:
        return self.table.sums, self.table.start, self.table.width

    def sample_at(self, surface: Surface, u: list[NDArray[np.float32]]) -> SurfaceSamples:
        cells = self.cells(surface, u[0])
        direction, share = surface.draw(u[1]), self.of.brdf_share
        _draw(u[2], u[3][0, :, 0], share, cells[0], cells[2], self._sums, self.edge, direction)
        brdf = surface.reflect(direction)[1].astype(np.float64)
        product = self.densities(direction, cells)
        density = share * brdf + (1.0 - share) * product
        # What goes below the surface is no sample of light.
        used = (brdf > 0.0) & (density > 0.0)
        return SurfaceSamples(
            direction, np.divide(1.0, density, out=np.zeros(density.shape), where=used)
        )


@register("product")
@dataclass(frozen=True)
class ProductSampling(LightSampler):
    """Directions by the product of light and BRDF, out of the map's hierarchy."""

    label: ClassVar[str] = "Product (Clarberg 2008)"
    references: ClassVar[tuple[Reference, ...]] = (
        Reference(
            "Petrik Clarberg, Tomas Akenine-Möller",
            "Practical product importance sampling for direct illumination",
            "Computer Graphics Forum",
            2008,
            kind="article",
            volume="27(2)",
            doi="10.1111/j.1467-8659.2008.01166.x",
        ),
    )
    stochastic: ClassVar[bool] = True
    in_all_tables: ClassVar[bool] = False  # the slowest at a budget, but for reservoirs

    brdf_samples: int = field(default=16, metadata={"readings": (64,)})
    widening: float = field(default=4.0, metadata={"readings": (1.0, 16.0)})
    brdf_share: float = field(default=0.25, metadata={"readings": (0.5,)})

    costly = ("brdf_samples",)

    def __post_init__(self) -> None:
        if self.brdf_samples < 1:
            raise EnvlightError(f"product: brdf_samples {self.brdf_samples}; use at least 1")
        if not self.widening > 0.0:
            raise EnvlightError(f"product: widening {self.widening}; use more than 0")
        if not 0.0 < self.brdf_share <= 1.0:
            raise EnvlightError(f"product: brdf_share {self.brdf_share}; use a value in (0, 1]")

    def _prepare(
        self, environment: EnvironmentMap, count: int, rng: np.random.Generator
    ) -> SurfaceDistribution:
        edge = np.cos(np.arange(environment.height + 1) * (math.pi / environment.height))
        return ProductLight(self, MipTable.of(environment.flux), edge, count)
