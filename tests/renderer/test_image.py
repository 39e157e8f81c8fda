"""Images come back from their files as they were written, whole or not at all."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from renderer.image import LARGEST_HALF, write_exr, write_hdr, write_png
from samplers.errors import EnvlightError
from samplers.files.image_file import read_radiance


@pytest.fixture
def picture() -> np.ndarray:
    """Values over twelve decades, different in every channel, of an odd size."""
    rng = np.random.default_rng(0)
    return (10.0 ** rng.uniform(-6.0, 6.0, (23, 37, 3))).astype(np.float32)


def test_float_files_keep_every_bit(tmp_path: Path, picture: np.ndarray) -> None:
    write_exr(tmp_path / "deep" / "a.exr", picture)
    np.testing.assert_array_equal(read_radiance(tmp_path / "deep" / "a.exr"), picture)


def test_half_files_round_to_half_and_clamp_to_its_largest(
    tmp_path: Path, picture: np.ndarray
) -> None:
    picture[0, 0] = (LARGEST_HALF, 65520.0, 1e30)  # 65520 rounds to infinity as a half
    write_exr(tmp_path / "a.exr", picture, half=True)
    back = read_radiance(tmp_path / "a.exr")
    assert np.isfinite(back).all()
    np.testing.assert_array_equal(back[0, 0], LARGEST_HALF)
    # Half a unit in the last of 11 bits, and half of the smallest subnormal.
    wanted = np.minimum(picture, LARGEST_HALF)
    np.testing.assert_allclose(back, wanted, rtol=2.0**-11, atol=2.0**-25)


def read_by_mitsuba(path: Path) -> np.ndarray:
    mi = pytest.importorskip("mitsuba", reason="the peer, mitsuba, is not installed")
    mi.set_variant("scalar_rgb")
    return np.array(mi.Bitmap(str(path)))[..., :3]


@pytest.mark.parametrize("read", [read_radiance, read_by_mitsuba])
def test_radiance_files_round_to_eight_bits_and_keep_the_energy(tmp_path: Path, read) -> None:
    """A step of 2⁻⁸ of a power of two above the largest: half of it is 2⁻⁸ of the largest at most.

    Of n values of one pixel's scale, each off evenly within that, the sum is off by its standard
    deviation, 2⁻⁸ / √3 / √n of the mean largest; four of them are allowed."""
    rng = np.random.default_rng(2)
    values = rng.uniform(0.0, 1.0, (200, 300, 3)).astype(np.float32)
    scale = 10.0 ** rng.uniform(-6.0, 6.0, (200, 300, 1)).astype(np.float32)
    values[0, 0], values[0, 1] = (0.0, 0.0, 0.0), (0.9999, 0.5, 0.0)  # rounds to the next exponent
    scale[0, :2] = 1.0
    write_hdr(tmp_path / "a.hdr", np.asfortranarray(values * scale))
    back = read(tmp_path / "a.hdr") / scale
    off, largest = (back - values).astype(np.float64), values.max(axis=2, keepdims=True)
    assert (np.abs(off) <= 2.0**-8 * (1.0 + 1e-6) * largest).all()
    assert np.abs(off.mean(axis=(0, 1))).max() <= 4.0 * 2.0**-8 / np.sqrt(3.0 * 200 * 300)
    assert (back[0, 0] == 0.0).all() and back[0, 1, 0] == 1.0


@pytest.mark.parametrize("half", [False, True])
def test_arrays_of_any_layout_are_written_right(
    tmp_path: Path, picture: np.ndarray, half: bool
) -> None:
    picture = np.minimum(picture, 1e4).astype(np.float16).astype(np.float32)
    layouts = {
        "transposed": np.asfortranarray(picture),
        "flipped": np.ascontiguousarray(picture[::-1, ::-1])[::-1, ::-1],
        "strided": np.repeat(np.repeat(picture, 2, axis=0), 3, axis=1)[::2, ::3],
        "planes": np.ascontiguousarray(picture.transpose(2, 0, 1)).transpose(1, 2, 0),
        "bgr": np.ascontiguousarray(picture[..., ::-1])[..., ::-1],
        "double": picture.astype(np.float64),
    }
    for name, array in layouts.items():
        write_exr(tmp_path / f"{name}.exr", array, half=half)
        np.testing.assert_array_equal(read_radiance(tmp_path / f"{name}.exr"), picture)


def test_png_keeps_bytes_of_any_layout(tmp_path: Path) -> None:
    pixels = np.random.default_rng(1).integers(0, 256, (11, 13, 3), np.uint8)
    write_png(tmp_path / "a.png", np.asfortranarray(pixels))
    np.testing.assert_array_equal(np.asarray(Image.open(tmp_path / "a.png")), pixels)


def test_a_failed_write_leaves_the_old_file_and_no_other(
    tmp_path: Path, picture: np.ndarray, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "a.exr"
    write_exr(path, picture)
    before = path.read_bytes()

    class Broken:
        """Writes half of a file, then runs out of space."""

        def __init__(self, *_: object) -> None: ...

        def write(self, target: str) -> None:
            Path(target).write_bytes(before[: len(before) // 2])
            raise OSError("no space left on device")

    monkeypatch.setattr("OpenEXR.File", Broken)
    with pytest.raises(EnvlightError, match="no space left"):
        write_exr(path, picture)
    assert path.read_bytes() == before
    assert [p.name for p in tmp_path.iterdir()] == ["a.exr"]


def test_an_impossible_folder_is_named(tmp_path: Path, picture: np.ndarray) -> None:
    (tmp_path / "file").write_text("in the way")
    for write in (
        lambda p: write_exr(p, picture),
        lambda p: write_png(p, np.zeros((2, 2, 3), "u1")),
    ):
        with pytest.raises(EnvlightError, match="cannot be written"):
            write(tmp_path / "file" / "a.png")
    assert [p.name for p in tmp_path.iterdir()] == ["file"]
