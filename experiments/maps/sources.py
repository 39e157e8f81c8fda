"""Environment suites: maps made from code or from Poly Haven, or any folder or file of maps."""

import math
import os
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from experiments.maps import places, poly_haven
from experiments.maps.patterns import select
from experiments.maps.poly_haven import SUFFIXES
from experiments.progress import telling
from samplers import EnvironmentMap, EnvlightError
from samplers.decomposition.emissive import TIMES_AVERAGE
from samplers.environment import Repair
from samplers.files.stored_image import as_text

EMBEDDED = "embedded"
MOST_BYTES = 120
"""Of a name: files of a run are called by the scene, the map and the budget."""
MANY = 4
"""Equal texels that are no chance."""


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
        try:
            if self.path:
                return EnvironmentMap.from_file(self.path, self.repair)
            return places.make(self.name, self.height)
        except MemoryError as error:
            raise EnvlightError(
                f"map '{self.name}': there is not enough memory for it; resample it"
            ) from error


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
    repaired : what was repaired, by name; maps without any are not named
    bad : what is wrong with each of the others, by name
    clipped : what to tell about good maps that look clipped, by name
    """

    good: tuple[EnvironmentSource, ...]
    repaired: dict[str, Repair]
    bad: dict[str, str]
    clipped: dict[str, str]


def check_environments(
    sources: Iterable[EnvironmentSource], strict: bool = False
) -> CheckedEnvironments:
    """Load every map that comes from a file once, so that a run knows before it begins.

    strict : refuse the whole where one map is no good

    Raises EnvlightError where no map is good, or not all are and `strict` is set; it says what is
    wrong with the first and names the others.
    """
    good: list[EnvironmentSource] = []
    repaired: dict[str, Repair] = {}
    bad: dict[str, str] = {}
    clipped: dict[str, str] = {}
    with telling("reading the maps") as told:
        for source in sources:
            told.working_on(f"reading the map {source.name}")
            if not source.path:
                good.append(source)
                continue
            try:
                if len(os.fsencode(source.name)) > MOST_BYTES:
                    raise EnvlightError(f"map '{source.name}': its name is too long; shorten it")
                environment = source.load()
            except EnvlightError as error:
                bad[source.name] = as_text(str(error))
                continue
            good.append(source)
            if environment.repair:
                repaired[source.name] = environment.repair
            if sentence := clipping_sentence(environment):
                clipped[source.name] = sentence
    if bad and (strict or not good):
        (_, first), *others = bad.items()
        more = f"; no good either: {', '.join(name for name, _ in others)}" if others else ""
        raise EnvlightError(f"{first}{more}")
    return CheckedEnvironments(tuple(good), repaired, bad, clipped)


def repair_sentence(name: str, repair: Repair) -> str:
    """What to tell about a map with repaired values."""
    return f"map '{name}': {repair}"


def clipping_sentence(environment: EnvironmentMap) -> str | None:
    """What to tell about a map whose brightest texels are many and equal, as a clipped sun's are,
    or equal in two channels, as where its third has room left.

    Values that were measured are not equal to the last bit: of two by chance, of a square of four
    hardly. They must be brighter than three times the mean, as what is emissive is, since a map of
    one colour is equal everywhere. No share of the flux is asked for: the lower a sun was clipped,
    the less it has left and the more is missing.
    """
    luminance, radiance = environment.luminance, environment.radiance
    mean = environment.luminous_flux / (4.0 * math.pi)
    whole = luminance == luminance.max()
    partly = sum((plane == plane.max()).view(np.uint8) for plane in np.moveaxis(radiance, 2, 0)) > 1
    for equal, how in ((whole, "equal"), (partly, "equal in two channels")):
        their = luminance[equal]
        # In float32 a multiple of the mean may overflow.
        if len(their) < MANY or not float(their.min()) > TIMES_AVERAGE * mean:
            continue
        rows = np.where(equal, luminance, 0.0).sum(axis=1, dtype=np.float64)
        share = float(rows @ environment.row_solid_angle) / environment.luminous_flux
        return (
            f"map '{environment.name}': its {len(their)} brightest texels are {how}, luminance "
            f"{their.max():.6g}, and give {100.0 * share:.3g} % of the "
            "flux; if what they show was clipped, the light is stronger than the map says"
        )
    return None


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
    stems = Counter(file.stem for file in files)
    twice = next((stem for stem, count in stems.items() if count > 1), None)
    if twice:
        raise EnvlightError(f"environments '{place}': two maps are called '{twice}'; rename one")
    return [_source(file, repair) for file in files]


def _is_map(file: Path) -> bool:
    hidden = file.name.startswith(".")
    return file.suffix.lower() in SUFFIXES and not hidden and file.is_file()


def _source(file: Path, repair: bool) -> EnvironmentSource:
    return EnvironmentSource(as_text(file.stem), str(file.resolve()), repair=repair)
