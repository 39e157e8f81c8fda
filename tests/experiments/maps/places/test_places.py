"""Embedded environment maps: deterministic, seamless, and of equal energy at every resolution."""

import ast
import math
import sys

import numpy as np
import pytest

from experiments.maps import places as embedded
from experiments.maps.places import colours
from experiments.maps.places.catalogue import KINDS
from experiments.maps.places.emitters import coverage, disc, polygon, polygon_solid_angle
from experiments.maps.places.noise import fractal, stripes
from experiments.maps.places.place import Place
from experiments.maps.places.raster import Picture, rasterized, subdivision
from experiments.maps.places.rays import BOX, CYLINDER, nearest
from experiments.maps.places.sky import SUN_HALF_ANGLE, ClearSky, Sun, sun, towards
from samplers.errors import EnvlightError
from samplers.preview import automatic_exposure, contact_sheet, encoded
from samplers.sphere import direction_from_uv, pixel_direction, row_solid_angle
from samplers.threads import set_thread_count, thread_count

SMALL = 32
EPSILON32 = float(np.finfo(np.float32).eps)

PLACES_OF_A_SUN = {
    "middle": towards(0.0, 35.0),
    "seam": towards(180.0, 20.0),
    "over the pole": np.array([0.0, 1.0, 0.0]),
    "beside the pole": towards(77.0, 89.6),
    "below, beside the pole": towards(-20.0, -89.8),
}


@pytest.fixture(scope="module")
def maps() -> dict:
    """All maps, made on three threads, with the colours that are kept alone."""
    before = thread_count()
    try:
        set_thread_count(3)
        with pytest.MonkeyPatch.context() as patch:
            patch.setitem(sys.modules, "colour", None)
            return {name: embedded.make(name, SMALL) for name in embedded.names()}
    finally:
        set_thread_count(before)


def black(direction, width):
    return np.zeros_like(direction)


def flux(radiance) -> np.ndarray:
    height = len(radiance)
    return row_solid_angle(height, 2 * height) @ radiance.astype(np.float64).sum(axis=1)


def test_thirty_two_maps_of_known_kinds():
    names = embedded.names()
    assert len(names) == len(set(names)) == 32
    assert {embedded.kind(name) for name in names} == set(KINDS)
    assert all(name == name.lower() and " " not in name and "_" not in name for name in names)


def test_colours_that_are_kept_are_those_of_colour_science():
    for call, kept in colours.kept_colours().items():
        name, _, numbers = call.partition("(")
        made = getattr(colours, name).__wrapped__(*ast.literal_eval(f"({numbers}"))
        # A spectrum's 471 values are summed in an order that the machine chooses.
        np.testing.assert_allclose(kept, made, rtol=471 * np.finfo(np.float64).eps, err_msg=call)


def test_unknown_names_are_answered_with_near_ones():
    with pytest.raises(EnvlightError, match="moonlit-hills"):
        embedded.make("moonlight-hills", SMALL)
    with pytest.raises(EnvlightError, match="room-one-window"):
        embedded.kind("room-one-windw")


@pytest.mark.parametrize("height", [14, 33, 4098])
def test_unfit_heights_are_refused(height):
    with pytest.raises(EnvlightError, match="even number"):
        embedded.make("constant", height)


@pytest.mark.parametrize("name", ["room-three-windows", "neon-alley", "partly-cloudy-hills"])
def test_bits_do_not_depend_on_the_thread_count(maps, name):
    before = thread_count()
    try:
        set_thread_count(1)
        alone = embedded.make(name, SMALL)
    finally:
        set_thread_count(before)
    assert np.array_equal(alone.radiance, maps[name].radiance)


@pytest.mark.parametrize("height", [32, 128, 1024])
@pytest.mark.parametrize("place", PLACES_OF_A_SUN)
def test_flux_of_a_sun_does_not_depend_on_the_resolution(place, height):
    light = Sun(PLACES_OF_A_SUN[place], np.array([1e5, 9e4, 7e4]))
    radiance = rasterized(Picture(black, [light.emitter]), height)
    # Each texel is rounded to float32 once, with a relative error of half an epsilon.
    assert flux(radiance) == pytest.approx(light.irradiance, rel=EPSILON32)


