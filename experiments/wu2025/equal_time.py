"""All methods in the same time: image strips, error maps, insets and numbers.

Reproduces Fig. 1, 9, 10 and 14 of Wu, "Efficient environment map rendering based on decomposition",
2025, whose methods had 4 seconds each at 1600×1200 pixels with 4 sub-pixels on eight cores. Here
they have as many seconds per pixel, on the machine at hand: 4 s times the number of pixels over
that of the paper. The time counts rendering; lights are generated apart, as in the paper.

Strips are drawn for the maps that the paper names, for one map of every class of the others, and
for the two hardest, where even the best method's FLIP is largest (Fig. 14: there, too, every method
loses). The paper prints the figures of single images inside its pictures alone, which its text does
not hold; the means of its Table 1, made in the same 4 seconds, stand beside ours.

Scale quick uses two of the four scenes and one embedded map of every kind, chosen by kind alone;
--maps '*' takes all, --maps NAME those, with strips of each where there are eight or fewer.
"""

from pathlib import Path

import pandas as pd

from experiments.run.budget import Budget
from experiments.run.defaults import with_quick_maps, with_quick_scenes
from experiments.run.grid_experiment import GridExperiment, Run, run_grid
from experiments.run.request import RunRequest
from experiments.run.sampler_spec import SamplerSpec
from experiments.run.scale import Scale
from experiments.wu2025.table1 import PAPER, TEST_SCENES

NAME = "equal-time"
TITLE = "Equal time (Wu 2025, Fig. 1, 9, 10 and 14)"
PAPER_SECONDS, PAPER_PIXELS = 4.0, 1600 * 1200
FORMATS = {
    "sampler": "s", "rmse": ".4f", "flip": ".4f", "noise_floor": ".4f", "near_floor": "d",
    "lights": ".1f", "rays": ".1f", "render_ms": ".1f", "generate_ms": ".1f",
    "paper_rmse": ".4f", "paper_flip": ".4f",
}  # fmt: skip


def seconds_budget(scale: Scale) -> tuple[Budget, ...]:
    """The paper's four seconds for as many pixels as the scale has."""
    seconds = PAPER_SECONDS * scale.width * scale.height / PAPER_PIXELS
    return (Budget(float(f"{seconds:.4g}"), "seconds"),)


def paper_samplers() -> tuple[SamplerSpec, ...]:
    """The methods of the paper's Table 1, in its order."""
    return tuple(SamplerSpec(name) for name in PAPER)


def means(rows: pd.DataFrame) -> pd.DataFrame:
    """Mean errors, floors and costs of the samplers at one budget, least FLIP first."""
    from experiments.report.summary import compared

    fair = compared(rows).assign(
        rays=lambda part: (part["rays_shadow"] + part["rays_brdf"]) / part["rays_primary"],
        render_ms=lambda part: 1e3 * part["seconds_render"],
        generate_ms=lambda part: 1e3 * part["seconds_lights"],
    )
    case = ["environment", "scene", "sampler"]
    columns = ["rmse", "flip", "noise_floor", "lights", "rays", "render_ms", "generate_ms"]
    table = fair.groupby(case)[columns].mean().groupby(level="sampler").mean()
    table["near_floor"] = fair.groupby("sampler")["near_noise_floor"].sum()
    for position, error in ((0, "rmse"), (2, "flip")):
        table[f"paper_{error}"] = [
            PAPER[str(name)][position] if name in PAPER else float("nan") for name in table.index
        ]
    return table.sort_values(["flip", "rmse"], kind="stable").reset_index()


def report(run: Run) -> list[Path]:
    """The report with means, the hardest maps and the strips; means as CSV."""
    from experiments.report.case_figures import gallery, hardest_maps, shown_maps, write_strips
    from experiments.report.frames import rounded, table
    from experiments.report.write import closing, opening
    from experiments.run.record import write_csv, write_text

    lines, found = opening(run, TITLE), []
    for budget in run.budgets:
        rows = run.rows[run.rows["budget"] == budget]
        if rows.empty:
            continue
        part = means(rows)
        found.append(part.assign(budget=budget))
        lines += [f"## {budget}", "", table(rounded(part, FORMATS), "pipe"), ""]
        hard = hardest_maps(rows)
        lines += [
            f"Hardest for every method: {', '.join(hard)} (largest FLIP of the best method). Mean "
            "RMSE / FLIP there:",
            "",
            table(_hardest(rows, hard), "pipe"),
            "",
        ]
    lines += [
        "`lights`, `rays` per sub-pixel and times are means of what was really used. Columns "
        "called paper are Table 1 of Wu 2025, of 4 s at 1600×1200 pixels on eight cores, from "
        "other maps and scenes. `noise floor` is the mean error of the references themselves, "
        "`near floor` counts measurements within 3× of it.",
        "",
        *gallery(run, write_strips(run, shown_maps(run.rows))),
        *closing(run),
    ]
    path, csv = run.folder / "report.md", run.folder / "means.csv"
    write_text(path, "\n".join(lines))
    write_csv(csv, pd.concat(found, ignore_index=True))
    return [path, csv]


def _hardest(rows: pd.DataFrame, maps: list[str]) -> pd.DataFrame:
    """RMSE and FLIP of every sampler on these maps, as text."""
    errors = rows.groupby(["sampler", "environment"])[["rmse", "flip"]].mean()
    names = list(dict.fromkeys(rows["sampler"]))
    shown = pd.DataFrame({"sampler": names})
    for environment in maps:
        shown[environment] = [
            "{:.4f} / {:.4f}".format(*errors.loc[(name, environment)])
            if (name, environment) in errors.index
            else "–"
            for name in names
        ]
    return shown


EXPERIMENT = GridExperiment(NAME, TITLE, TEST_SCENES, paper_samplers, seconds_budget, report)


def run(request: RunRequest, dry_run: bool) -> int:
    """Run the experiment; returns the exit status."""
    return run_grid(EXPERIMENT, with_quick_maps(with_quick_scenes(request), 1), dry_run)
