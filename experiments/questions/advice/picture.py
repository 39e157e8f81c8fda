"""A map among all: errors against counts, as `envlight advise --picture` draws them."""

from typing import TYPE_CHECKING

import numpy as np

from experiments.questions.advice.expected import Advice, Answer
from experiments.questions.advice.measured import Measured
from experiments.report.style import COLORS, REST, STYLE, looks, new_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def among_maps(table: Measured, advice: Advice, name: str) -> "Figure":
    """A panel per answer: its sampler's errors on every measured map, and what is expected here."""
    import matplotlib as mpl

    with mpl.rc_context(STYLE):
        figure = new_figure(5.2 * len(advice.answers), 4.0)
        panels = figure.subplots(1, len(advice.answers), squeeze=False)[0]
        for axes, answer in zip(panels, advice.answers, strict=True):
            _panel(axes, table, advice, answer, name)
    return figure


def _panel(axes: "Axes", table: Measured, advice: Advice, answer: Answer, name: str) -> None:
    one = answer.chosen
    errors = table.errors[advice.wish.metric][:, table.samplers.index(one.sampler)]
    alike = [other.name for other in advice.alike]
    axes.set_xscale("log", base=2)
    axes.set_yscale("log")
    for other, line in zip(table.maps, errors, strict=True):
        near = other in alike
        axes.plot(table.counts, line, zorder=1 + near, color=COLORS[-1] if near else REST,
                  linewidth=1.1 if near else 0.6,
                  label="maps most like it" if other == alike[0] else None)  # fmt: skip
    color = looks(list(table.samplers))[one.sampler].color
    off = np.array([[one.error - one.low], [one.high - one.error]])
    axes.errorbar([one.count], [one.error], yerr=np.maximum(off, 0.0), color=color, marker="o",
                  capsize=4, zorder=4, label=name)  # fmt: skip
    axes.set_xticks(table.counts, [str(count) for count in table.counts])
    axes.set_xlabel(f"lights or samples of {one.sampler}")
    axes.set_ylabel(advice.label)
    axes.legend()
