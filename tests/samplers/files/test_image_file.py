"""Maps are read exactly, whatever their layout; anything else is one quiet sentence."""

import gzip
import os
import re
import struct
import subprocess
import sys
from pathlib import Path

import numpy as np
import OpenEXR
import OpenImageIO
import pytest
from PIL import Image

from samplers import EnvlightError
from samplers.files.image_file import read_image, read_radiance

PIXELS = (np.random.default_rng(0).random((8, 16, 3)) * 50.0).astype(np.float32)
PLAIN = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
LOSSLESS = ("NO", "RLE", "ZIPS", "ZIP", "PIZ")


def write(path, channels=None, **header):
    OpenEXR.File(PLAIN | header, channels or {"RGB": PIXELS}).write(str(path))
    return path


def planes(*kinds):
    return {
        name: np.ascontiguousarray(PIXELS[..., k].astype(kind))
        for k, (name, kind) in enumerate(zip("RGB", kinds, strict=True))
    }


def write_radiance(path, pixels=PIXELS):
    spec = OpenImageIO.ImageSpec(pixels.shape[1], pixels.shape[0], 3, "float")
    output = OpenImageIO.ImageOutput.create(str(path))
    output.open(str(path), spec)
    output.write_image(pixels)
    output.close()
    return path


@pytest.mark.parametrize("compression", LOSSLESS)
@pytest.mark.parametrize("tiled", [False, True])
def test_exr_comes_back_exactly(tmp_path, compression, tiled):
    header = {"compression": getattr(OpenEXR, f"{compression}_COMPRESSION")}
    if tiled:
        header |= {"type": OpenEXR.tiledimage, "tiles": OpenEXR.TileDescription()}
    image = read_radiance(write(tmp_path / "map.exr", **header))
    assert image.dtype == np.float32
    assert image.flags.c_contiguous
    np.testing.assert_array_equal(image, PIXELS)


@pytest.mark.parametrize(
    "kinds",
    [
        (np.float16,) * 3,
        (np.uint32,) * 3,
        (np.float16, np.float32, np.uint32),
        (np.uint32, np.float16, np.float32),
    ],
)
def test_half_and_integer_channels_keep_their_values(tmp_path, kinds):
    image = read_radiance(write(tmp_path / "map.exr", planes(*kinds)))
    wanted = [PIXELS[..., k].astype(kind).astype(np.float32) for k, kind in enumerate(kinds)]
    np.testing.assert_array_equal(image, np.stack(wanted, axis=-1))


def test_further_channels_are_left_out(tmp_path):
    channels = planes(*(np.float32,) * 3) | {
        name: np.full((8, 16), 7.0, np.float32) for name in ("A", "Z", "albedo.R", "B2")
    }
    np.testing.assert_array_equal(read_radiance(write(tmp_path / "map.exr", channels)), PIXELS)


def refused(path, sentence, capfd):
    """The path is refused by one sentence that names it; nothing else is printed."""
    with pytest.raises(EnvlightError, match=sentence) as caught:
        read_radiance(path)
    text = str(caught.value)
    assert text.startswith(f"{path}: ")
    assert "\n" not in text
    assert text.isprintable()
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("layout", ["scan lines", "tiles", "uncompressed", "radiance"])
def test_files_cut_short_at_any_length_are_refused_quietly(tmp_path, capfd, layout):
    path = tmp_path / ("map.hdr" if layout == "radiance" else "map.exr")
    small = {"RGB": np.ascontiguousarray(PIXELS[:2, :4])}
    match layout:
        case "scan lines":
            write(path, small)
        case "tiles":
            write(path, small, type=OpenEXR.tiledimage, tiles=OpenEXR.TileDescription())
        case "uncompressed":
            write(path, small, compression=OpenEXR.NO_COMPRESSION)
        case _:
            write_radiance(path)
    whole = path.read_bytes()
    for length in range(len(whole)):
        path.write_bytes(whole[:length])
        refused(path, "fetch it again", capfd)


