"""How kernels are compiled: one decorator for all, so that they differ in nothing but their code.

Kernels release the interpreter's lock and their machine code is kept in a folder. Divisions follow
IEEE 754: a zero below makes an infinity or NaN, not an exception, whose check would be compiled at
each of them. Kernels are called from Python and from each other, never through a C pointer, so no
entry for one is made.
"""

from collections.abc import Callable
from typing import Any, TypeVar

from numba import njit

Function = TypeVar("Function", bound=Callable[..., Any])
OPTIONS: dict[str, Any] = {
    "nogil": True, "cache": True, "error_model": "numpy", "no_cfunc_wrapper": True,
}  # fmt: skip


def kernel(function: Function) -> Function:
    """The function, compiled when it is first called; its Python code stays there as `py_func`."""
    return njit(**OPTIONS)(function)
