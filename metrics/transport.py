"""How far two sets of lights are apart: light moved times the angle that it moves by.

Light is carried from one set to the other at the least total of energy × angle; what does not pay
to be carried, or has no counterpart, goes out or is lit at a price per energy. Splitting a light
into close ones costs next to nothing, as it does in an image; a light that jumps costs its jump.

That is the Kantorovich–Rubinstein distance for unequal masses (Piccoli and Rossi, "Generalized
Wasserstein distance and its application to transport equations with source", ARMA 2014), solved
exactly as a linear program. Light that both sets have in the same direction stays, which the
triangle inequality makes optimal.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from samplers.errors import EnvlightError

PENALTY = 0.5
"""Price in radians of energy that goes out or is lit, so that no light is carried further than 1
radian."""


def transport_distance(
    direction_a: ArrayLike, energy_a: ArrayLike, direction_b: ArrayLike, energy_b: ArrayLike,
    penalty: float = PENALTY,
) -> float:  # fmt: skip
    """Least Σ energy × angle, in energy × radians, that makes set b of set a.

    direction : (n, 3) and (m, 3), unit; energy : (n,) and (m,), not negative
    penalty : radians that energy counts for which goes out or is lit
    """
    if not penalty > 0.0:
        raise EnvlightError(f"transport: a penalty of {penalty}; give a positive number")
    direction = np.concatenate(
        [np.reshape(np.asarray(d, np.float64), (-1, 3)) for d in (direction_a, direction_b)]
    )
    first, second = np.asarray(energy_a, np.float64), np.asarray(energy_b, np.float64)
    if len(first) + len(second) != len(direction):
        raise EnvlightError("transport: the numbers of directions and of energies must agree")
    if not (np.isfinite(direction).all() and (first >= 0.0).all() and (second >= 0.0).all()):
        raise EnvlightError("transport: give finite directions and energies that are not negative")
    place, where = np.unique(direction, axis=0, return_inverse=True)
    surplus = np.zeros(len(place))
    np.add.at(surplus, np.ravel(where), np.concatenate([first, -second]))
    give, take = np.flatnonzero(surplus > 0.0), np.flatnonzero(surplus < 0.0)
    supply, demand = surplus[give], -surplus[take]
    if not len(give) or not len(take):
        return penalty * float(supply.sum() + demand.sum())
    saved = 2.0 * penalty - _angles(place[give], place[take])
    return penalty * float(supply.sum() + demand.sum()) - _most_saved(saved, supply, demand)


def _angles(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """Angles (n, m), exact for small ones too: 2 atan2(|a − b|, |a + b|)."""
    difference = np.linalg.norm(a[:, None] - b[None], axis=2)
    return np.asarray(2.0 * np.arctan2(difference, np.linalg.norm(a[:, None] + b[None], axis=2)))


def _most_saved(
    saved: NDArray[np.float64], supply: NDArray[np.float64], demand: NDArray[np.float64]
) -> float:
    """The most that carrying saves against putting all out and lighting it anew."""
    from scipy.optimize import linprog
    from scipy.sparse import coo_array

    i, j = np.nonzero(saved > 0.0)
    if not len(i):
        return 0.0
    scale = max(supply.sum(), demand.sum())
    edge = np.arange(len(i))
    limits = coo_array(
        (np.ones(2 * len(i)), (np.concatenate([i, len(supply) + j]), np.tile(edge, 2))),
        shape=(len(supply) + len(demand), len(i)),
    )
    bounds = np.concatenate([supply, demand]) / scale
    result = linprog(-saved[i, j], A_ub=limits.tocsr(), b_ub=bounds, method="highs")
    if result.status != 0:
        raise EnvlightError(f"transport: the linear program was not solved ({result.message})")
    return -float(result.fun) * float(scale)
