"""Environment suites: the maps made from code, or any folder or file of .exr and .hdr maps."""

import fnmatch
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from experiments.identity import file_digest, source_digest
from samplers import EnvironmentMap, EnvlightError

SUFFIXES = (".exr", ".hdr")
EMBEDDED = "embedded"


@dataclass(frozen=True)
class EnvironmentSource:
    """Where a map comes from; small enough to be sent to another process.

    path : of a file, or empty for a map made from code at `height` rows
    repair : clamp bad radiance values instead of refusing the map
    """

    name: str
    path: str = ""
    height: int = 0
    repair: bool = False

    @cached_property
    def identity(self) -> dict[str, str | int | bool]:
        if self.path:
            return {
                "name": self.name,
                "file": file_digest(Path(self.path)),
                "repair": self.repair,
            }
        return {
            "name": self.name,
            "height": self.height,
            "source": source_digest("experiments.embedded"),
        }

    def load(self) -> EnvironmentMap:
        """The map itself; EnvlightError where the file is no good."""
        if self.path:
            return EnvironmentMap.from_file(self.path, self.repair)
        from experiments import embedded

        return embedded.make(self.name, self.height)


def find_environments(
    suite: str, patterns: list[str], height: int, repair: bool = False
) -> list[EnvironmentSource]:
    """The maps of a suite ("embedded", a folder or a file) whose names match any pattern.

    Raises EnvlightError where the suite does not exist, or a pattern matches nothing.
    """
    if suite == EMBEDDED:
        from experiments import embedded

        sources = [EnvironmentSource(name, height=height) for name in embedded.names()]
    else:
        sources = _from_files(Path(suite), repair)
    return select(sources, patterns, "environment", lambda source: source.name)


def _from_files(place: Path, repair: bool) -> list[EnvironmentSource]:
    if place.is_file():
        files = [place]
    elif place.is_dir():
        files = sorted(file for file in place.iterdir() if file.suffix.lower() in SUFFIXES)
    else:
        raise EnvlightError(
            f"environments '{place}': no such folder or file; give one, or '{EMBEDDED}'"
        )
    if not files:
        raise EnvlightError(f"environments '{place}': it holds no .exr or .hdr file")
    stems = [file.stem for file in files]
    twice = next((stem for stem in stems if stems.count(stem) > 1), None)
    if twice:
        raise EnvlightError(f"environments '{place}': two maps are called '{twice}'; rename one")
    return [EnvironmentSource(file.stem, str(file.resolve()), repair=repair) for file in files]


def select(items: list, patterns: list[str], kind: str, name_of=str) -> list:
    """The items whose names match any of the shell patterns, all where there is none.

    Raises EnvlightError for a pattern that matches nothing.
    """
    if not patterns:
        return items
    chosen = set()
    for pattern in patterns:
        matching = {
            index for index, item in enumerate(items) if fnmatch.fnmatchcase(name_of(item), pattern)
        }
        if not matching:
            import difflib

            names = [name_of(item) for item in items]
            near = difflib.get_close_matches(pattern, names, n=3, cutoff=0.4) or names[:8]
            raise EnvlightError(f"no {kind} matches '{pattern}'; did you mean {', '.join(near)}?")
        chosen |= matching
    return [item for index, item in enumerate(items) if index in chosen]
