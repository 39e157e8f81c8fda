"""The table of `mitsuba-3` against Mitsuba's own: densities, and what its samples hit."""

import math

import numpy as np
import pytest
from scipy import stats

from samplers import EnvironmentMap, make_sampler

mi = pytest.importorskip("mitsuba", reason="the peer, mitsuba, is not installed: pip install it")
mi.set_variant("scalar_rgb")
mi.set_log_level(mi.LogLevel.Error)


def noise(height=16, seed=0, sun=200.0):
    rng = np.random.default_rng(seed)
    radiance = rng.uniform(0.0, 1.0, (height, 2 * height, 3)) ** 3
    radiance[height // 3, -1] *= sun  # beside the seam
    return EnvironmentMap.from_array(radiance)


def flat():
    """A map that is too even for compensation: its darkest texel is 0.5 % below the mean."""
    radiance = np.random.default_rng(1).uniform(0.995, 1.005, (8, 16, 1)) * np.ones(3)
    return EnvironmentMap.from_array(radiance)


def one_texel(row, column):
    radiance = np.zeros((16, 32, 3))
    radiance[row, column] = (3.0, 2.0, 1.0)
    return EnvironmentMap.from_array(radiance)


MAPS = {
    "noise": noise(), "odd": noise(9, 3), "three-rows": noise(3, 2), "flat": flat(),
    "one-texel": one_texel(5, 11), "one-texel-on-the-seam": one_texel(9, 0),
}  # fmt: skip


def emitter_of(environment, compensation):
    bitmap = mi.Bitmap(environment.radiance.copy())  # it takes no read-only array
    scene = {
        "type": "scene",
        "light": {"type": "envmap", "bitmap": bitmap, "mis_compensation": compensation},
    }
    return mi.load_dict(scene).emitters()[0]


def ours(environment, compensation):
    sampler = make_sampler("mitsuba-3", compensation=compensation)
    return sampler.prepare(environment, 2, np.random.default_rng(0))


@pytest.mark.parametrize("name", MAPS)
@pytest.mark.parametrize("compensation", [False, True])
def test_densities_are_those_of_mitsuba(name, compensation):
    environment = MAPS[name]
    theirs, found = emitter_of(environment, compensation), ours(environment, compensation)
    rng = np.random.default_rng(4)
    direction = rng.normal(size=(1500, 3))
    drawn, _ = found.sample(rng.random((500, 3), np.float32))
    direction = np.concatenate([direction / np.linalg.norm(direction, axis=1)[:, None], drawn])
    away = np.abs(direction[:, 1]) < 0.98  # where its acos of y loses digits
    direction = direction[away].astype(np.float32)
    record, place = mi.DirectionSample3f(), mi.Interaction3f()
    wanted = np.empty(len(direction))
    for i, way in enumerate(direction):
        record.d = mi.Vector3f(*map(float, way))
        wanted[i] = theirs.pdf_direction(place, record)
    # Its angles are float32, 1e-7 rad of cells of 0.1 rad: next to a corner of weight 0 that is
    # 1e-6 of the patch's largest density.
    np.testing.assert_allclose(found.pdf(direction), wanted, rtol=1e-3, atol=1e-5 * wanted.max())


@pytest.mark.parametrize("compensation", [False, True])
def test_samples_of_mitsuba_follow_our_density(compensation):
    environment, count, side = MAPS["noise"], 20_000, 16
    theirs, found = emitter_of(environment, compensation), ours(environment, compensation)
    rng, place = np.random.default_rng(6), mi.Interaction3f()
    drawn = np.array([
        np.array(theirs.sample_direction(place, mi.Point2f(*u))[0].d)
        for u in rng.random((count, 2)).tolist()
    ])  # fmt: skip
    height = np.clip(drawn[:, 1], -1.0, 1.0)
    turn = np.arctan2(drawn[:, 0], -drawn[:, 2]) / (2.0 * math.pi) % 1.0
    row = np.minimum((0.5 * (1.0 - height) * side).astype(int), side - 1)
    column = np.minimum((turn * 2 * side).astype(int), 2 * side - 1)
    seen = np.bincount(row * 2 * side + column, minlength=2 * side * side)
    fine = 32  # equal areas: 32² points of each cell
    y = 1.0 - 2.0 * (np.arange(side * fine) + 0.5) / (side * fine)
    phi = 2.0 * math.pi * (np.arange(2 * side * fine) + 0.5) / (2 * side * fine)
    flat = np.sqrt(1.0 - y**2)[:, None]
    way = np.stack(
        [np.sin(phi) * flat, np.broadcast_to(y[:, None], (len(y), len(phi))), -np.cos(phi) * flat],
        axis=-1,
    )
    density = found.pdf(way.reshape(-1, 3).astype(np.float32)).astype(np.float64)
    mass = density.reshape(side, fine, 2 * side, fine).mean(axis=(1, 3)) * 4.0 * math.pi
    expected = count * mass.ravel() / (2 * side * side)
    # What is left of the poles' 1 / sin θ by 32² points.
    assert expected.sum() == pytest.approx(count, rel=2e-3)
    often = expected >= 5.0
    s = np.append(seen[often], seen[~often].sum())
    e = np.append(expected[often], expected[~often].sum())
    s, e = s[e >= 5.0], e[e >= 5.0]
    # Two such tests: each at 1 % / 2.
    assert stats.chi2.sf(((s - e) ** 2 / e).sum(), len(e) - 1) > 0.005