@pytest.mark.parametrize("size", [(2**31 - 2,) * 2, (200_000, 100_000), (65_000, 32_500)])
def test_huge_declared_sizes_are_refused_before_memory_is_taken(tmp_path, capfd, size):
    path = write(tmp_path / "map.exr")
    data = bytearray(path.read_bytes())
    for window in (b"dataWindow\0box2i\0", b"displayWindow\0box2i\0"):
        place = data.index(window) + len(window) + 4
        data[place : place + 16] = struct.pack("<4i", 0, 0, size[0] - 1, size[1] - 1)
    path.write_bytes(data)
    refused(path, "fetch it again", capfd)
    path = write_radiance(tmp_path / "map.hdr")
    line = f"-Y {size[1]} +X {size[0]}\n".encode()
    path.write_bytes(path.read_bytes().replace(b"-Y 8 +X 16\n", line))
    refused(path, "fetch it again", capfd)


def test_a_size_beyond_the_limit_is_refused(tmp_path, capfd, monkeypatch):
    monkeypatch.setattr("samplers.files.stored_image.MAX_PIXELS", 127)
    refused(write(tmp_path / "map.exr"), "16×8 pixels are declared, more than the limit", capfd)


def test_missing_empty_and_foreign_files_are_named(tmp_path, capfd):
    (tmp_path / "empty.exr").touch()
    (tmp_path / "folder.hdr").mkdir()
    Image.new("RGB", (16, 8)).save(tmp_path / "ldr.png")
    Image.new("RGB", (16, 8)).save(tmp_path / "ldr.jpg")
    refused(tmp_path / "none.exr", "no such file", capfd)
    refused(tmp_path / "empty.exr", "the file is empty", capfd)
    refused(tmp_path / "folder.hdr", "not a file", capfd)
    refused(tmp_path / "ldr.png", "a map is an .exr or .hdr file", capfd)
    refused(tmp_path / "ldr.jpg", "a map is an .exr or .hdr file", capfd)
    (tmp_path / "png.exr").write_bytes((tmp_path / "ldr.png").read_bytes())
    (tmp_path / "jpeg.hdr").write_bytes((tmp_path / "ldr.jpg").read_bytes())
    refused(tmp_path / "png.exr", "its content is png, not openexr", capfd)
    refused(tmp_path / "jpeg.hdr", "its content is jpeg, not hdr", capfd)
    marked = tmp_path / "marked.hdr"
    marked.write_bytes(
        "\ufeff#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 2\n".encode() + bytes(8)
    )
    refused(marked, "does not begin as .hdr files do", capfd)
    (tmp_path / "text.exr").write_text("no image\n" * 50, encoding="utf-8")
    (tmp_path / "text.hdr").write_text("no image\n" * 50, encoding="utf-8")
    refused(tmp_path / "text.exr", "not a readable .exr file", capfd)
    refused(tmp_path / "text.hdr", "not a readable .hdr file", capfd)
    (tmp_path / "packed.exr").write_bytes(gzip.compress(b"v/1\x01"))
    (tmp_path / "pointer.hdr").write_text(
        "version https://git-lfs.github.com/spec/v1\noid sha256:0"
    )
    (tmp_path / "words.hdr").write_text("ENVI\nsamples = 16")
    refused(tmp_path / "packed.exr", "compressed by gzip; unpack it", capfd)
    refused(tmp_path / "words.hdr", "a header of ENVI's", capfd)
    refused(tmp_path / "pointer.hdr", "a pointer of Git LFS; run", capfd)


@pytest.mark.parametrize("prefix", ["", ".", "Combined.", "Image Layer.Combined.", "x" * 60 + "."])
@pytest.mark.parametrize("letters", ["RGB", "rgb"])
def test_a_single_layer_is_read_under_any_name(tmp_path, prefix, letters):
    channels = {
        prefix + letter: np.ascontiguousarray(PIXELS[..., k]) for k, letter in enumerate(letters)
    }
    channels |= {"Depth.Z": np.zeros((8, 16), np.float32), "normal.X": PIXELS[..., 0].copy()}
    np.testing.assert_array_equal(read_radiance(write(tmp_path / "map.exr", channels)), PIXELS)


