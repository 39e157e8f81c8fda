"""A glTF file's lights and scene in three.js, by a Chromium without a window.

ENVLIGHT_NODE names a folder in which `npm install three` was run. Chromium's SwiftShader draws, on
the processor. `python -m tests.experiments.export.threejs` prints what frames take.
"""

import json
import os
import shutil
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from experiments.export.gltf import as_gltf
from experiments.export.light_set import light_set
from experiments.maps.sources import single_environment
from renderer import load_scene
from samplers import EnvlightError, make_sampler

NODE = os.environ.get("ENVLIGHT_NODE", "")
REACH, MAP_SIZE, BIAS = 6.0, 4096, 0.01
"""Half the side of what a shadow map covers; its texels; its bias."""
MOST_SECONDS = 240
PAGE = """<!DOCTYPE html>
<script type="importmap">{"imports": {"three": "http://test/three/build/three.module.js"}}</script>
<script type="module">
import * as THREE from "three";
import { GLTFLoader } from "http://test/three/examples/jsm/loaders/GLTFLoader.js";
import { HDRLoader } from "http://test/three/examples/jsm/loaders/HDRLoader.js";
const [width, height, reach, size, bias, sky, frames] = NUMBERS;
const file = await new GLTFLoader().loadAsync("http://test/lights.glb");
const world = new THREE.Scene();
world.add(file.scene);
const renderer = new THREE.WebGLRenderer();
renderer.shadowMap.enabled = true;
renderer.shadowMap.type = THREE.BasicShadowMap;
file.scene.traverse(one => {
  if (one.isMesh) one.castShadow = one.receiveShadow = true;
  if (!one.isDirectionalLight) return;
  one.castShadow = true;
  one.shadow.mapSize.set(size, size);
  const camera = one.shadow.camera;
  [camera.left, camera.right, camera.bottom, camera.top] = [-reach, reach, -reach, reach];
  [camera.near, camera.far] = [-4 * reach, 4 * reach];
  one.shadow.bias = -bias / (8 * reach);
});
if (sky) {
  const map = await new HDRLoader().setDataType(THREE.FloatType).loadAsync("http://test/rest.hdr");
  map.mapping = THREE.EquirectangularReflectionMapping;
  world.environment = world.background = map;
  world.environmentRotation.set(0, sky, 0);
  world.backgroundRotation.set(0, sky, 0);
}
const camera = file.cameras[0];
camera.aspect = width / height;
camera.updateProjectionMatrix();
const target = new THREE.WebGLRenderTarget(width, height, {type: THREE.FloatType});
renderer.setRenderTarget(target);
const pixels = new Float32Array(4 * width * height), times = [];
for (let frame = 0; frame <= frames; frame++) {
  const started = performance.now();
  renderer.render(world, camera);
  renderer.readRenderTargetPixels(target, 0, 0, width, height, pixels);
  times.push(performance.now() - started);
}
window.found = {pixels: Array.from(pixels), times: times.slice(1)};
</script>"""


def node_package(name: str) -> Path:
    """The folder of an npm package; EnvlightError where it is not there."""
    folder = Path(NODE, "node_modules", name)
    if not NODE or not folder.is_dir() or shutil.which("node") is None:
        raise EnvlightError(
            f"npm's {name} is not installed, or ENVLIGHT_NODE names no folder that has it"
        )
    return folder


def render(
    scene: bytes, size: tuple[int, int], residual: bytes = b"", turn: float = 0.0, frames: int = 0
) -> tuple[NDArray[np.float32], list[float]]:
    """The picture (height, width, 3), linear, of a .glb file's scene, lights and camera.

    residual : an .hdr file that lights the scene as well, turned by `turn` about +Y
    frames : so many are drawn once more, and their seconds returned

    Raises EnvlightError where three.js or a browser is missing.
    """
    three, browsers = node_package("three"), ("chromium", "chromium-browser", "chrome")
    browser = next(filter(None, map(shutil.which, browsers)), None)
    if browser is None:
        raise EnvlightError("no chromium is installed")
    try:
        from playwright import sync_api
    except ImportError:
        raise EnvlightError("playwright is not installed") from None
    numbers = json.dumps([*size, REACH, MAP_SIZE, BIAS, turn if residual else 0, frames])
    files = {
        "": (PAGE.replace("NUMBERS", numbers).encode(), "text/html"),
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
    pixels = np.array(found["pixels"], np.float32).reshape(size[1], size[0], 4)
    return pixels[::-1, :, :3], [0.001 * one for one in found["times"]]


def main() -> None:
    """Print three.js's seconds a frame at 640×480 by number of lights, each with a shadow map.

    It is SwiftShader that draws, on the processor, and says nothing about a GPU; frames are read
    back. Lights are those of median cut, of which a material takes about a dozen.
    """
    scene, environment = load_scene("vase"), single_environment("noon-desert", 512).load()
    print("lights  frames/s of three.js by SwiftShader, shadow maps of", MAP_SIZE)
    for count in (1, 2, 4, 8, 12):
        lights = make_sampler("median-cut").prepare(environment, count, np.random.default_rng(0))
        file = as_gltf(light_set(lights, environment, "median-cut", count, 0), scene)
        _, seconds = render(file, (640, 480), frames=5)
        print(f"{count:6d}  {1.0 / np.median(seconds):.2f}", flush=True)


if __name__ == "__main__":
    main()
