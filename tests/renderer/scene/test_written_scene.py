"""Scenes of Mitsuba and pbrt: the same points as those programs see, of the nearest materials."""

import math
import warnings

import numpy as np
import pytest
import trimesh

from renderer.primary import camera_axes
from renderer.scene.load import files_of, load_scene
from renderer.scene.materials import Coated, Conductor, Lambert
from renderer.view import make_view
from samplers.errors import EnvlightError

WIDTH, HEIGHT = 96, 64

MITSUBA = """<scene version="3.0.0">
  <default name="wide" value="{width}"/>
  <integrator type="path"/>
  <emitter type="envmap"><string name="filename" value="sky.exr"/>
    <spectrum name="odd" value="400:1, 700:2"/></emitter>
  <bsdf type="twosided" id="red"><bsdf type="diffuse">
    <rgb name="reflectance" value="0.5, 0.25, 0.125"/></bsdf></bsdf>
  <sensor type="perspective">
    <float name="fov" value="35"/><string name="fov_axis" value="{axis}"/>
    <transform name="to_world"><lookat origin="1, 3, 7" target="0, .7, 0" up="0, 1, 0"/>
      <translate x="0.1"/></transform>
    <film type="hdrfilm"><integer name="width" value="$wide"/>
      <integer name="height" value="{height}"/></film>
  </sensor>
  <shape type="rectangle" id="floor"><transform name="to_world">
    <rotate x="1" angle="-90"/><scale value="8"/></transform><ref id="red"/></shape>
  <shape type="cube"><transform name="to_world"><scale x=".5" y="1" z=".25"/>
    <rotate y="1" angle="30"/><translate x="-2" y="1"/></transform></shape>
  <shape type="sphere"><point name="center" x="0.5" y="1" z="0.5"/>
    <float name="radius" value="1"/></shape>
  <shape type="disk"><transform name="to_world">
    <matrix value="1 0 0 2.5  0 1 0 1.2  0 0 1 -1  0 0 0 1"/></transform></shape>
  <shape type="ply" id="ring"><string name="filename" value="ring.ply"/>
    <transform name="to_world"><scale x="-1"/><translate value="0, 0.4, 2.5"/></transform></shape>
</scene>"""

ODD = '<spectrum name="odd" value="400:1, 700:2"/>'


def ring(folder):
    trimesh.creation.torus(0.6, 0.25).export(folder / "ring.ply")


def mitsuba_scene(folder, axis="x"):
    ring(folder)
    (folder / "sky.exr").write_bytes(b"")
    path = folder / "scene.xml"
    path.write_text(MITSUBA.format(axis=axis, width=WIDTH, height=HEIGHT), encoding="utf-8")
    return path


def quiet(path, read=load_scene):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return read(path)


def rays_of_mitsuba(path):
    """What Mitsuba sees through the centres of pixels: whether, where, and its normals."""
    mi = pytest.importorskip("mitsuba", reason="the peer, mitsuba, is not installed")
    mi.set_variant("scalar_rgb")
    text = path.read_text("utf-8").replace('<emitter type="envmap">', '<emitter type="constant">')
    plain = path.with_name("plain.xml")
    for line in ('<string name="filename" value="sky.exr"/>', ODD):
        text = text.replace(line, "")
    plain.write_text(text, "utf-8")
    scene = mi.load_file(str(plain))
    found = []
    for y in range(HEIGHT):
        for x in range(WIDTH):
            place = mi.Point2f((x + 0.5) / WIDTH, (y + 0.5) / HEIGHT)
            ray, _ = scene.sensors()[0].sample_ray(0.0, 0.5, place, mi.Point2f(0.5, 0.5))
            hit = scene.ray_intersect(ray)
            if hit.is_valid():
                found.append([y * WIDTH + x, *hit.p, *hit.n, *hit.sh_frame.n])
    return np.array(found)