def test_luminance_alone_is_grey(tmp_path):
    path = write(tmp_path / "y.exr", {"Y": PIXELS[..., 0].copy(), "A": PIXELS[..., 1].copy()})
    np.testing.assert_array_equal(read_radiance(path), PIXELS[..., :1].repeat(3, axis=2))


def test_wrong_channels_are_named(tmp_path, capfd):
    one = np.ascontiguousarray(PIXELS[..., 0])
    refused(write(tmp_path / "z.exr", {"Z": one}), "channels Z; .* needs R, G and B", capfd)
    layers = {f"{layer}.{name}": one for name in "RGB" for layer in ("diffuse", "specular")}
    refused(write(tmp_path / "two.exr", layers), "the layers diffuse, specular; save", capfd)
    for names in (("Y", "RY", "BY"), ("CIE.X", "CIE.Y", "CIE.Z"), ("C", "M", "Y", "K")):
        others = write(tmp_path / f"{names[0]}.exr", dict.fromkeys(names, one))
        refused(others, "Y is one of the channels .*luminance and chroma", capfd)


@pytest.mark.parametrize("value", ["sRGB", 2.2, ["a"] * 8, np.float32([0.3, 0.3])])
def test_chromaticities_that_are_not_eight_numbers_are_named(tmp_path, capfd, value):
    path = write(tmp_path / "map.exr", chromaticitieS=value)
    path.write_bytes(path.read_bytes().replace(b"chromaticitieS", b"chromaticities"))
    refused(path, "chromaticities red nan nan, .* are those of no colours", capfd)


def test_channels_of_fewer_pixels_are_named(tmp_path, capfd):
    path = write(tmp_path / "map.exr")
    blue = b"B\0" + struct.pack("<4i", 2, 0, 1, 1)  # float, not linear, every column and row
    assert blue in path.read_bytes()
    path.write_bytes(path.read_bytes().replace(blue, b"B\0" + struct.pack("<4i", 2, 0, 2, 2)))
    refused(path, "some channels have fewer pixels", capfd)


def test_deep_and_multi_part_files_are_named(tmp_path, capfd):
    deep = np.empty((8, 16), object)
    for place in np.ndindex(deep.shape):
        deep[place] = np.ones(2, np.float32)
    header = {"type": OpenEXR.deepscanline, "compression": OpenEXR.ZIPS_COMPRESSION}
    refused(write(tmp_path / "deep.exr", dict.fromkeys("RGB", deep), **header), "deep data", capfd)
    parts = [OpenEXR.Part(PLAIN | {"name": name}, {"RGB": PIXELS}) for name in "ab"]
    OpenEXR.File(parts).write(str(tmp_path / "parts.exr"))
    refused(tmp_path / "parts.exr", "the parts a, b; save", capfd)


@pytest.mark.parametrize("order", [1, -1])
def test_the_only_part_with_colours_is_the_map(tmp_path, order):
    depth = OpenEXR.Part(PLAIN | {"name": "depth"}, {"Z": PIXELS[..., 0] + 7.0})
    beauty = OpenEXR.Part(PLAIN | {"name": "beauty"}, {"RGB": PIXELS})
    OpenEXR.File([depth, beauty][::order]).write(str(tmp_path / "parts.exr"))
    image = read_image(tmp_path / "parts.exr")
    np.testing.assert_array_equal(image.pixels, PIXELS)
    assert image.facts["part"] == "beauty"


def window(left, top, width, height):
    return (
        np.array([left, top], np.int32),
        np.array([left + width - 1, top + height - 1], np.int32),
    )


