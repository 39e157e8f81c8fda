"""Which stored results are what they would be now, by the parts of their identities.

A map or scene from a file and a sampler in one are taken as they were: the store does not know
where a file lies.
"""

from typing import Any

from experiments.run.identity import ALONE, module_digest, source_digest, version_of
from experiments.run.machine import machine_identity
from experiments.run.store import Planned, Store, Stored
from samplers.files.from_file import PREFIX as FROM_FILE

Identity = dict[str, Any]


def is_present(identity: Identity) -> bool:
    """Whether the programs, libraries and machines of an identity are those of now."""
    now: Identity
    for name, then in identity.items():
        if not isinstance(then, dict):
            continue
        if name == "programs":
            now = {module: _program_now(module, digest) for module, digest in then.items()}
        elif name == "libraries":
            now = {library: version_of(library) for library in then}
        elif name == "machine":
            now = machine_identity() if then else {}
        elif is_present(then):
            continue
        else:
            return False
        if now != then:
            return False
    return True


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
        return is_present(identity) and all(map(self._stands, parts))

    def _stands(self, key: str) -> bool:
        """Whether what a hash stands for is what it would be now; what is no hash is."""
        if key not in self._known:
            found = self.store.shared(key)
            if not isinstance(found, dict):
                result = self.store.get(key)
                found = result.identity if result else {}
            self._known[key] = self._is_now(found)
        return self._known[key]