@pytest.mark.parametrize("axis", ["x", "y", "smaller", "larger"])
def test_points_are_where_mitsuba_has_them(tmp_path, axis):
    """All but the sphere is triangles in both; its chords are of 90° / 48, on the diagonal √2 that.

    A facet of a unit sphere then is 1 − cos(δ / 2) = 2.7e-4 inside of it, δ = √2 · 1.875°, its
    plane half a chord, 1.33°, off the normal there, and its interpolated normals are off by less
    than a tenth of that. Mitsuba's rays and matrices are of float32, a few dozen steps of 6e-8,
    taken as 3e-5 across the ray for each unit along it. Pixels with an edge in their centre may
    show either side: few do."""
    path = mitsuba_scene(tmp_path, axis)
    theirs, scene = rays_of_mitsuba(path), quiet(path)
    view = make_view(scene, WIDTH, HEIGHT, 1)
    names = [item.name for item in scene.objects]
    assert names == ["floor", "cube", "sphere", "disk", "ring"]
    both, i, j = np.intersect1d(view.pixel, theirs[:, 0].astype(int), return_indices=True)
    assert max(len(view), len(theirs)) - len(both) <= 0.004 * len(both)
    assert set(view.material[i]) == set(range(5))
    ball = view.material[i] == names.index("sphere")
    sag = 1.0 - math.cos(math.radians(0.5 * math.sqrt(2.0) * 90.0 / 48.0))
    cosine = np.abs((view.geometric * view.toward_eye).sum(axis=1))[i]
    apart = np.linalg.norm(view.position[i] - theirs[j, 1:4], axis=1) * cosine
    assert np.mean(apart <= 3e-5 * view.depth[i] + sag * ball) > 0.995
    turned = np.linalg.norm(np.cross(view.geometric[i], theirs[j, 4:7]), axis=1)
    assert np.mean(turned[~ball] < 1e-5) > 0.995
    assert np.mean(turned[ball] < math.sin(math.radians(1.33))) > 0.98
    shading = np.linalg.norm(view.normal[i] - theirs[j, 7:10], axis=1)
    assert np.mean(shading[ball] < math.radians(0.133)) > 0.98


def test_of_a_file_lights_are_told_and_meshes_known(tmp_path):
    path = mitsuba_scene(tmp_path)
    with pytest.warns(UserWarning, match=r"lights are left aside.*: envmap of sky\.exr"):
        scene = load_scene(path)
    assert scene.objects[0].material == Lambert((0.5, 0.25, 0.125))
    assert scene.objects[1].material == Lambert((0.5, 0.5, 0.5))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert files_of(path) == {"ring.ply": tmp_path / "ring.ply"}


BSDFS = [
    ('<bsdf type="diffuse"/>', Lambert((0.5, 0.5, 0.5))),
    (
        '<bsdf type="roughplastic"><float name="alpha" value="0.2"/><float name="int_ior" '
        'value="1.5"/><float name="ext_ior" value="1"/></bsdf>',
        Coated((0.5, 0.5, 0.5), 0.2, 1.5),
    ),
    (
        '<bsdf type="conductor"><string name="material" value="none"/>'
        '<rgb name="specularReflectance" value="0.5"/></bsdf>',
        Conductor((0.5, 0.5, 0.5), 0.0),
    ),
    # |(n − 1 + ik) / (n + 1 + ik)|², n + ik = 1 + 2i: 4 / 8.
    (
        '<bsdf type="roughconductor"><rgb name="eta" value="1"/><rgb name="k" value="2"/></bsdf>',
        Conductor((0.5, 0.5, 0.5), 0.1),
    ),
]
LEAST = """<scene version="3.0.0"><sensor type="perspective"><float name="fov" value="40"/>
<transform name="to_world"><lookat origin="{}" target="0,0,0" up="{}"/></transform></sensor>
<shape type="sphere">{}</shape></scene>"""


@pytest.mark.parametrize(("bsdf", "wanted"), BSDFS)
def test_materials_of_mitsuba_are_the_nearest_of_ours(tmp_path, bsdf, wanted):
    path = tmp_path / "a.xml"
    path.write_text(LEAST.format("0,0,5", "0,1,0", bsdf), encoding="utf-8")
    found = load_scene(path).objects[0].material
    assert type(found) is type(wanted)
    for name, value in vars(wanted).items():
        assert getattr(found, name) == pytest.approx(value, rel=1e-12)


@pytest.mark.parametrize("up", [(0, 0, 1), (0, 0, -1), (1, 0, 0), (-1, 0, 0)])
def test_up_becomes_plus_y_and_the_picture_stays(tmp_path, up):
    """A camera and its up are turned together: what is up in the file is up here."""
    path = tmp_path / "a.xml"
    eye = np.roll([5.0, 0.0, 2.0], int(np.argmax(np.abs(up)) == 0))  # not along up
    shape = (
        f'<transform name="to_world"><translate x="{up[0]}" y="{up[1]}" z="{up[2]}"/></transform>'
    )
    words = (",".join(str(float(x)) for x in vector) for vector in (eye, up))
    path.write_text(LEAST.format(*words, shape), encoding="utf-8")
    with pytest.warns(UserWarning, match=r"the camera's up, its [xz] axis, becomes \+Y"):
        scene = load_scene(path)
    middle = scene.objects[0].mesh.vertex.astype(float).mean(axis=0)
    assert middle == pytest.approx([0.0, 1.0, 0.0], abs=1e-6)
    assert scene.camera.eye[1] == pytest.approx(float(eye @ up), abs=1e-12)
    assert np.linalg.norm(scene.camera.eye) == pytest.approx(np.linalg.norm(eye))


