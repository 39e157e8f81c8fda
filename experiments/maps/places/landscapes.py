"""Maps of open country by day: clear, cloudy and overcast."""

from experiments.maps.places.catalogue import embedded_map
from experiments.maps.places.land import Ground, Land, Ridge, Water
from experiments.maps.places.raster import Picture
from experiments.maps.places.sky import ClearSky, Clouds, clouded, overcast, sun


@embedded_map("noon-desert", "sun")
def noon_desert() -> Picture:
    """High sun in clear, dry air over sand and mesas."""
    light = sun(50.0, 71.0, 2.2)
    sky = ClearSky(light, 2.2)
    sand = Ground(
        ((0.46, 0.31, 0.17), (0.52, 0.37, 0.22)),
        patch=25.0, grain=0.03, contrast=0.3, relief=0.5, bump=(2.0, 2.0, 0.7), haze=6000.0,
    )  # fmt: skip
    rock = ((0.30, 0.15, 0.08), (0.42, 0.24, 0.14))
    ridges = (
        Ridge(7.0, 6.0, rock, "mountains", 0.8, 9000.0, 30000.0, seed=510),
        Ridge(1.2, 2.0, rock, "hills", 0.25, 2500.0, 30000.0, seed=540),
    )
    land = Land.under(lambda d, w: sky(d), sand, ridges, light)
    return Picture(land, [light.emitter])


@embedded_map("morning-meadow", "sun")
def morning_meadow() -> Picture:
    """Sun at 28° over grass, a line of trees and hills."""
    light = sun(-65.0, 28.0, 3.0)
    sky = ClearSky(light, 3.0)
    grass = Ground(
        ((0.045, 0.085, 0.018), (0.13, 0.13, 0.04)),
        patch=5.0, grain=0.05, contrast=1.3, relief=0.55, bump=(0.35, 0.35, 0.35), seed=120,
    )  # fmt: skip
    leaves = ((0.018, 0.035, 0.010), (0.06, 0.085, 0.022))
    ridges = (
        Ridge(3.0, 2.5, ((0.06, 0.09, 0.04), (0.10, 0.12, 0.05)), "hills", 0.7, 6000.0, 9000.0),
        Ridge(5.5, 5.0, leaves, "trees", 0.35, 180.0, 9000.0, seed=530),
    )
    return Picture(Land.under(lambda d, w: sky(d), grass, ridges, light), [light.emitter])


@embedded_map("low-sun-sea", "sun")
def low_sun_sea() -> Picture:
    """Sun at 9° in hazy air, glittering on the sea before islands."""
    light = sun(20.0, 9.0, 3.5)
    sky = ClearSky(light, 3.5)
    wisps = Clouds(0.36, 1.1, 0.35, seed=17)
    cliff = ((0.07, 0.065, 0.05), (0.14, 0.12, 0.08))
    ridges = (Ridge(-1.0, 5.5, cliff, "hills", 0.9, 7000.0, 9000.0, seed=561),)
    water = Water(0.13, 2.5)
    land = Land.under(lambda d, w: clouded(sky, wisps, d, w), water, ridges, light)
    return Picture(land, [light.emitter])


@embedded_map("snow-field-morning", "sun")
def snow_field_morning() -> Picture:
    """Sun at 18° over snow, firs and mountains: the ground is as bright as the sky."""
    light = sun(125.0, 18.0, 2.0)
    sky = ClearSky(light, 2.0)
    snow = Ground(
        ((0.76, 0.78, 0.80), (0.86, 0.86, 0.87)),
        patch=9.0, grain=0.04, contrast=0.12, relief=0.35, bump=(2.0, 2.0, 1.0), haze=7000.0,
        seed=140,
    )  # fmt: skip
    rock = ((0.10, 0.10, 0.11), (0.19, 0.18, 0.18))
    firs = ((0.010, 0.018, 0.012), (0.03, 0.045, 0.025))
    ridges = (
        Ridge(13.0, 8.0, rock, "mountains", 0.6, 9000.0, 26000.0, 7.0, seed=571),
        Ridge(3.4, 3.2, firs, "firs", 0.30, 300.0, 26000.0, seed=580),
    )
    return Picture(Land.under(lambda d, w: sky(d), snow, ridges, light), [light.emitter])


@embedded_map("partly-cloudy-hills", "sun")
def partly_cloudy_hills() -> Picture:
    """Sun at 46° in a gap between clouds over hills."""
    light = sun(-30.0, 46.0, 3.0)
    sky = ClearSky(light, 3.0)
    clouds = Clouds(0.47, 1.3, 2.2, seed=23)
    heath = Ground(
        ((0.075, 0.10, 0.03), (0.17, 0.145, 0.06)),
        patch=7.0, grain=0.06, contrast=1.2, relief=0.6, bump=(0.5, 0.5, 0.5), seed=160,
    )  # fmt: skip
    green = ((0.05, 0.075, 0.028), (0.11, 0.12, 0.05))
    ridges = (
        Ridge(5.0, 3.5, green, "hills", 0.8, 9000.0, 14000.0, seed=591),
        Ridge(2.5, 3.0, green, "hills", 0.5, 2500.0, 14000.0, seed=595),
    )
    land = Land.under(lambda d, w: clouded(sky, clouds, d, w), heath, ridges, light)
    return Picture(land, [light.emitter])


@embedded_map("overcast-moor", "overcast")
def overcast_moor() -> Picture:
    """A grey sky over a wet moor."""
    moor = Ground(
        ((0.05, 0.055, 0.025), (0.12, 0.09, 0.05)),
        patch=3.0, grain=0.06, contrast=1.3, relief=0.7, bump=(0.4, 0.4, 0.4), haze=700.0, seed=180,
    )  # fmt: skip
    peat = ((0.05, 0.05, 0.03), (0.09, 0.08, 0.05))
    ridges = (
        Ridge(4.0, 3.0, peat, "hills", 0.8, 4000.0, 5000.0, seed=611),
        Ridge(1.5, 2.0, peat, "hills", 0.4, 1200.0, 5000.0, seed=615),
        Ridge(2.2, 3.0, ((0.02, 0.025, 0.015), (0.04, 0.045, 0.025)), "trees", 0.4, 350.0, 5000.0,
              seed=620),
    )  # fmt: skip
    return Picture(Land.under(lambda d, w: overcast(d, w, 0.9, 0.5), moor, ridges))
