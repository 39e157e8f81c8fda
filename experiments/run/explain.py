"""What determines a stored result, and in what it differs from another or from the present project.

A result is found by a hash of its identity, so one that is not found any more is told apart by the
parts of its identity: the names of these parts are paths such as `sampler.source`.
"""

import ast
import json
from typing import Any

from experiments.maps.sources import EnvironmentSource
from experiments.run.budget import Budget
from experiments.run.case import (
    MAP_FEATURES,
    SCENE_FEATURES,
    Case,
    environment_identity,
    score_programs,
)
from experiments.run.identity import Shared, plain, source_digest
from experiments.run.measurement import image_identity
from experiments.run.sampler_spec import SamplerSpec
from experiments.run.scale import Scale
from experiments.run.store import Planned, Store, Stored
from metrics.registry import find_metric
from samplers import EnvlightError

Identity = dict[str, Any]


def explain(store: Store, keys: list[str]) -> str:
    """What determines one measurement and whether it is stale, or in what two differ.

    keys : one or two, each cut short at will

    Raises EnvlightError for a key that belongs to no stored measurement, or to several.
    """
    if len(keys) not in (1, 2):
        raise EnvlightError("--why: give the key of one measurement, or of two to compare")
    key, identity = _find(store, keys[0])
    if len(keys) == 2:
        other, compared = _find(store, keys[1])
        return "\n".join([f"{key} and {other} differ in:", *differences(identity, compared)])
    parts = json.dumps(identity, indent=2, ensure_ascii=False)
    return f"{parts}\n\n{_ranking(store, key, identity)}"


def _find(store: Store, start: str) -> tuple[str, Identity]:
    found = store.beginning(start)
    if len(found) != 1:
        raise EnvlightError(
            f"{store.folder}: {len(found)} measurements have a key that begins with '{start}'; "
            "take one from measurements.csv"
        )
    return found[0].key, store.identity(found[0])


def differences(one: Any, other: Any, path: str = "") -> list[str]:
    """The parts in which two identities differ, each as "path: value → value"."""
    if isinstance(one, dict) and isinstance(other, dict):
        return [
            line
            for name in dict.fromkeys([*one, *other])
            for line in differences(
                one.get(name), other.get(name), f"{path}.{name}" if path else name
            )
        ]
    return [] if one == other else [f"{path}: {_text(one)} → {_text(other)}"]


def _text(value: Any) -> str:
    return "nothing" if value is None else json.dumps(value, ensure_ascii=False).strip('"')


def _ranking(store: Store, key: str, identity: Identity) -> str:
    """Whether the next start takes the result, and what has changed where it does not."""
    try:
        changed = [*differences(identity, present(identity)), *_stale_scores(store, key)]
    except EnvlightError as error:
        return f"whether {key} is stale cannot be told: {error}"
    if changed:
        lines = "\n".join(changed)
        return f"{key} is stale: it enters no table, and the project differs from it in:\n{lines}"
    plan = "belongs" if key in {one.key for one in store.plan} else "does not belong"
    return f"{key} is what the project would measure now; it {plan} to the newest start"


def present(identity: Identity) -> Identity:
    """The identity of the same measurement by the project's source and libraries as they are now.

    A map from a file is taken as it was: the store does not know where the file lies. So are all
    parts of a row that is not a grid's.

    Raises EnvlightError where a name or parameter of it is not known any more, and where its scene
    comes from a file, whose place the store does not know.
    """
    if "case" not in identity:
        return identity
    budget, seed, sets = Budget.parse(identity["budget"]), identity["seed"], identity["sets"]
    case = Shared(_present_case(identity["case"]))
    return plain(image_identity(case, _present_sampler(identity["sampler"]), budget, seed, sets))


def _present_case(case: Identity) -> Identity:
    if "files" in case:
        raise EnvlightError(f"scene '{case['scene']}' comes from a file; start the run again")
    width, height, subpixels = case["view"]
    environment = case["environment"]
    rows = environment.get("height", 0)
    source = EnvironmentSource(environment["name"], environment.get("file", ""), rows)
    now = Case(case["scene"], source, Scale("", width, height, subpixels, 0.0, 0, rows, ()))
    return now.identity_under(environment if source.path else environment_identity(source))


def _present_sampler(sampler: Identity) -> SamplerSpec:
    parameters = {name: ast.literal_eval(text) for name, text in sampler["parameters"].items()}
    return SamplerSpec(sampler["name"], tuple(parameters.items()))


class Present:
    """Which rows of a scale are what they would be now. What rows share is looked at once."""

    def __init__(self, scale: Scale) -> None:
        self._view = [scale.width, scale.height, scale.subpixels], scale.sets
        self._known: dict[str, bool | None] = {}

    def has(self, store: Store, one: Planned, stored: Stored, same_methods: bool) -> bool:
        """Whether a row's image, reference, scores and features are what they would be now.

        same_methods : what is taken where that cannot be told: of own scenes and samplers
        """
        identity = stored.identity
        case = store.shared(identity["case"])
        if not isinstance(case, dict) or (case["view"], identity["sets"]) != self._view:
            return False
        alike = {name: identity[name] for name in identity if name != "seed"}
        parts = ["reference " + one.reference, *one.scores, *one.features, json.dumps(alike)]
        for part in parts:
            if part not in self._known:
                self._known[part] = self._find_out(store, part, identity)
        known = [self._known[part] for part in parts]
        return False not in known and (same_methods or None not in known)

    def _find_out(self, store: Store, part: str, identity: Identity) -> bool | None:
        """Whether a part is as it would be now; None where that cannot be told."""
        if part.startswith("{"):
            whole = store.written_out(identity)
            try:
                return not differences(whole, present(whole))
            except EnvlightError:
                return None
        if part.startswith("reference "):
            found = store.get(part.partition(" ")[2])
            now = source_digest("renderer.reference")
            return found is not None and store.identity(found)["reference_source"] == now
        if (found := store.get(part)) is not None:
            programs = {source_digest(module) for module in (MAP_FEATURES, SCENE_FEATURES)}
            return store.identity(found)["features_source"] in programs
        score = store.shared(part)
        try:
            return isinstance(score, dict) and not differences(_programs(score), score)
        except EnvlightError:  # such a metric is gone
            return False


def _programs(score: Identity) -> Identity:
    """The identity of a score with the programs as they are now."""
    return {**score, **score_programs(find_metric(score["metric"]))}


def _stale_scores(store: Store, key: str) -> list[str]:
    """Metrics whose stored scores of an image the project would make anew."""
    planned = next((one for one in store.plan if one.key == key), Planned(key))
    stale = []
    for part in planned.scores:
        score = store.shared(part)
        if isinstance(score, dict):
            lines = differences(score, _programs(score))
            stale += [f"score by {score['metric']}: {line}" for line in lines]
    return stale
