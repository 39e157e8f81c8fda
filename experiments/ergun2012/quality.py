"""Noise of images by the kd-tree and by inversion, at equal samples and at equal time.

Figures 6 and 7 of Ergun 2012: spheres of three measured materials and one of extreme anisotropy,
alone under the map, and the teapot. One sub-pixel, so that samples are per pixel as in the paper;
half of them from the BRDF. Inversion and the kd-tree each draw with low-discrepancy and with
independent random numbers; what a gain is over draws with the same. Filtered importance sampling is
Figure 7's rival; on spheres that stand alone it lacks no shadows.

Its maps cannot be passed on and its materials are refitted surrogates, so that levels of PSNR do
not compare; gains may.
"""

import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pandas as pd

from experiments.ergun2012 import FIGURE6, SAMPLES_INVERSION, SAMPLES_KD_TREE
from experiments.report.case_figures import image_tile, sheet
from experiments.report.parts import Heading, Part, Table, Text
from experiments.report.style import label_of
from experiments.run.budget import Budget
from experiments.run.experiment import GridExperiment, PaperFigure, answer, experiment
from experiments.run.kept_images import budget_in_file_name
from experiments.run.loaded_run import Run
from experiments.run.sampler_spec import SamplerSpec
from experiments.run.scale import Scale, of_scale

SPHERES = (*FIGURE6, "brushed-metal")
SCENES = tuple(str(Path(__file__).parent / "scenes" / f"{name}.toml") for name in SPHERES)
HEIGHT = {"quick": 256, "standard": 1024, "paper": 1024}
"""Rows of embedded maps: the paper's but at scale quick, where building trees would take most."""
NOISE, MOST_SAMPLES = 0.4, 16384
"""How much finer references are, for PSNR near 50 dB."""
SAMPLES = {"quick": (8, 32), "standard": (8, 32, 128), "paper": (8, 32, 128)}
SECONDS = {"quick": 0.015, "standard": 0.3, "paper": 2.0}
"""About what inversion takes for the paper's eight samples, on two cores."""
NUMBERS = ("low-discrepancy", "independent")
INVERSION = {kind: SamplerSpec("mis", (("guided", False), ("numbers", kind))) for kind in NUMBERS}
KD_TREE = {f"kd-tree[numbers={kind}]": kind for kind in NUMBERS}
"""Labels of the paper's sampler with the numbers that it draws with."""
OWN = list(KD_TREE)[-1]
"""With the paper's independent numbers."""
CONTROLS = ("exact", "walk")
"""Without the law: blocks by an alias table, and by a walk that keeps the numbers' strata."""
FILTERED, ANISOTROPIC = "filtered-importance-sampling", "brushed-metal"
"""The rival of Figure 7, and its sphere."""
TIMES = 5.0
"""Differences are shown this much larger, as in Figure 6."""
FORMATS = {
    "scene": "s", "environment": "s", "sampler": "s", "samples": ".0f", "ms": ".1f",
    "psnr": ".2f", "psnr_spread": ".2f", "gain": "+.2f",
}  # fmt: skip
PAPER_FORMATS = {
    "scene": "s", "numbers": "s", "samples_ratio": ".2f", "gain_samples": "+.2f",
    "gain_time": "+.2f", "gain_paper_ratio": "+.2f", "published": "s", "published_gain": "+.2f",
}  # fmt: skip


@experiment("kd-tree-quality")
def kd_tree_quality() -> GridExperiment:
    """PSNR by kd-tree and inversion at equal samples and equal time."""
    return GridExperiment(
        title="Images by the kd-tree and by inversion (Ergun, Kurt and Öztürk 2012, Fig. 6 and 7)",
        scenes=(*SCENES, "ward-teapot"),
        maps=("room-three-windows",),
        samplers=compared,
        budgets=budgets,
        scale=per_pixel,
        sections=(psnr_section, paper_section, images_section),
        figures=(
            PaperFigure("Fig. 6", "PSNR of spheres in equal time", gain_in_time),
            PaperFigure("Fig. 7", "a sphere of extreme anisotropy", beside_filtered),
        ),
    )


