"""What several checks of one sampler look at, made once."""

from collections.abc import Callable, Hashable
from typing import Any


class Once:
    """Results by key, for the sampler that was asked for last; those of another go.

    A sampler is known as an object, not by its value, since one that is yet to be checked need not
    have a value.
    """

    def __init__(self) -> None:
        self._sampler: object = None
        self._made: dict[Hashable, Any] = {}

    def __call__(self, sampler: object, key: Hashable, make: Callable[[], Any]) -> Any:
        """What `make` returned for this sampler and key, which is called the first time."""
        if sampler is not self._sampler:
            self._sampler, self._made = sampler, {}
        if key not in self._made:
            self._made[key] = make()
        return self._made[key]
