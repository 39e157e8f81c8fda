"""Exported lights light a scene as the sampler's do: read back, on plates that face the axes."""

import csv
import json
import math
import re
import runpy
import sys
from collections import defaultdict
from functools import cache
from itertools import pairwise
from pathlib import Path
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest

from experiments.cli.lights import SUFFIXES, USD_SUFFIXES, _write
from experiments.cli.lights import lights as write_lights
from experiments.export.light_set import light_set, part
from renderer.image import write_exr
from renderer.scene.blender_frame import UP_TO_Z
from samplers import DiscLights, EnvironmentMap, EnvlightError, make_sampler, sampler_names
from samplers.conformance.stress_maps import stress_map
from samplers.conformance.suite import parts_of
from samplers.files.image_file import read_radiance
from samplers.grids.nearest_light import shining_radius
from samplers.sphere import (
    angular_distance,
    cap_solid_angle,
    direction_from_uv,
    pixel_direction,
    pixel_directions,
    row_solid_angle,
)
from tests.samplers.maps import sizes_of_a_sun

PLATES = np.concatenate([np.eye(3), -np.eye(3)])
LIGHTINGS = {
    name: make_sampler(name).prepare(stress_map("constant"), 16, np.random.default_rng(0))
    for name in sampler_names()
}
SAMPLERS = [name for name, lighting in LIGHTINGS.items() if parts_of(lighting)]
"""Those that give a set of lights."""
SIZED = [name for name in SAMPLERS if not isinstance(LIGHTINGS[name], DiscLights)]
"""Those whose lights are as large as what shines at them: a disc has a size of its own."""
SUN, SHARE = math.radians(1.4), 0.94
"""Angular radius of a sun, and its part of the flux."""
DOUBLE, QUADRATURE, SINGLE = 1e-12, 1e-9, 1e-6
"""What repr keeps of float64, `cosine_share` of an integral, and USD's float32 of a few terms."""


def on_plates(lights):
    """Irradiance (6, 3) of plates, from (direction, irradiance) of each light."""
    return sum(np.maximum(PLATES @ np.array(d), 0.0)[:, None] * np.array(e) for d, e in lights)


@pytest.fixture(scope="module")
def maps(tmp_path_factory):
    path = tmp_path_factory.mktemp("maps") / "sky.exr"
    write_exr(path, stress_map("sun-and-sky").radiance)
    return path


def skip_without_usd(name):
    if name.endswith(USD_SUFFIXES):
        pytest.importorskip("pxr", reason="USD is not installed: the extra 'usd' holds it")


@pytest.fixture
def export(maps, tmp_path):
    def export(name, sampler, file_format="", residual=None):
        skip_without_usd(name)
        path = tmp_path / name
        rest = tmp_path / residual if residual else None
        write_lights(str(maps), sampler, 32, file_format, 3, False, path, rest)
        return path

    return export


def truth(maps, sampler, facing):
    """Direction, irradiance and angle of the lights; `facing`: as planes get it from discs."""
    environment = EnvironmentMap.from_file(maps)
    lighting = make_sampler(sampler).prepare(environment, 32, np.random.default_rng(3))
    direction, irradiance, angle = map(np.concatenate, zip(*parts_of(lighting), strict=True))
    if not isinstance(lighting, DiscLights):
        return direction, irradiance, shining_radius(environment, direction)
    return direction, irradiance * (cosine_share(angle)[:, None] if facing else 1.0), angle


def cosine_share(angle):
    """∫ cos θ dω over ∫ dω on caps, by the midpoint rule, which is exact to 1/n² = 1e-10."""
    theta = (np.arange(100_000) + 0.5) / 100_000 * angle[:, None]
    return (np.sin(theta) * np.cos(theta)).sum(1) / np.sin(theta).sum(1)


def from_json(path):
    content = json.loads(path.read_text(encoding="utf-8"))
    lights = [light for layer in content["layers"] for light in layer["lights"]]
    return [(li["direction"], li["irradiance"]) for li in lights], [
        li["angular_radius"] for li in lights
    ]


def from_csv(path):
    with path.open(encoding="utf-8") as file:
        rows = list(csv.DictReader(line for line in file if not line.startswith("#")))
    number = [{key: float(v) for key, v in row.items() if key != "layer"} for row in rows]
    return [
        ([r[f"direction_{a}"] for a in "xyz"], [r[f"irradiance_{c}"] for c in "rgb"])
        for r in number
    ], [r["angular_radius_rad"] for r in number]


