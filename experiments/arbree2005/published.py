"""What Arbree, Walter and Bala 2005 print in Table 1.

Frames per second are of a graphics card of 2004 (GeForce 6800) at 512 × 512 pixels.
"""

import pandas as pd

TABLE1 = pd.DataFrame(
    [
        ("Galileo", 8, 12.8, 7.5),
        ("Grace", 10, 6.7, 4.2),
        ("Kitchen", 4, 21.2, 5.6),
        ("St Peter's", 17, 5.1, 4.1),
    ],
    columns=["map", "lights", "fps_three_boxes", "fps_column"],
)
REFERENCE_FPS, REFERENCE_POINTS = 0.1, 1024
DECOMPOSITION = "0.5 to 1.5 hours on two Xeons of 3.06 GHz"
