"""From a view of a scene and a lighting to an image."""
