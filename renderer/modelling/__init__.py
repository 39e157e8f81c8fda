"""Building meshes from code: shapes, the ways to make them, and their normals."""

from renderer.modelling.curves import Points, arc, bezier, rounded, spline
from renderer.modelling.normals import shade
from renderer.modelling.shape import Shape, merge, weld
from renderer.modelling.solids import (
    box,
    cylinder,
    ground,
    plate,
    rounded_box,
    sphere,
    square,
    torus,
)
from renderer.modelling.surfaces import bezier_patches, grid, lathe, sweep, tube
from renderer.modelling.vessels import vessel

__all__ = [
    "Points",
    "Shape", "arc", "bezier", "bezier_patches", "box", "cylinder", "grid", "ground", "lathe",
    "merge", "plate", "rounded", "rounded_box", "shade", "sphere", "spline", "square", "sweep",
    "torus", "tube", "vessel", "weld",
]  # fmt: skip
