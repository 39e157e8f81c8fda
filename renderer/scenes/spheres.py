"""Three spheres of measured materials: pink fabric, blue metallic paint and chrome steel.

Ward materials from diffuse to nearly a mirror, after Ergun, Kurt and Öztürk, "Real-time kd-tree
based importance sampling of environment maps", SCCG 2012, figure 6. The materials are surrogates,
see `ward_materials.py`.
"""

from collections.abc import Mapping

from renderer.modelling import ground, shade, sphere
from renderer.scene import Camera, Object, Scene
from renderer.scene.materials import Lambert, Ward
from renderer.scene.ward_materials import MATERIALS

MEASURED = {
    name: MATERIALS[name] for name in ("pink-fabric", "blue-metallic-paint", "chrome-steel")
}
SPACING = 2.3


def scene(materials: Mapping[str, Ward] = MEASURED) -> Scene:
    """A sphere of each of the materials, in a row; the materials' names are the spheres'."""
    ball = sphere(1.0, 56).resting()
    objects = [Object("ground", shade(ground(13.0)), Lambert((0.45, 0.45, 0.45)))]
    for i, (name, material) in enumerate(materials.items()):
        x = (i - 0.5 * (len(materials) - 1)) * SPACING
        objects.append(Object(name, shade(ball.moved(x)), material))
    return Scene("spheres", tuple(objects), Camera((0.0, 2.7, 10.5), (0.0, 0.95, 0.0), 29.0))
