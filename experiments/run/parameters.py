"""A sampler's parameters as typed on the command line."""

import ast
from typing import Any

from samplers import EnvlightError


def parse_parameters(texts: list[str]) -> dict[str, Any]:
    """From ["order=rounds", "cases=64"] to {"order": "rounds", "cases": 64}.

    Raises EnvlightError for what is not name=value, and for a name that is given twice.
    """
    result: dict[str, Any] = {}
    for text in texts:
        name, separator, value = text.partition("=")
        if not separator or not name.isidentifier():
            raise EnvlightError(f"parameter '{text}': write it as name=value")
        if name in result:
            raise EnvlightError(f"parameter '{name}': it is given twice; give one value")
        result[name] = _value(value)
    return result


def _value(text: str) -> Any:
    """A Python literal as what it is, anything else as text."""
    if text in ("true", "false"):
        return text == "true"
    try:
        return ast.literal_eval(text)
    except (ValueError, SyntaxError, MemoryError, RecursionError):
        return text