@pytest.mark.parametrize("place", PLACES_OF_A_SUN)
def test_a_suns_flux_has_the_direction_of_the_sun(place):
    height, axis = 256, PLACES_OF_A_SUN[place]
    row, column, share = coverage(disc(axis, SUN_HALF_ANGLE, np.ones(3)), height)
    direction = pixel_direction(row[:, None], column[None, :], height)
    weight = share * row_solid_angle(height, 2 * height)[row][:, None]
    mean = (weight[..., None] * direction).sum(axis=(0, 1)) / weight.sum()
    # Where a texel is cut, its centre is off the covered part by less than half its diagonal; the
    # errors of opposite rims cancel in part, and their mean cannot exceed one of them.
    assert np.linalg.norm(mean - axis) < 0.5 * math.hypot(1.0, 1.0) * math.pi / height


def test_inner_texels_of_a_sun_carry_its_radiance():
    _, _, share = coverage(disc(towards(10.0, 30.0), SUN_HALF_ANGLE, np.ones(3), 96), 2048)
    # The loop is a 96-gon whose area, 1 − (2π/96)²/6 of the disc's, is scaled up to the disc's.
    assert share.max() == pytest.approx(1.0, abs=1.01 * (2.0 * math.pi / 96) ** 2 / 6.0)
    assert np.count_nonzero(share > 0.99) > 10


def test_a_polygon_over_the_seam_covers_the_same_as_elsewhere():
    height = 64
    corners = np.array([[-0.3, 0.4, -1.0], [0.2, 0.4, -1.0], [0.2, 0.1, -1.0], [-0.3, 0.1, -1.0]])
    turned = corners * np.array([-1.0, 1.0, -1.0])
    shares = []
    for shape in (corners, turned):
        row, column, share = coverage(polygon(shape, np.ones(3)), height)
        image = np.zeros((height, 2 * height))
        np.add.at(image, (row[:, None], column[None, :]), share)
        shares.append(image)
    # Half a turn is a whole number of columns; 1e-12 is for the rounding of longitudes.
    assert np.allclose(np.roll(shares[0], height, axis=1), shares[1], rtol=0.0, atol=1e-12)


def test_solid_angle_of_an_octant_is_half_pi():
    assert abs(polygon_solid_angle(np.eye(3))) == pytest.approx(0.5 * math.pi, rel=1e-12)


def test_flux_of_maps_hardly_changes_with_resolution():
    # Heights of 16 and 64 average the same samples of the shade (their grids have 256 rows), and
    # emitters are exact: what differs is the rounding of each texel to float32, twice.
    assert subdivision(16) * 16 == subdivision(64) * 64
    for name in ("noon-desert", "night-street-lamps", "studio-two-softboxes", "forest-sun-flecks"):
        coarse, fine = (flux(embedded.make(name, height).radiance) for height in (16, 64))
        # Weights of sub-rows within a texel are sines of their middles, as solid angles are.
        assert coarse == pytest.approx(fine, rel=2.0 * EPSILON32)


def test_only_the_constant_map_is_flat(maps):
    assert np.all(maps["constant"].radiance == np.float32(0.5))
    for name, environment in maps.items():
        if name == "constant":
            continue
        blocks = environment.luminance.reshape(8, 4, 16, 4)
        spread = blocks.max(axis=(1, 3)) - blocks.min(axis=(1, 3))
        assert spread.min() > 0.0, name


def test_suns_outshine_their_skies_a_thousandfold(maps):
    suns = [name for name in maps if embedded.kind(name) == "sun"]
    assert len(suns) >= 5
    for name in suns:
        # A texel of 5.6° dilutes the disc of 0.53° by 140 at most; the physical ratio is near 1e5
        # for a high sun and 1e4 for a low one, so that 50 remains.
        luminance = maps[name].luminance
        assert luminance.max() > 50.0 * np.median(luminance), name


def test_noise_has_no_seam_and_no_pinch():
    column = np.array([0.0, 1.0 - 1e-9])
    for v in (0.2, 0.5, 0.999999):
        left, right = fractal(direction_from_uv(column, np.full(2, v)), 0.0, 0.1, 6)
        # The slope is below 60 per radian, and the two directions are 1e-8 apart.
        assert abs(left - right) < 1e-6


def test_noise_fades_before_it_aliases():
    points = np.random.default_rng(3).uniform(-50.0, 50.0, (4000, 3))
    fine = fractal(points, 0.0, 1.0, 6)
    blurred = fractal(points, 0.2, 1.0, 6)
    gone = fractal(points, 0.5, 1.0, 6)
    assert 0.2 < fine.std() < 0.5
    assert 0.0 < blurred.std() < fine.std()
    assert np.all(gone == 0.0)


