"""Lights as JSON and CSV, which keep every digit, as a script for Blender, and as a USD stage.

Each says in itself what its numbers mean, in which units and along which axes.

Blender: a SUN light each, in one collection per layer, in its frame
(`renderer.scene.blender_frame`). A SUN shines along its −Z; its strength is the
irradiance of a facing plane in W/m², its angle the angular diameter in radians.

USD: a UsdLux DistantLight each, one Scope per layer, +Y up. A DistantLight shines along the −Z of
its frame, so its +Z points towards the light. `normalize` is on: the irradiance of a plane that
faces the light is then intensity × color, whatever the angle up to 180°. `angle` is the angular
diameter in degrees.

Where lights leave a residual map, it becomes the world's texture. Blender's maps have +X in their
middle and −Y to the right of it, ours −Y and −X (both +Z up), a quarter turn about +Z apart. USD's
DomeLight reads a map as OpenEXR defines it, with +Z in the middle and +X to the left, as ours.
"""

import csv
import io
import json
import math
from typing import Any

from experiments.export.light_set import (
    Layer,
    LightSet,
    frame_towards,
    quaternion,
    strength_and_color,
)
from experiments.run.outputs import Kind
from renderer.scene.blender_frame import MAP_TURN, UP_TO_Z
from samplers import EnvlightError

KINDS = {
    "json": Kind("a JSON file of lights", (b'"conventions": {',)),
    "csv": Kind("a CSV file of lights", (b"layer,direction_x,",)),
    "blender": Kind("a Blender script of lights", (b"Run it in Blender's text editor, or: ",)),
    "gltf": Kind("a glTF file of lights", (b'"generator":"envlight, with trimesh"',)),
    "usd": Kind("a USD file of lights", (b"Irradiance of a facing plane: ", b"PXR-USDC")),
}
UNIT = "linear Rec. 709; W/m2 where the map's radiance is in W/(m2 sr)"
SIZE = (
    "a disc's own; of any other light that of an even cap with the luminous flux F = integral of Y "
    "and the luminance (integral of Y^2) / F of the texels nearest to it of all lights; at most "
    "pi/2, and 0 where there are none"
)
CONVENTIONS = {
    "direction": "unit vector towards the light; right-handed frame, +Y up; the map's first row is "
    "+Y, its middle column (u = 1/2) is +Z, u = 1/4 is +X",
    "irradiance": f"integral of radiance over the light's part of the map, per channel, {UNIT}",
    "angular_radius": f"in radians; {SIZE}",
    "use": "a surface with normal n receives the sum of irradiance * max(0, dot(n, direction)) "
    "over all lights of all layers; times (1 + cos(angular_radius)) / 2 for discs, which are "
    "uniform and cast soft shadows",
}
COLUMNS = (
    "layer",
    *(f"direction_{axis}" for axis in "xyz"),
    *(f"irradiance_{channel}" for channel in "rgb"),
    "angular_radius_rad",
)
SCRIPT = '''"""{title}.

Run it in Blender's text editor, or: blender FILE.blend --python THIS_FILE
Axes: +Z is up, where the map's first row is; its middle column is -Y, and u = 1/4 is +X. A sun
shines along its -Z.
Strength times colour: irradiance of a plane that faces the sun, {unit}.
A white diffuse plane that faces a sun of strength E has radiance E / pi.
Angle: angular diameter in radians, twice the angular radius.
Radius: {size}.
"""

import bpy

# (strength, colour, angle, rotation as quaternion w x y z)
LAYERS = {layers}

for layer, suns in LAYERS.items():
    collection = bpy.data.collections.new({name} + " " + layer)
    bpy.context.scene.collection.children.link(collection)
    for index, (strength, color, angle, rotation) in enumerate(suns):
        sun = bpy.data.lights.new(f"{{layer}} {{index:05d}}", "SUN")
        sun.energy, sun.color, sun.angle = strength, color, angle
        item = bpy.data.objects.new(sun.name, sun)
        item.rotation_mode, item.rotation_quaternion = "QUATERNION", rotation
        collection.objects.link(item)
'''
STAGE = """{title}.
Axes: +Y is up, where the map's first row is; its middle column is +Z, and u = 1/4 is +X. A light
shines along the -Z of its frame.
Irradiance of a facing plane: intensity * color, {unit}.
Angle: angular diameter in degrees, twice the angular radius.
Radius: {size} radians."""
WORLD = """
# What the suns leave of the map is the world's texture.
world = bpy.data.worlds.new({name})
world.use_nodes = True
nodes, links = world.node_tree.nodes, world.node_tree.links
nodes.clear()
place = nodes.new("ShaderNodeTexCoord")
turn = nodes.new("ShaderNodeMapping")
turn.inputs["Rotation"].default_value = (0.0, 0.0, {turn!r})
texture = nodes.new("ShaderNodeTexEnvironment")
texture.image = bpy.data.images.load({file})
background = nodes.new("ShaderNodeBackground")
output = nodes.new("ShaderNodeOutputWorld")
links.new(place.outputs["Generated"], turn.inputs["Vector"])
links.new(turn.outputs["Vector"], texture.inputs["Vector"])
links.new(texture.outputs["Color"], background.inputs["Color"])
links.new(background.outputs["Background"], output.inputs["Surface"])
bpy.context.scene.world = world
"""


