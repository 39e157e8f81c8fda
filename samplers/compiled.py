"""How kernels are compiled: one decorator for all, so that they differ in nothing but their code.

Kernels release the interpreter's lock and their machine code is kept in a folder. They use
registers of 512 bits where the processor has them: sixteen floats, a packet's. Divisions follow
IEEE 754: a zero below makes an infinity or NaN, not an exception, whose check would be compiled at
each of them. Kernels are called from Python and from each other, never through a C pointer, so no
entry for one is made.
"""

from collections.abc import Callable
from typing import Any, TypeVar

import llvmlite.binding as llvm
from llvmlite import ir
from numba import njit, types
from numba.core import cgutils, config
from numba.extending import intrinsic

Function = TypeVar("Function", bound=Callable[..., Any])
OPTIONS: dict[str, Any] = {
    "nogil": True, "cache": True, "error_model": "numpy", "no_cfunc_wrapper": True,
}  # fmt: skip

INNER_OPTIONS = {**OPTIONS, "forceinline": True, "_nrt": False}


def _fill_registers() -> None:
    """Have LLVM use registers of 512 bits, unless NUMBA_CPU_FEATURES or NUMBA_CPU_NAME is set.

    Left alone it takes halves of them on many processors, for the sake of programs that use wide
    ones so seldom that to run slower for a while costs more than it gains. Results are the same.
    """
    try:
        features = llvm.get_host_cpu_features()
    except RuntimeError:
        return  # of a processor that LLVM cannot ask
    settings = vars(config)
    if features.get("avx512f") and not settings["CPU_FEATURES"] and not settings["CPU_NAME"]:
        settings["CPU_FEATURES"] = f"{features.flatten()},-prefer-256-bit"


_fill_registers()


def kernel(function: Function) -> Function:
    """The function, compiled when it is first called; its Python code stays there as `py_func`."""
    return njit(**OPTIONS)(function)


def inner(function: Function) -> Function:
    """`kernel` for what other kernels call at every step, and which makes no arrays.

    It becomes part of its callers, and references to its arrays are not counted: whoever calls it
    holds them. Counting is an atomic instruction for each array that is passed on or cut, and
    before it all reads under way must arrive; passing an array puts seven numbers on the stack.
    """
    return njit(**INNER_OPTIONS)(function)


def _address_of(typing_context, array):
    def generate(context, builder, signature, arguments):
        view = context.make_array(signature.args[0])(context, builder, arguments[0])
        return builder.ptrtoint(view.data, context.get_value_type(types.intp))

    return types.intp(array), generate


def _prefetch(typing_context, array, index):
    def generate(context, builder, signature, arguments):
        view = context.make_array(signature.args[0])(context, builder, arguments[0])
        place = builder.bitcast(builder.gep(view.data, [arguments[1]]), cgutils.voidptr_t)
        number = ir.IntType(32)
        kind = ir.FunctionType(ir.VoidType(), [place.type, number, number, number])
        function = builder.module.declare_intrinsic("llvm.prefetch", [place.type], kind)
        # For reading, to stay in the nearest cache, data.
        builder.call(function, [place, number(0), number(3), number(1)])
        return context.get_dummy_value()

    return types.void(array, index), generate


address_of: Callable[..., int] = intrinsic(_address_of)
"""address_of(array), in kernels: where a contiguous array begins, as functions of C take it.

`array.ctypes.data` says the same, but counts a reference to the array each time.
"""
prefetch: Callable[..., None] = intrinsic(_prefetch)
"""prefetch(array, index), in kernels: ask for what array[index] of a flat array holds.

It changes no result, and may point beyond the array. A read at a place that nobody can foresee
takes as long as hundreds of instructions; asked for early, it comes while others are worked on.
"""
