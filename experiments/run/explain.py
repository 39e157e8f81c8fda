"""What determines a stored result, and in what it differs from another or from the present project.

A result is found by a hash of its identity, so one that is not found any more is told apart by the
parts of its identity: the names of these parts are paths such as `sampler.source`.
"""

import ast
import json
from typing import Any

from experiments.maps.sources import EnvironmentSource
from experiments.run.budget import Budget
from experiments.run.case import MAP_FEATURES, SCENE_FEATURES, Case, environment_identity
from experiments.run.identity import source_digest
from experiments.run.measurement import Measurement
from experiments.run.sampler_spec import SamplerSpec
from experiments.run.scale import Scale
from experiments.run.store import Store
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
    stored = [*store.results("image"), *store.results("row")]
    found = [(key, identity) for key, identity, _ in stored if key.startswith(start)]
    if len(found) != 1:
        raise EnvlightError(
            f"{store.folder}: {len(found)} measurements have a key that begins with '{start}'; "
            "take one from measurements.csv"
        )
    return found[0]


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
    plan = "belongs" if key in {one.key for one in store.plan()} else "does not belong"
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
    case, sampler = identity["case"], identity["sampler"]
    if "files" in case:
        raise EnvlightError(f"scene '{case['scene']}' comes from a file; start the run again")
    width, height, subpixels = case["view"]
    environment = case["environment"]
    rows = environment.get("height", 0)
    source = EnvironmentSource(environment["name"], environment.get("file", ""), rows)
    now = Case(case["scene"], source, Scale("", width, height, subpixels, 0.0, 0, rows, ()))
    parameters = {name: ast.literal_eval(text) for name, text in sampler["parameters"].items()}
    spec = SamplerSpec(sampler["name"], tuple(parameters.items()))
    one = Measurement(now, spec, Budget.parse(identity["budget"]), identity["seed"])
    under = environment if source.path else environment_identity(source)
    return one.identity_on(now.identity_under(under))


def _stale_scores(store: Store, key: str) -> list[str]:
    """Metrics whose stored scores of an image the project would make anew."""
    stale = []
    for planned in store.plan():
        if planned.key != key:
            continue
        for name, score in planned.scores.items():
            if name in (MAP_FEATURES, SCENE_FEATURES):
                continue
            stored = store.identity("score", score)
            metric = find_metric(name)
            now = {"metric_source": source_digest(metric.module)}
            stale += [f"score by {name}: {line}" for line in differences(
                {part: (stored or {}).get(part) for part in now}, now)]  # fmt: skip
    return stale