def from_usd(path):
    from pxr import Gf, Usd, UsdGeom, UsdLux

    stage = Usd.Stage.Open(str(path))
    assert UsdGeom.GetStageUpAxis(stage) == "Y"
    lights, angles = [], []
    for prim in stage.Traverse():
        if not prim.IsA(UsdLux.DistantLight):
            continue
        light = UsdLux.DistantLight(prim)
        assert light.GetNormalizeAttr().Get() is True
        world = UsdGeom.Xformable(prim).ComputeLocalToWorldTransform(Usd.TimeCode.Default())
        travel = world.TransformDir(Gf.Vec3d(0, 0, -1))
        color = np.array(light.GetColorAttr().Get())
        lights.append((-np.array(travel), light.GetIntensityAttr().Get() * color))
        angles.append(math.radians(light.GetAngleAttr().Get()) / 2.0)
    return lights, angles


class Nodes(list):
    """A node tree of a stand-in for Blender: nodes by their type, links as pairs of sockets."""

    def new(self, kind):
        def sockets(side):
            return defaultdict(lambda: SimpleNamespace(node=node, side=side, default_value=None))

        node = SimpleNamespace(kind=kind)
        node.inputs, node.outputs = sockets("in"), sockets("out")
        self.append(node)
        return node


def blender_after(path):
    """The objects that a script links, and its world, under a stand-in for Blender."""
    linked = []

    def collection(name):
        return SimpleNamespace(name=name, objects=SimpleNamespace(link=linked.append))

    children = SimpleNamespace(link=lambda _: None)
    bpy = ModuleType("bpy")
    bpy.data = SimpleNamespace(
        collections=SimpleNamespace(new=collection),
        lights=SimpleNamespace(new=lambda name, kind: SimpleNamespace(name=name, kind=kind)),
        objects=SimpleNamespace(new=lambda name, data: SimpleNamespace(name=name, data=data)),
    )
    scene = SimpleNamespace(collection=SimpleNamespace(children=children))
    bpy.context = SimpleNamespace(scene=scene)
    tree = SimpleNamespace(nodes=Nodes(), links=[])
    tree.links = SimpleNamespace(made=[], new=lambda a, b: tree.links.made.append((a, b)))
    bpy.data.worlds = SimpleNamespace(new=lambda name: SimpleNamespace(node_tree=tree))
    bpy.data.images = SimpleNamespace(load=Path)
    sys.modules["bpy"] = bpy
    try:
        runpy.run_path(str(path))
    finally:
        del sys.modules["bpy"]
    return linked, getattr(scene, "world", None)


def turned_z(x, y, z, w):
    """Where a quaternion turns +Z, which is against the travel of a light."""
    return np.array([2 * (x * z + w * y), 2 * (y * z - w * x), w * w - x * x - y * y + z * z])


def from_blender(path):
    lights, angles = [], []
    for item in blender_after(path)[0]:
        assert (item.data.kind, item.rotation_mode) == ("SUN", "QUATERNION")
        w, *vector = item.rotation_quaternion
        lights.append(
            (UP_TO_Z.T @ turned_z(*vector, w), item.data.energy * np.array(item.data.color))
        )
        angles.append(item.data.angle / 2.0)
    return lights, angles


def from_gltf(path):
    content = path.read_bytes()
    tree = json.loads(content[20 : 20 + int.from_bytes(content[12:16], "little")])
    made, lights, angles = tree["extensions"]["KHR_lights_punctual"]["lights"], [], []
    for node in tree["nodes"]:
        if "extensions" not in node:
            continue
        light = made[node["extensions"]["KHR_lights_punctual"]["light"]]
        lights.append((turned_z(*node["rotation"]), light["intensity"] * np.array(light["color"])))
        angles.append(node["extras"]["angular_radius"])
    return lights, angles


READERS = {
    "lights.json": (from_json, DOUBLE),
    "lights.csv": (from_csv, DOUBLE),
    "lights.usda": (from_usd, SINGLE),
    "lights.usdc": (from_usd, SINGLE),
    "lights.py": (from_blender, QUADRATURE),
    "lights.glb": (from_gltf, QUADRATURE),
}


