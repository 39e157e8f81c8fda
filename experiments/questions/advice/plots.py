"""Pictures of a model of errors: its coefficients, how it predicts, who wins where, and one map."""

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from experiments.maps.features import FEATURES
from experiments.questions.advice.choice import Advice
from experiments.questions.advice.leagues import members
from experiments.questions.advice.model import Model
from experiments.questions.advice.reasons import decisive
from experiments.report.figures import label_plainly
from experiments.report.style import COLORS, INK, REST, Looks, looks, new_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Array = NDArray[np.float64]
GROUND = 61
"""Points along each side of the plane on which whom to choose is asked."""


def term_names() -> list[str]:
    """Names of the terms of a regression, in their order."""
    squares, products = ([f"{name}{end}" for name in FEATURES] for end in ("²", " × count"))
    return [*FEATURES, *squares, *products]


def coefficients(model: Model, metric: str) -> "Figure":
    """Factors on the error by sampler and feature, at the middle count."""
    size = len(FEATURES)
    slopes = 2.0 * model.errors[metric].coefficient[:, :size]
    figure = new_figure(2.4 + 0.5 * len(FEATURES), 1.6 + 0.24 * len(model.samplers))
    axes = figure.add_subplot()
    most = max(float(np.nanmax(np.abs(slopes), initial=0.0)), 1e-6)
    image = axes.imshow(slopes, cmap="RdBu_r", vmin=-most, vmax=most, aspect="auto")
    axes.set_xticks(range(len(FEATURES)), list(FEATURES), rotation=40, ha="right")
    axes.set_yticks(range(len(model.samplers)), model.samplers)
    axes.grid(False)
    for (row, column), value in np.ndenumerate(slopes):
        if math.isfinite(value):
            dark = abs(value) > 0.6 * most
            axes.text(column, row, f"{math.exp(value):.2f}", ha="center", va="center",
                      fontsize="x-small", color="white" if dark else "black")  # fmt: skip
    bar = figure.colorbar(image, ax=axes)
    bar.set_label("ln of the factor", fontsize="small")
    return figure


def predicted_and_measured(model: Model, metric: str, styles: Looks) -> "Figure":
    """Errors of every map at the middle count, against what the other maps predict."""
    place = len(model.counts) // 2
    figure = new_figure(6.4, 4.6)
    axes = figure.add_subplot()
    axes.set_xscale("log")
    axes.set_yscale("log")
    for k, sampler in enumerate(model.samplers):
        error = model.measured[metric][:, k, place]
        predicted = error * np.exp(-model.residuals[metric][:, k, place])
        axes.plot(predicted, error, linestyle="", color=styles[sampler].color,
                  marker=styles[sampler].marker, markersize=3, alpha=0.5,
                  label=sampler)  # fmt: skip
    found = model.measured[metric][:, :, place]
    ends = [float(np.nanmin(found)), float(np.nanmax(found))]
    axes.plot(ends, ends, color=INK, linewidth=0.8)
    for axis in (axes.xaxis, axes.yaxis):
        label_plainly(axis)
    axes.set_xlabel(f"predicted {model.labels[metric]}")
    axes.set_ylabel(f"measured {model.labels[metric]}")
    figure.legend(*axes.get_legend_handles_labels(), loc="center left", bbox_to_anchor=(0.91, 0.5),
                  fontsize="small")  # fmt: skip
    return figure


