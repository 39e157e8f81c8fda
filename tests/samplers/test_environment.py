"""Environment maps: what is refused, what is repaired, and the tables that samplers share."""

import math
import pickle
import threading

import numpy as np
import OpenEXR
import pytest

from samplers import EnvironmentMap, EnvlightError
from samplers.files.colours import to_rec709
from samplers.grids.map_kernels import box_sum
from samplers.sphere import pixel_direction, pixel_directions

EPSILON = float(np.finfo(np.float64).eps)
EPSILON32 = float(np.finfo(np.float32).eps)


def noisy(height, sun=0.0, seed=0):
    """Radiance over four decades, with a sun in one texel."""
    rng = np.random.default_rng(seed)
    radiance = 10.0 ** rng.uniform(-2.0, 2.0, (height, 2 * height, 3))
    if sun:
        radiance[height // 3, height // 2] = sun
    return radiance.astype(np.float32)


@pytest.mark.parametrize(
    ("shape", "sentence"),
    [
        ((4, 8), "wanted (H, W, 3)"),
        ((4, 8, 4), "wanted (H, W, 3)"),
        ((4, 8, 1), "wanted (H, W, 3)"),
        ((0, 0, 3), "it is empty"),
        ((4, 7, 3), "7×4 pixels; a latitude-longitude map is twice as wide"),
        ((8, 4, 3), "twice as wide as high; `envlight new-map` makes one"),
        ((8, 8, 3), "this may be an angular map, a mirror ball or an octahedral map"),
        ((6, 8, 3), "this may be a cube map: `envlight new-map` makes one of other projections"),
        ((8, 6, 3), "this may be a cube map: `envlight new-map` makes one of other projections"),
        ((2, 12, 3), "this may be a cube map: `envlight new-map` makes one of other projections"),
    ],
)
def test_wrong_shapes_are_named(shape, sentence):
    with pytest.raises(EnvlightError) as caught:
        EnvironmentMap.from_array(np.ones(shape), "somewhere")
    assert str(caught.value).startswith("map 'somewhere': ")
    assert sentence in str(caught.value)


@pytest.mark.parametrize("kind", [np.complex128, object, np.bool_, "U1"])
def test_values_that_are_no_numbers_are_named(kind):
    with pytest.raises(EnvlightError, match="wanted real numbers"):
        EnvironmentMap.from_array(np.ones((1, 2, 3)).astype(kind))


def test_bad_values_are_counted_with_their_first_place():
    radiance = np.ones((4, 8, 3))
    radiance[1, 5, 2] = radiance[2, 0, 0] = np.nan
    radiance[0, 7, 1] = -np.inf
    radiance[3, 3, 0] = 1e39  # infinite as float32
    radiance[3, 3, 1] = -1e-30
    with pytest.raises(EnvlightError) as caught:
        EnvironmentMap.from_array(radiance, "m")
    assert str(caught.value) == (
        "map 'm': radiance has 2 NaN (first in row 1, column 5, channel B) and 2 infinite (first "
        "in row 0, column 7, channel G) and 2 negative (first in row 0, column 7, channel G); mend "
        "the file or let --repair clamp it"
    )
    fixed = EnvironmentMap.from_array(radiance, "m", repair=True)
    assert (fixed.repair.nan, fixed.repair.infinite, fixed.repair.negative) == (2, 1, 2)
    assert fixed.repaired == 5
    wanted = np.ones((4, 8, 3), np.float32)
    for place in ((1, 5, 2), (2, 0, 0), (0, 7, 1), (3, 3, 1)):
        wanted[place] = 0.0
    wanted[3, 3, 0] = np.finfo(np.float32).max
    np.testing.assert_array_equal(fixed.radiance, wanted)


def test_infinity_becomes_the_largest_value_of_the_format():
    radiance = np.ones((2, 4, 3), np.float16)
    radiance[0, 1] = np.inf
    fixed = EnvironmentMap.from_array(radiance, repair=True)
    # Eight texels of equal solid angle, of which seven are finite and 1.
    change = (7.0 + 65504.0) / 7.0 - 1.0
    assert fixed.repair.change == pytest.approx(change, rel=32 * EPSILON)
    assert str(fixed.repair) == (
        "3 values changed: 3 infinite became 65504; the flux is +9.36e+05 % against the finite "
        "ones alone"
    )


def test_the_flux_that_negative_values_took_is_told():
    radiance = np.ones((2, 4, 3))
    radiance[1, 2] = -1.0
    repair = EnvironmentMap.from_array(radiance, repair=True).repair
    assert repair.change == pytest.approx(7.0 / 6.0 - 1.0, rel=64 * EPSILON)
    assert str(repair).startswith("3 values changed: 3 negative became 0; the flux is +16.7 %")


def test_a_map_of_nothing_but_nan_is_repaired_to_black():
    fixed = EnvironmentMap.from_array(np.full((2, 4, 3), np.nan), repair=True)
    assert fixed.repaired == 24
    assert fixed.is_black
    assert "the finite ones had no flux" in str(fixed.repair)


def test_repair_leaves_a_good_map_alone():
    radiance = noisy(4)
    fixed = EnvironmentMap.from_array(radiance, repair=True)
    assert fixed.repaired == 0
    np.testing.assert_array_equal(fixed.radiance, radiance)


def test_a_map_does_not_share_memory_with_its_maker():
    radiance = noisy(4)
    environment = EnvironmentMap.from_array(radiance)
    before = environment.radiance.copy()
    radiance[:] = 7.0
    np.testing.assert_array_equal(environment.radiance, before)
    for array in (environment.radiance, environment.luminance, environment.flux_table):
        with pytest.raises(ValueError, match="read-only"):
            array[0, 0] = 1.0


def test_nobody_makes_a_shared_map_writable_again():
    """Samplers of all measurements see the same arrays, and so do views of them."""
    environment = EnvironmentMap.from_array(noisy(4))
    for array in (environment.radiance, environment.luminance, environment.moment_table):
        for view in (array, array[1:3], array.reshape(-1), np.asarray(array)):
            with pytest.raises(ValueError, match="cannot set WRITEABLE flag"):
                view.flags.writeable = True


def test_a_map_survives_pickling():
    environment = EnvironmentMap.from_array(-noisy(4), "m", repair=True)
    again = pickle.loads(pickle.dumps(environment))
    assert (again.name, again.repaired, again.digest) == ("m", 96, environment.digest)


def test_the_digest_follows_pixels_and_shape():
    radiance = noisy(4)
    other = radiance.copy()
    other[2, 3, 1] = np.nextafter(other[2, 3, 1], np.float32(np.inf))
    digests = {EnvironmentMap.from_array(a, "x").digest for a in (radiance, radiance, other)}
    assert len(digests) == 2
    sizes = {EnvironmentMap.from_array(np.zeros((h, 2 * h, 3))).digest for h in (1, 2)}
    assert len(sizes) == 2


def test_luminance_is_zero_only_where_radiance_is():
    radiance = np.zeros((4, 8, 3), np.float32)
    for k in range(3):
        radiance[1, k, k] = np.finfo(np.float32).smallest_subnormal
    environment = EnvironmentMap(radiance)
    np.testing.assert_array_equal(environment.luminance > 0.0, radiance.any(axis=2))


def test_luminance_and_flux_are_those_of_the_definition():
    environment = EnvironmentMap.from_array(noisy(16, sun=1e7))
    exact = environment.radiance.astype(np.float64) @ [0.2126, 0.7152, 0.0722]
    # Three rounded weights, three products and two sums in float32, all positive.
    np.testing.assert_allclose(environment.luminance, exact, rtol=4 * EPSILON32)
    solid_angle = environment.row_solid_angle[:, None]
    np.testing.assert_array_equal(environment.flux, environment.luminance * solid_angle)


def test_total_flux_is_the_sum_over_texels():
    environment = EnvironmentMap.from_array(noisy(32, sun=1e7))
    solid_angle = environment.row_solid_angle
    for channel in range(3):
        terms = environment.radiance[..., channel] * solid_angle[:, None]
        # A sum of n positive terms is off by at most n ε of itself.
        error = (sum(environment.radiance.shape[:2]) + 4) * EPSILON
        assert environment.total_flux[channel] == pytest.approx(math.fsum(terms.flat), rel=error)


def boxes(height, count=200):
    """Random boxes and all of the map, as (top, left, bottom, right)."""
    rng = np.random.default_rng(4)
    rows = np.sort(rng.integers(0, height + 1, (count, 2)), axis=1)
    columns = np.sort(rng.integers(0, 2 * height + 1, (count, 2)), axis=1)
    found = np.stack([rows[:, 0], columns[:, 0], rows[:, 1], columns[:, 1]], axis=1)
    return [*map(tuple, found), (0, 0, height, 2 * height), (0, 0, 1, 1)]


def terms_of(environment, table):
    """What each table sums, (H, W, channels), in float64."""
    height, width = environment.height, environment.width
    luminance = environment.luminance.astype(np.float64)
    flux = luminance * environment.row_solid_angle[:, None]
    column, row = np.meshgrid(np.arange(width) + 0.5 - height, np.arange(height) + 0.5 - height / 2)
    match table:
        case "flux_table":
            return flux[..., None]
        case "square_table":
            return (luminance**2 * environment.row_solid_angle[:, None])[..., None]
        case "moment_table":
            return flux[..., None] * pixel_directions(height)
        case _:
            place = np.stack([column, row, column**2 + row**2], axis=-1)
            return flux[..., None] * place


@pytest.mark.parametrize(
    "table", ["flux_table", "square_table", "moment_table", "pixel_moment_table"]
)
@pytest.mark.parametrize("height", [1, 2, 21])
def test_summed_area_tables_agree_with_exact_sums(table, height):
    environment = EnvironmentMap.from_array(noisy(height, sun=1e7))
    sums = getattr(environment, table).reshape(height + 1, 2 * height + 1, -1)
    terms = terms_of(environment, table)
    assert not sums[0].any()
    assert not sums[:, 0].any()
    for channel in range(terms.shape[2]):
        # A corner adds W terms along a row and H rows, each addition and each term rounded, and a
        # box takes four corners, so its error is set by all that lies left of and above it.
        bound = 4 * (3 * height + 8) * EPSILON * np.abs(terms[..., channel]).sum()
        for top, left, bottom, right in boxes(height):
            exact = math.fsum(terms[top:bottom, left:right, channel].flat)
            found = box_sum(sums[:, :, channel], top, left, bottom, right)
            assert abs(found - exact) <= bound


def test_a_table_is_built_once_for_all_threads(monkeypatch):
    calls = []
    monkeypatch.setattr(
        "samplers.environment.summed_flux", lambda *args: calls.append(1) or np.zeros(3)
    )
    environment = EnvironmentMap.from_array(noisy(4))
    barrier, got = threading.Barrier(4), []

    def ask():
        barrier.wait()
        got.append(environment.flux_table)

    threads = [threading.Thread(target=ask) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(calls) == 1
    assert all(table is got[0] for table in got)


def test_black_and_nearly_black_maps_are_told_apart():
    assert EnvironmentMap.from_array(np.zeros((2, 4, 3))).is_black
    one = np.zeros((2, 4, 3), np.float32)
    one[1, 2, 0] = 1e-38
    assert not EnvironmentMap.from_array(one).is_black


def test_lookup_finds_the_texel_of_its_centre():
    environment = EnvironmentMap.from_array(noisy(5))
    row, column = np.indices((5, 10))
    found = environment.lookup(pixel_direction(row, column, 5))
    np.testing.assert_array_equal(found, environment.radiance)


@pytest.mark.parametrize(("kind", "largest"), [("f2", 65504.0), ("f4", np.finfo("f4").max)])
def test_a_file_gives_its_name_and_its_repairs(tmp_path, kind, largest):
    radiance = noisy(4).astype(kind)
    radiance[0, 0] = np.nan
    radiance[1, 1, 1] = np.inf
    write_map(tmp_path / "street.night.exr", radiance)
    with pytest.raises(EnvlightError, match=r"map 'street\.night': radiance has 3 NaN"):
        EnvironmentMap.from_file(tmp_path / "street.night.exr")
    environment = EnvironmentMap.from_file(tmp_path / "street.night.exr", repair=True)
    assert (environment.name, environment.repaired) == ("street.night", 4)
    assert environment.radiance[1, 1, 1] == environment.repair.largest == largest


AP1 = (0.713, 0.293, 0.165, 0.830, 0.128, 0.044, 0.32168, 0.33767)


def write_map(path, radiance, **header):
    header |= {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    OpenEXR.File(header, {"RGB": radiance}).write(str(path))


def test_what_is_outside_rec_709_is_told_with_the_file_s_colours(tmp_path):
    radiance = np.ones((4, 8, 3), np.float32)
    radiance[2, 3] = 0.0, 1.0, 0.0
    write_map(tmp_path / "wide.exr", radiance, chromaticities=AP1)
    with pytest.raises(EnvlightError, match=r"has 2 negative .* converted to Rec\. 709 from red 0"):
        EnvironmentMap.from_file(tmp_path / "wide.exr")
    environment = EnvironmentMap.from_file(tmp_path / "wide.exr", repair=True)
    assert environment.repair.negative == 2
    # What was cut off is the luminance of the negative red and blue.
    assert 0.0 < environment.repair.change < 1.0 / 8.0
    assert "converted to Rec. 709" in environment.facts["colours"]


def test_infinity_is_told_as_such_and_repaired_before_colours_are_converted(tmp_path):
    radiance = np.ones((4, 8, 3), np.float16)
    radiance[2, 3] = np.inf
    write_map(tmp_path / "sun.exr", radiance, chromaticities=AP1)
    with pytest.raises(EnvlightError, match=r"radiance has 3 infinite \(first in row 2, column 3"):
        EnvironmentMap.from_file(tmp_path / "sun.exr")
    environment = EnvironmentMap.from_file(tmp_path / "sun.exr", repair=True)
    # White stays white: rows of the matrix add up to 1, each product rounded.
    np.testing.assert_allclose(environment.radiance[2, 3], 65504.0, rtol=4 * EPSILON32)


@pytest.mark.parametrize("kind", ["f2", "f4"])
def test_saturated_colours_of_rec_709_survive_other_primaries(tmp_path, kind):
    wide = np.linalg.inv(to_rec709(tmp_path, AP1))
    colours = np.eye(3)[np.arange(32) % 3].reshape(4, 8, 3)
    colours *= np.random.default_rng(1).uniform(1.0, 2.0, (4, 8, 1))
    write_map(tmp_path / "led.exr", (colours @ wide.T).astype(kind), chromaticities=AP1)
    environment = EnvironmentMap.from_file(tmp_path / "led.exr")
    assert environment.repair is None
    # Half a unit in the last place of what is stored, times the sum of a row of the matrix.
    error = np.finfo(kind).eps * np.abs(np.linalg.inv(wide)).sum(axis=1).max() * 2.0
    assert np.abs(environment.radiance - colours).max() <= error
