"""EnvIndirects: an even spread of lights for the part of a map that is not emissive.

The map becomes thousands of small lights of about equal solid angle in a binary tree by direction.
A cut through the tree starts at the root; the node of largest objective is replaced by its two
children until the cut has as many nodes as lights are wanted. The objective weighs the node's
luminance variance V, directional extent D and energy E, each divided by its maximum over the nodes
that can be replaced: with V alone homogeneous regions keep lights that are too large and too few.

Source: Wu, "Efficient environment map rendering based on decomposition", Computer Graphics Forum
44(1), 2025, section 3.4, Eq. 3; the cut with V alone is that of Cheslack-Postava, Wang, Åkerlund
and Pellacini, "Fast, realistic lighting and material design using nonlinear cut approximation",
ACM Transactions on Graphics 27(5), 2008.

Children depend on their node alone, so only nodes that the cut replaces are ever built: n lights
of l leaves cost O(l log l · log n) for the tree and O(n²) for the objective. Deterministic.

What the paper leaves open, measured by the experiment `readings`
    Leaves are HEALPix cells of the unmasked part. A node is cut across the longest side of its
    leaves' bounding box, or across its principal axis, where its solid angle is halved, or its
    energy; V is Σ ΔΩ (Y − Ȳ)² or that per solid angle; D is the mean or the largest angle
    between the mean direction and the leaves, whichever the lights are perturbed by, or the solid
    angle of the leaves. Of equal nodes the one with more leaves is replaced.
"""

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from samplers.compiled import kernel
from samplers.environment import EnvironmentMap
from samplers.errors import EnvlightError
from samplers.grids.light_leaves import LightLeaves, light_leaves, lights_of_leaves
from samplers.lighting import LIGHT_EXTENT, DirectionalLights, LightExtent
from samplers.sphere import CANCELLED

FLAT = 1e-10
"""Relative deviation of luminance that is rounding of sums: radiance has 24 bits."""
TIE = 2.0**-30
"""Places closer together than this are equal, and leaves at equal places keep their order: where
leaves are single pixels many are tied, which rounding must not decide."""
SIDE = 32
"""Cells along an edge of a HEALPix face: 12 · 32² leaves at most."""
Axis = Literal["box", "principal"]
Median = Literal["solid_angle", "energy"]
Variance = Literal["sum", "mean"]
Extent = Literal["angle", "solid_angle"]
BY_SOLID_ANGLE, BY_MEAN, BY_LARGEST = range(3)


@dataclass(frozen=True)
class CutRule:
    """How the tree is built and which node of a cut is replaced.

    variance_weight, extent_weight, energy_weight : w_V, w_D and w_E of Eq. 3; (1, 0, 0) is the
        original cut
    axis : "box" cuts across the longest side of the bounding box, "principal" across the
        principal axis
    median : what is halved: the leaves' "solid_angle" or "energy"
    variance : "sum" or "mean" over the node's solid angle
    extent : D is the "angle" to the leaves that `light_extent` names, or the "solid_angle"
    light_extent : of the lights too, see `samplers.lighting`
    """

    variance_weight: float = 1.0
    extent_weight: float = 5.0
    energy_weight: float = 1.0
    axis: Axis = "principal"
    median: Median = "solid_angle"
    variance: Variance = "sum"
    extent: Extent = "angle"
    light_extent: LightExtent = LIGHT_EXTENT

    def __post_init__(self) -> None:
        weights = (self.variance_weight, self.extent_weight, self.energy_weight)
        if not all(0.0 <= weight < math.inf for weight in weights):
            raise EnvlightError(f"illumination cut: weights {weights}; use numbers from 0")

    @property
    def measure(self) -> int:
        """How D is measured; the full angle differs from the largest by a factor alone."""
        if self.extent == "solid_angle":
            return BY_SOLID_ANGLE
        return BY_MEAN if self.light_extent == "mean" else BY_LARGEST


@kernel
def _measures(leaf, direction, solid_angle, energy, mean_variance, measure):
    """V, D and E of the node with the leaves `leaf`."""
    weight = total = 0.0
    x = y = z = 0.0
    for k in leaf:
        weight += solid_angle[k]
        total += energy[k]
        x += solid_angle[k] * direction[k, 0]
        y += solid_angle[k] * direction[k, 1]
        z += solid_angle[k] * direction[k, 2]
    mean = total / weight
    variance = 0.0
    for k in leaf:
        deviation = energy[k] / solid_angle[k] - mean
        if abs(deviation) > FLAT * mean:
            variance += solid_angle[k] * deviation * deviation
    if mean_variance:
        variance /= weight
    if measure == BY_SOLID_ANGLE:
        return variance, weight, total
    length = math.sqrt(x * x + y * y + z * z)
    if length <= CANCELLED * weight:
        return variance, math.pi, total
    largest = summed = 0.0
    for k in leaf:
        u = direction[k, 0] - x / length
        v = direction[k, 1] - y / length
        w = direction[k, 2] - z / length
        angle = 2.0 * math.asin(min(1.0, 0.5 * math.sqrt(u * u + v * v + w * w)))
        largest = max(largest, angle)
        summed += solid_angle[k] * angle
    return variance, largest if measure == BY_LARGEST else summed / weight, total


