"""What a sampler of anybody's may do to a program: end it, or never end. Neither gets through.

Python code that takes too long is interrupted where it is. Where that has no effect, since it waits
or runs machine code, its process is ended: a run in processes goes on without that measurement,
another keeps what it has stored.
"""

import ctypes
import os
import sys
import threading
from collections.abc import Callable
from typing import ParamSpec, TypeVar

from samplers import EnvlightError

P = ParamSpec("P")
R = TypeVar("R")
GRACE_SECONDS = 10.0
"""What was interrupted must have ended by then."""


class _TimeIsUp(BaseException):
    """No `except Exception` of a sampler's is meant to catch it."""


class _Clock:
    """Interrupts the thread that made it some seconds after it was begun, unless it was stopped."""

    def __init__(self, seconds: float) -> None:
        self._seconds, self._thread = seconds, threading.get_ident()
        self._lock = threading.Lock()
        self.begun, self._stopped = threading.Event(), threading.Event()
        threading.Thread(target=self._run, daemon=True).start()

    def _run(self) -> None:
        self.begun.wait()
        if self._stopped.wait(self._seconds):
            return
        with self._lock:
            if not self._stopped.is_set():
                self._raise_there(_TimeIsUp)
        if not self._stopped.wait(GRACE_SECONDS):
            print(
                f"envlight: a measurement neither ended within {self._seconds:g} s (--timeout) nor "
                "when it was interrupted; its process ends here, what is stored stays. With "
                "--executor processes the other measurements go on",
                file=sys.stderr, flush=True,
            )  # fmt: skip
            os._exit(1)

    def stop(self) -> None:
        with self._lock:
            self._stopped.set()
            self._raise_there(None)  # of an interrupt that comes too late

    def _raise_there(self, error: type[BaseException] | None) -> None:
        ctypes.pythonapi.PyThreadState_SetAsyncExc(
            ctypes.c_ulong(self._thread), ctypes.py_object(error) if error else None
        )


def guarded(seconds: float, work: Callable[P, R], *args: P.args, **kwargs: P.kwargs) -> R:
    """The result of a sampler's work, in any thread.

    seconds : that it may take, 0 for as long as it needs

    Raises EnvlightError where it takes longer, or would end the program.
    """
    clock = _Clock(seconds) if seconds else None
    try:
        try:
            if clock:
                clock.begun.set()
            return work(*args, **kwargs)
        finally:
            if clock:
                clock.stop()
    except SystemExit as end:
        raise EnvlightError(
            f"it ended the program, by sys.exit({end.code!r}); let it raise an error instead"
        ) from end
    except _TimeIsUp:
        if clock:
            clock.stop()
        raise EnvlightError(f"it was not finished within {seconds:g} s (--timeout)") from None
    except (Exception, KeyboardInterrupt):
        raise
    except BaseException as error:  # such as asyncio's cancellation, which would end the run
        raise EnvlightError(f"it raised {type(error).__name__}: {error}") from error
