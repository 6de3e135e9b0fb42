"""The elements of a MAT file, looked at before SciPy reads them: it allocates what they claim to have."""

from __future__ import annotations

import math
import struct
import zlib

from ...files import Allowance

_HEAD = 128
_COMPRESSED, _MATRIX = 15, 14
_SIZES = {1: 1, 2: 1, 3: 2, 4: 2, 5: 4, 6: 4, 7: 4, 9: 8, 12: 8, 13: 8, 16: 1, 17: 2, 18: 4}
"""Bytes of a number of each type."""
_CELL, _STRUCT, _CHAR, _LAST = 1, 2, 4, 15
_DEPTH = 8
"""Cells in structures, and so on: a stored result has two levels."""
_CHAR_BYTES = 4
_OBJECT_BYTES = 128
"""Memory of an entry of a cell or a structure."""


def unpacked(content: bytes, room: Allowance) -> bytes:
    """The same file without compression, in which every array has the data that it claims."""
    if len(content) < _HEAD or content[126:128] != b"IM":
        raise ValueError("it does not begin as a MAT file of version 5 does")
    pieces, at = [content[:_HEAD]], _HEAD
    while at < len(content):
        kind, _, begin, end = _element(content, at, len(content))
        if kind == _COMPRESSED:
            inflate = zlib.decompressobj()
            plain = inflate.decompress(content[begin:end], max(room.most - room.taken, 0) + 1)
            room.take(len(plain), "its arrays, unpacked,")
            if not inflate.eof:
                raise ValueError("a compressed array is cut short")
            inner_kind, _, inner, inner_end = _element(plain, 0, len(plain))
            if inner_kind != _MATRIX:
                raise ValueError(f"a compressed element is of the kind {inner_kind}, not an array")
            _matrix(plain, inner, inner_end, room, 0)
            pieces.append(plain)
            at = end
        elif kind == _MATRIX:
            _matrix(content, begin, end, room, 0)
            pieces.append(content[at:end])
            at = end
        else:
            raise ValueError(f"an element is of the kind {kind}, not an array")
    return b"".join(pieces)


def _element(data: bytes, at: int, end: int) -> tuple[int, int, int, int]:
    """Kind and size of an element, and where its data begin and it ends."""
    if at + 8 > end:
        raise ValueError("an element is cut short")
    kind, size = struct.unpack_from("<II", data, at)
    if kind >> 16:  # a small one, in eight bytes
        kind, size = kind & 0xFFFF, kind >> 16
        if size > 4:
            raise ValueError(f"a small element has {size} bytes")
        return kind, size, at + 4, at + 8
    after = at + 8 + size + (-size % 8 if kind != _COMPRESSED else 0)
    if at + 8 + size > end:
        raise ValueError(f"an element claims {size} bytes, and {end - at - 8} are left")
    return kind, size, at + 8, min(after, end)


def _matrix(data: bytes, at: int, end: int, room: Allowance, depth: int) -> None:
    """Compare what an array claims with the data that it has."""
    if at == end:
        return  # an empty one
    if depth > _DEPTH:
        raise ValueError(f"arrays nest more than {_DEPTH} deep")
    kind, size, begin, at = _element(data, at, end)
    if (kind, size) != (6, 8):
        raise ValueError("an array has no flags")
    of = data[begin]
    kind, size, begin, at = _element(data, at, end)
    if kind != 5 or size % 4:
        raise ValueError("an array has no dimensions")
    shape = struct.unpack_from(f"<{size // 4}i", data, begin)
    if len(shape) < 2 or min(shape) < 0:
        raise ValueError(f"an array has the dimensions {shape}")
    count = math.prod(shape)
    _, _, _, at = _element(data, at, end)  # the name
    if of in (_CELL, _STRUCT):
        if of == _STRUCT:
            _, _, length, at = _element(data, at, end)
            longest = struct.unpack_from("<i", data, length)[0]
            _, names, _, at = _element(data, at, end)
            if longest < 1 or names % longest:
                raise ValueError("the names of a structure have no length")
            count *= names // longest
        if 8 * count > end - at:
            raise ValueError(f"a cell or structure claims {count} entries in {end - at} bytes")
        room.take(_OBJECT_BYTES * count)
        for _ in range(count):
            kind, _, begin, at = _element(data, at, end)
            if kind != _MATRIX:
                raise ValueError(f"an entry is of the kind {kind}, not an array")
            _matrix(data, begin, at, room, depth + 1)
        return
    if not _CHAR <= of <= _LAST or of == 5:
        raise ValueError(f"an array is of the class {of}, which no result has")
    kind, size, _, at = _element(data, at, end)
    # letters take one to four bytes in UTF-8
    if kind not in _SIZES or (size < count if of == _CHAR else size != count * _SIZES[kind]):
        raise ValueError(f"an array of the dimensions {shape} has {size} bytes of the kind {kind}")
    room.take((_CHAR_BYTES if of == _CHAR else 8) * count)
