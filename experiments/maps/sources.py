"""Environment suites: maps made from code or from Poly Haven, or any folder or file of maps."""

import fnmatch
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from experiments.maps import poly_haven
from experiments.maps.lists import split_list
from experiments.maps.poly_haven import SUFFIXES
from samplers import EnvironmentMap, EnvlightError

EMBEDDED = "embedded"
MOST_NAMED = 12


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

    def load(self) -> EnvironmentMap:
        """The map itself; EnvlightError where the file is no good."""
        if self.path:
            return EnvironmentMap.from_file(self.path, self.repair)
        from experiments.maps import places as embedded

        return embedded.make(self.name, self.height)


def find_environments(
    suite: str, patterns: list[str], height: int, repair: bool = False
) -> list[EnvironmentSource]:
    """The maps of a suite whose names match any pattern.

    suite : "embedded", "poly-haven-32", "paper-named-12", a folder or a file

    Raises EnvlightError where the suite does not exist, or a pattern matches nothing.
    """
    if suite == EMBEDDED:
        from experiments.maps import places as embedded

        sources = [EnvironmentSource(name, height=height) for name in embedded.names()]
    elif poly_haven.is_suite(suite):
        sources = [
            EnvironmentSource(name, str(file.resolve()), repair=repair)
            for name, file in poly_haven.suite_files(suite).items()
        ]
    else:
        sources = _from_files(Path(suite), repair)
    return select(sources, patterns, "environment", lambda source: source.name)


def single_environment(text: str, height: int, repair: bool = False) -> EnvironmentSource:
    """One map: embedded, by its name, or a file, by its path."""
    from experiments.maps import places as embedded

    if text not in embedded.names() and (Path(text).suffix or Path(text).is_file()):
        return _source(Path(text), repair)
    embedded.kind(text)  # raises for an unknown name
    return EnvironmentSource(text, height=height)


def check_environments(sources: Iterable[EnvironmentSource]) -> dict[str, int]:
    """Load every map that comes from a file once; how many values were repaired, by name.

    Raises EnvlightError for the first that is no good, so that a run fails before it begins.
    """
    repaired = {source.name: source.load().repaired for source in sources if source.path}
    return {name: count for name, count in repaired.items() if count}


def repair_sentence(name: str, count: int) -> str:
    """What to tell about a map with repaired values."""
    return f"map '{name}': {count} values were NaN, infinite or negative and have been clamped"


def _from_files(place: Path, repair: bool) -> list[EnvironmentSource]:
    if place.is_dir():
        try:
            files = sorted(file for file in place.iterdir() if _is_map(file))
        except OSError as error:
            raise EnvlightError(
                f"environments '{place}': cannot be read ({error.strerror}); check the folder"
            ) from error
    elif place.exists():
        files = [place]
    else:
        raise EnvlightError(
            f"environments '{place}': no such folder or file; give one, or "
            f"{', '.join([EMBEDDED, *poly_haven.SUITES])}"
        )
    if not files:
        raise EnvlightError(
            f"environments '{place}': it holds no .exr or .hdr file; give a folder that does"
        )
    stems = [file.stem for file in files]
    twice = next((stem for stem in stems if stems.count(stem) > 1), None)
    if twice:
        raise EnvlightError(f"environments '{place}': two maps are called '{twice}'; rename one")
    return [_source(file, repair) for file in files]


def _is_map(file: Path) -> bool:
    hidden = file.name.startswith(".")
    return file.suffix.lower() in SUFFIXES and not hidden and file.is_file()


def _source(file: Path, repair: bool) -> EnvironmentSource:
    return EnvironmentSource(file.stem, str(file.resolve()), repair=repair)


def select(
    items: list, patterns: list[str], kind: str, name_of: Callable[[Any], str] = str
) -> list:
    """The items whose names match any of the shell patterns, all where there is none.

    patterns : each may be several with commas between

    Raises EnvlightError for a pattern that matches nothing.
    """
    if not patterns:
        return items
    chosen = set()
    for pattern in split_list(patterns):
        matching = {
            index for index, item in enumerate(items) if fnmatch.fnmatchcase(name_of(item), pattern)
        }
        if not matching:
            raise EnvlightError(f"no {kind} matches '{pattern}'; {_hint(pattern, items, name_of)}")
        chosen |= matching
    return [item for index, item in enumerate(items) if index in chosen]


def _hint(pattern: str, items: list, name_of: Callable[[Any], str]) -> str:
    import difflib

    names = [name_of(item) for item in items]
    near = difflib.get_close_matches(pattern, names, n=3, cutoff=0.4)
    if near:
        return f"did you mean {' or '.join(near)}?"
    more = f" and {len(names) - MOST_NAMED} more" if len(names) > MOST_NAMED else ""
    return f"there are {', '.join(names[:MOST_NAMED])}{more}"
