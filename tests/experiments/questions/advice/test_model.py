"""The model finds a law that errors follow, tells how far it is off, and is kept as text."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from experiments.maps.features import FEATURES, PREFIX
from experiments.questions.advice.coordinates import Frame, plain, transformed
from experiments.questions.advice.judged import at_rays, coverage, median_factor
from experiments.questions.advice.measured import measured
from experiments.questions.advice.model import (
    SURE,
    design,
    quantiles,
)
from experiments.questions.advice.model_file import from_json, load_model, to_json
from experiments.questions.advice.train import (
    _fits,
    _left_out,
    _parted,
    _splits,
    _whole,
    trained_on,
)
from metrics.registry import NEAR
from samplers import EnvlightError
from tests.experiments.questions.advice.conftest import NOISE
from tests.experiments.questions.advice.known_law import (
    COUNTS,
    RAYS_PER_LIGHT,
    SAMPLERS,
    features_of,
    law,
    law_run,
)

NAMES = sorted(SAMPLERS)


@pytest.fixture(scope="module")
def exact(tmp_path_factory):
    """Trained on a law without noise."""
    return trained_on([law_run(tmp_path_factory.mktemp("exact"), maps=40)])


def test_the_law_is_found_on_a_map_that_was_not_seen(exact):
    """Errors of a log-linear law; only the ridge, and ranges that a new map leaves, stand between.

    The least ridge that is tried, 1, shrinks coefficients by about 1 of 160 rows; means over the
    scenes are 1.
    """
    rng = np.random.default_rng(99)
    model = exact.model
    for _ in range(20):
        features = features_of(rng)
        inside = np.clip(plain({PREFIX + k: v for k, v in features.items()}),
                         model.features.min(0), model.features.max(0))  # fmt: skip
        known = dict(zip(FEATURES, inside, strict=True))
        for count in (4, 12, 32):
            found = np.exp(model.log_errors("rmse", inside, np.array([count])))[:, 0]
            wanted = [law(sampler, known, count) for sampler in NAMES]
            assert found == pytest.approx(wanted, rel=0.05)
            rays = np.exp(model.log_rays(inside, np.array([count])))[:, 0]
            assert rays == pytest.approx([RAYS_PER_LIGHT[s] * count for s in NAMES], rel=0.02)


def test_what_changes_nothing_has_no_weight(exact):
    size = len(FEATURES)
    slopes = exact.model.errors["rmse"].coefficient[:, :size]
    names = list(FEATURES)
    spread = exact.model.frame.spread
    wanted = np.zeros_like(slopes)
    wanted[NAMES.index("ours"), names.index("contrast")] = -0.3 * spread[names.index("contrast")]
    wanted[NAMES.index("mis"), names.index("texture")] = 0.3 * spread[names.index("texture")]
    assert slopes == pytest.approx(wanted, abs=0.01)
    assert np.abs(exact.model.errors["rmse"].coefficient[:, size:]).max() < 0.01


def test_residuals_are_of_maps_that_were_left_out(noisy):
    """Noise of 0.15 in ln error: predictions of left-out maps are off by that, or a bit more."""
    off = noisy.model.residuals["rmse"]
    # 720 draws: a standard error of 0.15/√1440 = 0.004; 39 terms of 240 rows each cost at most
    # 39/240 of the variance twice over.
    assert 0.135 < off.std() < 0.18
    assert median_factor(noisy.model, "rmse") == pytest.approx(
        math.exp(0.6745 * off.std()), rel=0.03
    )
    assert np.nanmean(coverage(noisy.model, "rmse")) == pytest.approx(SURE, abs=0.03)


def test_intervals_hold_on_new_maps(noisy, tmp_path):
    fresh = measured([law_run(tmp_path, maps=200, noise=NOISE, seed=5)])
    model, inside = noisy.model, []
    for features, errors in zip(fresh.features, fresh.errors["rmse"], strict=True):
        predicted = np.exp(model.log_errors("rmse", features, np.array(COUNTS, np.float64)))
        for k in range(len(NAMES)):
            for c, count in enumerate(COUNTS):
                low, high = model.interval("rmse", k, count)
                inside.append(low * predicted[k, c] <= errors[k, c] <= high * predicted[k, c])
    # Of 80 %, with quantiles from 60 maps each: a standard error of 5 % each, over 12 pairs.
    assert 0.74 < np.mean(inside) < 0.88


def test_quantiles_are_those_of_one_map_more():
    """The k-th of n values is exceeded by the next one with probability k/(n + 1)."""
    low, high = quantiles(np.arange(9.0))
    assert (math.log(low), math.log(high)) == pytest.approx((0.0, 8.0))
    rng = np.random.default_rng(3)
    hits = []
    for _ in range(2000):
        low, high = (math.log(factor) for factor in quantiles(rng.normal(size=29)))
        hits.append(low <= rng.normal() <= high)
    assert np.mean(hits) == pytest.approx(SURE, abs=4.0 * math.sqrt(SURE * 0.2 / 2000))
    assert quantiles(np.array([])) == (0.0, math.inf)


def test_a_model_is_its_text(noisy, tmp_path):
    text = to_json(noisy.model)
    again = from_json(text)
    assert to_json(again) == text
    json.loads(text, parse_constant=lambda word: pytest.fail(word))  # no NaN, no infinity
    counts = np.array([5.0, 30.0])
    features = noisy.model.features[3]
    for metric in ("rmse", "flip"):
        # Coefficients of seven digits, residuals of four.
        assert again.log_errors(metric, features, counts) == pytest.approx(
            noisy.model.log_errors(metric, features, counts), abs=1e-4
        )
        assert again.interval(metric, 1, 8) == pytest.approx(
            noisy.model.interval(metric, 1, 8), rel=1e-3
        )
    file = tmp_path / "model.json"
    file.write_text(text.replace('"contrast"', '"glare"'), encoding="utf-8")
    with pytest.raises(EnvlightError, match=r"no model of errors .*another version"):
        load_model(file)
    with pytest.raises(EnvlightError, match="cannot be read"):
        load_model(tmp_path / "nowhere.json")


def test_what_is_not_measured_is_not_predicted(tmp_path):
    run = law_run(tmp_path, maps=12)
    rows = run.rows
    rows = rows[~((rows["sampler"] == "mis") & (rows["budget"] == "lights=4"))]
    run = type(run)(run.folder, rows, run.record)
    trained = trained_on([run])
    gone = trained.model.residuals["rmse"][:, NAMES.index("mis")]
    assert np.isnan(gone[:, 0]).all() and np.isfinite(gone[:, 1:]).all()
    assert to_json(from_json(to_json(trained.model))) == to_json(trained.model)


def test_a_count_that_only_bright_maps_have_is_predicted_for_all(tmp_path):
    """Runs may differ in their counts, and the maps of one be other than those of the other."""
    run = law_run(tmp_path, maps=40)
    contrast = run.rows[PREFIX + "contrast"]
    few = (run.rows["budget"] == "lights=32") & (contrast < contrast.median())
    kept = type(run)(run.folder, run.rows[~few], run.record)
    model, table = trained_on([kept]).model, measured([run])
    counts = np.array(table.counts)
    for k in range(40):
        found = np.exp(model.log_errors("rmse", table.features[k], counts))
        assert found == pytest.approx(table.errors["rmse"][k], rel=0.05)
        rays = np.exp(model.log_rays(table.features[k], counts))
        assert rays == pytest.approx(table.rays[k], rel=0.02)
    common, beside = _parted(np.log(measured([kept]).errors["rmse"]))
    gone = np.isnan(common[:, 0])
    assert gone[:, 3].sum() == 20 and not gone[:, :3].any()
    over = beside.transpose(0, 2, 1)[~gone].mean(axis=1)
    assert over == pytest.approx(np.zeros(len(over)), abs=1e-12)
    assert np.nanstd(common, axis=0).min() > 0.1


def test_without_a_sampler_that_has_everything_no_mean_is_taken():
    target = np.arange(12.0).reshape(3, 2, 2)
    target[0, 0, 1] = target[1, 1, 0] = np.nan
    common, beside = _parted(target)
    assert not common.any() and np.array_equal(beside, target, equal_nan=True)


def test_errors_below_the_floor_count_as_it(tmp_path):
    run = law_run(tmp_path, maps=8)
    plain_errors = measured([run]).errors["rmse"]
    middle = float(np.median(plain_errors))
    floored = run.rows.assign(rmse_floor=middle / NEAR)
    found = measured([type(run)(run.folder, floored, run.record)]).errors["rmse"]
    assert found == pytest.approx(np.maximum(plain_errors, middle))


def test_of_a_map_in_two_runs_the_last_counts(tmp_path):
    one, other = law_run(tmp_path / "a", maps=8), law_run(tmp_path / "b", maps=8, seed=1)
    both, last = measured([one, other]), measured([other])
    assert both.maps == last.maps
    assert np.array_equal(both.errors["rmse"], last.errors["rmse"])
    assert np.array_equal(both.features, last.features)


def test_rows_without_features_are_refused(tmp_path):
    run = law_run(tmp_path, maps=8)
    rows = run.rows.drop(columns="map_contrast")
    with pytest.raises(EnvlightError, match=r"without features of the maps \(map_contrast\)"):
        measured([type(run)(run.folder, rows, run.record)])
    with pytest.raises(EnvlightError, match="3 maps were measured; a model needs"):
        measured([law_run(tmp_path, maps=3)])
    timed = run.rows.assign(budget="rays=4")
    with pytest.raises(EnvlightError, match="no budgets of lights"):
        measured([type(run)(run.folder, timed, run.record)])


def test_errors_at_rays_lie_between_those_at_counts():
    rays = np.log(np.array([[[1.0, 2.0, 4.0], [8.0, 16.0, 32.0]]]))
    errors = np.array([[[0.0, -1.0, -2.0], [5.0, 4.0, 3.0]]])
    assert at_rays(rays, errors, 2.0)[0, 0] == pytest.approx(-1.0)
    assert at_rays(rays, errors, math.sqrt(8.0))[0, 0] == pytest.approx(-1.5)
    found = at_rays(rays, errors, 5.0)[0]
    assert found[0] == pytest.approx(-2.0)  # within a quarter of the last
    assert math.isnan(found[1])


def test_verdicts_tell_regret_by_brute_force(noisy, run):
    table = measured([run])
    place = COUNTS.index(8)
    errors = table.errors["rmse"][:, :, place]
    (found,) = [
        one
        for one in noisy.model.verdicts
        if (one.metric, one.league, one.kind, one.amount) == ("rmse", "all", "lights", 8.0)
    ]
    choice, always, margin = [], [], noisy.model.margins["rmse"]
    for k in range(len(errors)):
        others = np.delete(np.log(errors), k, axis=0).mean(axis=0)
        guess = noisy.predicted["rmse"][k, :, place]
        led = guess[others.argmin()] - guess.min() > margin
        chosen = guess.argmin() if led else others.argmin()
        choice.append(errors[k, chosen] / errors[k].min())
        always.append(errors[k, others.argmin()] / errors[k].min())
    assert found.choice == pytest.approx(np.exp(np.log(choice).mean()))
    assert found.always == pytest.approx(np.exp(np.log(always).mean()))
    random = np.exp(np.log(errors / errors.min(axis=1, keepdims=True)).mean())
    assert found.random == pytest.approx(random)
    # The law has a winner by contrast and texture, so that looking at the map pays.
    assert found.better and found.choice < found.always < found.random


def test_predictions_of_a_map_do_not_see_it(tmp_path):
    table = measured([law_run(tmp_path, maps=10, noise=0.1)])
    target = np.log(table.errors["rmse"])
    spoiled = target.copy()
    spoiled[4] += 5.0
    splits = _splits(table, None)
    (plainly,), (again,) = (_left_out(splits, one, "and both", (3.0,)) for one in (target, spoiled))
    assert np.array_equal(plainly[4], again[4])
    assert not np.isclose(plainly, again)[:4].any()
    # Nor do the scales of the features.
    changed = table.features.copy()
    changed[4] = changed[:4].max(axis=0)
    others = _splits(replace(table, features=changed), None)
    split, other = (next(one for one in found if one.left == [4]) for found in (splits, others))
    assert np.array_equal(split.terms[split.kept], other.terms[other.kept])


def test_coordinates_are_in_units_of_the_measured_spread():
    rng = np.random.default_rng(0)
    maps = np.array([list(features_of(rng).values()) for _ in range(30)])
    maps[:, 4] = 0.5
    frame = Frame.of(maps)
    points = frame.point(maps)
    same = np.zeros(len(FEATURES), bool)
    same[4] = True
    assert points.mean(axis=0) == pytest.approx(np.zeros(len(FEATURES)), abs=1e-12)
    assert points.std(axis=0) == pytest.approx(np.where(same, 0.0, 1.0))
    # Beyond the furthest nothing is known.
    far = maps.max(axis=0) + 0.04
    assert frame.point(far) == pytest.approx(points.max(axis=0))


def test_steps_are_factors():
    row = dict.fromkeys(FEATURES, 0.5) | {"contrast": 100.0, "emitters": 0.0, "emitter_size": 10.0}
    found = dict(zip(FEATURES, transformed(np.array(list(row.values()))), strict=True))
    assert found["contrast"] == pytest.approx(math.log(100.0))
    assert found["emitters"] == 0.0 and found["entropy"] == 0.0
    assert found["emitter_size"] == pytest.approx(math.log(10.0))
    assert found["texture"] == 0.5


def test_terms_are_those_of_their_parts():
    row = design(np.array([[2.0, 3.0]]), np.array([0.5]))[0]
    assert row.tolist() == [2.0, 3.0, 3.0, 8.0, 1.0, 1.5]


def test_without_features_the_mean_over_maps_is_predicted(tmp_path):
    table = measured([law_run(tmp_path, maps=10, noise=0.1)])
    target = np.log(table.errors["rmse"])
    (found,) = _left_out(_splits(table, None), target, "the count alone", (1.0,))
    for k in range(10):
        assert found[k] == pytest.approx(np.delete(target, k, axis=0).mean(axis=0))


def test_what_features_move_adds_up(noisy):
    model, x = noisy.model, 0.7
    found = model.errors["rmse"]
    points = model.frame.point(model.features)
    rest = found(np.zeros(len(FEATURES)), np.array([x]))[:, 0]
    moved = found.moved(points, x)
    for k in (0, 7, 30):
        assert rest + moved[:, k].sum(axis=1) == pytest.approx(
            found(points[k], np.array([x]))[:, 0]
        )
        assert found.moved(points[k], x) == pytest.approx(moved[:, k])


def test_ridges_are_solved_as_the_normal_equations_say(tmp_path):
    table = measured([law_run(tmp_path, maps=9, noise=0.1)])
    target, whole = np.log(table.errors["rmse"]), _whole(table)
    ridges = (0.5, 20.0)
    x = whole.terms.reshape(-1, whole.terms.shape[2])
    y = (target - target.mean(axis=0)).transpose(0, 2, 1).reshape(-1, len(NAMES))
    for ridge, found in zip(ridges, _fits(whole, target, "and both", ridges), strict=True):
        wanted = np.linalg.solve(x.T @ x + ridge * np.eye(x.shape[1]), x.T @ y)
        assert found.coefficient == pytest.approx(wanted.T, abs=1e-9)
        assert found.mean == pytest.approx(target.mean(axis=0))
