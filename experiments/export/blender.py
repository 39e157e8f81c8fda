"""Lights as a Python script for Blender: a SUN light each, in one collection per layer.

Blender is +Z up: (x, y, z) of a map becomes (x, −z, y). A SUN shines along its −Z; its strength is
the irradiance of a facing plane in W/m², its angle the angular diameter in radians.
"""

import json

from experiments.export.frame import UP_TO_Z, frame_towards, quaternion
from experiments.export.light_set import LightSet, strength_and_color

SCRIPT = '''"""{title}.

Run it in Blender's text editor, or: blender FILE.blend --python THIS_FILE
A white diffuse plane that faces a sun of strength E has radiance E / pi.
"""

import bpy

# (strength in W/m2, linear colour, angle in radians, rotation as quaternion w x y z)
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
    return SCRIPT.format(title=title, layers=layers, name=json.dumps(f"envlight {lights.map_name}"))
