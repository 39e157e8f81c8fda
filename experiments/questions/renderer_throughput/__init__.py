"""The renderer's speed beside its peers."""
