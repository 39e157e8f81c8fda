"""What a run is: cases, measurements, budgets, the store, and who works on them."""