def as_json(lights: LightSet) -> str:
    """One object: what the lights were made from, the conventions, and the layers."""
    content = {
        "map": {"name": lights.map_name, "digest": lights.map_digest},
        "sampler": lights.sampler,
        "count": lights.count,
        "seed": lights.seed,
        "conventions": CONVENTIONS,
        "layers": [{"name": layer.name, "lights": _objects(layer)} for layer in lights.layers],
    }
    if lights.ambient is not None:
        content["ambient"] = {
            "irradiance_from_all_sides": lights.ambient.total_flux.tolist(),
            "meaning": "integral over the sphere of the radiance that no disc holds",
        }
    if lights.residual is not None:
        content["residual"] = {
            "file": lights.residual_file,
            "irradiance_from_all_sides": lights.residual.total_flux.tolist(),
            "meaning": "a map of the radiance that no light carries; light the scene by it as well",
        }
    return json.dumps(content, indent=1, ensure_ascii=False) + "\n"


def _objects(layer: Layer) -> list[dict[str, object]]:
    rows = zip(
        layer.direction.tolist(), layer.irradiance.tolist(), layer.angle.tolist(), strict=True
    )
    return [{"direction": d, "irradiance": e, "angular_radius": a} for d, e, a in rows]


def as_csv(lights: LightSet) -> str:
    """One line per light below a line of names; above that the conventions, in lines with #."""
    text = io.StringIO()
    notes = (f"{name}: {meaning}" for name, meaning in CONVENTIONS.items())
    text.writelines(f"# {line}\n" for line in (lights.title, *notes))
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(COLUMNS)
    for layer in lights.layers:
        for d, e, a in zip(layer.direction, layer.irradiance, layer.angle, strict=True):
            writer.writerow([layer.name, *d.tolist(), *e.tolist(), float(a)])
    return text.getvalue()


def as_blender(lights: LightSet) -> str:
    """The script's text."""
    parts = []
    for layer in lights.layers:
        suns = []
        for direction, irradiance, angle in zip(
            layer.direction, layer.on_facing_plane, layer.angle, strict=True
        ):
            strength, color = strength_and_color(irradiance)
            rotation = quaternion(frame_towards(UP_TO_Z @ direction))
            suns.append(f"        ({strength!r}, {color!r}, {2.0 * float(angle)!r}, {rotation!r}),")
        parts.append("\n".join([f"    {layer.name!r}: [", *suns, "    ],"]))
    title = lights.title.replace("\\", "/").replace('"', "'")
    layers = "\n".join(["{", *parts, "}"])
    name = json.dumps(f"envlight {lights.map_name}")
    script = SCRIPT.format(title=title, layers=layers, name=name, unit=UNIT, size=SIZE)
    if lights.residual is None:
        return script
    file = json.dumps(lights.residual_file)
    return script + WORLD.format(name=name, turn=MAP_TURN, file=file)


def as_usd(lights: LightSet) -> Any:
    """The stage, in memory (`pxr.Usd.Stage`); EnvlightError where USD is not installed."""
    try:
        from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux
    except ImportError:
        raise EnvlightError(
            "USD is not installed; pip install 'envlight[usd]', or use --format json"
        ) from None
    stage = Usd.Stage.CreateInMemory()
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    stage.SetMetadata("comment", STAGE.format(title=lights.title, unit=UNIT, size=SIZE))
    root = UsdGeom.Xform.Define(stage, "/lights")
    stage.SetDefaultPrim(root.GetPrim())
    for layer in lights.layers:
        scope = Sdf.Path("/lights").AppendChild(layer.name)
        UsdGeom.Xform.Define(stage, scope)
        for index, direction in enumerate(layer.direction):
            light = UsdLux.DistantLight.Define(stage, scope.AppendChild(f"light_{index:05d}"))
            strength, color = strength_and_color(layer.on_facing_plane[index])
            light.CreateIntensityAttr(strength)
            light.CreateColorAttr(Gf.Vec3f(*color))
            light.CreateNormalizeAttr(True)
            light.CreateAngleAttr(math.degrees(2.0 * float(layer.angle[index])))
            rows = Gf.Matrix3d(*frame_towards(direction).T.ravel().tolist())  # row vectors
            light.AddTransformOp().Set(Gf.Matrix4d(rows, Gf.Vec3d(0.0)))
    if lights.residual is not None:
        dome = UsdLux.DomeLight.Define(stage, "/lights/residual")
        dome.CreateIntensityAttr(1.0)
        dome.CreateTextureFileAttr(Sdf.AssetPath(lights.residual_file))
        dome.CreateTextureFormatAttr(UsdLux.Tokens.latlong)
    return stage