@pytest.mark.parametrize("sampler", SAMPLERS)
@pytest.mark.parametrize("name", READERS)
def test_lights_are_read_back_as_they_were(export, maps, name, sampler):
    read, tolerance = READERS[name]
    lights, angles = read(export(name, sampler))
    directions, irradiances = map(np.array, zip(*lights, strict=True))
    wanted = truth(maps, sampler, name.endswith((".usda", ".usdc", ".py", ".glb")))
    for got, kept in zip((directions, irradiances, angles), wanted, strict=True):
        assert np.allclose(got, kept, rtol=tolerance, atol=tolerance * kept.max())


@cache
def lit(name):
    """A sun over a dim gradient, with its texels; a texel; a grey map."""
    if name == "sun":
        way, size = pixel_directions(128), row_solid_angle(128, 256)[:, None]
        shape = angular_distance(way, direction_from_uv(0.31, 0.29)) < SUN
        sky = np.where(shape, 0.0, 1.2 + way[..., 1])
        sky *= (1.0 / SHARE - 1.0) * (shape * size).sum() / (sky * size).sum()
    else:
        shape = np.zeros((16, 32), bool)
        shape[5, 9] = name == "texel"
        sky = np.zeros(shape.shape) if name == "texel" else np.full(shape.shape, 0.3)
    radiance = (shape + sky)[..., None].repeat(3, axis=2)
    return EnvironmentMap.from_array(radiance, name), shape


@cache
def left_by(sampler, name, count=16):
    lighting = make_sampler(sampler).prepare(lit(name)[0], count, np.random.default_rng(0))
    return light_set(lighting, lit(name)[0], sampler, count, 0)


@pytest.fixture(params=READERS)
def leave(request, tmp_path):
    """Write lights in each format; their directions (n, 3) and angles (n,) as they are read."""
    name = request.param
    skip_without_usd(name)
    read, tolerance = READERS[name]

    def leave(found):
        _write(found, SUFFIXES[Path(name).suffix], tmp_path / name)
        lights, angles = read(tmp_path / name)
        return np.array([d for d, _ in lights]), np.array(angles)

    leave.tolerance = 1e-5 + 2.0 * tolerance
    """Of a solid angle, which goes with the square of the angle; luminance is float32."""
    return leave


@pytest.mark.parametrize("sampler", SIZED)
def test_a_sun_leaves_as_large_as_it_is(leave, sampler):
    environment, sun = lit("sun")
    directions, angles = leave(left_by(sampler, "sun"))
    for light, least, most in sizes_of_a_sun(environment, sun, directions):
        got = cap_solid_angle(angles[light])
        assert least * (1.0 - leave.tolerance) <= got <= most * (1.0 + leave.tolerance)


@pytest.mark.parametrize("sampler", SIZED)
def test_a_lit_texel_leaves_as_large_as_it_is(leave, sampler):
    size = lit("texel")[0].row_solid_angle[5]
    _, angles = leave(left_by(sampler, "texel"))
    # Its centre is nearest to one light alone; nothing shines at others.
    assert np.count_nonzero(angles) == 1
    assert cap_solid_angle(angles.max()) == pytest.approx(size, rel=leave.tolerance)


def test_no_light_is_wider_than_a_hemisphere(leave):
    _, angles = leave(left_by("median-cut", "grey", 1))
    assert angles == pytest.approx([0.5 * math.pi], rel=leave.tolerance)


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("a.json", ('"angular_radius": "in radians; ', '"irradiance": "integral of', "+Y up; ")),
        ("a.csv", ("# angular_radius: in radians; ", "# irradiance: integral of", "+Y up; ")),
        ("a.py", ("Angle: angular diameter in radians", "W/m2", "Axes: +Z is up")),
        ("a.usda", ("Angle: angular diameter in degrees", "W/m2", "Axes: +Y is up")),
        ("a.gltf", ("angular_radius in radians", "(lux) * color is the irradiance", "+Y up, ")),
    ],
)
def test_units_and_axes_stand_in_every_format(export, name, said):
    text = export(name, "median-cut").read_text(encoding="utf-8")
    assert all(words in text for words in said)
    assert re.search(r"\d+ lights of sky by median-cut, seed 3|\"sampler\": \"median-cut\"", text)


