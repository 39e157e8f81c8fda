"""What no paper asks: run time against error, stability, skipped work, speed."""
