"""A glTF file's lights and scene in three.js, by a Chromium without a window.

ENVLIGHT_NODE names a folder in which `npm install three` was run. Chromium's SwiftShader draws, on
the processor. `python -m tests.benchmarks threejs-frames` measures what frames take.
"""

import json
import os
import shutil
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from experiments.export.gltf import as_gltf
from experiments.export.light_set import light_set
from experiments.maps.sources import single_environment
from experiments.run.bench import Timing, interleaved, load_average
from renderer import load_scene
from renderer.render import render as render_ours
from renderer.view import make_view
from samplers import EnvlightError, make_sampler

NODE = os.environ.get("ENVLIGHT_NODE", "")
REACH, MAP_SIZE, BIAS = 6.0, 4096, 0.01
"""Half the side of what a shadow map covers; its texels; its bias."""
MOST_SECONDS, PATIENCE = 600, 30
"""Seconds until a picture is given up; after which no further frame is timed."""
PAGE = Path(__file__).with_suffix(".html").read_text(encoding="utf-8")


class Drawn(NamedTuple):
    """A picture (height, width, 3), linear; seconds of frames with shadow maps anew, and kept."""

    picture: NDArray[np.float32]
    anew: list[float]
    kept: list[float]
    renderer: str
    units: int


def node_package(name: str) -> Path:
    """The folder of an npm package; EnvlightError where it is not there."""
    folder = Path(NODE, "node_modules", name)
    if not NODE or not folder.is_dir() or shutil.which("node") is None:
        raise EnvlightError(
            f"npm's {name} is not installed, or ENVLIGHT_NODE names no folder that has it"
        )
    return folder


def render(
    scene: bytes, size: tuple[int, int], residual: bytes = b"", turn: float = 0.0, **timed: int
) -> Drawn:
    """Draw a .glb file's scene, lights and camera.

    residual : an .hdr file that lights the scene as well, turned by `turn` about +Y
    timed : `frames` to be timed in each way at most; `most` lights of a pass, as passes add up;
        `texels` on a side of a shadow map

    Raises EnvlightError where three.js or a browser is missing, AssertionError if they complain."""
    three, browsers = node_package("three"), ("chromium", "chromium-browser", "chrome")
    browser = next(filter(None, map(shutil.which, browsers)), None)
    if browser is None:
        raise EnvlightError("no chromium is installed")
    try:
        from playwright import sync_api
    except ImportError:
        raise EnvlightError("playwright is not installed") from None
    numbers = {"size": size, "reach": REACH, "texels": MAP_SIZE, "bias": BIAS, "patience": PATIENCE}
    numbers |= {"sky": turn if residual else 0, "frames": 0, "most": 1 << 20, **timed}
    files = {
        "": (PAGE.replace("NUMBERS", json.dumps(numbers)).encode(), "text/html"),
        "lights.glb": (scene, "model/gltf-binary"),
        "rest.hdr": (residual, "application/octet-stream"),
    }

    def serve(route: sync_api.Route) -> None:
        name = route.request.url.removeprefix("http://test/")
        if name in files:
            body, kind = files[name]
        else:
            body, kind = (three / name.removeprefix("three/")).read_bytes(), "text/javascript"
        route.fulfill(body=body, content_type=kind)

    with sync_api.sync_playwright() as started:
        arguments = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
        opened = started.chromium.launch(executable_path=browser, args=arguments)
        page = opened.new_page()
        said: list[str] = []
        page.on("pageerror", lambda error: said.append(str(error)))
        page.on("console", lambda one: said.append(one.text) if one.type == "error" else None)
        page.route("**/*", serve)
        page.goto("http://test/")
        try:
            page.wait_for_function("window.found", timeout=MOST_SECONDS * 1000)
        except sync_api.TimeoutError:
            raise EnvlightError(f"three.js: no picture in {MOST_SECONDS} s {said}") from None
        found = page.evaluate("window.found")
        opened.close()
    assert said == [], said
    picture = np.array(found.pop("pixels"), np.float32).reshape(size[1], size[0], 4)
    return Drawn(picture[::-1, :, :3], **found)


def frames(counts: Sequence[int], draw: Callable[..., Drawn] = render) -> pd.DataFrame:
    """A row for each number of lights, with shadow maps; how many a material takes is tried."""
    scene, environment = load_scene("vase"), single_environment("noon-desert", 512).load()
    size, rounds, texels, view = (640, 480), 11, 1024, make_view(scene, 640, 480, 1)

    def made(count: int) -> tuple[bytes, Any]:
        lights = make_sampler("median-cut").prepare(environment, count, np.random.default_rng(0))
        return as_gltf(light_set(lights, environment, "median-cut", count, 0), scene), lights

    def takes(count: int) -> bool:
        try:
            return bool(draw(made(count)[0], (16, 12), texels=16))
        except AssertionError:
            return False

    units = draw(made(1)[0], (16, 12), texels=16).units
    taken, rows = next(filter(takes, range(units, 0, -1))), []
    for count in counts:
        (file, lights), passes = made(count), -(-count // taken)
        drawn = draw(file, size, texels=texels, frames=rounds, most=-(-count // passes))
        row = {"lights": count, "texture_units": units, "most_lights": taken, "passes": passes}
        row |= {"shadow_map": texels, "frames": len(drawn.anew)}
        anew, kept = Timing.of(drawn.anew), Timing.of(drawn.kept)
        row |= {"ms": 1e3 * anew.median, "ms_lower": 1e3 * anew.lower, "ms_upper": 1e3 * anew.upper}
        ours = interleaved({"": partial(render_ours, view, lights, environment)}, rounds)[""]
        row |= {"ms_maps_kept": 1e3 * kept.median, "ms_ours": 1e3 * ours.median}
        rows.append({**row, "load_average": load_average(), "webgl": drawn.renderer})
    return pd.DataFrame(rows)
