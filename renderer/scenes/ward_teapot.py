"""The Utah teapot alone, in chrome steel or another of the Ward materials.

After Ergun, Kurt and Öztürk, "Real-time kd-tree based importance sampling of environment maps",
SCCG 2012, figures 3 to 5. The materials are surrogates, see `ward_materials.py`.
"""

from renderer.modelling import ground, shade
from renderer.modelling.teapot import teapot
from renderer.scene import Camera, Object, Scene
from renderer.scene.materials import Lambert, Ward
from renderer.scene.ward_materials import CHROME_STEEL


def scene(material: Ward = CHROME_STEEL) -> Scene:
    objects = (
        Object("ground", shade(ground(16.0)), Lambert((0.45, 0.45, 0.45))),
        Object("teapot", shade(teapot(32).turned("y", 28.0)), material),
    )
    camera = Camera(eye=(1.0, 4.6, 10.6), target=(0.15, 1.35, 0.0), field_of_view=31.0)
    return Scene("ward-teapot", objects, camera)
