"""What is expected of a sampler is what was measured on the maps alike, here by a known law."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from experiments.maps.features import FEATURES, PREFIX
from experiments.questions.advice.expected import (
    LEAST_SHARE,
    SURE,
    Wish,
    advise,
    completed,
    judged_wish,
    likeness,
    measured_at,
    middle,
    on_map,
    transformed,
)
from experiments.questions.advice.measured import load_measured, to_json
from experiments.questions.which_sampler import gathered
from metrics.registry import NEAR
from samplers import EnvlightError
from tests.experiments.questions.advice.known_law import (
    COUNTS,
    RAYS_PER_LIGHT,
    SAMPLERS,
    law,
    law_run,
)

NOISE = 0.15
NAMES = sorted(SAMPLERS)


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    return law_run(tmp_path_factory.mktemp("law"), maps=80, noise=NOISE)


@pytest.fixture(scope="module")
def table(run):
    return gathered([run])


def columns(**changed):
    """A map's columns, with what is not changed in the middle of what the maps have."""
    features = dict.fromkeys(FEATURES, 0.5) | {"emitter_size": 30.0, "texture": 0.0} | changed
    return {PREFIX + name: value for name, value in features.items()}


def own(table, k):
    return {PREFIX + name: v for name, v in zip(FEATURES, table.features[k].tolist(), strict=True)}


def answer(advice, league):
    return next(one for one in advice.answers if one.league == league)


@pytest.mark.parametrize(("size", "count"), [(500.0, 4), (500.0, 11), (2.0, 4), (2.0, 32)])
def test_the_best_by_the_law_is_chosen_for_each_use(table, size, count):
    found = advise(table, columns(emitter_size=size), Wish("lights", count, "rmse"))
    features = {"emitter_size": size, "texture": 0.0}
    errors = {name: law(name, features, count) for name in ("ours", "median-cut")}
    fixed = answer(found, "fixed")
    assert fixed.chosen.sampler == min(errors, key=errors.__getitem__)
    assert fixed.runner_up.error >= fixed.chosen.error and fixed.better > 0.5
    drawn = answer(found, "distribution").chosen
    assert (drawn.sampler, drawn.count) == ("mis", count)
    assert drawn.low < drawn.error < drawn.high
    assert drawn.rays == pytest.approx(RAYS_PER_LIGHT["mis"] * count)
    assert found.measured_as == "" and found.beyond == ()
    assert sum(one.share for one in found.alike) < 1.0


def test_a_measured_map_is_answered_with_its_own_rows(table):
    """By its features, of which a file keeps six digits; at a measured count to the last bit."""
    rounded = {name: float(f"{value:.6g}") for name, value in own(table, 7).items()}
    for features in (own(table, 7), rounded):
        found = advise(table, features, Wish("lights", 8, "rmse"))
        assert found.measured_as == table.maps[7] == found.alike[0].name
        for one in (*(found.answers), found.answers[0].runner_up):
            one = getattr(one, "chosen", one)
            error = table.errors["rmse"][7, table.samplers.index(one.sampler), 1]
            assert one.error == one.low == one.high == pytest.approx(error, rel=1e-12)
    other = own(table, 7) | {PREFIX + "emitter_size": 1.01 * own(table, 7)[PREFIX + "emitter_size"]}
    assert advise(table, other, Wish("lights", 8, "rmse")).measured_as == ""


def test_likeness_falls_with_the_distance_and_what_lies_beyond_all_maps_is_told(table):
    shares = likeness(table, table.features[3])
    assert shares.sum() == pytest.approx(1.0) and shares.argmax() == 3
    known = transformed(table.features)
    spread = known.std(axis=0)
    differ = spread > 1e-9
    distance = (((known - known[3])[:, differ] / spread[differ]) ** 2).sum(axis=1)
    order = np.argsort(distance)
    assert (np.diff(shares[order]) <= 0.0).all()
    told = advise(table, columns(emitter_size=1e9), Wish("lights", 8, "rmse"))
    assert told.beyond == ("emitter_size",)
    assert all(math.isfinite(one.chosen.error) for one in told.answers)


