"""OpenEXR files (.exr): a flat part with a layer of R, G and B, or of luminance alone.

OpenImageIO reads them: it keeps the messages of the library below it to itself, reads chosen
channels alone, and places the first level of a file with several.
"""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from samplers.errors import EnvlightError
from samplers.files.colours import AP0, SPACES, converted_from, to_rec709
from samplers.files.stored_image import StoredImage, check_size, for_libraries, one_line

MAGIC = b"v/1\x01"
MOST_PACKED = {
    "none": 1.0, "rle": 64.0, "zips": 1032.0, "zip": 1032.0, "pxr24": 1376.0, "piz": 512.0,
    "b44": 11.0, "b44a": 11.0,
}  # fmt: skip
"""Bytes that one stored byte can stand for, by compression; others have no bound of use.

Runs are of 128 bytes in two; deflate reaches 1032, and PXR24 drops a quarter first; PIZ has a run
of 256 numbers of two bytes in ten bits; B44 has a block of 32 bytes in three at least.
"""
NAMED = 6
"""Layers or parts that a sentence lists."""
SIZES = {"half": 2, "float": 4, "uint": 4}


def read_openexr_file(path: Path) -> StoredImage:
    """The pixels of a map within its display window.

    Raises EnvlightError for a file of another kind, by its name; for a header fact that changes
    what pixels mean and cannot be applied; and for one that cannot be read.
    """
    import OpenImageIO

    file = OpenImageIO.ImageInput.open(for_libraries(path))
    if file is None:
        raise EnvlightError(f"{path}: {_refusal(one_line(OpenImageIO.geterror()))}")
    try:
        part, name = _part(path, file)
        file.seek_subimage(part, 0)
        spec = file.spec()
        _check_kind(path, spec)
        layer, places = _layer(path, spec.channelnames)
        window = _window(path, spec)
        kinds = [str(kind) for kind in spec.channelformats] or [str(spec.format)] * spec.nchannels
        packed = MOST_PACKED.get(spec.get_string_attribute("compression"), np.inf)
        stored = packed * path.stat().st_size / sum(SIZES.get(kind, 4) for kind in kinds)
        check_size(path, spec.width, spec.height, stored)
        chromaticities, facts = _colours(path, spec)
        if layer:
            facts["layer"] = layer
        if name:
            facts["part"] = name
        pixels = _pixels(path, file, part, places, [kinds[place] for place in places])
    finally:
        file.close()
    floats = [np.finfo("f2" if kinds[place] == "half" else "f4") for place in places]
    red, green, blue = (float(one.max) for one in floats)
    return StoredImage(
        np.ascontiguousarray(pixels[window]),
        (red, green, blue),
        float(max(one.eps for one in floats)) / 2.0,
        to_rec709(path, chromaticities) if chromaticities else None,
        facts,
    )


def _refusal(reason: str) -> str:
    if "ubsampl" in reason:
        return f"some channels have fewer pixels ({reason}); save R, G and B at full resolution"
    return (
        f"not a readable .exr file ({reason}); fetch it again, or save it anew where other "
        "programs read it"
    )


def _check_kind(path: Path, spec: Any) -> None:
    if spec.deep:
        raise EnvlightError(f"{path}: deep data; save it as a flat image")
    if spec.get_string_attribute("textureformat").startswith("CubeFace"):
        raise EnvlightError(
            f"{path}: its attribute envmap says that it is a cube map; convert it to a "
            "latitude-longitude map"
        )
    if spec.get_int_attribute("Orientation", 1) != 1:
        raise EnvlightError(f"{path}: its Orientation is not 1, as of what is upright; turn it")
    aspect = spec.get_float_attribute("PixelAspectRatio", 1.0)
    if not np.isclose(aspect, 1.0, atol=1e-3):
        raise EnvlightError(
            f"{path}: its pixelAspectRatio is {aspect:g}, so its pixels are not square; resample it"
        )


def _part(path: Path, file: Any) -> tuple[int, str]:
    """The part that is the map, the only one with R, G and B of several, and its name."""
    names: list[str] = []
    coloured = []
    while file.seek_subimage(len(names), 0):
        spec = file.spec()
        if {"R", "G", "B"} <= {name.rpartition(".")[2].upper() for name in spec.channelnames}:
            coloured.append(len(names))
        names.append(spec.get_string_attribute("name") or f"part {len(names) + 1}")
    if len(names) == 1:
        return 0, ""
    if len(coloured) == 1:
        return coloured[0], names[coloured[0]]
    raise EnvlightError(
        f"{path}: it has the parts {_listed(names)}; save the one that is the map alone"
    )


def _listed(names: list[str]) -> str:
    more = ", …" if len(names) > NAMED else ""
    return f"{one_line(', '.join(names[:NAMED]))}{more}"