def winners(model: Model, metric: str, styles: Looks, league: str = "fixed") -> "Figure":
    """Who has the least error on each map, and whom the model chooses, at three counts.

    The plane is of the two features that decide the most between the samplers of a league; on the
    ground all others have their means. A sampler that cannot make so few lights is left out.
    """
    counts = [model.counts[len(model.counts) * k // 3] for k in range(3)]
    leagues = dict(zip(model.samplers, model.leagues, strict=True))
    inside = members(leagues, model.samplers, league) or list(range(len(model.samplers)))
    strongest = np.argsort(-decisive(model, metric, inside))[:2]
    figure = new_figure(9.6, 3.4)
    panels = figure.subplots(1, len(counts), sharex=True, sharey=True)
    for axes, count in zip(panels, counts, strict=True):
        if able := [k for k in inside if model.least[k] <= count]:
            _winners_at(axes, model, metric, styles, strongest, able, count)
        axes.set_title(f"{count} lights")
    names = list(FEATURES)
    figure.supxlabel(f"{names[strongest[0]]}, in standard deviations", y=0.0, va="top")
    panels[0].set_ylabel(names[strongest[1]])
    handles = dict(zip(*reversed(_handles(panels)), strict=True))
    figure.legend(list(handles.values()), list(handles), loc="center left",
                  bbox_to_anchor=(0.91, 0.5), fontsize="small")  # fmt: skip
    return figure


def _handles(panels: "NDArray") -> tuple[list, list]:
    found: tuple[list, list] = ([], [])
    for axes in panels:
        for kept, new in zip(found, axes.get_legend_handles_labels(), strict=True):
            kept.extend(new)
    return found


def _winners_at(
    axes: "Axes", model: Model, metric: str, styles: Looks, plane: NDArray[np.int64],
    inside: list[int], count: int,
) -> None:  # fmt: skip
    from matplotlib.colors import to_rgb

    points = model.frame.point(model.features)[:, plane]
    low, high = points.min(axis=0) - 0.3, points.max(axis=0) + 0.3
    across, up = (np.linspace(low[k], high[k], GROUND) for k in range(2))
    at = np.zeros((GROUND * GROUND, len(FEATURES)))
    at[:, plane] = np.stack(np.meshgrid(across, up), axis=-1).reshape(-1, 2)
    x = model.scale(np.array([float(count)]))
    guess = np.stack([model.errors[metric](one, x)[inside, 0] for one in at])
    chosen = np.where(np.isfinite(guess), guess, np.inf).argmin(axis=1)
    palette = np.array([to_rgb(styles[model.samplers[k]].color) for k in inside])
    ground = 0.25 * palette[chosen].reshape(GROUND, GROUND, 3) + 0.75
    extent = (low[0], high[0], low[1], high[1])
    axes.imshow(ground, origin="lower", extent=extent, aspect="auto", interpolation="nearest")
    axes.grid(False)
    errors = model.measured[metric][:, inside, model.counts.index(count)]
    best = np.where(np.isfinite(errors), errors, np.inf).argmin(axis=1)
    for k in np.unique(best):
        look, there = styles[model.samplers[inside[k]]], best == k
        axes.plot(points[there, 0], points[there, 1], linestyle="", color=look.color,
                  marker=look.marker, markersize=5, label=model.samplers[inside[k]])  # fmt: skip


def among_maps(model: Model, advice: Advice, name: str) -> "Figure":
    """Error against count of the chosen sampler on this map, as predicted, among all maps."""
    metric, sampler = advice.wish.metric, model.samplers.index(advice.chosen.sampler)
    figure = new_figure(6.4, 4.2)
    axes = figure.add_subplot()
    axes.set_xscale("log", base=2)
    axes.set_yscale("log")
    alike = {one.name for one in advice.alike}
    for k, other in enumerate(model.maps):
        near = other in alike
        axes.plot(model.counts, model.measured[metric][k, sampler], zorder=1 + near,
                  color=COLORS[-1] if near else REST, linewidth=1.1 if near else 0.6,
                  label="most alike maps" if other == advice.alike[0].name else None)  # fmt: skip
    counts = np.unique(np.round(np.geomspace(model.counts[0], model.counts[-1], 40)))
    color = looks(list(model.samplers))[advice.chosen.sampler].color
    features = np.array(list(advice.features.values()))
    error = np.exp(model.log_errors(metric, features, counts))[sampler]
    band = np.array([model.interval(metric, sampler, count) for count in counts])
    axes.fill_between(counts, error * band[:, 0], error * band[:, 1], color=color, alpha=0.2,
                      linewidth=0, zorder=3)  # fmt: skip
    axes.plot(counts, error, color=color, linewidth=2, label=name, zorder=4)
    axes.plot([advice.chosen.count], [advice.chosen.error], color=color, marker="o", zorder=5)
    axes.set_xticks(model.counts, [str(count) for count in model.counts])
    axes.set_xlabel(f"lights or samples of {advice.chosen.sampler}")
    axes.set_ylabel(model.labels[metric])
    axes.legend()
    return figure
