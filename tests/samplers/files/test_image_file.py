"""Maps are read exactly, whatever their layout; anything else is one quiet sentence."""

import os
import re
import struct

import numpy as np
import OpenEXR
import OpenImageIO
import pytest
from PIL import Image

from samplers import EnvlightError
from samplers.files.image_file import read_radiance

PIXELS = (np.random.default_rng(0).random((8, 16, 3)) * 50.0).astype(np.float32)
PLAIN = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
LOSSLESS = ("NO", "RLE", "ZIPS", "ZIP", "PIZ")
RECENT = ("ZSTD", "HTJ2K256", "HTJ2K32")
"""Lossless as well; OpenEXR has them since 3.4 or 3.5."""
LOSSY = ("PXR24", "B44", "B44A", "DWAA", "DWAB")


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


@pytest.mark.parametrize("compression", RECENT)
def test_recent_compressions_come_back_exactly_where_the_library_has_them(tmp_path, compression):
    kind = getattr(OpenEXR, f"{compression}_COMPRESSION", None)
    if kind is None:
        pytest.skip(f"OpenEXR {OpenEXR.__version__} has no {compression}")
    image = read_radiance(write(tmp_path / "map.exr", compression=kind))
    np.testing.assert_array_equal(image, PIXELS)


@pytest.mark.parametrize("compression", LOSSY)
def test_lossy_exr_comes_back_closely(tmp_path, compression):
    header = {"compression": getattr(OpenEXR, f"{compression}_COMPRESSION")}
    smooth = np.linspace(1.0, 2.0, 32 * 64 * 3).reshape(32, 64, 3).astype(np.float16)
    image = read_radiance(write(tmp_path / "map.exr", {"RGB": smooth}, **header))
    # B44 keeps 6 bits of a difference within a block of 4 × 4, DWA drops what nobody sees.
    np.testing.assert_allclose(image, smooth.astype(np.float32), rtol=0.02)


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


def test_radiance_comes_back_to_its_eight_bits(tmp_path):
    image = read_radiance(write_radiance(tmp_path / "map.hdr"))
    # The three mantissas of a pixel share the exponent of the largest, 8 bits wide, cut off.
    error = np.abs(image - PIXELS)
    assert (error <= PIXELS.max(axis=2, keepdims=True) * 2.0**-7).all()


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


def test_damaged_bytes_end_in_an_image_or_a_sentence(tmp_path, capfd):
    rng = np.random.default_rng(2)
    for path in (write(tmp_path / "map.exr"), write_radiance(tmp_path / "map.hdr")):
        whole = path.read_bytes()
        sentences = 0
        for _ in range(150):
            damaged = bytearray(whole)
            for place in rng.integers(0, min(len(whole), 700), 3):
                damaged[place] = rng.integers(256)
            path.write_bytes(damaged)
            try:
                assert read_radiance(path).shape[2] == 3
            except EnvlightError as error:
                sentences += 1
                assert str(error).isprintable()
        assert sentences > 20
    assert capfd.readouterr() == ("", "")


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
    monkeypatch.setattr("samplers.files.image_file.MAX_PIXELS", 127)
    refused(write(tmp_path / "map.exr"), "16×8 pixels are declared, more than the limit", capfd)


def test_missing_empty_and_foreign_files_are_named(tmp_path, capfd):
    (tmp_path / "empty.exr").touch()
    (tmp_path / "folder.hdr").mkdir()
    Image.new("RGB", (16, 8)).save(tmp_path / "ldr.png")
    Image.new("RGB", (16, 8)).save(tmp_path / "ldr.jpg")
    refused(tmp_path / "none.exr", "no such file", capfd)
    refused(tmp_path / "empty.exr", "the file is empty", capfd)
    refused(tmp_path / "folder.hdr", "a folder", capfd)
    refused(tmp_path / "ldr.png", "not a high-dynamic-range format", capfd)
    refused(tmp_path / "ldr.jpg", "not a high-dynamic-range format", capfd)
    (tmp_path / "png.exr").write_bytes((tmp_path / "ldr.png").read_bytes())
    (tmp_path / "jpeg.hdr").write_bytes((tmp_path / "ldr.jpg").read_bytes())
    refused(tmp_path / "png.exr", "its content is png, not openexr", capfd)
    refused(tmp_path / "jpeg.hdr", "its content is jpeg, not hdr", capfd)
    (tmp_path / "text.exr").write_text("no image\n" * 50, encoding="utf-8")
    (tmp_path / "text.hdr").write_text("no image\n" * 50, encoding="utf-8")
    refused(tmp_path / "text.exr", "not a readable .exr file", capfd)
    refused(tmp_path / "text.hdr", "not a readable .hdr file", capfd)


