# %% [markdown]
# # envlight as a library
# From a map to lights, from lights to an image, from an image to its error. Every cell runs by
# itself in a notebook (Jupyter and VS Code open `# %%` cells), the whole as a script.

# %%
import sys
from pathlib import Path

import numpy as np

from experiments import load_run, summary
from metrics.errors import exposure_scale, rmse
from renderer import load_scene, make_view, render, render_reference, write_exr
from samplers import EnvironmentMap, LayeredLights, make_sampler, sampler_names

# %% [markdown]
# A map: a file, or an array of linear RGB, twice as wide as high, +Y in the first row.

# %%
if len(sys.argv) > 1 and Path(sys.argv[1]).suffix in (".exr", ".hdr"):
    environment = EnvironmentMap.from_file(sys.argv[1])
else:
    height = 64
    radiance = np.full((height, 2 * height, 3), 0.1)
    radiance[: height // 2] = [0.4, 0.6, 1.0]  # sky
    radiance[14:16, 30:32] = 2000.0  # sun
    environment = EnvironmentMap.from_array(radiance, "sky with a sun")
print(environment.name, environment.radiance.shape, "flux", environment.total_flux)

# %% [markdown]
# In a notebook a map, lights and images show themselves as pictures: end a cell with `environment`.
#
# A sampler by its name, with parameters where they differ from the paper's; `./file.py:Class` is a
# name, too.

# %%
print(sampler_names())
rng = np.random.default_rng(0)
lights = make_sampler("median-cut", order="heap").prepare(environment, 16, rng)
ours = make_sampler("ours").prepare(environment, 16, rng)
assert isinstance(ours, LayeredLights)
print(len(lights), "lights;", len(ours.direct), "direct and", len(ours.indirect), "indirect ones")

# %% [markdown]
# A view is computed once and serves every map and sampler. `load_scene` takes the path of a scene's
# TOML file as well.

# %%
view = make_view(load_scene("three-boxes"), 96, 72, subpixels=4)
reference = render_reference(view, environment, 0.02, 1024)
scale = exposure_scale(reference.image, view.coverage > 0.0)
for name, lighting in {"median-cut": lights, "ours": ours}.items():
    rendering = render(view, lighting, environment)
    error = rmse(rendering.image * scale, reference.image * scale)
    print(f"{name:12} RMSE {error:.4f}, {rendering.rays.traced} rays")

# %% [markdown]
# Images are arrays of linear radiance; OpenEXR keeps them as they are.

# %%
folder = Path(sys.argv[-1])
if folder.is_dir() and not (folder / "run.json").is_file():
    write_exr(folder / "three-boxes.exr", rendering.image)

# %% [markdown]
# What `envlight run` or `envlight publish` left in a folder: rows as a DataFrame, means and ranks.

# %%
if (folder / "run.json").is_file():
    run = load_run(folder)
    print(run)
    print(summary(run.rows)[["sampler", "rmse", "rmse_rank"]])
