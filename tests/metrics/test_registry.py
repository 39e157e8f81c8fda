"""Metrics are data: registered once, judged together, each value where its name says."""

import math

import numpy as np
import pytest

from metrics import registry
from metrics.errors import corrected_square, rmse
from metrics.registry import Metric, find_metric, leading_metric, metrics, ranked_metrics, register
from metrics.truth import Truth
from samplers import EnvlightError, threads


def noisy(seed, sigma=0.1):
    return np.random.default_rng(seed).normal(1.0, sigma, (40, 50, 3)).astype(np.float32)


def truth(image=None, floor=0.0, halves=None):
    return Truth(noisy(0) if image is None else image, 2.0, floor, halves)


def test_names_and_labels_are_distinct_and_one_metric_leads():
    found = metrics()
    assert len({metric.name for metric in found}) == len({m.label for m in found}) == len(found)
    assert [metric.name for metric in found if metric.leads] == [leading_metric().name]
    assert leading_metric() in ranked_metrics()


@pytest.mark.parametrize("metric", metrics(), ids=lambda metric: metric.name)
def test_a_perfect_image_has_the_best_value(metric):
    best = metric.columns(truth().image, truth())[metric.name]
    worse = metric.columns(noisy(1), truth())[metric.name]
    assert best < worse if metric.better == "less" else best > worse
    if metric.better == "less":
        assert best == 0.0


@pytest.mark.parametrize("metric", metrics(), ids=lambda metric: metric.name)
def test_the_thread_count_changes_no_bit(metric, monkeypatch):
    image, reference = (np.tile(noisy(seed), (4, 6, 1)) for seed in (1, 0))
    values = []
    for count in (1, 3):
        monkeypatch.setattr(threads, "_thread_count", count)
        values.append(metric.columns(image, truth(reference))[metric.name])
    assert values[0] == values[1]


def test_what_is_needed_is_made_once_for_all_images():
    made = []
    metric = Metric(
        "mean_gap", "mean gap", lambda image, truth, mean: abs(float(image.mean()) - mean),
        needs=(lambda truth: made.append(truth) or float(truth.image.mean()),),
    )  # fmt: skip
    reference = truth()
    for seed in range(3):
        assert metric.columns(noisy(seed), reference)["mean_gap"] >= 0.0
    assert len(made) == 1


def test_a_metric_that_is_registered_is_found_and_goes_again():
    metric = register(Metric("largest", "largest error", lambda image, truth: 1.0, ranked=True))
    try:
        assert find_metric("largest") is metric
        assert metric in ranked_metrics()
        assert ranked_metrics()[-1] is leading_metric()
    finally:
        del registry._registry["largest"]
    with pytest.raises(EnvlightError, match="no metric is called 'largest'; use "):
        find_metric("largest")


def test_what_cannot_be_a_metric_is_refused():
    with pytest.raises(EnvlightError, match="its name is a column"):
        Metric("two words", "x", lambda image, truth: 0.0)
    with pytest.raises(EnvlightError, match="ranks are by errors"):
        Metric("ssim", "SSIM", lambda image, truth: 0.0, better="more", ranked=True)
    with pytest.raises(EnvlightError, match="two metrics are called 'psnr'"):
        register(Metric("psnr", "PSNR", lambda image, truth: 0.0))


def test_the_correction_for_the_references_noise_is_unbiased():
    """A truth that is known, references with noise of known size: their mean error is the true one.

    With n = 6000 values of noise σ, the corrected square has a standard deviation of about
    √(2/n) σ² + 2 σ e/√n around e², here 7e-5 + 5e-5; over 400 references its mean has a twentieth
    of that, 6e-6. Five of these are allowed. Without the correction it is off by σ² = 4e-3."""
    rng = np.random.default_rng(4)
    exact = rng.uniform(0.5, 1.5, (40, 50, 3))
    image = (exact + 0.03 * rng.normal(size=exact.shape)).astype(np.float32)
    square = rmse(image, exact.astype(np.float32)) ** 2
    sigma, found = 2.0**-4, []
    for _ in range(400):
        noise = sigma * rng.normal(size=exact.shape)
        floor = math.sqrt((noise**2).mean())
        found.append(corrected_square(image, (exact + noise).astype(np.float32), floor))
    assert np.mean(found) == pytest.approx(square, abs=3e-5)
    assert np.mean(found) + sigma**2 > square + 1e-3


def test_values_near_their_floor_are_marked():
    exact = np.full((40, 50, 3), 1.0, np.float32)
    halves = tuple((exact + 0.02 * noisy(seed, 1.0)).astype(np.float32) for seed in (1, 2))
    mean = (0.5 * (halves[0].astype(np.float64) + halves[1])).astype(np.float32)
    floor = rmse(halves[0], halves[1]) / 2.0
    reference = truth(mean, floor, halves)
    for metric in ranked_metrics():
        close = metric.columns(exact, reference)
        far = metric.columns(np.full_like(exact, 3.0), reference)
        assert close[metric.floor_column] > 0.0
        assert close[metric.near_column] and not far[metric.near_column]


def test_without_halves_the_floor_is_unknown_and_nothing_is_marked():
    columns = find_metric("flip").columns(noisy(1), truth())
    assert math.isnan(columns["flip_floor"]) and not columns["flip_near_floor"]