def test_steps_are_factors():
    row = dict.fromkeys(FEATURES, 0.5) | {"contrast": 100.0, "emitters": 0.0, "entropy": 0.0}
    found = dict(zip(FEATURES, transformed(np.array(list(row.values()))), strict=True))
    assert found["contrast"] == pytest.approx(math.log(100.0))
    assert found["emitters"] == 0.0 and found["share_above_horizon"] == 0.0
    assert found["entropy"] == pytest.approx(math.log(LEAST_SHARE / (1.0 - LEAST_SHARE)))


def test_intervals_hold_on_new_maps(table, tmp_path):
    fresh = gathered([law_run(tmp_path, maps=150, noise=NOISE, seed=5)])
    inside = []
    for features, errors in zip(fresh.features, fresh.errors["rmse"], strict=True):
        for one in on_map(table, features, Wish("lights", 8, "rmse")):
            error = errors[table.samplers.index(one.sampler), COUNTS.index(8)]
            inside.append(one.low <= error <= one.high)
    # Of 80 %; 450 draws have a standard error of 2 %, quantiles of about 15 maps one of 10 %,
    # the same for all new maps that are alike.
    assert 0.7 < np.mean(inside) < 0.9


def test_the_middle_leaves_a_tenth_of_the_weight_at_each_end():
    values = np.arange(100.0)
    low, high = middle(values, np.ones(100))
    assert (low, high) == pytest.approx((9.5, 89.5))
    assert SURE == 0.8
    heavy = np.where(values >= 50.0, 1.0, 0.0)
    assert middle(np.where(values < 50.0, np.nan, values), np.ones(100)) == middle(values, heavy)


def test_rays_are_kept_to(table):
    found = answer(advise(table, columns(), Wish("rays", 6.0, "rmse")), "distribution").chosen
    assert found.count == 8 and found.rays == pytest.approx(6.0)
    most = answer(advise(table, columns(), Wish("rays", 1e6, "rmse")), "distribution").chosen
    assert most.count == COUNTS[-1]


def test_seconds_are_those_of_the_rows_times_this_machines_speed(table):
    """0.01 s a light, and 2e-8 s a ray of "mis"."""
    subpixels = 100_000_000
    wish = Wish("seconds", 10.0, "rmse", subpixels)
    found = answer(advise(table, columns(), wish), "distribution").chosen
    assert found.seconds_lights == pytest.approx(0.01 * found.count)
    assert found.seconds_image == pytest.approx(2e-8 * 0.75 * found.count * subpixels)
    one = 0.01 + 2e-8 * 0.75 * subpixels
    assert found.count == int(10.0 / one)
    slow = answer(advise(table, columns(), replace(wish, speed=1.5)), "distribution").chosen
    assert slow.count == int(10.0 / 1.5 / one)


def test_the_least_count_that_reaches_an_error(table):
    reached = answer(advise(table, columns(), Wish("lights", 12, "rmse")), "distribution").chosen
    wish = Wish("error", reached.error * (1.0 + 1e-9), "rmse")
    found = answer(advise(table, columns(), wish), "distribution").chosen
    assert found.count == 12 and found.error <= wish.amount


@pytest.mark.parametrize(
    ("wish", "said"),
    [
        (Wish("lights", 16, "psnr"), "--metric psnr: errors are known by rmse, flip"),
        (Wish("lights", 300, "rmse"), "--lights 300: give a number of lights from 4 to 32"),
        (Wish("rays", 0.1, "rmse"), "--rays 0.1: even 4 lights cost more; give more rays"),
        (Wish("seconds", 1e-9, "rmse"), "--seconds 1e-09: even 4 lights take longer"),
        (Wish("error", 1e-6, "rmse"), "nobody is expected to reach it with 32 lights"),
    ],
)
def test_what_cannot_be_told_is_refused(table, wish, said):
    with pytest.raises(EnvlightError) as caught:
        advise(table, columns(), wish)
    assert said in str(caught.value)