@pytest.mark.parametrize(
    ("data", "display", "there"),
    [
        ((4, 2, 16, 8), (0, 0, 32, 16), "16×8 of the 32×16 pixels"),
        ((8, 0, 16, 8), (0, 0, 16, 8), "8×8 of the 16×8 pixels"),
        ((40, 0, 16, 8), (0, 0, 16, 8), "0×8 of the 16×8 pixels"),
    ],
)
def test_a_part_of_a_map_is_named(tmp_path, capfd, data, display, there):
    header = {"dataWindow": window(*data), "displayWindow": window(*display)}
    refused(write(tmp_path / "crop.exr", **header), there, capfd)


def test_what_lies_beyond_the_display_window_is_cut_off(tmp_path):
    header = {"dataWindow": window(-3, -2, 16, 8), "displayWindow": window(1, -1, 12, 6)}
    image = read_radiance(write(tmp_path / "overscan.exr", **header))
    np.testing.assert_array_equal(image, PIXELS[1:7, 4:16])


@pytest.mark.parametrize(
    ("header", "sentence"),
    [
        ({"envmap": OpenEXR.ENVMAP_CUBE}, "cube map"),
        ({"pixelAspectRatio": 2.0}, "pixelAspectRatio is 2"),
        ({"Orientation": 3}, "Orientation is not 1"),
        ({"chromaticities": (0.3,) * 8}, "those of no colours"),
        ({"colorInteropID": "srgb_rec709_scene"}, "colorInteropID is srgb_rec709;"),
        ({"oiio:ColorSpace": "sRGB", "chromaticities": (0.3,) * 8}, "oiio:ColorSpace is srgb"),
        ({"gamma": 2.2}, "gamma is not 1"),
    ],
)
def test_header_facts_that_cannot_be_applied_are_named(tmp_path, capfd, header, sentence):
    refused(write(tmp_path / "map.exr", **header), sentence, capfd)


REC2020 = (0.708, 0.292, 0.170, 0.797, 0.131, 0.046, 0.3127, 0.3290)
AP1 = (0.713, 0.293, 0.165, 0.830, 0.128, 0.044, 0.32168, 0.33767)
EXACT = {
    # ITU-R BT.2087, and the matrix of ACES's CSC from ACEScg to linear Rec. 709.
    REC2020: [[1.6605, -0.5876, -0.0728], [-0.1246, 1.1329, -0.0083], [-0.0182, -0.1006, 1.1187]],
    AP1: [[1.7051, -0.6218, -0.0833], [-0.1303, 1.1408, -0.0105], [-0.0240, -0.1290, 1.1530]],
}


@pytest.mark.parametrize(
    ("header", "primaries"),
    [
        ({"chromaticities": AP1}, AP1),
        ({"colorInteropID": "lin_ap1_scene"}, AP1),
        ({"oiio:ColorSpace": "lin_rec2020", "gamma": 1.0}, REC2020),
    ],
)
def test_other_primaries_are_converted_and_told(tmp_path, header, primaries):
    image = read_image(write(tmp_path / "map.exr", **header))
    assert image.facts["colours"].startswith(f"converted to Rec. 709 from red {primaries[0]:.4g}")
    exact = PIXELS.astype(np.float64) @ np.transpose(EXACT[primaries])
    # The printed matrices have four decimals: half a unit of the last for each of three channels.
    assert np.abs(image.radiance() - exact).max() <= 3 * 0.5e-4 * PIXELS.max() * 1.01


def test_a_latlong_file_says_that_it_is_read_as_cells(tmp_path):
    image = read_image(write(tmp_path / "map.exr", envmap=OpenEXR.ENVMAP_LATLONG))
    assert "read as cells" in image.facts["envmap"]
    np.testing.assert_array_equal(image.radiance(), PIXELS)


def test_white_stays_white_under_any_primaries(tmp_path):
    grey = np.full((4, 8, 3), 3.0, np.float32)
    for number, primaries in enumerate((AP1, (1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1 / 3, 1 / 3))):
        path = write(tmp_path / f"{number}.exr", {"RGB": grey}, chromaticities=primaries)
        # One rounding to float32; the matrix is inverted twice in float64.
        np.testing.assert_allclose(read_radiance(path), 3.0, rtol=2e-7)


