"""Names of pages, links to them, and words in them."""

import re
from urllib.parse import quote

from markupsafe import Markup, escape

from experiments.run.identity import digest


def slug(name: str) -> str:
    """A file name, without suffix, for any text; different texts give different names."""
    plain = re.sub(r"[^A-Za-z0-9.-]+", "_", name).strip("._")
    return plain if plain == name else f"{plain[:60]}-{digest(name)[:6]}"


def quoted(path: str) -> str:
    """A relative path as it stands in a link."""
    return quote(path, safe="/")


def inline(text: str) -> Markup:
    """Text with `names` as code, and **names** in bold."""
    marked = re.sub(r"`([^`]+)`", r"<code>\1</code>", str(escape(text)))
    return Markup(re.sub(r"(?<!\w)\*\*([\w-]+)\*\*(?!\w)", r"<strong>\1</strong>", marked))
