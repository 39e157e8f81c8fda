"""What a notebook shows of maps, lights and images: short words, and pictures that can be read."""

import io

import numpy as np
import pytest
from PIL import Image

from renderer.rays import RayCount
from renderer.render import Rendering
from renderer.scene.load import load_scene
from renderer.view import make_view
from samplers import (
    DirectionalLights,
    DiscLights,
    EnvironmentMap,
    LayeredLights,
    make_sampler,
    sampler_class,
    sampler_names,
)
from samplers.preview import THUMBNAIL_WIDTH, lettering
from samplers.sphere import direction_from_uv

AT = (0.75, 0.25)


def lights(at: tuple[float, float] = AT, colour: tuple[float, ...] = (3.0, 0.0, 0.0)):
    return DirectionalLights(direction_from_uv(*at)[None], np.array([colour]), np.zeros(1))


def picture(shown) -> np.ndarray:
    return np.asarray(Image.open(io.BytesIO(shown._repr_png_())))


def test_a_map_is_small_and_as_bright_above_as_it_is():
    radiance = np.zeros((512, 1024, 3), np.float32)
    radiance[:256] = (0.1, 0.2, 0.9)
    environment = EnvironmentMap.from_array(radiance, "half a sky")
    shown = picture(environment)
    assert shown.shape == (THUMBNAIL_WIDTH // 2, THUMBNAIL_WIDTH, 3)
    assert shown[:128, :, 2].min() > shown[:128, :, 0].max() > 0 and not shown[128:].any()
    assert repr(environment) == "EnvironmentMap('half a sky', 1024×512)"


@pytest.mark.parametrize(
    "shown",
    [
        lights(),
        LayeredLights(lights(), DirectionalLights.none()),
        LayeredLights(DirectionalLights.none(), lights()),
        DiscLights(
            direction_from_uv(*AT)[None], np.array([[3.0, 0.0, 0.0]]), np.ones(1),
            EnvironmentMap.from_array(np.zeros((2, 4, 3))),
        ),
    ],
    ids=["directional", "direct", "indirect", "disc"],
)  # fmt: skip
def test_a_light_is_a_dot_of_its_colour_where_it_stands(shown):
    found = picture(shown)
    rows, columns = np.nonzero(found[..., 0] == 255)
    assert abs(columns.mean() / found.shape[1] - AT[0]) < 1.0 / found.shape[1]
    assert abs(rows.mean() / found.shape[0] - AT[1]) < 1.0 / found.shape[0]
    assert not found[..., 1:].any()
    assert len(repr(shown)) < 200 and "array(" not in repr(shown)


def test_a_dot_has_an_area_as_its_energy():
    pair = [lights((0.25, 0.5), (4.0,) * 3), lights((0.75, 0.5), (1.0,) * 3)]
    both = DirectionalLights(
        np.concatenate([one.direction for one in pair]),
        np.concatenate([one.irradiance for one in pair]),
        np.zeros(2),
    )
    left, right = np.hsplit(picture(both)[..., 0] > 0, 2)
    # Radii of 11.5 and 6.5 pixels, whose edges are drawn within a pixel.
    assert 2.3 < left.sum() / right.sum() < 4.2


def test_an_image_shows_itself():
    image = np.full((60, 80, 3), 0.5, np.float32)
    shown = Rendering(image, RayCount(1, 2, 3, 4), 0.5)
    assert picture(shown).shape == (60, 80, 3)
    assert repr(shown).startswith("Rendering(80×60, ")


def test_what_a_notebook_prints_is_short():
    environment = EnvironmentMap.from_array(np.ones((16, 32, 3), np.float32))
    rng = np.random.default_rng(0)
    lightings = [make_sampler(name).prepare(environment, 16, rng) for name in sampler_names()]
    view = make_view(load_scene("vase"), 8, 6)
    for shown in (*lightings, view, view.scene, view.scene.objects[0]):
        assert len(repr(shown)) < 200 and "array(" not in repr(shown)


def test_labels_have_the_letters_of_every_author():
    font = lettering(12)
    drawn = {
        letter: bytes(font.getmask(letter)) + str(font.getmask(letter).size).encode()
        for letter in {*"\uffff", *"".join(sampler_class(name).label for name in sampler_names())}
    }
    missing = drawn.pop("\uffff")
    assert missing not in [mask for letter, mask in drawn.items() if letter.strip()]