def gain_in_time(run: Run) -> tuple[str, str]:
    """The kd-tree's gain over inversion on the paper's spheres, in time and with its samples."""
    table = beside_paper(with_gain(run.rows))
    table = table[table["scene"].isin(FIGURE6)]
    time, samples, paper = (
        table[name] for name in ("gain_time", "gain_paper_ratio", "published_gain")
    )
    better = int((time > 0.0).sum())
    return (
        f"{answer(better, len(time))}: {time.min():+.1f} to {time.max():+.1f} dB in equal time",
        f"On this processor; with {SAMPLES_KD_TREE} samples against {SAMPLES_INVERSION}, which the "
        f"paper's card allows in equal time, {samples.min():+.1f} to {samples.max():+.1f} dB, the "
        f"paper {paper.min():+.1f} to {paper.max():+.1f} dB.",
    )


def beside_filtered(run: Run) -> tuple[str, str]:
    """At how many budgets the kd-tree has the higher PSNR on the sphere of Figure 7."""
    psnr = _filtered(with_gain(run.rows))
    better = int((psnr[OWN] > psnr[FILTERED]).sum())
    return (
        f"{answer(better, len(psnr))}: better at {better} of {len(psnr)}",
        filtered_sentence(with_gain(run.rows)),
    )


def compared() -> tuple[SamplerSpec, ...]:
    """Inversion and the kd-tree with both kinds of numbers, its controls, filtered sampling."""
    kd_tree = [SamplerSpec("kd-tree", (("numbers", kind),)) for kind in NUMBERS]
    controls = [SamplerSpec("kd-tree", (("pdf_form", form),)) for form in CONTROLS]
    filtered = SamplerSpec(FILTERED)
    return (*INVERSION.values(), SamplerSpec("mis"), *kd_tree, *controls, filtered)


def budgets(scale: Scale) -> tuple[Budget, ...]:
    """Equal samples, and equal time."""
    samples = tuple(Budget(count) for count in of_scale(SAMPLES, scale.name))
    return (*samples, Budget(of_scale(SECONDS, scale.name), "seconds"))


def per_pixel(scale: Scale) -> Scale:
    """The scale with one sub-pixel, maps of the paper's size and finer references."""
    return replace(
        scale, subpixels=1, map_height=of_scale(HEIGHT, scale.name),
        noise_target=NOISE * scale.noise_target, max_samples=MOST_SAMPLES,
    )  # fmt: skip


def psnr_section(run: Run) -> Iterator[Part]:
    """PSNR and gain over inversion, budget by budget."""
    yield Text(
        "PSNR in dB, mean and spread over seeds; `gain` is over inversion by binary search with "
        "random numbers of the same kind, on the same budget. `ms` is the time to render. All "
        "methods share the rays and the shading, so that at equal time a method that draws "
        "quickly gets but a few samples more."
    )
    table = with_gain(run.rows)
    for budget, part in table.groupby("budget", sort=False):
        yield Heading(str(budget), 3)
        yield Table("psnr", part, FORMATS)


def with_gain(rows: pd.DataFrame) -> pd.DataFrame:
    """A line per budget, case and sampler: PSNR over seeds, and its gain over inversion."""
    case = ["budget", "scene", "environment"]
    grouped = rows.groupby([*case, "sampler"], sort=False)
    table = grouped.agg(
        samples=("count", "mean"), ms=("seconds_render", "median"), psnr=("psnr", "mean"),
        psnr_spread=("psnr", "std"),
    ).reset_index()  # fmt: skip
    table["ms"] *= 1e3
    table["numbers"] = [numbers_of(label) for label in table["sampler"]]
    base = {spec.label: kind for kind, spec in INVERSION.items()}
    inversion = table[table["sampler"].isin(base)].rename(columns={"psnr": "base"})
    table = table.merge(inversion[[*case, "numbers", "base"]], on=[*case, "numbers"], how="left")
    table["gain"] = (table["psnr"] - table.pop("base")).where(~table["sampler"].isin(base))
    return table


def numbers_of(label: str) -> str:
    """The kind of random numbers that a sampler of this label draws with."""
    return next((kind for kind in NUMBERS if f"numbers={kind}" in label), NUMBERS[0])


