"""One sample a pixel with its neighbours' help: ReSTIR's noise against the light set's bias.

Fig. 13 of Wu 2025 sets pictures of Zhang et al., "Area ReSTIR", 2024, at one sample a pixel beside
the paper's lights in a game engine: noise and 18 frames a second against none and 70 to 80, on a
graphics processor. Here both are in one renderer, in the time and at the rays that ReSTIR takes
with one sample in a case, with one sub-pixel a pixel, and others beside them, on a diffuse, a
partly glossy and a glossy scene. ReSTIR is that of a still view (`samplers.restir`), without Area
ReSTIR's share of lens and pixel. Where the package of the extra `denoise` is there (`pip install
envlight[denoise]`), two are denoised as well; in the time of eight samples, as a denoiser alone
takes longer than one.

What is asked besides: does reuse pay by both metrics alike? Points that share a survivor err alike,
so that noise has grains of several pixels, which the eye, and FLIP's filters, average less than
white noise. The grain of an image is the RMSE that is left after a blur over that before, in units
of what the blur leaves of white noise, √Σ g²: 1 where errors of neighbours have nothing to do with
each other, whatever their sizes, and larger where they are alike, as all of a bias is.
"""

from collections.abc import Iterator
from dataclasses import replace
from importlib.util import find_spec

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from experiments.report.case_figures import comparison_figures, found_in_images
from experiments.report.parts import Heading, Part, Table, Text, counted, listed
from experiments.report.sections.ranks import ranked
from experiments.report.style import label_of
from experiments.report.summary import compared, errors_per_case, errors_per_map, interval
from experiments.run.budget import Budget
from experiments.run.experiment import GridExperiment, PaperFigure, answer, experiment
from experiments.run.loaded_run import Run
from experiments.run.sampler_spec import SamplerSpec
from metrics.ranking import ratio_to_baseline
from metrics.registry import ranked_metrics

SAMPLERS = "ours", "mis", "mis-compensated", "ris", "ris-stratified", "restir", "product"
DENOISED = "mis-compensated", "restir"
TEMPORAL = SamplerSpec("restir", (("frames", 4),))  # the cost of those before is counted
SCENES = "three-boxes", "vase", "glossy"
"""Diffuse, partly glossy, glossy."""
BUDGETS = "time=restir:1", "rays=restir:1", "rays=restir:8", "time=restir:8"
REUSING, ALONE, LIGHTS = "restir", "ris", "ours"
BLUR = 2.0
"""Standard deviation of the blur in pixels."""


@experiment("reuse")
def reuse() -> GridExperiment:
    """ReSTIR at one sample a pixel against the light set, and what reuse does to noise."""
    return GridExperiment(
        title="One sample a pixel: reuse and lights (Wu 2025, Fig. 13)",
        sections=(ranked(), by_scene, gains, grains, comparison_figures(2)),
        scenes=SCENES,
        samplers=contenders,
        budgets=lambda scale: tuple(map(Budget.parse, BUDGETS)),
        scale=lambda scale: replace(scale, subpixels=1),
        seeds=1,
        quick_maps=1,
        findings=sentences,
        figures=(PaperFigure("Fig. 13", "lights and ReSTIR at one sample a pixel", beside_lights),),
    )


def beside_lights(run: Run) -> tuple[str, str]:
    """Whether the light set has less error in ReSTIR's time than ReSTIR with one sample a pixel."""
    rows, wins, told = compared(run.at(BUDGETS[0])), [], []
    for metric in ranked_metrics():
        errors = errors_per_case(rows, metric.name)
        smaller = int((errors[LIGHTS] < errors[REUSING]).sum())
        wins.append(smaller)
        told.append(f"{metric.label} on {smaller}")
    cases, won, of = len(errors), sum(wins), len(errors) * len(wins)
    return (
        f"{answer(won, of)}: {LIGHTS} better in {won} of {of}",
        f"in the time of one sample of {label_of(REUSING)}, {LIGHTS} has less "
        f"{' and '.join(told)} of {cases} cases; on a graphics card the paper has 70 to 80 frames "
        "a second without noise against 18",
    )


def contenders() -> tuple[SamplerSpec, ...]:
    """The samplers, and those that are denoised where the package is there."""
    denoised = DENOISED if find_spec("pyoidn") else ()
    return (
        *map(SamplerSpec, SAMPLERS),
        TEMPORAL,
        *(SamplerSpec(name, (("denoise", True),)) for name in denoised),
    )


def by_scene(run: Run) -> Iterator[Part]:
    """Errors on every scene: what sees the surface gains where that is glossy."""
    yield Heading("Scene by scene")
    for metric in ranked_metrics():
        logs = np.log(run.rows[metric.name].where(run.rows[metric.name] > 0.0))
        names = [run.rows[name] for name in ("budget", "sampler", "scene")]
        means = np.exp(logs.groupby(names).mean()).unstack("scene").reset_index()
        scenes = means.columns[2:].tolist()
        yield Table(
            f"scenes_{metric.name}",
            means,
            {"budget": "s", "sampler": "s", **dict.fromkeys(scenes, f".{metric.digits}f")},
            caption=f"{metric.label} by scene, geometric means over maps, without regard to who is "
            "over a budget.",
        )


