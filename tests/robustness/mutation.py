"""Damage to the bytes of a file, as disks, networks and hostile writers do it."""

import numpy as np

EXTREMES = (0, 1, 0x7F, 0x80, 0xFF, 0x7FFF, 0xFFFF, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF, 0x7FC00000)
"""Whole numbers at which signs, sizes and products turn over; the last is a NaN."""
TOKENS = (b"nan", b"inf", b"-1", b"1e999", b"99999999999999999999", b"\0", b"\xff\xfe", b"../", b"")
"""What may stand in the place of a word of a text."""
MOST_DAMAGES = 6
HEAD = 700
"""Half of the damage falls on the first bytes, where headers are."""


def mutate(content: bytes, other: bytes, rng: np.random.Generator) -> bytes:
    """`content` with one to six damages, mostly few.

    other : another file's bytes, of which pieces may be put in"""
    data = bytearray(content)
    for _ in range(min(int(rng.geometric(0.5)), MOST_DAMAGES)):
        _damage(data, other, rng)
    return bytes(data)


def _damage(data: bytearray, other: bytes, rng: np.random.Generator) -> None:
    """One damage, in place."""
    size = min(len(data), HEAD) if rng.random() < 0.5 else len(data)
    at = int(rng.integers(0, max(size, 1)))
    length = int(2 ** rng.uniform(0.0, 6.0))
    match int(rng.integers(9)):
        case 0 if data:
            data[at % len(data)] ^= 1 << int(rng.integers(8))
        case 1 if data:
            data[at % len(data)] = int(rng.integers(256))
        case 2:
            width = int(rng.choice([1, 2, 4, 8]))
            number = int(rng.choice(EXTREMES)) & ((1 << 8 * width) - 1)
            order = "little" if rng.random() < 0.7 else "big"
            data[at : at + width] = number.to_bytes(width, order)  # type: ignore[arg-type]
        case 3:
            del data[at:]
        case 4:
            del data[at : at + length]
        case 5:
            data[at:at] = rng.bytes(length)
        case 6:
            data[at:at] = data[at : at + length] * int(rng.integers(1, 9))
        case 7:
            begin = int(rng.integers(0, max(len(other), 1)))
            data[at : at + length] = other[begin : begin + length]
        case _:
            _replace_word(data, at, rng)


def _replace_word(data: bytearray, at: int, rng: np.random.Generator) -> None:
    """Put a token in the place of the word around `at`."""
    begin = end = at
    while begin > 0 and data[begin - 1 : begin].isalnum():
        begin -= 1
    while end < len(data) and (data[end : end + 1].isalnum() or data[end : end + 1] in b".-+"):
        end += 1
    data[begin:end] = TOKENS[int(rng.integers(len(TOKENS)))]
