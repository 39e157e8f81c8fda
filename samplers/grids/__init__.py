"""What several methods stand on: tables of sums, regions, HEALPix cells, nearest lights,
survivors of candidates."""