def _layer(path: Path, names: tuple[str, ...]) -> tuple[str, list[int]]:
    """The layer that is the map, and the places of its R, G and B among the channels.

    A layer without a name goes first, then the only one of R, G and B, then the only grey one.
    """
    layers: dict[str, dict[str, int]] = {}
    for place in sorted(range(len(names)), key=lambda place: names[place]):  # "R" before "r"
        layer, _, channel = names[place].rpartition(".")
        layers.setdefault(layer, {}).setdefault(channel.upper(), place)
    for wanted in ("RGB", "YYY"):
        whole = [layer for layer, found in layers.items() if set(wanted) <= found.keys()]
        chosen = "" if "" in whole else whole[0] if len(whole) == 1 else None
        if chosen is not None and wanted == "YYY" and layers[chosen].keys() - {"Y", "A", "Z"}:
            raise EnvlightError(
                f"{path}: Y is one of the channels {one_line(', '.join(names))}, as of luminance "
                "and chroma or of CIE XYZ; save it as R, G and B"
            )
        if chosen is not None:
            grey = "grey" if wanted == "YYY" else ""
            return ", ".join(filter(None, (chosen, grey))), [layers[chosen][c] for c in wanted]
        if whole:
            raise EnvlightError(
                f"{path}: it has the layers {_listed(whole)}; save the one that is the map alone"
            )
    raise EnvlightError(
        f"{path}: channels {one_line(', '.join(names))}; an environment map needs R, G and B"
    )


def _window(path: Path, spec: Any) -> tuple[slice, slice]:
    """The rows and columns of the stored pixels that the display window shows."""
    top, left = spec.full_y - spec.y, spec.full_x - spec.x
    height, width = spec.full_height, spec.full_width
    rows = min(top + height, spec.height) - max(top, 0)
    columns = min(left + width, spec.width) - max(left, 0)
    if (rows, columns) != (height, width):
        raise EnvlightError(
            f"{path}: {max(columns, 0)}×{max(rows, 0)} of the {width}×{height} pixels of its "
            "display window are stored; save the whole map"
        )
    return slice(top, top + height), slice(left, left + width)


def _colours(path: Path, spec: Any) -> tuple[tuple[float, ...], dict[str, str]]:
    """The file's chromaticities where it names any, and what to tell of its colours."""
    facts = {}
    chromaticities = spec.getattribute("chromaticities", "float[8]") or ()
    if not chromaticities and spec.getattribute("chromaticities") is not None:
        chromaticities = (np.nan,) * 8  # a text, or fewer numbers
    if not chromaticities and spec.get_int_attribute("acesImageContainerFlag") == 1:
        chromaticities = AP0
    for name in ("colorInteropID", "oiio:ColorSpace"):
        space = (spec.get_string_attribute(name) or "unknown").lower().removesuffix("_scene")
        if space not in SPACES:
            raise EnvlightError(f"{path}: its {name} is {one_line(space)}; save it as lin_rec709")
        chromaticities = chromaticities or SPACES[space]
    if spec.get_float_attribute("gamma", 1.0) != 1.0:
        raise EnvlightError(f"{path}: its gamma is not 1; save it with linear values")
    if chromaticities and to_rec709(path, chromaticities) is not None:
        facts["colours"] = converted_from(chromaticities)
    if spec.get_int_attribute("oiio:sampleborder"):
        facts["envmap"] = "latlong: read as cells, not as points from pole to pole (OpenEXR's rule)"
    white = spec.get_float_attribute("whiteLuminance", 0.0)
    if white > 0.0:
        facts["white"] = f"{white:g} cd/m² (whiteLuminance; radiance stays relative)"
    neutral = spec.getattribute("adoptedNeutral", "float2")
    if neutral is not None:
        facts["neutral"] = f"{neutral[0]:.4g} {neutral[1]:.4g} (adoptedNeutral; not applied)"
    return tuple(chromaticities), facts


def _pixels(
    path: Path, file: Any, part: int, places: list[int], kinds: list[str]
) -> NDArray[np.float32]:
    """R, G and B, (H, W, 3) float32, by one read where they stand in a row."""
    first, together = places[0], "uint" not in kinds
    if together and places == [first, first + 1, first + 2]:
        return _read(path, file, part, first, first + 3, "float")
    spec = file.spec()
    pixels = np.empty((spec.height, spec.width, 3), np.float32)
    for k, (place, kind) in enumerate(zip(places, kinds, strict=True)):
        # As numbers: read as "float", whole numbers become shares of the largest.
        asked = "uint" if kind == "uint" else "float"
        pixels[..., k] = _read(path, file, part, place, place + 1, asked)[..., 0]
    return pixels


def _read(path: Path, file: Any, part: int, begin: int, end: int, kind: str) -> NDArray:
    found = file.read_image(part, 0, begin, end, kind)
    if found is None:
        raise EnvlightError(
            f"{path}: its pixels cannot be read ({one_line(file.geterror())}), as where it is "
            "damaged or cut short; fetch it again"
        )
    return found
