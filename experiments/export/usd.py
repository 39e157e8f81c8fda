"""Lights as a USD stage: a UsdLux DistantLight each, one Scope per layer, +Y up.

A DistantLight shines along the −Z of its frame, so its +Z points towards the light. `normalize` is
on: the irradiance of a plane that faces the light is then intensity × color, whatever the angle.
`angle` is the angular diameter in degrees.
"""

import math
from typing import Any

from experiments.export.frame import frame_towards
from experiments.export.light_set import LightSet, strength_and_color
from samplers import EnvlightError


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
    stage.SetMetadata("comment", f"{lights.title}. Irradiance of a facing plane: intensity * color")
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
    return stage
