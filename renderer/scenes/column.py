"""A column on a plinth under an abacus: 440 triangles.

The shaft swells and its mouldings stand out, so that curved soft shadows fall on it and beside it.
It is coarse on purpose, 23 sides.
"""

from renderer.modelling import box, lathe, merge, shade, square
from renderer.scene import Camera, Object, Scene
from renderer.scene.materials import Lambert

SIDES = 23
PLINTH = 0.3
OUTLINE = [
    (0.0, PLINTH),
    (0.78, PLINTH),
    (0.84, 0.40),
    (0.78, 0.50),
    (0.60, 0.56),
    (0.60, 1.60),
    (0.50, 3.20),
    (0.50, 3.28),
    (0.66, 3.40),
    (0.74, 3.60),
    (0.0, 3.60),
]


def scene() -> Scene:
    stone = Lambert((0.62, 0.58, 0.50))
    plinth = box((1.8, PLINTH, 1.8)).resting()
    abacus = box((1.7, 0.26, 1.7)).resting(OUTLINE[-1][1])
    column = merge(plinth, lathe(OUTLINE, SIDES), abacus).turned("y", 30.0)
    objects = (
        Object("ground", shade(square(32.0)), Lambert((0.50, 0.50, 0.48))),
        Object("column", shade(column, 35.0), stone),
    )
    camera = Camera(eye=(2.6, 4.4, 9.6), target=(0.35, 1.65, 0.0), field_of_view=32.0)
    return Scene("column", objects, camera)
