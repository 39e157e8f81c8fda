"""The one exception type of the project: a sentence for the user, not a traceback."""

from traceback import format_exception_only


class EnvlightError(ValueError):
    """Bad input. The message says what is wrong, where, and what to do about it."""


def told(error: BaseException) -> str:
    """Kind and message of somebody else's error in one line, whatever its `__str__` does."""
    text = " ".join("".join(format_exception_only(error)).split())
    return text[text.find(type(error).__name__) :]
