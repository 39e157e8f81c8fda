"""What determines a stored result, and what of that has changed since it was measured.

A result is found by a hash of its identity, so one that is not found any more is told apart by the
parts of its identity: the names of these parts are paths such as `sampler.programs`. A map or scene
from a file and a sampler in one are taken as they were: the store does not know where a file lies.
"""

import json
from collections.abc import Iterator
from typing import Any

from experiments.run.identity import ALONE, module_digest, source_digest, version_of
from experiments.run.machine import machine_identity
from experiments.run.store import Planned, Store, Stored
from samplers import EnvlightError
from samplers.files.from_file import PREFIX as FROM_FILE

Identity = dict[str, Any]


def explain(store: Store, keys: list[str]) -> str:
    """What determines one measurement and what of it has changed, or in what two differ.

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
    changed = "\n".join(changes(identity))
    told = "stale: these have changed:\n" + changed if changed else "what would be measured now"
    return f"{parts}\n\n{key} is {told}"


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


def changes(identity: Identity, path: str = "") -> Iterator[str]:
    """The programs, libraries and machines of an identity that are others by now."""
    now: Identity
    for name, then in identity.items():
        if not isinstance(then, dict) or not then:
            continue
        if name == "programs":
            now = {module: _program_now(module, digest) for module, digest in then.items()}
        elif name == "libraries":
            now = {library: version_of(library) for library in then}
        elif name == "machine":
            now = machine_identity()
        else:
            yield from changes(then, f"{path}{name}.")
            continue
        yield from differences(then, now, f"{path}{name}")


def _program_now(module: str, then: str) -> str:
    if module.startswith(FROM_FILE):
        return then
    if module.endswith(ALONE):
        return module_digest(module.removesuffix(ALONE))
    return source_digest(module)


class Present:
    """Which rows of a store are what they would be now. What rows share is looked at once."""

    def __init__(self, store: Store) -> None:
        self.store = store
        self._known: dict[str, bool] = {}

    def has(self, one: Planned, stored: Stored) -> bool:
        """Whether a row's image, reference, scores and features are what they would be now."""
        parts = (one.reference, *one.scores, *one.features)
        return self._is_now(stored.identity) and all(map(self._stands, parts))

    def _is_now(self, identity: Identity) -> bool:
        parts = (part for part in identity.values() if isinstance(part, str))
        return not any(changes(identity)) and all(map(self._stands, parts))

    def _stands(self, key: str) -> bool:
        """Whether what a hash stands for is what it would be now; what is no hash is."""
        if key not in self._known:
            found = self.store.shared(key)
            if not isinstance(found, dict):
                result = self.store.get(key)
                found = result.identity if result else {}
            self._known[key] = self._is_now(found)
        return self._known[key]
