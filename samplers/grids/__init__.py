"""What several methods stand on: tables of sums, regions, HEALPix cells and quads, nearest lights."""
