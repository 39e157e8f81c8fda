"""Inversion of tabulated running sums, sixteen samples side by side.

The searches work in two scratch arrays, one of whole and one of real numbers, whose rows of
sixteen are named here. One array of each kind, with constant places, lets the compiler see that
rows do not overlap: all but the look-ups become vector instructions, and no jump is mispredicted.
"""

import numpy as np
from numpy.typing import NDArray

from samplers.compiled import inner, kernel, prefetch
from samplers.grids.map_kernels import ROWS
from samplers.sphere import RUN
from samplers.threads import for_blocks

KEY, STEP, LOW, HIGH, MIDDLE = (RUN * i for i in range(5))
WHOLE_SIZE = 5 * RUN
"""Rows of whole numbers: the table's row, the guide's step, the interval left, and its middle."""
SHARE, VALUE, FOUND, BELOW, WITHIN, ACROSS, ALONG, DOWN = (RUN * i for i in range(8))
REAL_SIZE = 8 * RUN
"""Rows of real numbers: the share of the total asked for, and the running sum that it means; the
sums at a cell and at the one before it; the place within the cell, in [0, 1]. Then what a search of
rows and columns is given, a number in [0, 1) for the column and one for the row, and the place
within the row."""


@kernel
def _guide_rows(prefix, start, stop, guide):
    """guide[r, k]: the first cell of row r whose running sum exceeds k / G of the row's total."""
    size = guide.shape[1] - 1
    for r in range(start, stop):
        total, cell = prefix[r, -1], 0
        for k in range(size):
            while cell < prefix.shape[1] - 1 and prefix[r, cell] <= total * (k / size):
                cell += 1
            guide[r, k] = cell
        guide[r, size] = prefix.shape[1] - 1


def guides_of(prefix: NDArray[np.float64], size: int) -> NDArray[np.int32]:
    """Guides (rows, size + 1) of running sums (rows, cells)."""
    guide = np.empty((len(prefix), size + 1), np.int32)
    for_blocks(lambda a, b: _guide_rows(prefix, a, b, guide), len(prefix), ROWS)
    return guide


@inner
def take(u, first, real):
    """Sixteen numbers for the columns and the rows, from row `first` of u (n, 3) on.

    Beyond the end of u the last ones are repeated.
    """
    for k in range(RUN):
        i = min(first + k, len(u) - 1)
        real[ACROSS + k], real[ALONG + k] = u[i, 0], u[i, 1]


@inner
def _narrow(whole, real):
    """Halve the intervals by what was found in their middles; returns how many go on."""
    going = 0
    for k in range(RUN):
        low, high, middle = whole[LOW + k], whole[HIGH + k], whole[MIDDLE + k]
        is_open, above = low < high, real[FOUND + k] > real[VALUE + k]
        low = np.int32(middle + 1) if is_open & (not above) else low
        high = middle if is_open & above else high
        whole[LOW + k], whole[HIGH + k] = low, high
        whole[MIDDLE + k] = np.int32((low + high) >> 1)
        going += 1 if low < high else 0
    return going


@inner
def choose_steps(size, whole, real):
    """The guides' steps STEP for the shares SHARE; a row has `size` + 1 guides."""
    for k in range(RUN):
        whole[STEP + k] = np.int32(real[SHARE + k] * size)


@inner
def ask_for_guides(guide, size, whole):
    """Ask for what `open_intervals` reads."""
    for k in range(RUN):
        prefetch(
            guide, np.uint64(whole[KEY + k]) * np.uint64(size + 1) + np.uint64(whole[STEP + k])
        )


@inner
def open_intervals(guide, size, whole):
    """The intervals LOW to HIGH of the rows KEY to search at the steps STEP, and their middles."""
    for k in range(RUN):
        at = np.uint64(whole[KEY + k]) * np.uint64(size + 1) + np.uint64(whole[STEP + k])
        whole[LOW + k], whole[HIGH + k] = guide[at], guide[at + np.uint64(1)]
    for k in range(RUN):
        whole[MIDDLE + k] = np.int32((whole[LOW + k] + whole[HIGH + k]) >> 1)


@inner
def ask_for_sums(prefix, width, whole):
    """Ask for what `close_intervals` reads first."""
    for k in range(RUN):
        prefetch(
            prefix, np.uint64(whole[KEY + k]) * np.uint64(width) + np.uint64(whole[MIDDLE + k])
        )


@inner
def close_intervals(prefix, width, whole, real):
    """Narrow the intervals to cells LOW, and find the place WITHIN them."""
    going = RUN
    while going > 0:
        for k in range(RUN):
            at = np.uint64(whole[KEY + k]) * np.uint64(width) + np.uint64(whole[MIDDLE + k])
            real[FOUND + k] = prefix[at]
        going = _narrow(whole, real)
    for k in range(RUN):
        cell = whole[LOW + k]
        at = np.uint64(whole[KEY + k]) * np.uint64(width) + np.uint64(cell)
        real[FOUND + k] = prefix[at]
        real[BELOW + k] = prefix[at - np.uint64(1)] if cell > 0 else 0.0
    for k in range(RUN):
        below = real[BELOW + k]
        real[WITHIN + k] = (real[VALUE + k] - below) / (real[FOUND + k] - below)


@inner
def invert(prefix, width, guide, size, whole, real):
    """Where the shares SHARE of the totals of the rows KEY fall: cells LOW, and WITHIN them.

    prefix, guide : flat; `width` running sums and `size` + 1 guides to a row
    VALUE : the shares times their rows' totals

    A guide narrows the binary search, for the first running sum that is greater than a value; with
    one step it is the plain search. One loop for each thing that is done: loops that only compute
    become vector instructions, those that read tables do not.
    """
    choose_steps(size, whole, real)
    open_intervals(guide, size, whole)
    close_intervals(prefix, width, whole, real)


@inner
def find_rows(row_total, marginal, marginal_guide, whole, real):
    """The rows KEY where the numbers ALONG fall, DOWN in them, and what to search them for.

    row_total, marginal : (rows,), marginal_guide : (steps + 1,)
    """
    rows = len(row_total)
    for k in range(RUN):
        whole[KEY + k], real[SHARE + k] = 0, real[ALONG + k]
        real[VALUE + k] = real[ALONG + k] * marginal[rows - 1]
    invert(marginal, rows, marginal_guide, len(marginal_guide) - 1, whole, real)
    for k in range(RUN):
        whole[KEY + k], real[DOWN + k] = whole[LOW + k], real[WITHIN + k]
        real[SHARE + k] = real[ACROSS + k]
        real[VALUE + k] = real[SHARE + k] * row_total[np.uint64(whole[KEY + k])]


@inner
def find_cells(prefix, row_total, guide, marginal, marginal_guide, whole, real):
    """The cells where the numbers ACROSS and ALONG fall: rows KEY, columns LOW.

    prefix : (rows · columns,) and guide : (rows · (steps + 1),), flat; row_total : (rows,)
    marginal : (rows,), marginal_guide : (steps + 1,)

    DOWN and WITHIN are the places within them.
    """
    rows = len(row_total)
    find_rows(row_total, marginal, marginal_guide, whole, real)
    invert(prefix, len(prefix) // rows, guide, len(guide) // rows - 1, whole, real)