def gains(run: Run) -> Iterator[Part]:
    """What reuse gains by each metric, over the same candidates without it."""
    found = gained(run.rows, REUSING, ALONE)
    if found.empty:
        return
    yield Heading("What reuse gains")
    yield Table(
        "gains",
        found,
        {"budget": "s", "metric": "s", "interval": "s", "smaller": "d", "maps": "d"},
        {
            "interval": f"{label_of(REUSING)} / {label_of(ALONE)}",
            "smaller": "maps on which it is smaller",
        },
        caption="Geometric means over maps of the ratio of errors, with 95 % intervals.",
    )
    yield from map(Text, sentences(run))


def gained(rows: pd.DataFrame, name: str, other: str) -> pd.DataFrame:
    """By budget and metric: the ratio of a sampler's error to that of another."""
    lines = []
    for budget, part in rows[rows["sampler"].isin((name, other))].groupby("budget", sort=False):
        for metric in ranked_metrics():
            errors = errors_per_map(compared(part), metric.name)
            if not {name, other} <= set(errors) or not len(errors):
                continue
            both = errors[[other, name]].to_numpy(np.float64)
            found = ratio_to_baseline(both, 0)
            ratio, low, high = (float(end[1]) for end in (found.ratio, found.low, found.high))
            lines.append({
                "budget": budget, "metric": metric.label, "ratio": ratio, "low": low, "high": high,
                "interval": interval(ratio, low, high), "maps": len(both),
                "smaller": int((both[:, 1] < both[:, 0]).sum()),
            })  # fmt: skip
    return pd.DataFrame(lines)


def sentences(run: Run) -> list[str]:
    """Whether reuse, in space and time, and a denoiser gain by each metric, at each budget."""
    told = []
    denoised = ((f"{name}[denoise=True]", name) for name in DENOISED)
    for name, other in ((REUSING, ALONE), (TEMPORAL.label, REUSING), *denoised):
        found = gained(run.rows, name, other)
        for budget, part in found.groupby("budget", sort=False) if len(found) else ():
            ratios = part.set_index("metric")["ratio"]
            said = " and ".join(
                f"{ratio:.2f} times the {metric}" for metric, ratio in ratios.items()
            )
            told.append(
                f"{budget}, {counted(int(part['maps'].iloc[0]), 'map')}: {label_of(name)} has "
                f"{said} of {label_of(other)}; {ratios.idxmin()} says more for it."
            )
    return told or [f"Without {label_of(REUSING)} and {label_of(ALONE)} nothing is told of reuse."]


def grains(run: Run) -> Iterator[Part]:
    """How far errors of neighbouring pixels are alike."""
    found = found_in_images(
        run, "grain.csv", lambda run, case: case.names.assign(
            grain=[grain(image - case.truth) for image in case.images]
        ),
    )  # fmt: skip
    if found.empty:
        return
    groups = found.groupby(["budget", "scene", "sampler"], sort=False)["grain"].mean()
    wide = groups.unstack("scene").reset_index()
    scenes = [str(name) for name in wide if name not in ("budget", "sampler")]
    yield Heading("Grain")
    yield Table(
        "grains", wide, {"budget": "s", "sampler": "s", **dict.fromkeys(scenes, ".2f")},
        caption=f"RMSE after a Gaussian blur of {BLUR:g} pixels over that before, in units of what "
        "it leaves of white noise; means over maps, at seed 0. 1 is white noise.",
    )  # fmt: skip
    spans = found.groupby("sampler")["grain"].agg(["min", "max"]).reindex([REUSING, ALONE]).dropna()
    each = spans.rename(label_of).itertuples()
    told = listed([f"{name} {least:.2f} to {most:.2f}" for name, least, most in each])
    yield Text(f"Grain over all cases and budgets: {told or 'neither was run'}.")


def grain(error: NDArray[np.floating]) -> float:
    """Root mean square of an error (H, W, 3) after the blur over that before, by white noise's.

    The expected squares of blurred independent errors are their own squares blurred by g², whose
    sum is that of the unblurred ones times Σ g². NaN without an error.
    """
    from scipy.ndimage import gaussian_filter1d

    blurred = error.astype(np.float64)
    total = np.square(blurred).sum()
    kernel = gaussian_filter1d(np.eye(1, 65, 32)[0], BLUR)
    for axis in (0, 1):
        blurred = gaussian_filter1d(blurred, BLUR, axis=axis, mode="constant")
    white = np.square(kernel).sum()
    return float(np.sqrt(np.square(blurred).sum() / total) / white) if total > 0.0 else np.nan