def test_the_primaries_of_rec_709_change_no_bit(tmp_path):
    named = (0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290)
    header = {"chromaticities": named, "adoptedNeutral": np.float32([0.31, 0.33])}
    image = read_image(write(tmp_path / "map.exr", **header, whiteLuminance=80.0))
    np.testing.assert_array_equal(image.radiance(), PIXELS)
    assert image.facts == {
        "neutral": "0.31 0.33 (adoptedNeutral; not applied)",
        "white": "80 cd/m² (whiteLuminance; radiance stays relative)",
    }


def with_lines(path, *lines):
    """A Radiance file with further lines in its header."""
    extra = "".join(f"{line}\n" for line in lines).encode()
    path.write_bytes(write_radiance(path).read_bytes().replace(b"\n\n-Y", b"\n" + extra + b"\n-Y"))
    return path


def test_exposures_and_colour_corrections_are_divided_out(tmp_path):
    plain = read_radiance(write_radiance(tmp_path / "plain.hdr"))
    lines = ("EXPOSURE=0.25", "Exposure = 2", "COLORCORR=1 2 0.5")
    image = read_image(with_lines(tmp_path / "map.hdr", *lines))
    # Powers of two are divided exactly.
    np.testing.assert_array_equal(image.radiance(), plain / np.float32([0.5, 1.0, 0.25]))
    assert image.facts["exposure"] == "divided by 0.5 1 0.25 (EXPOSURE, COLORCORR)"


def test_header_lines_that_say_nothing_new_change_no_bit(tmp_path):
    lines = (
        "SOFTWARE=a=b", "EXPOSURE=1.0000", "GAMMA=1", "PIXASPECT=1.0", "VIEW= -vh 360 -vv 180",
        "PRIMARIES=0 0 0 0 0 0 0 0", "format=32-bit_rle_xyze", "FORMAT=\t32-bit_rle_rgbe",
        "PRIMARIES=0.64 0.33 0.3 0.6 0.15 0.06 0.3127 0.329", "rpict -vh 45", "\tEXPOSURE=2",
        " GAMMA=2.2",
    )  # fmt: skip
    image = read_image(with_lines(tmp_path / "map.hdr", *lines))
    plain = read_radiance(write_radiance(tmp_path / "plain.hdr"))
    np.testing.assert_array_equal(image.radiance(), plain)
    assert image.facts == {}


@pytest.mark.parametrize(
    ("line", "sentence"),
    [
        ("EXPOSURE=0", "EXPOSURE=0: pixels cannot be divided"),
        ("EXPOSURE=-1", "cannot be divided"),
        ("EXPOSURE=", "EXPOSURE=: a number was expected"),
        ("EXPOSURE=bright", "a number was expected"),
        ("EXPOSURE=nan", "a number was expected"),
        ("EXPOSURE=1_0", "a number was expected"),
        ("COLORCORR=1 1", "3 numbers were expected"),
        ("PRIMARIES=1 2 3", "8 numbers were expected"),
        ("GAMMA=2.2", "GAMMA=2.2: its values are not linear"),
        ("PIXASPECT=0.5", "its pixels are not square"),
        ("VIEW= -vtv -vp 0 0 0 -vh 45 -vv 30", "is not the whole sphere"),
        ("VIEW= -vta -vh 360 -vv 180", "is not the whole sphere"),
        ("VIEW= -vh 360 -vv 180 -vs 0.5", "is not the whole sphere"),
        ("PRIMARIES=0.64 0.33 0.3 0.6 0.15 0.06 5 0.3", "those of no colours"),
        ("gamma = 2.2", "its values are not linear"),
        ("FORMAT=Radiance_spectra", "FORMAT=Radiance_spectra is not read"),
    ],
)
def test_lines_of_a_radiance_header_that_cannot_be_applied_are_named(
    tmp_path, capfd, line, sentence
):
    refused(with_lines(tmp_path / "map.hdr", line), sentence, capfd)