def paper_section(run: Run) -> Iterator[Part]:
    """The kd-tree's gains beside the paper's, sphere by sphere."""
    table = beside_paper(with_gain(run.rows))
    if table.empty:
        return
    caption = (
        "Gains of the kd-tree over inversion in dB, means over maps: with as many samples "
        f"({SAMPLES_INVERSION}), in the same time, in which it gets `samples ratio` times as many, "
        f"and with {SAMPLES_KD_TREE} samples against {SAMPLES_INVERSION}, which the paper could "
        "afford in equal time on its GPU; beside them the paper's PSNR and gain."
    )
    yield Heading("Beside the paper")
    yield Table("beside_paper", table, PAPER_FORMATS, caption=caption)
    yield from map(Text, filter(None, [filtered_sentence(with_gain(run.rows))]))


def beside_paper(table: pd.DataFrame) -> pd.DataFrame:
    """A line per scene and kind of numbers, with what the paper prints of it."""
    few, many = f"lights={SAMPLES_INVERSION}", f"lights={SAMPLES_KD_TREE}"
    timed = table[[Budget.parse(text).timed for text in table["budget"]]]["budget"]
    lines = []
    for (scene, kind), part in table.groupby(["scene", "numbers"], sort=False):
        tree = part[part["sampler"].isin(KD_TREE)].groupby("budget").mean(numeric_only=True)
        base = part[part["sampler"] == INVERSION[str(kind)].label]
        base = base.groupby("budget").mean(numeric_only=True)
        if tree.empty or base.empty:
            continue
        equal_time = next((budget for budget in timed if budget in tree.index), "")
        ratio = tree["samples"] / base["samples"]
        line = {
            "scene": scene, "numbers": kind, "gain_samples": tree["gain"].get(few),
            "gain_time": tree["gain"].get(equal_time), "samples_ratio": ratio.get(equal_time),
            "gain_paper_ratio": tree["psnr"].get(many, math.nan) - base["psnr"].get(few, math.nan),
        }  # fmt: skip
        if scene in FIGURE6:
            inversion, kd_tree = FIGURE6[str(scene)]
            line["published"] = f"{inversion:.2f} → {kd_tree:.2f} dB"
            line["published_gain"] = kd_tree - inversion
        lines.append(line)
    return pd.DataFrame(lines)


def filtered_sentence(table: pd.DataFrame) -> str:
    """The kd-tree and filtered importance sampling on the sphere of Figure 7; empty without it."""
    psnr = _filtered(table)
    if psnr.empty:
        return ""
    found = [
        f"{budget} {row[OWN]:.2f} against {row[FILTERED]:.2f} dB" for budget, row in psnr.iterrows()
    ]
    return (
        f"On {ANISOTROPIC} (Fig. 7, where the paper shows pictures alone), {label_of(OWN)} "
        f"against {label_of(FILTERED)}: {'; '.join(found)}."
    )


def _filtered(table: pd.DataFrame) -> pd.DataFrame:
    """PSNR (budgets × both methods) on the sphere of Figure 7; empty without one of them."""
    part = table[table["scene"] == ANISOTROPIC]
    psnr = part.pivot_table(index="budget", columns="sampler", values="psnr", sort=False)
    return psnr.reindex(columns=[OWN, FILTERED]).dropna()


def images_section(run: Run) -> Iterator[Part]:
    """The reference and all images over their differences, as in Figures 6 and 7."""
    yield Heading(f"Images, and {TIMES:g} times their differences")
    rows = run.rows[run.rows["seed"] == 0]
    for case, part in rows.groupby(["scene", "environment", "budget"], sort=False):
        scene, environment, budget = map(str, case)
        exposure, reference = float(part["exposure"].iloc[0]), run.kept_reference(part.iloc[0])
        upper = [("reference", image_tile(run, reference, exposure))]
        lower = [("", image_tile(run, reference, exposure))]
        for _, row in part.iterrows():
            image = run.kept_image(row)
            figures = f"{row['count']} samples, {row['psnr']:.1f} dB"
            upper.append((label_of(row["sampler"]), image_tile(run, image, exposure)))
            lower.append((figures, image_tile(run, image, TIMES * exposure, reference)))
        file = f"images_{scene}_{environment}_{budget_in_file_name(budget)}.webp"
        yield sheet(file, f"{scene}, {environment}, {budget}", [*upper, *lower], len(upper))