PBRT = """# a comment with "quotes
Film "image" "integer xresolution" [ {width} ] "integer yresolution" {height}
{mirror}
LookAt 1 3 7  0 .7 0  0 1 0
Camera "perspective" "float fov" [35]
Integrator "path" "integer maxdepth" [5]
WorldBegin
LightSource "infinite" "string filename" "sky.exr" "blackbody L" 3000
AttributeBegin
  Material "matte" "rgb Kd" [.5 .25 .125]
  Shape "trianglemesh" "point3 P" [-8 0 -8  8 0 -8  8 0 8  -8 0 8] "integer indices" [0 1 2 0 2 3]
AttributeEnd
AttributeBegin
  Translate 2 1 0  Rotate 30 0 1 0  Scale .5 1 .25
  MakeNamedMaterial "gold" "string type" "conductor" "spectrum eta" "metal-Au-eta"
    "spectrum k" "metal-Au-k" "float roughness" 0.04
  NamedMaterial "gold"
  Shape "sphere" "float radius" [1]
AttributeEnd
Include "more.pbrt"
"""
MORE = """TransformBegin ConcatTransform [1 0 0 0  0 1 0 0  0 0 1 0  -2 1.2 -1 1]
Material "coateddiffuse" "float roughness" .25 "bool remaproughness" false "float eta" [1.3]
Shape "disk" "float height" [.5] "float radius" 1.5
TransformEnd
Shape "plymesh" "string filename" "ring.ply"
"""


def pbrt_scene(folder, mirror="", width=WIDTH, height=HEIGHT):
    ring(folder)
    path = folder / "scene.pbrt"
    path.write_text(PBRT.format(mirror=mirror, width=width, height=height), encoding="utf-8")
    (folder / "more.pbrt").write_text(MORE, encoding="utf-8")
    return path


def middle_of(item):
    """Of the box around it."""
    vertex = item.mesh.vertex.astype(float)
    return 0.5 * (vertex.min(axis=0) + vertex.max(axis=0))


@pytest.mark.parametrize("mirror", ["", "Scale -1 1 1"])
@pytest.mark.parametrize("size", [(96, 64), (64, 96)])
def test_points_of_pbrt_are_at_its_pixels(tmp_path, mirror, size):
    """pbrt's camera: of a point (x, y, z) in its frame, x / z and y / z over tan(fov / 2), the
    shorter side of the picture being [−1, 1]; its frame is `Scale` times that of `LookAt`, whose
    axes are up × ahead, up and ahead (pbrt-v4, util/transform.cpp)."""
    path = pbrt_scene(tmp_path, mirror, *size)
    scene = quiet(path)
    assert [item.name for item in scene.objects] == ["triangles", "sphere", "disk", "ply"]
    ahead = np.array([0.0, 0.7, 0.0]) - [1.0, 3.0, 7.0]
    ahead /= np.linalg.norm(ahead)
    right = np.cross([0.0, 1.0, 0.0], ahead)
    right /= np.linalg.norm(right)
    frame = np.stack([right, np.cross(ahead, right), ahead])
    view = make_view(scene, *size, 1)
    shorter = min(size)
    for name, place in (("sphere", (2.0, 1.0, 0.0)), ("disk", (-2.0, 1.2, -0.5))):
        x, y, z = frame @ (np.array(place) - [1.0, 3.0, 7.0])
        x = -x if mirror else x
        across, upward = np.array([x, y]) / (z * math.tan(math.radians(17.5)))
        column, row = 0.5 * (size[0] + shorter * across), 0.5 * (size[1] - shorter * upward)
        number = [item.name for item in scene.objects].index(name)
        eye, target = np.array(scene.camera.eye), middle_of(scene.objects[number])
        x, y, z = np.stack(camera_axes(scene.camera)) @ (target - eye)
        half = math.tan(math.radians(0.5 * scene.camera.field_of_view))
        assert 0.5 * (size[0] + size[1] * x / z / half) == pytest.approx(column, abs=1e-4)
        assert 0.5 * size[1] * (1.0 - y / z / half) == pytest.approx(row, abs=1e-4)
        pixel = int(row) * size[0] + int(column)
        if 0 <= column < size[0] and name == "sphere":
            assert view.material[view.pixel == pixel].tolist() == [number]