@pytest.mark.parametrize("line", [b"FORMAT=", b"format =\t"])
def test_xyze_and_primaries_are_converted(tmp_path, line):
    path = write_radiance(tmp_path / "map.hdr", np.full((4, 8, 3), 0.5, np.float32))
    rgbe, xyze = b"FORMAT=32-bit_rle_rgbe", line + b"32-bit_rle_xyze"
    path.write_bytes(path.read_bytes().replace(rgbe, xyze))
    assert "red 1 0, green 0 1, blue 0 0" in read_image(path).facts["colours"]
    np.testing.assert_allclose(read_radiance(path), 0.5, rtol=2e-7)  # equal values stay white
    other = with_lines(tmp_path / "other.hdr", f"PRIMARIES={' '.join(map(str, REC2020))}")
    plain = read_radiance(write_radiance(tmp_path / "plain.hdr")).astype(np.float64)
    exact = plain @ np.transpose(EXACT[REC2020])
    inside = (exact > 0.0).all(axis=2)
    error = np.abs(read_radiance(other) - exact)[inside]
    assert error.max() <= 3 * 0.5e-4 * plain.max() * 1.01


@pytest.mark.parametrize("order", ["-Y +X", "+Y +X", "-Y -X", "+Y -X", "+X -Y", "-X -Y", "+X +Y"])
def test_a_radiance_file_in_any_order_comes_back_the_right_way_up(tmp_path, order):
    first, second = order.split()
    seen = read_radiance(write_radiance(tmp_path / "plain.hdr"))
    stored = seen if first[1] == "Y" else seen.transpose(1, 0, 2)
    down, right = ("-Y", "+X") if first[1] == "Y" else ("+X", "-Y")
    stored = stored[:: 1 if first == down else -1, :: 1 if second == right else -1]
    path = write_radiance(tmp_path / "map.hdr", np.ascontiguousarray(stored))
    lines, length = stored.shape[:2]
    line = f"-Y {lines} +X {length}\n".encode()
    assert line in path.read_bytes()
    path.write_bytes(
        path.read_bytes().replace(line, f"{first} {lines} {second} {length}\n".encode())
    )
    np.testing.assert_array_equal(read_radiance(path), seen)


@pytest.mark.parametrize("line", [b"-Y 0 +X 16", b"-Y -8 +X 16", b"-Y 8 +Y 16", b"8 16", b""])
def test_a_size_line_that_is_none_is_named(tmp_path, capfd, line):
    path = write_radiance(tmp_path / "map.hdr")
    path.write_bytes(path.read_bytes().replace(b"-Y 8 +X 16", line))
    refused(path, f"its size line '{re.escape(line.decode())}' is no size; fetch it again", capfd)


HEAD = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y %d +X %d\n"


def shared_exponents(data):
    """What bytes (..., 4) of RGBE stand for."""
    data = data.astype(np.float64)
    value = data[..., :3] * 2.0 ** (data[..., 3:] - 136.0)
    return np.where(data[..., 3:] > 0, value, 0.0).astype(np.float32)


@pytest.mark.parametrize("width", [1, 7, 8, 16, 300])
@pytest.mark.parametrize("first", [(9, 8, 7, 130), (2, 2, 5, 129), (1, 1, 1, 2)])
def test_flat_files_are_read_whatever_they_begin_like(tmp_path, width, first):
    data = np.random.default_rng(3).integers(0, 256, (4, width, 4), np.uint8)
    data[0, 0] = first
    (tmp_path / "map.hdr").write_bytes(HEAD % (4, width) + data.tobytes())
    np.testing.assert_array_equal(read_radiance(tmp_path / "map.hdr"), shared_exponents(data))


def test_runs_of_pixels_are_read(tmp_path):
    pixel, other = (10, 20, 30, 129), (40, 50, 60, 120)
    line = [pixel, (1, 1, 1, 4), (1, 1, 1, 1), other, (1, 1, 1, 38)]  # 1 + 4 + 256 + 1 + 38
    path = tmp_path / "map.hdr"
    path.write_bytes(HEAD % (150, 300) + np.array(line * 150, np.uint8).tobytes())
    wanted = np.array([pixel] * 261 + [other] * 39, np.uint8)
    image = read_radiance(path)
    np.testing.assert_array_equal(image, np.tile(shared_exponents(wanted), (150, 1, 1)))


