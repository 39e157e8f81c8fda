"""Reading a TOML table with errors that say the file, the key and what was wanted."""

import difflib
import math
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from dataclasses import MISSING, fields
from typing import Any

from samplers.errors import EnvlightError

Vector = tuple[float, float, float]


class Table:
    """A table of a file. Each key is asked for once; `finish` refuses what nobody asked for.

    where : the file, and the table's place in it, for messages
    """

    def __init__(self, content: dict[str, Any], where: str) -> None:
        self._content = content
        self._where = where
        self._asked: list[str] = []

    def error(self, key: str, message: str) -> EnvlightError:
        return EnvlightError(f"{self._where}: {key}: {message}")

    @contextmanager
    def blamed(self) -> Iterator[None]:
        """Errors from inside are said to come from this table."""
        try:
            yield
        except EnvlightError as error:
            raise EnvlightError(f"{self._where}: {error}") from None

    def has(self, key: str) -> bool:
        self._asked.append(key)
        return key in self._content

    def get(self, key: str, default: Any) -> Any:
        """A value as it stands, unchecked."""
        return self._content[key] if self.has(key) else default

    def _value(self, key: str, default: Any, wanted: str) -> Any:
        if self.has(key):
            return self._content[key]
        if default is None:
            raise self.error(key, f"it is missing; give {wanted}")
        return default

    def text(self, key: str, default: str | None = None) -> str:
        value = self._value(key, default, "a text")
        if not isinstance(value, str) or not value:
            raise self.error(key, f"{value!r} is not a text; write it in quotes")
        return value

    def flag(self, key: str, default: bool) -> bool:
        value = self._value(key, default, "true or false")
        if not isinstance(value, bool):
            raise self.error(key, f"{value!r}; give true or false")
        return value

    def number(self, key: str, default: float | None = None, least: float = -math.inf) -> float:
        """A finite number above `least`; the default may equal it."""
        value = self._value(key, default, "a number")
        if not _is_number(value):
            raise self.error(key, f"{value!r} is not a finite number")
        if value <= least and value != default:
            raise self.error(key, f"{value!r}; give a number above {least:g}")
        return float(value)

    def vector(self, key: str, default: Vector | None = None) -> Vector:
        value = self._value(key, default, "three numbers")
        if (
            not isinstance(value, (list, tuple))
            or len(value) != 3
            or not all(map(_is_number, value))
        ):
            raise self.error(key, f"{value!r}; give three finite numbers, such as [0.0, 1.0, 0.0]")
        x, y, z = value
        return float(x), float(y), float(z)

    def choice(self, key: str, known: Collection[str], default: str | None = None) -> str:
        value = self._value(key, default, _one_of(known))
        if not isinstance(value, str) or value not in known:
            raise self.error(key, f"{value!r} is not known; give {_one_of(known, str(value))}")
        return value

    def table(self, key: str) -> "Table":
        value = self._value(key, None, f"a table [{key}]")
        if not isinstance(value, dict):
            raise self.error(key, f"{value!r}; give a table [{key}]")
        return Table(value, f"{self._where}: [{key}]")

    def tables(self, key: str) -> dict[str, "Table"]:
        """The tables inside a table, by name; none where it is missing."""
        value = self._value(key, {}, "")
        if not isinstance(value, dict) or not all(isinstance(v, dict) for v in value.values()):
            raise self.error(key, f"give tables [{key}.name]")
        return {name: Table(v, f"{self._where}: [{key}.{name}]") for name, v in value.items()}

    def array(self, key: str) -> list["Table"]:
        """The tables of an array of tables; none where it is missing."""
        value = self._value(key, [], "")
        if not isinstance(value, list) or not all(isinstance(v, dict) for v in value):
            raise self.error(key, f"give tables [[{key}]]")
        return [
            Table(v, f"{self._where}: [[{key}]] number {i}") for i, v in enumerate(value, start=1)
        ]

    def fields_of(self, cls: Any) -> dict[str, Any]:
        """What the table says of a dataclass's fields; only those with a default may be missing."""
        result = {}
        for field in fields(cls):
            if self.has(field.name):
                result[field.name] = self._content[field.name]
            elif field.default is MISSING:
                raise self.error(field.name, f"it is missing; {cls.__name__} needs it")
        return result

    def finish(self) -> None:
        """Refuse keys that were not asked for, which are mostly misspelt."""
        for key in self._content:
            if key not in self._asked:
                raise self.error(key, f"it is not known; use {_one_of(set(self._asked), key)}")


def _one_of(known: Collection[str], like: str = "") -> str:
    if not known:
        return "one that the file defines; it defines none"
    near = difflib.get_close_matches(like, known, n=3, cutoff=0.5) if like else []
    return " or ".join(f"'{name}'" for name in near or sorted(known))


def _is_number(value: object) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and abs(value) < 1e300
