"""What goes to other programs and comes from them: `envlight lights`, `scene` and `new-scene`.

Lights are a sampler's, as a file, and what they leave of the map.

Heavy imports stand inside, so that `--help` answers at once.
"""

import shutil
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from experiments.cli.one_map import Count, Environment, Repair, Sampler, Seed, files_read, load_map
from experiments.progress import telling

if TYPE_CHECKING:
    from experiments.export.light_set import LightSet
    from renderer.scene import Scene
    from samplers import EnvironmentMap, LightSampler

TEXTS = ("json", "csv", "blender")
GLTF, USD = "gltf", "usd"
USD_SUFFIXES = (".usda", ".usdc", ".usd")
GLTF_SUFFIXES = (".glb", ".gltf")
SUFFIXES = {
    ".json": "json", ".csv": "csv", ".py": "blender",
    **dict.fromkeys(GLTF_SUFFIXES, GLTF), **dict.fromkeys(USD_SUFFIXES, USD),
}  # fmt: skip


def lights(
    environment: Environment,
    sampler: Sampler = "median-cut",
    count: Count = 16,
    file_format: Annotated[
        str, typer.Option("--format", help="json, csv, gltf, usd or blender; else by the suffix.")
    ] = "",
    seed: Seed = 0,
    repair: Repair = False,
    output: Annotated[Path | None, typer.Option(help="The file; else the terminal.")] = None,
    residual: Annotated[
        Path | None,
        typer.Option(help="Write the map without what the lights carry: an .exr or .hdr file."),
    ] = None,
    scene: Annotated[
        str, typer.Option(help="Put this scene beside the lights: its name or file; glTF only.")
    ] = "",
) -> None:
    """Write a sampler's lights for other programs: glTF, USD, JSON, CSV, or a Blender script."""
    with telling(f"lights of {environment}"):
        import numpy as np

        from experiments.export.light_set import light_set
        from experiments.run.sampler_spec import single_sampler
        from renderer.scene.load import load_scene
        from samplers import EnvlightError
        from samplers.conformance.lighting_check import prepared

        kind = _format(file_format, output)
        if scene and kind != GLTF:
            raise EnvlightError(f"--scene {scene}: only glTF takes a scene; write to FILE.glb")
        _check_outputs(output, kind, residual, files_read(environment, sampler, scene))
        loaded = load_scene(scene) if scene else None
        spec = single_sampler(sampler)
        source = load_map(environment, repair)
        if residual is None:
            lighting = prepared(spec.sampler, source, count, np.random.default_rng(seed))
            found = light_set(lighting, source, spec.label, count, seed)
        else:
            found = _with_residual(spec.sampler, source, spec.label, count, seed, residual, output)
    _write(found, kind, output, loaded)
    largest = max((layer.angle.max(initial=0.0) for layer in found.layers), default=0.0)
    print(f"{found.title}; angular radius up to {np.degrees(largest):.3g}°", file=sys.stderr)
    if found.ambient is not None:
        print(_ambient(found, output), file=sys.stderr)


def _check_outputs(
    output: Path | None, kind: str, residual: Path | None, reads: "list[Path | str]"
) -> None:
    """EnvlightError where a file must not or could not be written."""
    from experiments.export.formats import KINDS
    from experiments.run.outputs import EXR, HDR, check_output, same_file
    from samplers import EnvlightError

    if output is not None:
        check_output(output, KINDS[kind], reads=reads)
        check_output(_ambient_file(output), EXR, reads=reads)
    if residual is None:
        return
    kinds = {".exr": EXR, ".hdr": HDR}
    if residual.suffix.lower() not in kinds:
        raise EnvlightError(f"--residual {residual}: it is a map; name it FILE.exr or FILE.hdr")
    if output is not None and same_file(residual, output):
        raise EnvlightError(f"--residual {residual}: the lights go there; name another file")
    check_output(residual, kinds[residual.suffix.lower()], "--residual", reads)


