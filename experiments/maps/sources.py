"""Environment suites: maps made from code or from Poly Haven, or any folder or file of maps."""

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from experiments.maps import places, poly_haven
from experiments.maps.patterns import select
from experiments.maps.poly_haven import SUFFIXES
from samplers import EnvironmentMap, EnvlightError

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

    def load(self) -> EnvironmentMap:
        """The map itself; EnvlightError where the file is no good."""
        if self.path:
            return EnvironmentMap.from_file(self.path, self.repair)
        return places.make(self.name, self.height)


def find_environments(
    suite: str, patterns: list[str], height: int, repair: bool = False
) -> list[EnvironmentSource]:
    """The maps of a suite whose names match any pattern.

    suite : "embedded", "poly-haven-32", "paper-named-12", a folder or a file

    Raises EnvlightError where the suite does not exist, or a pattern matches nothing.
    """
    if suite == EMBEDDED:
        sources = [EnvironmentSource(name, height=height) for name in places.names()]
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
    if text not in places.names() and (Path(text).suffix or Path(text).is_file()):
        return _source(Path(text), repair)
    places.kind(text)  # raises for an unknown name
    return EnvironmentSource(text, height=height)


@dataclass(frozen=True)
class CheckedEnvironments:
    """What loading every map once showed.

    good : the maps that can be measured, in their order
    repaired : how many values were clamped, by name; maps without any are not named
    bad : what is wrong with each of the others, by name
    """

    good: tuple[EnvironmentSource, ...]
    repaired: dict[str, int]
    bad: dict[str, str]


def check_environments(
    sources: Iterable[EnvironmentSource], strict: bool = False
) -> CheckedEnvironments:
    """Load every map that comes from a file once, so that a run knows before it begins.

    strict : refuse the whole where one map is no good

    Raises EnvlightError where no map is good, or not all are and `strict` is set; it says what is
    wrong with the first and names the others.
    """
    good: list[EnvironmentSource] = []
    repaired: dict[str, int] = {}
    bad: dict[str, str] = {}
    for source in sources:
        try:
            count = source.load().repaired if source.path else 0
        except EnvlightError as error:
            bad[source.name] = str(error)
            continue
        good.append(source)
        if count:
            repaired[source.name] = count
    if bad and (strict or not good):
        (_, first), *others = bad.items()
        more = f"; no good either: {', '.join(name for name, _ in others)}" if others else ""
        raise EnvlightError(f"{first}{more}")
    return CheckedEnvironments(tuple(good), repaired, bad)


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
