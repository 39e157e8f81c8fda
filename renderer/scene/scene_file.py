"""A user's own scene: a TOML file that names meshes, materials and a camera.

`README.md` beside this file says the format in full, with a picture of each material. A least one:

[camera]
eye = [0.0, 2.0, 6.0]
target = [0.0, 0.8, 0.0]

[materials.chalk]
type = "lambert"
albedo = [0.5, 0.5, 0.5]

[[objects]]
mesh = "bunny.ply"
material = "chalk"
"""

import tomllib
from pathlib import Path

from renderer.modelling import Shape, ground, shade
from renderer.scene import Camera, Object, Scene
from renderer.scene.materials import Coated, Conductor, Lambert, Material, Ward
from renderer.scene.mesh_file import cleaned, files_beside, read_parts
from renderer.scene.toml_table import Table
from samplers.errors import EnvlightError

MATERIALS: dict[str, type[Material]] = {
    "lambert": Lambert,
    "coated": Coated,
    "conductor": Conductor,
    "ward": Ward,
}


def read_scene(path: str | Path, text: str | None = None) -> Scene:
    """The scene that a TOML file describes.

    text : of the scene file, where there is none and `path` only says where it would be

    Raises EnvlightError that names the file, the key and the remedy.
    """
    file = Path(path)
    root = _parse(file, text)
    name = root.text("name", file.stem)
    camera = _camera(root.table("camera"))
    materials = {key: _material(table) for key, table in root.tables("materials").items()}
    objects = []
    if root.has("ground"):
        table = root.table("ground")
        material = materials[table.choice("material", materials)]
        objects.append(Object("ground", shade(ground(table.number("radius", least=0.0))), material))
        table.finish()
    meshes: dict[Path, dict[str, Shape]] = {}
    objects += [_object(table, file.parent, materials, meshes) for table in root.array("objects")]
    root.finish()
    if not objects:
        raise EnvlightError(f"{file}: it has no objects; add [[objects]] with a mesh each")
    with root.blamed():
        return Scene(name, tuple(objects), camera)


def mesh_files(path: str | Path) -> dict[str, Path]:
    """The mesh files that a scene file names, by the names it gives them, and what those name."""
    file = Path(path)
    tables = _parse(file).array("objects")
    meshes = {table.text("mesh"): inside(table, file.parent) for table in tables}
    beside = {
        f"{name}: {uri}": other
        for name, mesh in meshes.items()
        for uri, other in files_beside(mesh).items()
    }
    return meshes | beside


def _parse(file: Path, text: str | None = None) -> Table:
    try:
        return Table(tomllib.loads(file.read_text("utf-8") if text is None else text), f"{file}")
    except OSError as error:
        raise EnvlightError(f"{file}: {error.strerror or error}; check the path") from None
    except UnicodeDecodeError:
        raise EnvlightError(f"{file}: it is not text in UTF-8; a scene is a TOML file") from None
    except (tomllib.TOMLDecodeError, RecursionError) as error:
        raise EnvlightError(f"{file}: not valid TOML: {error}") from None


def _camera(table: Table) -> Camera:
    eye, target = table.vector("eye"), table.vector("target")
    angle, up = table.number("field_of_view", 40.0), table.vector("up", (0.0, 1.0, 0.0))
    table.finish()
    with table.blamed():
        return Camera(eye, target, angle, up)


def _material(table: Table) -> Material:
    cls = MATERIALS[table.choice("type", MATERIALS)]
    parameters = table.fields_of(cls)
    table.finish()
    with table.blamed():
        return cls(**parameters)


def _object(
    table: Table, folder: Path, materials: dict[str, Material], meshes: dict[Path, dict[str, Shape]]
) -> Object:
    """An object. meshes : what has been read of files, which is read once"""
    mesh_file = inside(table, folder)
    part = table.text("part") if table.has("part") else ""
    name = table.text("name", part or mesh_file.stem)
    material = materials[table.choice("material", materials)]
    with table.blamed():
        if mesh_file not in meshes:
            meshes[mesh_file] = {one.name: one.shape for one in read_parts(mesh_file)}
        shape = cleaned(mesh_file, meshes[mesh_file], part)
    shape = _placed(shape, table)
    crease = table.number("crease", 40.0, least=0.0)
    table.finish()
    with table.blamed():
        return Object(name, shade(shape, crease), material)


def inside(table: Table, folder: Path, key: str = "mesh") -> Path:
    """The path of a mesh that a table names; refused where it leads out of the scene's folder."""
    named = table.text(key)
    try:
        inside = (folder / named).resolve().is_relative_to(folder.resolve())
    except (OSError, RuntimeError, ValueError):  # endless links; characters no path can have
        raise table.error(key, f"{named!r} is not a path; name a file") from None
    if Path(named).is_absolute() or not inside:
        raise table.error(key, f"'{named}' is outside the scene's folder; put the mesh into it")
    return folder / named


def _placed(shape: Shape, table: Table) -> Shape:
    """Turned upright, scaled, turned, set down and moved, in this order."""
    up = table.choice("up", ("x", "y", "z"), "y")
    if up == "z":
        shape = shape.turned("x", -90.0)
    elif up == "x":
        shape = shape.turned("z", 90.0)
    if table.has("size") and table.has("scale"):
        raise table.error("scale", "there is a size as well; keep one of the two")
    low, high = shape.vertex.min(axis=0), shape.vertex.max(axis=0)
    if table.has("size"):
        shape = shape.scaled(table.number("size", least=0.0) / float((high - low).max()))
    elif table.has("scale"):
        shape = shape.scaled(table.number("scale", least=0.0))
    shape = shape.turned("y", table.number("turn", 0.0))
    if table.flag("rest", False):
        low, high = shape.vertex.min(axis=0), shape.vertex.max(axis=0)
        middle = 0.5 * (low + high)
        shape = shape.moved(x=-middle[0], z=-middle[2]).resting()
    return shape.moved(*table.vector("position", (0.0, 0.0, 0.0)))
