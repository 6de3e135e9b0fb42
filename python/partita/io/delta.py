"""A file stored as its difference to another one: the binary inside FMUs beside the module, whose code it shares.

Two files linked from the same crates have the same functions at other places. A difference of the kind of bsdiff
(Percival, "Naive differences of executable code", 2003) copies what they share with the bytes that the linker
changed. Nothing but the standard library is imported, so that `tools/wheels.py` can use this file alone.
"""

from __future__ import annotations

import hashlib
import re
import struct

HEADER = struct.Struct("<32s32sQQ")
"""SHA-256 of the old file and of the new one, bytes of the control block and of the sums; all little-endian."""
ROW = struct.Struct("<QQQ")
"""Bytes to add to the old file's, bytes that are new, and the way to the next place in the old file."""
_SIGN = 1 << 63
_CHANGED = re.compile(rb"[^\0]+")


class OtherFileError(ValueError):
    """The old file is not the one from which the difference was taken, or the difference is damaged."""


def stored(old: bytes, new: bytes, control: bytes, sums: bytes, extra: bytes) -> bytes:
    """The difference of two files as it is stored, from the three blocks that bsdiff computes; not yet compressed."""
    header = HEADER.pack(hashlib.sha256(old).digest(), hashlib.sha256(new).digest(), len(control), len(sums))
    return header + control + sums + extra


def applied(old: bytes, delta: bytes) -> bytes:
    """The new file, from the old one and the difference.

    Raises
    ------
    OtherFileError
        If the old file is another one than that from which the difference was taken, or the result another one than
        what was to be stored.
    """
    source, wanted, length, added = HEADER.unpack_from(delta)
    if hashlib.sha256(old).digest() != source:
        raise OtherFileError("the file has been changed")
    start = HEADER.size + length
    sums, extra = memoryview(delta)[start : start + added], memoryview(delta)[start + added :]
    new, at, read, taken = bytearray(), 0, 0, 0
    for copied, fresh, step in ROW.iter_unpack(delta[HEADER.size : start]):
        piece, change = bytearray(old[at : at + copied]), sums[read : read + copied]
        for found in _CHANGED.finditer(change):
            for i in range(*found.span()):
                piece[i] = (piece[i] + change[i]) & 0xFF
        new += piece
        new += extra[taken : taken + fresh]
        at += copied + (_SIGN - step if step & _SIGN else step)
        read, taken = read + copied, taken + fresh
    if hashlib.sha256(new).digest() != wanted:
        raise OtherFileError("the difference is damaged")
    return bytes(new)
