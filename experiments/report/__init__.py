"""Tables, plots and written reports of stored results."""
