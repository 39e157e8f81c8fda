"""A sampler's parameters as typed on the command line."""

import ast
from typing import Any

from samplers import EnvlightError


def parse_parameters(texts: list[str]) -> dict[str, Any]:
    """From ["order=rounds", "blocks=64"] to {"order": "rounds", "blocks": 64}."""
    result: dict[str, Any] = {}
    for text in texts:
        name, separator, value = text.partition("=")
        if not separator or not name.isidentifier():
            raise EnvlightError(f"parameter '{text}': write it as name=value")
        try:
            result[name] = ast.literal_eval(value)
        except (ValueError, SyntaxError):
            result[name] = value
    return result