def test_stripes_are_averaged_exactly():
    x = np.linspace(-3.0, 3.0, 41)
    for width in (0.05, 0.31, 2.4):
        inner = (np.arange(20000) + 0.5) / 20000.0 - 0.5
        inside = ((x[:, None] + width * inner) % 0.7) < 0.2
        # Counting 20000 points misses at most one per edge of the stripes inside the interval.
        edges = 2.0 * (width / 0.7 + 1.0)
        assert np.allclose(stripes(x, 0.7, 0.2, width), inside.mean(axis=1), atol=edges / 20000.0)


def test_the_clear_sky_is_brightest_at_its_sun_and_blue_away_from_it():
    light = sun(0.0, 45.0, 2.5)
    sky = ClearSky(light, 2.5)
    near, away = sky(np.array([light.direction, towards(180.0, 45.0)]))
    assert np.all(near > away)
    assert away[2] > away[0]


def test_a_low_sun_is_redder_and_dimmer():
    high, low = sun(0.0, 60.0, 3.0).radiance, sun(0.0, 4.0, 3.0).radiance
    assert np.all(low < high)
    assert low[0] * high[2] > 3.0 * high[0] * low[2]


def test_rays_meet_boxes_cylinders_and_the_room():
    bounds = np.array(
        [[-5.0, 0.0, -5.0, 5.0, 4.0, 5.0], [1.0, 0.0, -1.0, 2.0, 3.0, 1.0],
         [-3.0, 0.0, -0.5, -2.0, 3.0, 0.5]]
    )  # fmt: skip
    kind = np.array([BOX, BOX, CYLINDER])
    eye = np.array([0.0, 1.5, 0.0])
    expected = {
        (1.0, 0.0, 0.0): (1.0, 1, 0),
        (-1.0, 0.0, 0.0): (2.0, 2, 0),
        (0.0, 0.0, 1.0): (5.0, 0, 5),
        (0.0, -1.0, 0.0): (1.5, 0, 2),
    }
    for direction, (distance, solid, face) in expected.items():
        hit = nearest(eye, np.array(direction), bounds, kind, True, 1e9)
        assert hit == (pytest.approx(distance, abs=1e-9), solid, face)


def test_a_closed_room_keeps_the_light_of_three_bounces():
    from experiments.maps.places.building import Builder
    from experiments.maps.places.materials import Material

    grey = Material((0.5, 0.5, 0.5))
    room = Builder((-2.0, 0.0, -2.0), (2.0, 4.0, 2.0), grey, grey)
    room.globe((0.0, 2.0, 0.0), 0.05, np.ones(3))
    place: Place = room.place((0.5, 1.5, 0.5))
    irradiance, grid = place.irradiance, place._grid
    inner = grid.solid == 0
    # Flux that arrives = flux of the lamp × (1 + ρ + ρ² + ρ³) after three bounces in a closed room
    # of albedo ρ. 3 % is for the midpoint sums over a grid of 0.25 m and for 56 rays a point.
    area = 6.0 * 16.0
    arriving = irradiance[inner].mean(axis=0) * area
    lamp = 4.0 * math.pi * math.pi * 0.05**2
    assert arriving == pytest.approx(np.full(3, lamp * 1.875), rel=0.03)


def test_encoding_is_the_srgb_curve():
    image = np.array([[[0.0, 0.18, 1.0], [0.0031308, 4.0, 0.5]]])
    code = encoded(image)
    # From IEC 61966-2-1: 12.92 L below 0.0031308, else 1.055 L^(1/2.4) − 0.055; half a step each.
    assert code.tolist() == [[[0, 118, 255], [10, 255, 188]]]
    assert np.array_equal(encoded(image, 1.0), encoded(2.0 * image))


def test_exposure_puts_the_clipped_mean_at_the_key():
    rng = np.random.default_rng(4)
    image = np.repeat(rng.uniform(0.5, 5.0, (16, 32, 1)), 3, axis=2)
    image[0, 0] = 1e6
    scaled = image * 2.0 ** automatic_exposure(image, 0.24)
    # 24 halvings of 48 stops leave 3e-6 stops.
    assert np.minimum(scaled, 1.0).mean() == pytest.approx(0.24, rel=1e-5)


def test_a_contact_sheet_holds_every_picture():
    pictures = [(f"p{k}", np.full((8, 16, 3), 40 * k, np.uint8)) for k in range(1, 6)]
    sheet = contact_sheet(pictures, 2)
    assert sheet.dtype == np.uint8
    for k in range(1, 6):
        assert np.count_nonzero(np.all(sheet == 40 * k, axis=2)) >= 8 * 16
