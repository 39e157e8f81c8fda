"""Lights as JSON and CSV; both keep every digit."""

import csv
import io
import json

from experiments.export.light_set import Layer, LightSet

CONVENTIONS = {
    "direction": "unit vector towards the light; right-handed frame, +Y up; the map's first row is "
    "+Y, its middle column (u = 1/2) is +Z, u = 1/4 is +X",
    "irradiance": "integral of radiance over the light's part of the map, per channel, linear "
    "Rec. 709; W/m² where the map's radiance is in W/(m² sr)",
    "angular_radius": "radians; of the disc, or the mean angle between a light and its part of the "
    "map",
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
    return json.dumps(content, indent=1, ensure_ascii=False) + "\n"


def _objects(layer: Layer) -> list[dict[str, object]]:
    rows = zip(
        layer.direction.tolist(), layer.irradiance.tolist(), layer.angle.tolist(), strict=True
    )
    return [{"direction": d, "irradiance": e, "angular_radius": a} for d, e, a in rows]


def as_csv(lights: LightSet) -> str:
    """One line per light below a line of names; the conventions are those of the JSON."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(COLUMNS)
    for layer in lights.layers:
        for d, e, a in zip(layer.direction, layer.irradiance, layer.angle, strict=True):
            writer.writerow([layer.name, *d.tolist(), *e.tolist(), float(a)])
    return text.getvalue()
