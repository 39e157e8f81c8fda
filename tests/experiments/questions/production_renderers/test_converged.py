"""Converged means: their noise is as large as is said, and differences beyond it are found."""

import numpy as np
import pytest

from experiments.questions.production_renderers.shots import BLOCK, Agreement, Converged

HEIGHT, WIDTH, RUNS, SIGMA = 48, 64, 8, 0.1


def runs(seed: int, mean: np.ndarray | float = 0.5, count: int = RUNS) -> list[np.ndarray]:
    rng = np.random.default_rng(seed)
    return [
        (mean + SIGMA * rng.standard_normal((HEIGHT, WIDTH, 3))).astype(np.float32)
        for _ in range(count)
    ]


def test_noise_is_that_of_the_mean():
    found = Converged.of(runs(1))
    values = HEIGHT * WIDTH * 3
    # A variance over `values` pixels of 7 degrees of freedom each is known to √(2 / 7 / values).
    assert found.floor == pytest.approx(SIGMA / np.sqrt(RUNS), rel=3 * np.sqrt(0.5 / 7 / values))
    error = np.sqrt(((found.image - 0.5) ** 2).mean())
    assert error == pytest.approx(found.floor, rel=0.05)
    # A deviation of 8 means is known to a quarter (1 / √14), of which three are allowed.
    assert found.mean_error == pytest.approx(SIGMA / np.sqrt(RUNS * values), rel=0.81)
    blocks = SIGMA / np.sqrt(RUNS * 3 * BLOCK**2)
    assert np.sqrt((found.block_error**2).mean()) == pytest.approx(blocks, rel=0.15)
    assert found.blocks.shape == (HEIGHT // BLOCK, WIDTH // BLOCK)
    np.testing.assert_allclose(np.mean(found.halves, axis=0), found.image, atol=1e-6)


def test_equal_means_agree():
    found = Agreement.of(Converged.of(runs(2)), Converged.of(runs(3)))
    assert abs(found.difference) < 4.0 * found.difference_error
    # Student's t of 14 degrees of freedom has the variance 14 / 12; 48 blocks know it to a tenth.
    assert found.block_z == pytest.approx(np.sqrt(14.0 / 12.0), rel=0.35)
    assert found.block_difference < found.block_noise


def test_a_shift_and_a_local_difference_are_found():
    ours = Converged.of(runs(4))
    brighter = Agreement.of(Converged.of(runs(5, 0.51)), ours)
    assert brighter.difference == pytest.approx(0.02, abs=4.0 * brighter.difference_error)
    assert brighter.difference > 5.0 * brighter.difference_error
    # Half the picture brighter, half darker: the same mean, other blocks.
    split = np.full((HEIGHT, WIDTH, 3), 0.5)
    split[:, : WIDTH // 2] += 0.05
    split[:, WIDTH // 2 :] -= 0.05
    other = Agreement.of(Converged.of(runs(6, split)), ours)
    assert abs(other.difference) < 4.0 * other.difference_error
    assert other.block_difference == pytest.approx(0.1, rel=0.05) and other.block_z > 5.0


def test_images_without_noise_have_no_error():
    same = [np.full((BLOCK, BLOCK, 3), 0.25, np.float32)] * 2
    found = Agreement.of(Converged.of(same), Converged.of(same))
    assert (found.difference, found.difference_error, found.block_difference) == (0.0, 0.0, 0.0)
    assert np.isnan(found.block_z)
