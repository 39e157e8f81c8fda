"""The one exception type of the project: a sentence for the user, not a traceback."""


class EnvlightError(ValueError):
    """Bad input. The message says what is wrong, where, and what to do about it."""
