"""The one published table of benchmarks and campaigns: a CSV of each, and a page that shows all."""

from pathlib import Path

import pandas as pd

from experiments.run.loaded_run import write_csv, write_text
from experiments.run.machine import record

RESULTS = Path("results/performance")
PAGE = "report.md"
STATE = ("machine", "commit")
ABOUT = {
    "renderer-throughput": (
        "Scene glossy under noon-desert. Kernels are given in million shadow rays a second "
        "(primary rays for `primary`), beside Embree alone on the same rays: packets of 16 with "
        "the renderer's flags, and embreex's own `run`. Images and upsampling are given in "
        "milliseconds; a Mitsuba image has the same meshes, camera, map, sub-pixels and samples. "
        "`disc lights` are those of center-surround with the ambient map; `two lights` is what "
        "upsampling is meant to be cheaper than. Medians and quartiles of interleaved rounds."
    ),
    "reference-time": (
        "Seconds until a reference at 640×480 pixels reaches the noise target of scale standard, "
        "in a process of its own whose map, view and kernels are there."
    ),
    "paper-budget": (
        "The paper's 4 s at 1600×1200 pixels with 4 sub-pixels: `ratio` is the share of the budget "
        "that an image takes at the count chosen for it, `peak_mib` all of a process that renders "
        "this one image."
    ),
    "threejs-frames": (
        "three.js in Chromium at 640×480, vase under noon-desert, median cut's lights with shadow "
        "maps of `shadow_map`² texels. `webgl` draws: SwiftShader on a CPU, no GPU. At most "
        "`most_lights` compile, by units and varyings; of more, `passes` add up. `ms`: median of "
        "`frames` with shadow maps drawn anew; `ms_maps_kept`: kept; `ms_ours`: this renderer. "
        "Where `load_average` exceeds the cores, rows do not compare: others took part of the time."
    ),
    "measured-again": (
        "Published measurements drawn at random and made again by the methods as they are. `same`: "
        "all of count, lights, rays and scores agree to the last digit; `close`: within a "
        "thousandth; `noise`: the references were made otherwise, and errors differ by no more "
        "than both are noisy."
    ),
    "damaged-files": (
        "Small whole files of every compression and layout with one to six damages each: flipped "
        "bits, other bytes, extreme numbers, pieces cut out, doubled or put in. `fine` were read, "
        "`refused` by one sentence."
    ),
    "strange-maps": (
        "Generated maps: patterns over up to twelve decades at levels from 10⁻³⁰ to 10³⁰, holes, "
        "spikes on the seam and at the poles, single channels, 1 to 24 rows; samplers take turns "
        "at 1 to 256 lights, and each image is rendered."
    ),
    "killed-runs": (
        "Runs killed one to three times each at random moments, by SIGKILL or SIGINT, and left to "
        "end; tables are compared byte for byte with those of a run that nobody killed, timed "
        "columns left out, and images too."
    ),
}
"""What each benchmark's table tells, in the page's order."""


def show(rows: pd.DataFrame) -> str:
    """Lay rows out as a Markdown table, numbers to four digits."""
    return str(rows.to_markdown(index=False, floatfmt=".4g", intfmt=","))


def publish(name: str, rows: pd.DataFrame, folder: Path | None) -> None:
    """Print a benchmark's rows; with a folder, replace its table there and write the page anew."""
    print(show(rows))
    if folder is None:
        return
    machine = record()
    state = {
        "machine": f"{machine['processor']}, {machine['cores']} cores",
        "commit": machine["commit"] or "unknown",
    }
    write_csv(folder / f"{name}.csv", rows.assign(**state))
    print(write_page(folder))


def write_page(folder: Path) -> Path:
    """Write the page of all tables in `folder`; returns it."""
    parts = [
        "# Performance and robustness",
        "What only the program's makers ask, measured by `python -m tests.benchmarks` and "
        "`python -m tests.robustness`; `--publish` replaces a table.",
    ]
    for name, about in ABOUT.items():
        path = folder / f"{name}.csv"
        if not path.is_file():
            continue
        rows = pd.read_csv(path)
        states = [f"{one[0]}, commit {one[1]}" for one in rows[[*STATE]].drop_duplicates().values]
        parts += [
            f"## {name}", about, show(rows.drop(columns=[*STATE])), f"{'; '.join(states)}.",
        ]  # fmt: skip
    page = folder / PAGE
    write_text(page, "\n\n".join(parts) + "\n")
    return page