def test_materials_of_pbrt_are_the_nearest_of_ours(tmp_path):
    path = pbrt_scene(tmp_path)
    with pytest.warns(UserWarning, match=r"left aside.*: infinite of sky\.exr"):
        scene = load_scene(path)
    matte, gold, coated, last = (item.material for item in scene.objects)
    assert matte == Lambert((0.5, 0.25, 0.125))
    assert isinstance(gold, Conductor) and gold.roughness == pytest.approx(0.2)  # √0.04
    assert gold.reflectance[0] > gold.reflectance[1] > gold.reflectance[2]
    assert isinstance(coated, Coated) and coated.ior == pytest.approx(1.3)
    assert coated.roughness == 0.25 and last == coated
    assert set(quiet(path, files_of)) == {"more.pbrt", "ring.ply"}


BLEND = '<bsdf type="blendbsdf" id="b{0}"><ref name="x" id="b{1}"/><ref name="y" id="b{1}"/></bsdf>'
BLENDS = "".join(BLEND.format(k, k + 1) for k in range(40)) + '<bsdf id="b40"/></scene>'
TEXTURE = '<bsdf type="diffuse"><texture name="reflectance" type="bitmap"/></bsdf>'
CAMERA = 'LookAt 0 0 5 0 0 0 0 1 0 Camera "perspective" WorldBegin '
XML = LEAST.format("0,0,5", "0,1,0", "{}")


@pytest.mark.parametrize(
    ("suffix", "text", "said"),
    [
        (".xml", XML.replace("sphere", "hair"), "'hair' is not known; give"),
        (".xml", XML.format('<bsdf type="dielectric"/>'), "'dielectric' is not known"),
        (".xml", XML.format('<float name="radios" value="1"/>'), "radios: it is not known; use"),
        (".xml", XML.format('<ref id="none"/>'), "not a readable scene of Mitsuba: 'none'"),
        (".xml", XML.format(TEXTURE), "a bitmap texture is not read; give rgb"),
        (".xml", XML.replace("</scene>", BLENDS).format('<ref id="b1"/>'), "'blendbsdf' is not kn"),
        (".xml", XML.replace("</scene>", '<medium type="a"/></scene>'), "<medium> is not"),
        (".xml", XML.replace("perspective", "thinlens"), "'thinlens' is not known"),
        (".xml", XML.replace("0,1,0", "0,0,1"), "up points along the view"),
        (".xml", "<scene>", "not a readable scene of Mitsuba: no element found"),
        (".xml", '<scene version="3.0.0"/>', "it has no camera"),
        (".pbrt", CAMERA + 'Shape "curve"', "'curve' is not known; give"),
        (".pbrt", CAMERA + 'Material "hair" Shape "sphere"', "'hair' is not known; give"),
        (".pbrt", CAMERA + 'Shape "sphere" "float zmin" 0', "zmin: it is not known"),
        (".pbrt", CAMERA + 'Shape "plymesh" "string filename" "../a.ply"', "outside the scene's"),
        (".pbrt", CAMERA + 'Include "../a.pbrt"', "outside the scene's folder"),
        (".pbrt", CAMERA + 'Include "a.pbrt"', "recursion"),
        (".pbrt", CAMERA + 'ObjectBegin "a"', "ObjectBegin is not read; take it out"),
        (".pbrt", CAMERA + 'Shape "sphere', 'an unclosed "'),
        (".pbrt", CAMERA + 'Shape "sphere" "float radius"', "not a readable scene of pbrt"),
        (".pbrt", CAMERA + "AttributeEnd", "not a readable scene of pbrt: pop from empty"),
        (".pbrt", 'Shape "sphere"', "it has no camera"),
        (".pbrt", CAMERA, "it has no objects"),
    ],
)  # fmt: skip
def test_what_is_not_read_is_named_in_a_sentence(tmp_path, suffix, text, said):
    path = tmp_path / f"a{suffix}"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(EnvlightError, match=said) as caught:
        load_scene(path)
    assert "\n" not in str(caught.value)
    assert f"a{suffix}" in str(caught.value) or "scene 'a'" in str(caught.value)


def test_files_that_include_others_twice_come_to_an_end(tmp_path):
    for k in range(40):
        (tmp_path / f"{k}.pbrt").write_text(f'Include "{k + 1}.pbrt" ' * 2, encoding="utf-8")
    (tmp_path / "40.pbrt").write_text("Identity", encoding="utf-8")
    with pytest.raises(EnvlightError, match="Include: more than 10,000 files"):
        load_scene(tmp_path / "0.pbrt")
