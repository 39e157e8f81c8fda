"""Environment maps made from code: 32 places and times of day at any resolution.

Each map is a picture of the whole sphere of directions, not of texels: terrain and rooms are met by
rays, textures are noise in space, and small lights have their true shape, so that the same map
comes out sharper at a higher resolution, with the same energy. The maps are deterministic and do
not depend on the number of threads.
"""

from experiments.maps.places import halls, landscapes, nights, rooms, streets, studios, wilds
from experiments.maps.places.catalogue import entry, entry_names
from experiments.maps.places.raster import rasterized
from samplers.environment import EnvironmentMap
from samplers.errors import EnvlightError

__all__ = ["kind", "make", "names"]

_DESCRIPTIONS = (landscapes, nights, streets, rooms, halls, studios, wilds)

LOWEST, HIGHEST = 16, 4096


def names() -> list[str]:
    """Names of the maps, ordered by kind."""
    return entry_names()


def kind(name: str) -> str:
    """What sort of place a map shows: sun, overcast, dusk, night, interior, industrial, studio,
    forest or uniform."""
    return entry(name).kind


def make(name: str, height: int) -> EnvironmentMap:
    """The map of a name, `height` × 2 `height` texels.

    Raises EnvlightError for an unknown name and for a height that is odd or outside 16 … 4096.
    """
    if not LOWEST <= height <= HIGHEST or height % 2:
        raise EnvlightError(
            f"embedded map '{name}': height {height}; "
            f"give an even number from {LOWEST} to {HIGHEST}"
        )
    return EnvironmentMap(rasterized(entry(name).describe(), height), name)