@kernel
def _box_axis(leaf, direction):
    """The coordinate in which the leaves reach farthest."""
    best, longest = 0, -1.0
    for i in range(3):
        low, high = np.inf, -np.inf
        for k in leaf:
            low, high = min(low, direction[k, i]), max(high, direction[k, i])
        if high - low > longest + TIE:
            best, longest = i, high - low
    axis = np.zeros(3)
    axis[best] = 1.0
    return axis


@kernel
def _principal_axis(leaf, direction, solid_angle):
    """The direction of largest variance of the leaves."""
    mean, weight = np.zeros(3), 0.0
    for k in leaf:
        mean += solid_angle[k] * direction[k]
        weight += solid_angle[k]
    mean /= weight
    covariance = np.zeros((3, 3))
    for k in leaf:
        for i in range(3):
            for j in range(3):
                covariance[i, j] += (
                    solid_angle[k] * (direction[k, i] - mean[i]) * (direction[k, j] - mean[j])
                )
    return np.linalg.eigh(covariance)[1][:, 2].copy()


@kernel
def _split(leaf, direction, solid_angle, share, principal):
    """Sort the node's leaves along its axis; how many of them go to the first child."""
    axis = (
        _principal_axis(leaf, direction, solid_angle) if principal else _box_axis(leaf, direction)
    )
    along, total = np.empty(len(leaf)), 0.0
    for i in range(len(leaf)):
        k = leaf[i]
        place = direction[k, 0] * axis[0] + direction[k, 1] * axis[1] + direction[k, 2] * axis[2]
        along[i] = math.floor(place / TIE + 0.5)
        total += share[k]
    ordered = leaf[np.argsort(along, kind="mergesort")]
    for i in range(len(leaf)):
        leaf[i] = ordered[i]
    below = 0.0
    for i in range(len(leaf) - 1):
        below += share[leaf[i]]
        if below >= 0.5 * total:
            return i + 1
    return len(leaf) - 1


@kernel
def _largest(first, last, variance, extent, energy, nodes, weights):
    """The node of largest objective among those with more than one leaf, −1 if there is none."""
    top_v = top_d = top_e = 0.0
    for n in range(nodes):
        if last[n] - first[n] > 1:
            top_v, top_d = max(top_v, variance[n]), max(top_d, extent[n])
            top_e = max(top_e, energy[n])
    best, most = -1, -1.0
    for n in range(nodes):
        size = last[n] - first[n]
        if size == 1:
            continue
        value = weights[0] * variance[n] / top_v if top_v > 0.0 else 0.0
        value += weights[1] * extent[n] / top_d if top_d > 0.0 else 0.0
        value += weights[2] * energy[n] / top_e if top_e > 0.0 else 0.0
        if value > most or (value == most and size > last[best] - first[best]):
            best, most = n, value
    return best


@kernel
def _cut(
    direction, solid_angle, energy, share, count, weights, principal, mean_variance, measure, label
):
    """Fill `label` with the node of each leaf; the number of nodes."""
    order = np.arange(len(direction))
    first, last = np.zeros(count, np.int64), np.zeros(count, np.int64)
    variance, extent, total = np.zeros(count), np.zeros(count), np.zeros(count)
    last[0] = len(direction)
    nodes = 1
    while nodes < count:
        n = _largest(first, last, variance, extent, total, nodes, weights)
        if n < 0:
            break
        leaf = order[first[n] : last[n]]
        middle = first[n] + _split(leaf, direction, solid_angle, share, principal)
        first[nodes], last[nodes], last[n] = middle, last[n], middle
        for m in (n, nodes):
            variance[m], extent[m], total[m] = _measures(
                order[first[m] : last[m]], direction, solid_angle, energy, mean_variance, measure
            )
        nodes += 1
    for n in range(nodes):
        for k in order[first[n] : last[n]]:
            label[k] = n
    return nodes


def cut(leaves: LightLeaves, count: int, rule: CutRule) -> NDArray[np.int64]:
    """The node (n,) of each leaf in a cut of at most `count` nodes, numbered from 0."""
    label = np.zeros(len(leaves), np.int64)
    energy = leaves.luminous_flux / leaves.luminous_flux.max()
    share = leaves.solid_angle if rule.median == "solid_angle" else energy
    weights = np.array([rule.variance_weight, rule.extent_weight, rule.energy_weight])
    principal, mean = rule.axis == "principal", rule.variance == "mean"
    _cut(leaves.direction, leaves.solid_angle, energy, share, count, weights, principal, mean,
         rule.measure, label)  # fmt: skip
    return label


def env_indirects(
    environment: EnvironmentMap, emissive: NDArray[np.bool_], count: int, rule: CutRule
) -> DirectionalLights:
    """At most `count` lights for the pixels outside the mask, fewer if there are fewer leaves.

    emissive : (H, W), pixels that other lights stand for
    """
    leaves = light_leaves(environment, emissive, SIDE)
    if count == 0 or len(leaves) == 0:
        return DirectionalLights.none()
    return lights_of_leaves(leaves, cut(leaves, count, rule), rule.light_extent)
