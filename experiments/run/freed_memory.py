"""What becomes of memory that arrays give back: by default the system takes large blocks at once.

A render asks for hundreds of MiB and returns them. Where each of its pages has to be found and
cleared anew for the next one, that takes as long as tracing the primary rays, or twice that on a
virtual machine whose host takes back what is free.
"""

import ctypes
import sys

_TRIM_THRESHOLD, _MMAP_MAX = -1, -4
"""Parameters of glibc's `mallopt`."""
KEPT_BYTES = 1 << 30
"""Free memory at the end of the heap that a process keeps."""


def keep_freed_memory() -> bool:
    """Let this process use again what its arrays gave back; returns whether the system can.

    Needs glibc (Linux). Peak memory may grow by what lies between blocks of different size.
    """
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None) if sys.platform == "linux" else None
    if mallopt is None:
        return False
    return bool(mallopt(_MMAP_MAX, 0)) and bool(mallopt(_TRIM_THRESHOLD, KEPT_BYTES))