def test_a_line_of_another_width_than_its_file_s_is_named(tmp_path, capfd):
    path = write_radiance(tmp_path / "map.hdr")
    head, mark, lines = path.read_bytes().rpartition(b"\2\2\0\20")
    path.write_bytes(head + mark[:3] + b"\21" + lines)
    refused(path, "line 8 of 8 is cut short or damaged", capfd)


@pytest.mark.parametrize("width", [8, 127, 128, 129, 1000])
def test_radiance_is_read_bit_for_bit_as_another_reader_does(tmp_path, width):
    rng = np.random.default_rng(width)
    pixels = np.repeat(10.0 ** rng.uniform(-6.0, 6.0, (6, -(-width // 5), 3)), 5, axis=1)
    path = write_radiance(tmp_path / "map.hdr", pixels[:, :width].astype(np.float32))
    other = OpenImageIO.ImageInput.open(str(path))
    np.testing.assert_array_equal(read_radiance(path), other.read_image("float"))
    other.close()


def test_a_map_beyond_the_free_memory_is_refused_before_it_is_taken(tmp_path, capfd, monkeypatch):
    memory = tmp_path / "meminfo"
    memory.write_text("MemTotal: 9 kB\nMemAvailable:   1 kB\n", encoding="ascii")
    monkeypatch.setattr("samplers.files.stored_image.MEMORY", memory)
    for path in (write(tmp_path / "map.exr"), write_radiance(tmp_path / "map.hdr")):
        refused(path, "16×8 pixels need 0.0 GB of memory and 0.0 GB are free", capfd)


def test_memory_that_runs_out_and_files_that_cannot_be_opened_are_told(
    tmp_path, capfd, monkeypatch
):
    path = write_radiance(tmp_path / "map.hdr")

    def raising(error):
        def read_bytes(self):
            raise error

        monkeypatch.setattr("pathlib.Path.read_bytes", read_bytes)

    raising(MemoryError())
    refused(path, "not enough memory", capfd)
    raising(OSError(24, "Too many open files"))
    refused(path, "cannot be read .Too many open files.", capfd)


@pytest.mark.skipif(os.name != "posix", reason="names of files are bytes on POSIX alone")
def test_a_name_that_is_not_utf_8_is_told(tmp_path):
    path = tmp_path / os.fsdecode(b"sky\xff.exr")
    path.write_bytes(write(tmp_path / "map.exr").read_bytes())
    with pytest.raises(EnvlightError, match=r"sky\\xff\.exr: its name is not UTF-8; rename it"):
        read_radiance(path)


def test_maps_are_read_in_poor_surroundings(tmp_path):
    """Standard streams closed, few files open, and a locale that knows ASCII alone."""
    (tmp_path / "ä").mkdir()
    paths = [str(write(tmp_path / "ä" / "map.exr")), str(write_radiance(tmp_path / "map.hdr"))]
    script = (
        "import sys; from pathlib import Path; from samplers.files.image_file import read_radiance;"
        "sums = [float(read_radiance(Path(path)).sum()) for path in sys.argv[2:]];"
        "Path(sys.argv[1]).write_text(str(sums))"
    )
    words = [sys.executable, script, str(tmp_path / "sums"), *paths]
    plain = {**os.environ, "LC_ALL": "C", "PYTHONCOERCECLOCALE": "0", "PYTHONUTF8": "0"}
    run = 'ulimit -n 40; exec "$0" -c "$@" <&- >&- 2>&-'
    subprocess.run(["sh", "-c", run, *words], check=True, env=plain)
    sums = [float(read_radiance(Path(path)).sum()) for path in paths]
    assert (tmp_path / "sums").read_text() == str(sums)