def test_counts_that_only_some_maps_have_are_stepped_to_from_the_others(tmp_path):
    """Runs may differ in their counts, and the maps of one be harder than those of the other."""
    run = law_run(tmp_path, maps=40)
    whole = gathered([run])
    easy = run.rows["environment"] < "map-20"
    kept = type(run)(
        run.folder, run.rows[~(easy & (run.rows["budget"] == "lights=32"))], run.record
    )
    gaps = gathered([kept])
    assert np.isnan(gaps.errors["rmse"][:20, :, 3]).all()
    # Without noise every map falls by the same factor.
    assert completed(gaps.log_errors("rmse")) == pytest.approx(whole.log_errors("rmse"))
    few = whole.log_errors("rmse").copy()
    few[:, 1, 0] = np.nan
    assert np.isnan(completed(few)[:, 1, 0]).all()


def test_a_wish_is_judged_at_the_nearest_budget_that_was_measured(table):
    for wish, judged in (
        (Wish("lights", 11, "rmse"), ("lights", 8.0)),
        (Wish("rays", 3.0, "rmse"), ("rays", 3.0)),
    ):
        chosen = advise(table, columns(), wish).answers[0].chosen
        found = judged_wish(table, wish, chosen)
        assert (found.kind, found.amount) == judged
    wish = Wish("seconds", 10.0, "rmse", 100_000_000)
    chosen = advise(table, columns(), wish).answers[0].chosen
    found = judged_wish(table, wish, chosen)
    assert (found.kind, found.amount) == ("rays", chosen.rays)


def test_errors_at_rays_lie_between_those_at_counts(table):
    rays = np.broadcast_to([1.0, 2.0, 4.0, 8.0], table.rays.shape)
    at = measured_at(replace(table, rays=rays), Wish("rays", math.sqrt(8.0), "rmse"))
    errors = table.log_errors("rmse")
    assert at == pytest.approx(errors[:, :, 1:3].mean(axis=2))
    # A quarter may be missed.
    assert np.isfinite(measured_at(replace(table, rays=rays), Wish("rays", 9.9, "rmse"))).all()
    assert np.isnan(measured_at(replace(table, rays=rays), Wish("rays", 10.1, "rmse"))).all()


def test_errors_below_the_floor_count_as_it(run, table):
    middling = float(np.median(table.errors["rmse"]))
    floored = run.rows.assign(rmse_floor=middling / NEAR)
    found = gathered([type(run)(run.folder, floored, run.record)]).errors["rmse"]
    assert found == pytest.approx(np.maximum(table.errors["rmse"], middling))


def test_of_a_map_in_two_runs_the_last_counts(tmp_path):
    one, other = law_run(tmp_path / "a", maps=8), law_run(tmp_path / "b", maps=8, seed=1)
    both, last = gathered([one, other]), gathered([other])
    assert both.maps == last.maps
    assert np.array_equal(both.errors["rmse"], last.errors["rmse"])
    assert np.array_equal(both.features, last.features)


def test_rows_that_tell_too_little_are_refused(tmp_path):
    run = law_run(tmp_path, maps=8)
    rows = run.rows.drop(columns="map_contrast")
    with pytest.raises(EnvlightError, match=r"without features of the maps \(map_contrast\)"):
        gathered([type(run)(run.folder, rows, run.record)])
    with pytest.raises(EnvlightError, match="3 maps were measured at 4 numbers of lights"):
        gathered([law_run(tmp_path, maps=3)])
    timed = run.rows.assign(budget="rays=4")
    with pytest.raises(EnvlightError, match="no budgets of lights"):
        gathered([type(run)(run.folder, timed, run.record)])


def test_a_table_is_its_text(table, tmp_path):
    gone = table.rays.copy()
    gone[2, 1] = np.nan
    table = replace(table, rays=gone)
    text, file = to_json(table), tmp_path / "table.json"
    json.loads(text, parse_constant=lambda word: pytest.fail(word))  # no NaN, no infinity
    file.write_text(text, encoding="utf-8")
    again = load_measured(file)
    assert to_json(again) == text
    for name, errors in table.errors.items():
        assert again.errors[name] == pytest.approx(errors, rel=1e-3)  # four digits
    assert np.array_equal(np.isnan(again.rays), np.isnan(gone))
    file.write_text(text.replace('"contrast"', '"glare"'), encoding="utf-8")
    with pytest.raises(EnvlightError, match=r"no table of measured errors .*another version"):
        load_measured(file)
    with pytest.raises(EnvlightError, match="cannot be read"):
        load_measured(tmp_path / "nowhere.json")
