'''Environment maps made from code: 32 places and times of day at any resolution.

Each map is a picture of the whole sphere of directions, not of texels: terrain and rooms are met by
rays, textures are noise in space, and small lights have their true shape, so that the same map
comes out sharper at a higher resolution, with the same energy. The maps are deterministic and do
not depend on the number of threads. Nothing outside imports from inside: this module is the door.

How a place is described
------------------------
A place is a function that returns a `Picture`, entered under a name and a kind. Whoever adds this
to `rooms.py` has a map more; a module of its own is named in `_DESCRIPTIONS` below.

    @embedded_map("cell", "interior")
    def cell() -> Picture:
        """A bare cell in daylight from one window, with a lamp."""
        grey = Material((0.5, 0.5, 0.5), plaster)
        room = Builder((-2.0, 0.0, -1.5), (2.0, 2.8, 1.5), wall=grey, floor=grey)
        room.window("x+", along=(-0.5, 0.5), up=(1.0, 2.0))
        room.box((-1.8, 0.0, -1.4), (-1.0, 0.5, 0.4), Material((0.3, 0.2, 0.1), wood))
        room.globe((0.0, 2.6, 0.0), radius=0.05, radiance=40.0 * blackbody(2700.0))
        return room.place(eye=(0.3, 1.6, -0.2), outside=garden(60.0)).picture()

Lengths are in metres, y is up, albedos and radiances are linear Rec. 709, and a radiance of 1
stands for 10 kcd·m⁻². What a picture is made of, from the inside out:

    shapes                           the types of what follows
    noise, colours, emitters         textures, hues of lights, lights too small for sampling
    sky, evening, land               what is seen outdoors: callables from directions to radiance
    materials, furnishing, lamps     what rooms and streets are made of
    building, parts                  `Builder` puts a place together of solids, panels and lamps
    place, lightmap, rays, grid      shades it, with light that has bounced
    raster                           turns a picture into texels
    landscapes, nights, streets, rooms, halls, studios, wilds   the maps, a function each
    ring_of_fire                     flames that grow about the eye, to be laid over any map
'''

from experiments.maps.places import halls, landscapes, nights, rooms, streets, studios, wilds
from experiments.maps.places.catalogue import entry, entry_names
from experiments.maps.places.raster import rasterized
from experiments.maps.places.ring_of_fire import FRAMES as FIRE_FRAMES
from experiments.maps.places.ring_of_fire import SINES as FIRE_SINES
from experiments.maps.places.ring_of_fire import fire
from samplers.environment import EnvironmentMap
from samplers.errors import EnvlightError

__all__ = ["FIRE_FRAMES", "FIRE_SINES", "fire", "kind", "make", "names"]

_DESCRIPTIONS = (landscapes, nights, streets, rooms, halls, studios, wilds)

LOWEST, HIGHEST = 16, 4096


def names() -> list[str]:
    """Names of the maps, ordered by kind."""
    return entry_names()


def kind(name: str) -> str:
    """What sort of place a map shows: sun, overcast, dusk, night, interior, industrial, studio,
    forest or uniform."""
    return entry(name).kind


def make(name: str, height: int, split: int | None = None) -> EnvironmentMap:
    """The map of a name, `height` × 2 `height` texels.

    split : sub-texels along a texel's side; 1 does for a picture, in half the time

    Raises EnvlightError for an unknown name and for a height that is odd or outside 16 … 4096.
    """
    if not LOWEST <= height <= HIGHEST or height % 2:
        raise EnvlightError(
            f"embedded map '{name}': height {height}; "
            f"give an even number from {LOWEST} to {HIGHEST}"
        )
    return EnvironmentMap(rasterized(entry(name).describe(), height, split), name)
