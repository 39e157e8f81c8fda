"""Three boxes on a square: 38 triangles.

As plain as a scene with shadows can be. One box leans its shadow on another, so that soft shadows
can be judged on a floor and on a wall.
"""

from renderer.modelling import Shape, box, shade, square
from renderer.scene import Camera, Object, Scene
from renderer.scene.materials import Lambert


def scene() -> Scene:
    objects = (
        Object("ground", shade(square(32.0)), Lambert((0.55, 0.53, 0.50))),
        Object(
            "tall", shade(_standing((1.1, 3.0, 1.1), 25.0, -1.3, -0.9)), Lambert((0.62, 0.22, 0.16))
        ),
        Object(
            "cube", shade(_standing((1.5, 1.5, 1.5), -18.0, 1.1, -0.3)), Lambert((0.20, 0.36, 0.58))
        ),
        Object(
            "flat", shade(_standing((1.9, 0.6, 1.0), 12.0, -0.35, 1.6)), Lambert((0.66, 0.55, 0.22))
        ),
    )
    camera = Camera(eye=(2.4, 4.6, 9.4), target=(-0.1, 1.1, 0.1), field_of_view=31.0)
    return Scene("three-boxes", objects, camera)


def _standing(size: tuple[float, float, float], turn: float, x: float, z: float) -> Shape:
    return box(size).resting().turned("y", turn).moved(x, 0.0, z)
