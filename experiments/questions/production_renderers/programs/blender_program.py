"""Renders a written scene by Cycles, from Blender's own Python or from the package `bpy`.

`scene.json` says what is rendered, in Blender's frame; nothing is converted here. Persistent data
keeps what Cycles builds of the scene from the first rendering on, so that a later one is rendering
alone.
"""

import json
import runpy
import time
from pathlib import Path
from typing import Any

import numpy as np


class BlenderScene:
    """scene.json as Blender's data, to be rendered by Cycles."""

    def __init__(self, folder: Path, threads: int) -> None:
        import bpy

        bpy.ops.wm.read_factory_settings(use_empty=True)
        import addon_utils  # can be found once bpy is there

        addon_utils.enable("cycles", default_set=True)
        self._bpy: Any = bpy
        self._folder = folder
        self._written = folder / "rendered.exr"
        described = json.loads((folder / "scene.json").read_text(encoding="utf-8"))
        self._scene: Any = bpy.context.scene
        self._set_up(described, threads)
        for item in described["objects"]:
            self._add_object(item)
        self._add_camera(described["camera"])
        self._add_map(described["map"])
        self.facts = {
            "renderer": "Cycles",
            "version": bpy.app.version_string,
            **described["render"],
            **{f"cycles.{name}": value for name, value in described["cycles"].items()},
        }

    def _set_up(self, described: dict[str, Any], threads: int) -> None:
        render = self._scene.render
        render.engine = "CYCLES"
        render.threads_mode, render.threads = "FIXED", threads
        for name, value in described["render"].items():
            setattr(render, name, value)
        for name, value in described["cycles"].items():
            setattr(self._scene.cycles, name, value)
        output = render.image_settings
        output.file_format, output.color_mode = "OPEN_EXR", "RGB"
        output.color_depth, output.exr_codec = "32", "ZIP"

    def _add_object(self, item: dict[str, Any]) -> None:
        bpy = self._bpy
        with np.load(self._folder / item["mesh"]) as arrays:
            vertex, normal, triangle = arrays["vertex"], arrays["normal"], arrays["triangle"]
        mesh = bpy.data.meshes.new(item["name"])
        mesh.vertices.add(len(vertex))
        mesh.vertices.foreach_set("co", vertex.ravel())
        mesh.loops.add(triangle.size)
        mesh.loops.foreach_set("vertex_index", triangle.ravel())
        mesh.polygons.add(len(triangle))
        mesh.polygons.foreach_set("loop_start", np.arange(0, triangle.size, 3, dtype=np.int32))
        mesh.polygons.foreach_set("use_smooth", np.ones(len(triangle), bool))
        # Directions by vertex, kept to the last digit; split normals are rounded to .04 degrees.
        normals = mesh.attributes.new("custom_normal", "FLOAT_VECTOR", "POINT")
        normals.data.foreach_set("vector", normal.ravel())
        mesh.update(calc_edges=True)
        mesh.materials.append(self._material(item["name"], item["material"]))
        placed = bpy.data.objects.new(item["name"], mesh)
        for name, value in item["options"].items():
            setattr(placed, name, value)
        self._scene.collection.objects.link(placed)

    def _material(self, name: str, described: dict[str, Any]) -> Any:
        material = self._bpy.data.materials.new(name)
        material.use_nodes = True
        nodes = material.node_tree.nodes
        nodes.clear()
        surface = nodes.new(described["node"])
        for option, value in described["options"].items():
            setattr(surface, option, value)
        for socket, value in described["inputs"].items():
            surface.inputs[socket].default_value = value
        output = nodes.new("ShaderNodeOutputMaterial")
        material.node_tree.links.new(surface.outputs[0], output.inputs["Surface"])
        return material

    def _add_camera(self, described: dict[str, Any]) -> None:
        import mathutils

        camera = self._bpy.data.cameras.new("camera")
        camera.sensor_fit, camera.angle = "VERTICAL", described["angle"]
        camera.clip_start, camera.clip_end = described["clip"]
        placed = self._bpy.data.objects.new("camera", camera)
        placed.matrix_world = mathutils.Matrix(described["matrix"])
        self._scene.collection.objects.link(placed)
        self._scene.camera = placed

    def _add_map(self, described: dict[str, Any]) -> None:
        bpy = self._bpy
        world = bpy.data.worlds.new("map")
        world.use_nodes = True
        tree = world.node_tree
        tree.nodes.clear()
        place = tree.nodes.new("ShaderNodeTexCoord")
        turn = tree.nodes.new("ShaderNodeMapping")
        turn.inputs["Rotation"].default_value = described["rotation"]
        texture = tree.nodes.new("ShaderNodeTexEnvironment")
        texture.image = bpy.data.images.load(str(self._folder / described["file"]))
        texture.image.colorspace_settings.name = described["colorspace"]
        texture.interpolation = described["interpolation"]
        background = tree.nodes.new("ShaderNodeBackground")
        output = tree.nodes.new("ShaderNodeOutputWorld")
        tree.links.new(place.outputs["Generated"], turn.inputs["Vector"])
        tree.links.new(turn.outputs["Vector"], texture.inputs["Vector"])
        tree.links.new(texture.outputs["Color"], background.inputs["Color"])
        tree.links.new(background.outputs["Background"], output.inputs["Surface"])
        for name, value in described["cycles"].items():
            setattr(world.cycles, name, value)
        self._scene.world = world

    def render(self, samples: int, seed: int) -> tuple[float, dict[str, Any]]:
        self._scene.cycles.samples, self._scene.cycles.seed = samples, seed
        started = time.perf_counter()
        self._bpy.ops.render.render()
        return time.perf_counter() - started, {}

    def image(self) -> np.ndarray:
        """The last image. What was rendered can only be read from a file."""
        self.write(self._written)
        image = self._bpy.data.images.load(str(self._written))
        width, height = image.size
        pixels = np.empty(4 * width * height, np.float32)
        image.pixels.foreach_get(pixels)
        self._bpy.data.images.remove(image)
        self._written.unlink()
        return np.ascontiguousarray(pixels.reshape(height, width, 4)[::-1, :, :3])

    def write(self, path: Path) -> None:
        result = self._bpy.data.images["Render Result"]
        result.save_render(str(path.resolve()), scene=self._scene)


if __name__ == "__main__":
    here = Path(__file__).resolve().parent
    runpy.run_path(str(here / "session.py"))["main"](BlenderScene, here)