def test_fewer_lights_than_were_asked_for_are_told():
    found = left_by("variance-minimization", "texel")
    assert len(found) < 16 and found.title.endswith(f"; {len(found)} of 16 asked")
    assert left_by("median-cut", "sun").title.endswith("seed 0")


def test_only_gltf_takes_a_scene(maps, tmp_path):
    with pytest.raises(EnvlightError, match="only glTF takes a scene; write to FILE"):
        write_lights(str(maps), "median-cut", 4, "", 0, False, tmp_path / "a.csv", None, "vase")


def test_layers_are_told_apart(export):
    content = json.loads(export("a.json", "ours").read_text(encoding="utf-8"))
    assert [layer["name"] for layer in content["layers"]] == ["direct", "indirect"]
    assert sum(len(layer["lights"]) for layer in content["layers"]) <= 32
    assert set(content["conventions"]) >= {"direction", "irradiance", "angular_radius"}


def test_the_ambient_remainder_of_disc_lights_is_kept_as_a_map(export, maps, capsys):
    path = export("discs.json", "center-surround")
    assert "the ambient remainder" in capsys.readouterr().err
    ambient = read_radiance(path.with_name("discs.json.ambient.exr"))
    content = json.loads(path.read_text(encoding="utf-8"))
    there = EnvironmentMap.from_array(ambient).total_flux
    assert np.allclose(content["ambient"]["irradiance_from_all_sides"], there, rtol=SINGLE)
    discs = np.sum([e for _, e in from_json(path)[0]], axis=0)
    assert np.allclose(discs + there, EnvironmentMap.from_file(maps).total_flux, rtol=1e-5)


@pytest.mark.parametrize("residual", [None, "left.exr"])
def test_a_distribution_has_no_lights_to_write(export, tmp_path, residual):
    with pytest.raises(EnvlightError, match=r"mis gives a distribution, .* has no set of lights"):
        export("a.json", "mis", residual=residual)
    assert not any(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("name", "file_format", "said"),
    [
        ("a.txt", "", "the suffix tells no format; give --format, or one of .json, .csv, .py, "),
        ("a.json", "obj", "--format obj: use json, csv, blender, gltf or usd"),
        ("a.json", "usd", "name a usd file .usda, .usdc, .usd"),
    ],
)
def test_formats_that_do_not_exist_are_told(export, name, file_format, said):
    with pytest.raises(EnvlightError, match=said.replace(".", r"\.")):
        export(name, "median-cut", file_format)


def plates_under(radiance):
    """Irradiance (6, 3) of plates under a map, by its texels' centres."""
    height = len(radiance)
    weight = row_solid_angle(height, 2 * height)[:, None, None] * radiance.astype(np.float64)
    cosine = np.maximum(pixel_directions(height) @ PLATES.T, 0.0)
    return np.einsum("hwp,hwc->pc", cosine, weight)


@pytest.mark.parametrize("name", READERS)
def test_a_file_of_lights_names_the_residual(export, maps, name):
    read, tolerance = READERS[name]
    path = export(name, "ours", residual="rest/left.exr")
    left = read_radiance(path.parent / "rest" / "left.exr")
    whole = EnvironmentMap.from_file(maps)
    # Some of the map's texels, as they were.
    carried = (left == 0.0).all(axis=2)
    assert 0 < carried.sum() < 0.02 * carried.size
    assert np.array_equal(left[~carried], whole.radiance[~carried])
    lights, angles = read(path)
    energy = sum(np.array(e) for _, e in lights) + EnvironmentMap.from_array(left).total_flux
    assert np.allclose(energy, whole.total_flux, rtol=max(tolerance, 1e-6))
    # Lights are no larger than what they carry (Cauchy–Schwarz), a sky that stays does not count.
    size = (carried * whole.row_solid_angle[:, None]).sum()
    assert 0.0 < cap_solid_angle(angles).sum() <= size * (1.0 + 1e-5)
    if name == "lights.json":
        content = json.loads(path.read_text(encoding="utf-8"))
        assert [layer["name"] for layer in content["layers"]] == ["direct"]
        assert content["residual"]["file"] == "./rest/left.exr"


