"""Stored results that a test changes, as if they had been stored so."""

from collections.abc import Callable
from typing import Any

from experiments.run.store import Store

Row = dict[str, Any]


def store_instead(
    store: Store, table: str, key: str, new_key: str = "",
    identity: Callable[[str], str] = str, result: Callable[[Row], Row] = dict,
) -> None:  # fmt: skip
    """Store what stands under a key anew, under another where one is given.

    identity : changes the JSON text of what determined the result; result : changes the result
    """
    ...