def test_wrong_channels_are_named(tmp_path, capfd):
    one = np.ascontiguousarray(PIXELS[..., 0])
    refused(write(tmp_path / "y.exr", {"Y": one}), "channels Y; .* needs R, G and B", capfd)
    layer = {f"diffuse.{name}": one for name in "RGB"}
    refused(write(tmp_path / "layer.exr", layer), re.escape("channels diffuse.R, "), capfd)


def test_deep_and_multi_part_files_are_named(tmp_path, capfd):
    deep = np.empty((8, 16), object)
    for place in np.ndindex(deep.shape):
        deep[place] = np.ones(2, np.float32)
    header = {"type": OpenEXR.deepscanline, "compression": OpenEXR.ZIPS_COMPRESSION}
    refused(write(tmp_path / "deep.exr", dict.fromkeys("RGB", deep), **header), "deep data", capfd)
    parts = [OpenEXR.Part(PLAIN | {"name": name}, {"RGB": PIXELS}) for name in "ab"]
    OpenEXR.File(parts).write(str(tmp_path / "parts.exr"))
    refused(tmp_path / "parts.exr", "several parts", capfd)


def test_a_part_of_a_map_is_named(tmp_path, capfd):
    window = {
        "dataWindow": (np.array([4, 2], np.int32), np.array([19, 9], np.int32)),
        "displayWindow": (np.array([0, 0], np.int32), np.array([31, 15], np.int32)),
    }
    refused(write(tmp_path / "crop.exr", **window), "16×8 of 32×16 pixels are stored", capfd)


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        (b"-Y 8 +X 16", b"+Y 8 +X 16", "turned or mirrored"),
        (b"-Y 8 +X 16", b"+X 16 -Y 8", "turned or mirrored"),
        (b"rle_rgbe", b"rle_xyze", "CIE XYZ"),
        (b"-Y 8 +X 16", b"-Y 0 +X 16", "fetch it again"),
        (b"-Y 8 +X 16", b"-Y -8 +X 16", "fetch it again"),
    ],
)
def test_radiance_headers_that_would_be_misread_are_named(tmp_path, capfd, old, new, sentence):
    path = write_radiance(tmp_path / "map.hdr")
    path.write_bytes(path.read_bytes().replace(old, new))
    refused(path, sentence, capfd)


@pytest.mark.parametrize("at", ["the reading", "the flush", "the first stream", "the second"])
def test_an_interrupt_while_a_map_is_read_leaves_the_streams_as_they_were(
    tmp_path, capfd, monkeypatch, at
):
    path = write(tmp_path / "map.exr")
    back: list[int] = []

    def interrupt(*words, **named):
        raise KeyboardInterrupt

    point = os.dup2

    def pointing(source, target):
        back.append(target)  # 1 and 2 away, then 1 and 2 back
        if at == {3: "the first stream", 4: "the second"}.get(len(back)):
            raise KeyboardInterrupt
        return point(source, target)

    if at == "the reading":
        monkeypatch.setattr("OpenEXR.File", interrupt)
    elif at == "the flush":
        monkeypatch.setattr("samplers.files.image_file.ctypes.CDLL", interrupt)
    else:
        monkeypatch.setattr("samplers.files.image_file.os.dup2", pointing)
    with pytest.raises(KeyboardInterrupt):
        read_radiance(path)
    monkeypatch.undo()
    os.write(1, b"out")
    os.write(2, b"err")
    print("python")
    assert capfd.readouterr() == ("outpython\n", "err")
    np.testing.assert_array_equal(read_radiance(path), PIXELS)
