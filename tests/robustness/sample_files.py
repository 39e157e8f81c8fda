"""Small whole files of every format that is read, to be damaged: maps, meshes and scenes."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from tests.renderer.scene.test_scene_file import GOOD

COMPRESSIONS = (
    "NO", "RLE", "ZIPS", "ZIP", "PIZ", "PXR24", "B44", "B44A", "DWAA", "DWAB", "ZSTD", "HTJ2K256",
    "HTJ2K32",
)  # fmt: skip
SCENE = GOOD.replace("parts/brick.ply", "box.ply").replace("ball.obj", "box.ply")


def write_samples(folder: Path) -> list[Path]:
    """Write all of them into `folder`; returns their paths, in a fixed order."""
    folder.mkdir(parents=True, exist_ok=True)
    return [*_exr_files(folder), *_hdr_files(folder), *_meshes(folder), _scene(folder)]


def _pixels() -> np.ndarray:
    return (np.random.default_rng(0).random((8, 16, 3)) * 50.0).astype(np.float32)


def _exr_files(folder: Path) -> Iterator[Path]:
    """Every compression and layout, kinds of channels, several parts and deep data."""
    import OpenEXR

    pixels = _pixels()
    tiles = {"type": OpenEXR.tiledimage, "tiles": OpenEXR.TileDescription()}
    for name in COMPRESSIONS:
        if not hasattr(OpenEXR, f"{name}_COMPRESSION"):  # the last few are of recent versions
            continue
        header = {"compression": getattr(OpenEXR, f"{name}_COMPRESSION")}
        for layout, more in {"": {"type": OpenEXR.scanlineimage}, "-tiled": tiles}.items():
            kind = np.float16 if name in ("B44", "B44A", "DWAA", "DWAB") else np.float32
            path = folder / f"{name.lower()}{layout}.exr"
            OpenEXR.File(header | more, {"RGB": pixels.astype(kind)}).write(str(path))
            yield path
    plain = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    kinds = (np.uint32, np.float16, np.float32)
    planes = {
        name: np.ascontiguousarray(pixels[..., k].astype(kind))
        for k, (name, kind) in enumerate(zip("RGB", kinds, strict=True))
    }
    OpenEXR.File(plain, planes).write(str(folder / "mixed.exr"))
    parts = [OpenEXR.Part(plain | {"name": name}, {"RGB": pixels}) for name in "ab"]
    OpenEXR.File(parts).write(str(folder / "parts.exr"))
    deep = np.empty((8, 16), object)
    for place in np.ndindex(deep.shape):
        deep[place] = np.ones(2, np.float32)
    header = {"type": OpenEXR.deepscanline, "compression": OpenEXR.ZIPS_COMPRESSION}
    OpenEXR.File(header, dict.fromkeys("RGB", deep)).write(str(folder / "deep.exr"))
    yield from (folder / f"{name}.exr" for name in ("mixed", "parts", "deep"))


def _hdr_files(folder: Path) -> Iterator[Path]:
    """Run-length encoded by scan line, and flat where the rows are too short for that."""
    import OpenImageIO

    for name, pixels in {"runs": _pixels(), "flat": _pixels()[:3, :6]}.items():
        path = folder / f"{name}.hdr"
        output = OpenImageIO.ImageOutput.create(str(path))
        assert output is not None
        height, width = pixels.shape[:2]
        output.open(str(path), OpenImageIO.ImageSpec(width, height, 3, "float"))
        output.write_image(np.ascontiguousarray(pixels))
        output.close()
        yield path


def _meshes(folder: Path) -> Iterator[Path]:
    """A box and a scene of two as PLY (both encodings), OBJ and GLB."""
    import trimesh

    box = trimesh.creation.box()
    two = trimesh.Scene([box, trimesh.creation.icosphere(1).apply_translation([2.0, 0.0, 0.0])])
    ascii_ply = box.export(file_type="ply", encoding="ascii")
    files = {
        "box.ply": box.export(file_type="ply"),
        "ascii.ply": ascii_ply,
        "box.obj": box.export(file_type="obj"),
        "two.glb": two.export(file_type="glb"),
    }
    for name, content in files.items():
        data = content if isinstance(content, bytes) else content.encode()
        (folder / name).write_bytes(data)
        yield folder / name


def _scene(folder: Path) -> Path:
    path = folder / "box.toml"
    path.write_text(SCENE, encoding="utf-8")
    return path