def test_the_residual_is_blenders_world_and_turned_as_it_reads_maps(export):
    path = export("lights.py", "ours", residual="left.exr")
    world = blender_after(path)[1]
    tree = world.node_tree
    nodes = {node.kind: node for node in tree.nodes}
    assert nodes["ShaderNodeTexEnvironment"].image == path.with_name("left.exr")
    joined = [(a.node.kind, b.node.kind) for a, b in tree.links.made]
    chain = [f"ShaderNode{kind}" for kind in (
        "TexCoord", "Mapping", "TexEnvironment", "Background", "OutputWorld")]  # fmt: skip
    assert joined == list(pairwise(chain))
    angle = nodes["ShaderNodeMapping"].inputs["Rotation"].default_value[2]
    height = 8
    for row, column in ((1, 0), (3, 5), (4, 12), (6, 15)):
        x, y, z = UP_TO_Z @ pixel_direction(row, column, height)
        x, y = x * math.cos(angle) - y * math.sin(angle), x * math.sin(angle) + y * math.cos(angle)
        # Where Cycles looks a direction up, +Z being its upper edge.
        u = -math.atan2(y, x) / (2.0 * math.pi) + 0.5
        v = math.atan2(z, math.hypot(x, y)) / math.pi + 0.5
        assert u * 2 * height == pytest.approx(column + 0.5, abs=1e-9)
        assert (1.0 - v) * height == pytest.approx(row + 0.5, abs=1e-9)


def test_the_residual_is_usds_dome(export):
    path = export("lights.usda", "ours", residual="left.exr")
    from pxr import Usd, UsdLux

    stage = Usd.Stage.Open(str(path))
    (dome,) = [UsdLux.DomeLight(p) for p in stage.Traverse() if p.IsA(UsdLux.DomeLight)]
    assert dome.GetTextureFileAttr().Get().path == "./left.exr"
    assert dome.GetTextureFormatAttr().Get() == "latlong"
    assert dome.GetIntensityAttr().Get() == 1.0


def test_lights_and_residual_light_plates_as_the_map_does(export, maps):
    """The residual as it is, the lights as their texels: EnvDirects errs by where it puts them."""
    path = export("a.json", "ours", residual="left.exr")
    left, whole = read_radiance(path.with_name("left.exr")), EnvironmentMap.from_file(maps)
    lights, _ = from_json(path)
    got, wanted = on_plates(lights) + plates_under(left), plates_under(whole.radiance)
    # A texel of a cluster is within its extent, and no cosine changes by more than an angle.
    extent = part(make_sampler("ours"), whole, 32, np.random.default_rng(3)).lights.extent
    share = np.sum([e for _, e in lights], axis=0)
    assert (np.abs(got - wanted) <= extent.max() * share).all()


@pytest.mark.parametrize(
    ("sampler", "residual", "said"),
    [
        ("ours", "left.exr", r"which are written: \d+; pixels that they carry, black in the"),
        ("ours", "left.hdr", r"which are written: \d+; pixels that they carry, black in the"),
        (
            "median-cut",
            "left.exr",
            "nothing is left: median-cut gives all of the map to its lights",
        ),
        ("center-surround", "left.hdr", "the residual is the ambient map, what the discs leave"),
    ],
)
def test_what_is_left_is_told_with_its_energy(export, maps, capsys, sampler, residual, said):
    path = export("a.json", sampler, residual=residual)
    told = capsys.readouterr().err
    assert re.search(said, told) and "the ambient remainder" not in told
    offs = [float(off) for off in re.findall(r"off by ([+-]\S+?)(?:;|$)", told, re.MULTILINE)]
    assert len(offs) == 3 and max(map(abs, offs)) <= 1e-6
    left = read_radiance(path.with_name(residual))
    assert left.any() == (sampler != "median-cut")
    whole = sum(np.array(e) for _, e in from_json(path)[0]) + EnvironmentMap(left).total_flux
    # A value of an .hdr file is off by half a step, 2⁻⁸ of the largest, and evenly to both sides.
    rounding = 1e-6 if residual.endswith(".exr") else 2.0**-8
    assert np.allclose(whole, EnvironmentMap.from_file(maps).total_flux, rtol=rounding)


@pytest.mark.parametrize(
    ("residual", "said"),
    [("left.png", "name it FILE.exr"), ("a.exr", "the lights go there; name another file")],
)
def test_a_residual_that_could_not_be_read_is_refused(export, residual, said):
    with pytest.raises(EnvlightError, match=said):
        export("a.exr", "ours", "json", residual=residual)
