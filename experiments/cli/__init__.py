"""The command line, `envlight`."""
