"""Stored results that a test changes, as if they had been stored so."""

import json
from pathlib import Path
from typing import Any

from experiments.run.store import Store
from renderer.image import write_exr
from samplers.files.image_file import read_radiance


def store_instead(
    store: Store, table: str, key: str, old: str = "", new: str = "", new_key: str = "",
    **columns: Any,
) -> None:  # fmt: skip
    """Store what stands under a key anew, under another where one is given.

    old, new : words of the identity's JSON text; columns : replace those of the result
    """
    identity, result = store.identity(table, key), store.get(table, key)
    assert identity is not None
    assert result is not None
    store._connection.execute(f"DELETE FROM {table} WHERE key = ?", (key,))
    changed = json.loads(json.dumps(identity).replace(old, new)) if old else identity
    store.put(table, new_key or key, changed, {**result, **columns})


def damage(path: Path, how: str) -> None:
    """Remove an image, cut its file short, or alter a pixel of it."""
    if how == "missing":
        path.unlink()
    elif how == "cut short":
        path.write_bytes(path.read_bytes()[:-20])
    else:
        image = read_radiance(path)
        image[3, 4, 1] += 1.0
        write_exr(path, image)
