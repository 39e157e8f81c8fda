"""What kernels may use of the machine beneath them: addresses, and reads asked for early."""

import os

import llvmlite.binding as llvm
import numpy as np
import pytest
from numba import njit

from samplers.compiled import inner, kernel, prefetch


@kernel
def _sum_ahead(array, order, ahead):
    total = 0.0
    for k in range(len(order)):
        prefetch(array, order[k] + ahead)
        total += array[order[k]]
    return total


@inner
def _add(part, total):
    for k in range(len(part)):
        total[0] += part[k]


@kernel
def _sum_rows(table):
    total = np.zeros(1)
    for row in range(len(table)):
        _add(table[row], total)
    return total[0]


@pytest.mark.parametrize("ahead", [0, 16, 1 << 40])
def test_asking_changes_no_result_even_beyond_the_array(ahead: int) -> None:
    array = np.arange(1000.0)
    order = np.random.default_rng(0).permutation(1000)
    assert _sum_ahead(array, order, ahead) == array.sum()


def test_inner_kernels_hold_what_they_are_given() -> None:
    """Rows that nobody else refers to stay while they are read."""
    table = np.arange(12.0).reshape(4, 3)
    for _ in range(1000):
        assert _sum_rows(table) == 66.0
    assert table.sum() == 66.0


@pytest.mark.skipif(
    not llvm.get_host_cpu_features().get("avx512f")
    or not {"NUMBA_CPU_NAME", "NUMBA_CPU_FEATURES"}.isdisjoint(os.environ),
    reason="for processors with registers of 512 bits, where nobody says what to use",
)
def test_kernels_use_whole_registers() -> None:
    @njit
    def double(packet):
        for k in range(len(packet)):
            packet[k] += packet[k]

    double(np.ones(16, np.float32))
    assert "zmm" in "".join(double.inspect_asm().values())
