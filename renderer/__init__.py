"""From a view of a scene and a lighting to an image."""

from samplers import kernel_cache as kernel_cache  # before any kernel is declared
