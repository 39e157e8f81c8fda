"""Tables and figures of Wu, "Efficient environment map rendering based on decomposition", 2025."""
