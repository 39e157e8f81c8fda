"""Low-discrepancy points: Owen-scrambled Sobol' pairs, one scramble per pixel and dimension pair.

The first two Sobol' dimensions form a (0, 2)-sequence: any 2^k consecutive points starting at a
multiple of 2^k are stratified in every elementary interval. Further dimensions are padded with
independently shuffled pairs. Sources: Owen, "Randomly permuted (t, m, s)-nets and
(t, s)-sequences", 1995; hash-based scrambling after Laine and Karras, "Stratified sampling for
stochastic transparency", 2011, with Vegdahl's constants; Burley, "Practical hash-based Owen
scrambling", JCGT 2020.
"""

import numpy as np
from numba import njit

TO_UNIT = np.float32(2.0**-24)


# Numba widens 32-bit integer arithmetic to 64 bits, hence the explicit truncation to WORD bits.
WORD = np.uint64(0xFFFFFFFF)


@njit(nogil=True, cache=True)
def hash_mix(x):
    """A 32-bit integer hash with full avalanche (after Mueller)."""
    x = np.uint64(x) & WORD
    x ^= x >> np.uint64(16)
    x = (x * np.uint64(0x45D9F3B)) & WORD
    x ^= x >> np.uint64(16)
    x = (x * np.uint64(0x45D9F3B)) & WORD
    return x ^ (x >> np.uint64(16))


@njit(nogil=True, cache=True)
def _swapped(x, mask, shift):
    """Exchange the bits under `mask` with those `shift` above them."""
    return ((x >> shift) & mask) | ((x & mask) << shift)


@njit(nogil=True, cache=True)
def _reversed_bits(x):
    x = _swapped(x, np.uint64(0x55555555), np.uint64(1))
    x = _swapped(x, np.uint64(0x33333333), np.uint64(2))
    x = _swapped(x, np.uint64(0x0F0F0F0F), np.uint64(4))
    x = _swapped(x, np.uint64(0x00FF00FF), np.uint64(8))
    return _swapped(x, np.uint64(0x0000FFFF), np.uint64(16)) & WORD


@njit(nogil=True, cache=True)
def _scrambled_reversed(x, seed):
    """Owen scrambling of a bit-reversed number."""
    x ^= (x * np.uint64(0x3D20ADEA)) & WORD
    x = (x + seed) & WORD
    x = (x * ((seed >> np.uint64(16)) | np.uint64(1))) & WORD
    x ^= (x * np.uint64(0x05526C56)) & WORD
    return x ^ ((x * np.uint64(0x53A22864)) & WORD)


@njit(nogil=True, cache=True)
def _sobol_second_reversed(x):
    """The second Sobol' dimension, bit-reversed: the index times Pascal's triangle modulo 2."""
    x ^= (x & np.uint64(0xAAAAAAAA)) >> np.uint64(1)
    x ^= (x & np.uint64(0xCCCCCCCC)) >> np.uint64(2)
    x ^= (x & np.uint64(0xF0F0F0F0)) >> np.uint64(4)
    x ^= (x & np.uint64(0xFF00FF00)) >> np.uint64(8)
    return x ^ ((x & np.uint64(0xFFFF0000)) >> np.uint64(16))


@njit(nogil=True, cache=True)
def sobol_pair(index, seed):
    """Point `index` of the scrambled (0, 2)-sequence chosen by `seed`: two numbers in [0, 1)."""
    seed = np.uint64(seed) & WORD
    index = np.uint64(index) & WORD
    shuffled = _reversed_bits(_scrambled_reversed(_reversed_bits(index), hash_mix(seed)))
    first = _reversed_bits(_scrambled_reversed(shuffled, hash_mix(seed ^ np.uint64(0x9E3779B9))))
    second = _reversed_bits(
        _scrambled_reversed(
            _sobol_second_reversed(shuffled), hash_mix(seed ^ np.uint64(0x85EBCA6B))
        )
    )
    return (
        np.float32(first >> np.uint64(8)) * TO_UNIT,
        np.float32(second >> np.uint64(8)) * TO_UNIT,
    )


@njit(nogil=True, cache=True)
def fill_points(pixel, subpixel, subpixels, first, count, seed, stream, out):
    """Three-dimensional points (len(pixel) · count, 3) for samples first … first + count − 1.

    The samples of all sub-pixels of a pixel are one sequence: sample s of sub-pixel k is point
    s · subpixels + k. `stream` keeps the techniques apart.
    """
    for i in range(len(pixel)):
        base = hash_mix(np.uint64(pixel[i]) ^ hash_mix(hash_mix(seed) ^ np.uint64(stream)))
        other = hash_mix(base ^ np.uint64(0x27D4EB2F))
        for s in range(count):
            index = (first + s) * subpixels + subpixel[i]
            a, b = sobol_pair(index, base)
            c, _ = sobol_pair(index, other)
            row = i * count + s
            out[row, 0], out[row, 1], out[row, 2] = a, b, c
