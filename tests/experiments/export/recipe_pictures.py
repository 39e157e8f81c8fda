"""Pictures of the recipes: one sun and what it leaves of a map, in each program that is here.

python -m tests.experiments.export.recipe_pictures [PROGRAM …]

Blender is that of `make renderers`; Mitsuba is the extra `peer`; `threejs.py` says what it needs. A
program that is missing is told, and its picture stays as it is.
"""

import os
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
from experiments.report.preview import encoded
from numpy.typing import NDArray

from experiments.export.gltf import as_gltf
from experiments.export.light_set import light_set
from experiments.export.residual import Parted, part
from experiments.maps.sources import single_environment
from experiments.questions.production_renderers.process import renderers_python
from metrics.errors import exposure_scale
from renderer import load_scene
from renderer.direct import shade_directional
from renderer.image import write_exr, write_hdr, write_jpeg
from renderer.monte_carlo import shade_distribution
from renderer.scene import Scene
from renderer.scene.blender_frame import MAP_TURN
from renderer.view import make_view
from samplers import DirectionalLights, EnvlightError, LightDistribution, make_sampler
from samplers.files.image_file import read_radiance
from tests.experiments.export import threejs

FOLDER = Path(__file__).parents[3] / "experiments" / "export" / "pictures"
SIZE, SAMPLES = (240, 180), 64
MAP, SCENE, COUNT = "noon-desert", "teapot", 16
THREE_TURN = -0.5 * np.pi
"""Of `environmentRotation`: three.js has +X in the middle of a map, where ours has +Z."""
BLENDER = """
import sys
import bpy
bpy.ops.wm.read_factory_settings(use_empty=True)
import addon_utils
addon_utils.enable("cycles", default_set=True)
file, rest, turn, image, width, height, samples = sys.argv[1:]
bpy.ops.import_scene.gltf(filepath=file, export_import_convert_lighting_mode="RAW")
scene = bpy.context.scene
scene.camera = next(one for one in scene.objects if one.type == "CAMERA")
world = scene.world = bpy.data.worlds.new("rest")
world.use_nodes = True
nodes, links = world.node_tree.nodes, world.node_tree.links
place, mapping = nodes.new("ShaderNodeTexCoord"), nodes.new("ShaderNodeMapping")
mapping.inputs["Rotation"].default_value = (0.0, 0.0, float(turn))
texture = nodes.new("ShaderNodeTexEnvironment")
texture.image = bpy.data.images.load(rest)
links.new(place.outputs["Generated"], mapping.inputs["Vector"])
links.new(mapping.outputs["Vector"], texture.inputs["Vector"])
links.new(texture.outputs["Color"], nodes["Background"].inputs["Color"])
render = scene.render
render.engine, scene.cycles.samples, scene.cycles.use_denoising = "CYCLES", int(samples), False
scene.cycles.max_bounces = 0
render.resolution_x, render.resolution_y, render.filepath = int(width), int(height), image
render.image_settings.file_format, render.image_settings.color_depth = "OPEN_EXR", "32"
bpy.ops.render.render(write_still=True)
"""


def by_envlight(scene: Scene, parted: Parted) -> NDArray[np.float32]:
    view = make_view(scene, *SIZE, 16)
    lights, rest = parted.lights, parted.residual
    assert isinstance(lights, DirectionalLights)
    sky = make_sampler("mis").prepare(rest, SAMPLES, np.random.default_rng(0))
    assert isinstance(sky, LightDistribution)
    sun, _ = shade_directional(view, lights.direction[None], lights.irradiance)
    shade, _ = shade_distribution(view, rest, sky, 0)
    return view.to_image(sun + shade, rest.lookup(view.background_direction))


def by_mitsuba(scene: Scene, parted: Parted) -> NDArray[np.float32]:
    try:
        import mitsuba
    except ImportError:
        raise EnvlightError("mitsuba is not installed: the extra 'peer' holds it") from None
    from tests.experiments.export.test_residual_peer import peer_scene

    mitsuba.set_variant("scalar_rgb")
    lights = parted.lights
    assert isinstance(lights, DirectionalLights)
    # It takes one of sun and map at each sample, as often.
    peer = mitsuba.load_dict(peer_scene(scene, lights, parted.residual, SIZE, 4 * SAMPLES))
    return np.array(mitsuba.render(peer, seed=0), np.float32)


def by_blender(scene: Scene, parted: Parted) -> NDArray[np.float32]:
    with tempfile.TemporaryDirectory() as place:
        file, rest, image = (Path(place, name) for name in ("a.glb", "rest.exr", "image.exr"))
        file.write_bytes(exported(scene, parted))
        write_exr(rest, parted.residual.radiance)
        words = [file, rest, str(MAP_TURN), image, *map(str, (*SIZE, SAMPLES))]
        plain = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}
        python = renderers_python()
        done = subprocess.run([python, "-c", BLENDER, *words], capture_output=True, env=plain)
        if not image.exists():
            raise EnvlightError(f"{python} renders nothing: {done.stderr.decode()[-200:]!r}")
        return read_radiance(image)


def by_threejs(scene: Scene, parted: Parted) -> NDArray[np.float32]:
    with tempfile.TemporaryDirectory() as place:
        write_hdr(Path(place, "rest.hdr"), parted.residual.radiance)
        rest = Path(place, "rest.hdr").read_bytes()
    return threejs.render(exported(scene, parted), SIZE, rest, THREE_TURN)[0]


def exported(scene: Scene, parted: Parted) -> bytes:
    environment = single_environment(MAP, 512).load()
    return as_gltf(
        light_set(parted.lights, environment, "ours", COUNT, 0, parted.layer, parted.residual),
        scene,
    )


PROGRAMS: dict[str, Callable[[Scene, Parted], NDArray[np.float32]]] = {
    "envlight": by_envlight, "mitsuba": by_mitsuba, "blender": by_blender, "threejs": by_threejs,
}  # fmt: skip


def main() -> None:
    """Render and write them, all exposed as ours is."""
    scene = load_scene(SCENE)
    environment = single_environment(MAP, 512).load()
    parted = part(make_sampler("ours"), environment, COUNT, np.random.default_rng(0))
    scale = 0.0
    for name in ("envlight", *(sys.argv[1:] or list(PROGRAMS)[1:])):
        try:
            image = PROGRAMS[name](scene, parted)
        except EnvlightError as missing:
            print(f"{name}: {missing}")
            continue
        scale = scale or exposure_scale(image, np.ones(image.shape[:2], bool))
        write_jpeg(FOLDER / f"{name}.jpg", encoded(image * scale), quality=80)
        print(f"{name}: mean radiance {image.mean():.4g}")


if __name__ == "__main__":
    main()
