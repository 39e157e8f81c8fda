"""File names and links of the report's pages."""

import re
from urllib.parse import quote

from experiments.run.identity import digest


def slug(name: str) -> str:
    """A file name, without suffix, for any text; different texts give different names."""
    plain = re.sub(r"[^A-Za-z0-9.-]+", "_", name).strip("._")
    return plain if plain == name else f"{plain[:60]}-{digest(name)[:6]}"


def quoted(path: str) -> str:
    """A relative path as it stands in a link."""
    return quote(path, safe="/")
