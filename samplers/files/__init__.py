"""Files that come in: environment maps, and samplers of a user's own."""
