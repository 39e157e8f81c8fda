"""Low-discrepancy points: Owen-scrambled Sobol' pairs, one scramble per pixel and dimension pair.

The first two Sobol' dimensions form a (0, 2)-sequence: any 2^k consecutive points starting at a
multiple of 2^k are stratified in every elementary interval. Further dimensions are padded with
independently shuffled pairs. Sources: Owen, "Randomly permuted (t, m, s)-nets and
(t, s)-sequences", 1995; hash-based scrambling after Laine and Karras, "Stratified sampling for
stochastic transparency", 2011, with Vegdahl's constants; Burley, "Practical hash-based Owen
scrambling", JCGT 2020.
"""

import numpy as np

from samplers.compiled import inner

TO_UNIT = np.float32(2.0**-24)

# Numba widens 32-bit integers to 64 bits in every operation. Each result is narrowed at once, which
# lets the compiler take the operation itself back to 32 bits, sixteen of them to an instruction.


@inner
def hash_mix(x):
    """A 32-bit integer hash with full avalanche (after Mueller)."""
    x = np.uint32(x)
    x = np.uint32(x ^ (x >> np.uint32(16)))
    x = np.uint32(x * np.uint32(0x45D9F3B))
    x = np.uint32(x ^ (x >> np.uint32(16)))
    x = np.uint32(x * np.uint32(0x45D9F3B))
    return np.uint32(x ^ (x >> np.uint32(16)))


@inner
def _swapped(x, mask, shift):
    """Exchange the bits under `mask` with those `shift` above them."""
    mask, shift = np.uint32(mask), np.uint32(shift)
    return np.uint32(np.uint32((x >> shift) & mask) | np.uint32((x & mask) << shift))


@inner
def _reversed_bits(x):
    x = _swapped(x, 0x55555555, 1)
    x = _swapped(x, 0x33333333, 2)
    x = _swapped(x, 0x0F0F0F0F, 4)
    x = _swapped(x, 0x00FF00FF, 8)
    return _swapped(x, 0x0000FFFF, 16)


@inner
def _scrambled_reversed(x, seed):
    """Owen scrambling of a bit-reversed number."""
    x = np.uint32(x ^ np.uint32(x * np.uint32(0x3D20ADEA)))
    x = np.uint32(x + seed)
    x = np.uint32(x * np.uint32((seed >> np.uint32(16)) | np.uint32(1)))
    x = np.uint32(x ^ np.uint32(x * np.uint32(0x05526C56)))
    return np.uint32(x ^ np.uint32(x * np.uint32(0x53A22864)))


@inner
def _sobol_second_reversed(x):
    """The second Sobol' dimension, bit-reversed: the index times Pascal's triangle modulo 2."""
    x = np.uint32(x ^ np.uint32((x & np.uint32(0xAAAAAAAA)) >> np.uint32(1)))
    x = np.uint32(x ^ np.uint32((x & np.uint32(0xCCCCCCCC)) >> np.uint32(2)))
    x = np.uint32(x ^ np.uint32((x & np.uint32(0xF0F0F0F0)) >> np.uint32(4)))
    x = np.uint32(x ^ np.uint32((x & np.uint32(0xFF00FF00)) >> np.uint32(8)))
    return np.uint32(x ^ np.uint32((x & np.uint32(0xFFFF0000)) >> np.uint32(16)))


@inner
def _shuffled(index, seed):
    return _reversed_bits(_scrambled_reversed(_reversed_bits(np.uint32(index)), hash_mix(seed)))


@inner
def _unit(x):
    return np.float32(np.int32(_reversed_bits(x) >> np.uint32(8))) * TO_UNIT


@inner
def sobol_first(index, seed):
    """The first number of `sobol_pair`."""
    seed = np.uint32(seed)
    shuffled = _shuffled(index, seed)
    return _unit(_scrambled_reversed(shuffled, hash_mix(seed ^ np.uint32(0x9E3779B9))))


@inner
def sobol_pair(index, seed):
    """Point `index` of the scrambled (0, 2)-sequence chosen by `seed`: two numbers in [0, 1)."""
    seed = np.uint32(seed)
    second = _sobol_second_reversed(_shuffled(index, seed))
    second = _scrambled_reversed(second, hash_mix(seed ^ np.uint32(0x85EBCA6B)))
    return sobol_first(index, seed), _unit(second)


@inner
def seeds_of(pixel, seed, stream):
    """Seeds of a pixel's first two dimensions and of its third."""
    base = hash_mix(np.uint32(pixel) ^ hash_mix(hash_mix(seed) ^ np.uint32(stream)))
    return base, hash_mix(base ^ np.uint32(0x27D4EB2F))
