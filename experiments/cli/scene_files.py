"""The commands `envlight scene`, a scene with its map for another renderer, and `new-scene`."""

import shutil
from pathlib import Path
from typing import Annotated

import typer

from experiments.cli.one_map import Repair, load_map
from experiments.progress import telling

ENVIRONMENT = "sunset-mountains"


def scene(
    name: Annotated[str, typer.Argument(help="The scene's name, or the path of its file.")],
    folder: Annotated[Path, typer.Argument(help="A new folder for the files.")],
    to: Annotated[str, typer.Option(help="mitsuba, blender or luxcore.")],
    environment: Annotated[
        str, typer.Option(help="An embedded map's name, or a file.")
    ] = ENVIRONMENT,
    materials: Annotated[str, typer.Option(help="lambert or conductor.")] = "lambert",
    width: Annotated[int, typer.Option(min=1, max=16384)] = 320,
    height: Annotated[int, typer.Option(min=1, max=16384)] = 240,
    samples: Annotated[int, typer.Option(min=1, max=1 << 20, help="Samples a pixel.")] = 64,
    repair: Repair = False,
) -> None:
    """Write a scene for another renderer, as production-renderers has it rendered."""
    from experiments.questions.production_renderers.shots import WRITERS
    from experiments.questions.production_renderers.written_scene import Picture, with_materials
    from experiments.run.outputs import renewed_folder
    from renderer.scene.load import load_scene
    from samplers import EnvlightError

    if to not in WRITERS:
        raise EnvlightError(f"--to {to}: use {', '.join(WRITERS)}")
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise EnvlightError(f"{folder}: it holds something already; name a new folder")
    with telling(f"writing {folder}"):
        loaded = with_materials(load_scene(name), materials)
        source = load_map(environment, repair)
        with renewed_folder(folder) as place:
            command = WRITERS[to](loaded, source, Picture(width, height, samples), place)
    print(f"{loaded.name}, {materials}, under {source.name}: {folder}")
    print(f"there: {command}")
    print(f"or:    python render.py --samples {samples} --output image.exr")


def new_scene(
    file: Annotated[
        Path, typer.Argument(help="A mesh, or a scene of glTF, Mitsuba (.xml) or pbrt.")
    ],
    output: Annotated[
        Path | None, typer.Option(help="The scene's file; else FILE.toml beside it.")
    ] = None,
) -> None:
    """Write the scene file of a mesh or a scene, to be changed: camera, materials, places."""
    from experiments.export.gltf import as_gltf
    from experiments.run.loaded_run import write_text
    from renderer.image import write_whole
    from renderer.scene.foreign import description
    from renderer.scene.load import SUFFIX, files_of, load_scene
    from renderer.scene.written_scene import FORMATS
    from samplers import EnvlightError

    target = output or file.with_suffix(SUFFIX)
    if target.suffix.lower() != SUFFIX:
        raise EnvlightError(f"--output {target}: a scene's file is called NAME{SUFFIX}")
    if target.exists():
        raise EnvlightError(f"{target}: it is there already; give another --output, or remove it")
    if file.suffix.lower() in FORMATS:  # spheres and the like become meshes
        meshes, content = target.with_suffix(".glb"), as_gltf(None, load_scene(file))
        if meshes.exists():
            raise EnvlightError(f"{meshes}: it is there already; give another --output")
        write_whole(meshes, lambda place: place.write_bytes(content))
        print(f"meshes: {meshes}")
        file = meshes
    text = description(file)
    # A scene reads nothing outside its own folder.
    for name, source in {file.name: file, **files_of(file)}.items():
        place = target.parent / name
        if place.exists() and not place.samefile(source):
            raise EnvlightError(f"{place}: another file is there; give another --output")
        if not place.exists():
            place.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(source, place)
            print(f"copied: {place}")
    write_text(target, text)
    print(f"{target}: change it, then name it as --scene {target}")