def _with_residual(
    sampler: "LightSampler", source: "EnvironmentMap", label: str, count: int, seed: int,
    residual: Path, output: Path | None,
) -> "LightSet":  # fmt: skip
    """A sampler's lights, and the file with what they leave of the map; says what that is."""
    from dataclasses import replace

    import numpy as np

    from experiments.export.light_set import audit, light_set, part
    from renderer.image import write_exr, write_hdr

    parted = part(sampler, source, count, np.random.default_rng(seed))
    found = light_set(parted.lights, source, label, count, seed, parted.layer, parted.residual)
    write = write_hdr if residual.suffix.lower() == ".hdr" else write_exr
    write(residual, parted.residual.radiance)
    print(f"{parted.meaning}\n{audit(parted)}\n{residual}", file=sys.stderr)
    return replace(found, ambient=None, residual_file=_named_in(output, residual))


def _named_in(output: Path | None, file: Path) -> str:
    """How a file of lights names another: by its place beside or below it, or in full."""
    whole = file.resolve()
    # Blender does not know where a script lies.
    if output is not None and output.suffix != ".py":
        folder = output.resolve().parent
        if whole.is_relative_to(folder):
            return f"./{whole.relative_to(folder).as_posix()}"
    return whole.as_posix()


def _format(wanted: str, output: Path | None) -> str:
    """The format that is named, or else told by the output's suffix."""
    from samplers import EnvlightError

    if wanted:
        if wanted not in (*TEXTS, GLTF, USD):
            raise EnvlightError(f"--format {wanted}: use {', '.join((*TEXTS, GLTF))} or {USD}")
        return wanted
    if output is None:
        return "json"
    if output.suffix.lower() not in SUFFIXES:
        raise EnvlightError(
            f"--output {output}: the suffix tells no format; give --format, or one of "
            f"{', '.join(SUFFIXES)}"
        )
    return SUFFIXES[output.suffix.lower()]


def _write(found: "LightSet", kind: str, output: Path | None, scene: "Scene | None" = None) -> None:
    from experiments.export import formats, gltf
    from experiments.run.loaded_run import write_text
    from renderer.image import write_whole
    from samplers import EnvlightError

    if kind in TEXTS:
        text = getattr(formats, f"as_{kind}")(found)
        if output is None:
            print(text, end="")
        else:
            write_text(output, text)
        return
    suffixes = GLTF_SUFFIXES if kind == GLTF else USD_SUFFIXES
    if output is not None and output.suffix.lower() not in suffixes:
        raise EnvlightError(f"--output {output}: name a {kind} file {', '.join(suffixes)}")
    if kind == GLTF:
        binary = output is not None and output.suffix.lower() == ".glb"
        content = gltf.as_gltf(found, scene, binary)
        if output is None:
            print(content.decode())
        else:
            write_whole(output, lambda place: place.write_bytes(content))
        return
    stage = formats.as_usd(found)
    if output is None:
        print(stage.GetRootLayer().ExportToString(), end="")
    else:
        write_whole(output, lambda place: stage.GetRootLayer().Export(str(place)))


def _ambient_file(output: Path) -> Path:
    return output.with_name(f"{output.name}.ambient.exr")


def _ambient(found: "LightSet", output: Path | None) -> str:
    """Write the ambient remainder beside the lights, where those go to a file; say what it is."""
    from renderer.image import write_exr

    assert found.ambient is not None
    whole = found.ambient.total_flux + sum(layer.irradiance.sum(0) for layer in found.layers)
    share = f"{100.0 * found.ambient.total_flux.sum() / max(whole.sum(), 1e-300):.1f} %"
    sentence = f"the ambient remainder, {share} of the energy, is no light"
    if output is None:
        return f"{sentence}; with --output it is written beside the lights"
    path = _ambient_file(output)
    write_exr(path, found.ambient.radiance)
    return f"{sentence}; it is written as a map to {path}"


def scene(
    name: Annotated[str, typer.Argument(help="The scene's name, or the path of its file.")],
    folder: Annotated[Path, typer.Argument(help="A new folder for the files.")],
    to: Annotated[str, typer.Option(help="mitsuba, blender or luxcore.")],
    environment: Annotated[
        str, typer.Option(help="An embedded map's name, or a file.")
    ] = "sunset-mountains",
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
