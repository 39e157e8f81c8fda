"""Figures of Ergun, Kurt and Öztürk, "Real-time kd-tree based importance sampling of environment
maps", SCCG 2012, and what it prints.
"""

PAPER = "Ergun 2012"
NOT_MADE = {
    "Fig. 5": (
        "frames a second by number of samples",
        "there is no graphics card; `kd-tree-throughput` counts samples, whatever their number",
    ),
}
"""What nothing here makes: what it shows, and why."""
FRAMES_KD_TREE, FRAMES_INVERSION = 72.0, 19.0
"""Frames per second on the authors' graphics card, Figure 3."""
FIGURE6 = {
    "pink-fabric": (36.90, 39.22),
    "blue-metallic-paint": (36.07, 40.83),
    "chrome-steel": (43.92, 45.47),
}
"""PSNR in dB of a sphere under Doge2, by inversion with 8 and by the kd-tree with 32 samples per
pixel, at equal time on the same card."""
SAMPLES_INVERSION, SAMPLES_KD_TREE = 8, 32
COMPRESSIONS = {16: "1:65536 (Constant)", 6144: "1:170 (Uffizi, Doge2)"}
"""Section 4: by number of blocks, of maps of 2048 × 1024."""
MOST_BLOCKS, WIDTH = 6144, 2048
