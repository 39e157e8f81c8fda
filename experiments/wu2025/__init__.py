"""Tables and figures of Wu, "Efficient environment map rendering based on decomposition", 2025."""

PAPER = "Wu 2025"
NOT_MADE = {
    "Fig. 2": (
        "a scene lit by the emissive and by the other texels alone",
        "no image here is lit by a part of its map; `light-distribution` draws the two parts",
    ),
    "Fig. 12": (
        "160 frames a second in Unity",
        "there is no game engine and no graphics card; `real-time` counts frames of this renderer",
    ),
}
"""What nothing here makes: what it shows, and why."""
