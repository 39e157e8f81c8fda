"""What several methods stand on: sums, regions, HEALPix cells, nearest lights, resampling."""
