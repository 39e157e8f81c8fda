"""Renders a written scene: the command line that the programs of all renderers share.

    python render.py --samples 64 --seed 1 --output image.exr
    python render.py --plan plan.json

A plan lists renderings, {"renders": [{"samples": 4, "seed": 1, "output": "a.npy"}, …], "report":
"report.json"}; they are made one after another in this process, with the scene loaded once. The
report is rewritten after each: seconds of rendering alone, versions, settings. Runs with NumPy and
the renderer alone. A program gives `open(folder, threads)`; what that returns has `facts`, a
dictionary, and `render(samples, seed)`, which gives the seconds taken and a dictionary of what
else there is to say, `image()`, the last image as (H, W, 3) float32, top row first, and
`write(path)`, which writes that as OpenEXR.
"""

import argparse
import json
import os
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np


def main(open_scene: Callable[[Path, int], Any], folder: Path) -> None:
    """Do what the command line asks for, on the scene in `folder`."""
    # What follows "--" is for this script where Blender runs it.
    given = sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else sys.argv[1:]
    parser = argparse.ArgumentParser(prog="render.py", description="Render the scene here.")
    parser.add_argument("--samples", type=int, default=64, help="samples a pixel")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--threads", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--output", default="image.exr", help="OpenEXR, or .npy")
    parser.add_argument("--plan", help="a file that lists renderings, instead")
    chosen = parser.parse_args(given)
    one = {name: getattr(chosen, name) for name in ("samples", "seed", "output")}
    plan: dict[str, Any] = {"renders": [one]}
    if chosen.plan:
        plan = json.loads(Path(chosen.plan).read_text(encoding="utf-8"))
    # A renderer may change the working directory.
    outputs = [Path(wanted["output"]).resolve() for wanted in plan["renders"]]
    started = time.perf_counter()
    scene = open_scene(folder.resolve(), int(plan.get("threads", chosen.threads)))
    report: dict[str, Any] = {
        "facts": {**scene.facts, "numpy": np.__version__},
        "load_seconds": time.perf_counter() - started,
        "renders": [],
    }
    for wanted, output in zip(plan["renders"], outputs, strict=True):
        seconds, details = scene.render(wanted["samples"], wanted["seed"])
        if output.suffix == ".npy":
            np.save(output, scene.image())
        else:
            scene.write(output)
        report["renders"].append({**wanted, "seconds": seconds, **details})
        _write_report(report, plan.get("report"))
    if not plan.get("report"):
        for done in report["renders"]:
            print(f"{done['output']}: {done['samples']} samples a pixel, {done['seconds']:.3f} s")


def _write_report(report: dict[str, Any], place: str | None) -> None:
    if place:
        partial = Path(f"{place}.partial")
        partial.write_text(json.dumps(report), encoding="utf-8")
        partial.replace(place)
