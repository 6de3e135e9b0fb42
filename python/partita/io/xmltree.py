"""XML from untrusted sources: a small tree with line numbers, read by expat alone, which opens no other file.

Document types are refused as a whole, and with them entities; size, depth and count of elements are bounded.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import NoReturn
from xml.parsers import expat

from ..builder.checks import LARGEST
from ..errors import FileFormatError
from ..files import get, other
from ..limits import exceeded, limit

_LONG = 40
"""Characters of a value in a message."""


@dataclass
class Element:
    """An element: its tag, its attributes, its content, and the line where it begins, where that is known."""

    tag: str
    attributes: dict[str, str]
    line: int | None
    path: Path
    children: list[Element] = field(default_factory=list)
    pieces: list[str] = field(default_factory=list)

    @property
    def text(self) -> str:
        """All text directly inside it."""
        if len(self.pieces) > 1:
            self.pieces[:] = ["".join(self.pieces)]
        return self.pieces[0] if self.pieces else ""

    def all(self, *tags: str) -> Iterator[Element]:
        """Children of these tags, in the order of the file."""
        return (child for child in self.children if child.tag in tags)

    def first(self, tag: str) -> Element | None:
        """The first child of this tag."""
        return next(self.all(tag), None)

    def the(self, tag: str) -> Element:
        """The one child of this tag that must be there."""
        found = self.first(tag)
        return found if found is not None else self.fail(f"holds no <{tag}>")

    def get(self, key: str, otherwise: str = "") -> str:
        """An attribute."""
        return self.attributes.get(key, otherwise).strip()

    def must(self, key: str) -> str:
        """An attribute that must exist and not be empty."""
        found = self.get(key)
        return found if found else self.fail(f'has no attribute "{key}"')

    def numbers(self, key: str, count: int, otherwise: tuple[float, ...] | None = None) -> tuple[float, ...]:
        """This many finite numbers of an attribute."""
        if otherwise is not None and not self.get(key):
            return otherwise
        return numbers(self, f'"{key}"', self.must(key), count)

    def number(self, key: str, otherwise: float | None = None) -> float:
        """A finite number of an attribute."""
        return self.numbers(key, 1, None if otherwise is None else (otherwise,))[0]

    def fail(self, message: str) -> NoReturn:
        """Refuse the file because of this element."""
        name = f" {_short(self.get('name'))}" if self.get("name") else ""
        refuse(self.path, self.line, f"<{_cut(self.tag)}>{name} {message}")


def refuse(path: Path, line: int | None, message: str) -> NoReturn:
    """The file cannot be read."""
    where = f'"{path}", line {line}' if line is not None else f'"{path}"'
    raise FileFormatError(f"{where}: {message}", path=str(path), line=line)


def numbers(element: Element, what: str, words: str, count: int) -> tuple[float, ...]:
    """This many finite numbers of a text."""
    try:
        # Python reads 1_000 and digits of other scripts too; other programs do not
        if "_" in words or not words.isascii():
            raise ValueError
        given = words.split(None, count)
        found = tuple(float(word) for word in given[:count])
    except ValueError:
        element.fail(f"has {what} {_short(words)}, which is not made of numbers")
    if len(given) != count or not all(abs(x) < float("inf") for x in found):
        element.fail(f"has {what} {_short(words)}; it takes {count} finite number{'s' if count != 1 else ''}")
    if any(abs(x) > LARGEST for x in found):
        element.fail(f"has {what} {_short(words)}; magnitudes above {LARGEST:g} are not supported: use other units")
    return found


def is_zero(words: str) -> bool:
    """Whether a text is the number 0."""
    try:
        return float(words) == 0.0
    except ValueError:
        return False


def _short(words: str) -> str:
    return f'"{_cut(words)}"'


def _cut(words: str) -> str:
    return words if len(words) <= _LONG else f"{words[: _LONG - 3]}..."


class _Malformed(Exception):
    """What expat does not read; the message and the line."""


def parse(path: Path) -> Element:
    """The root of an XML file. Raises `FileFormatError` with the line of what is wrong.

    Two faults that other parsers of robots' files overlook are overlooked too: -- in comments, and text before the
    declaration.
    """
    content = get(path, "model_bytes")
    if not content.strip():
        refuse(path, None, "it is empty")
    if (kind := other(content)) is not None:
        refuse(path, None, kind)
    try:
        return _tree(path, content)
    except _Malformed as error:
        message, line = error.args
    try:
        return _tree(path, _without_comments(content))
    except _Malformed:
        refuse(path, line, message)


def _without_comments(content: bytes) -> bytes:
    """The same without comments and declaration, in the same lines. With CDATA, in which a comment is none, it stays
    as it is."""
    if b"<![CDATA[" in content:
        return content
    kept, at = [], 0
    while (begin := content.find(b"<!--", at)) >= 0 and (end := content.find(b"-->", begin + 4)) >= 0:
        kept += [content[at:begin], b"\n" * content.count(b"\n", begin, end)]
        at = end + 3
    plain = b"".join([*kept, content[at:]])
    return re.sub(rb"\A(\s+)<\?xml[^>]*\?>", rb"\1", plain)


def _tree(path: Path, content: bytes) -> Element:
    """The root of an XML text; raises `_Malformed` too."""
    parser = expat.ParserCreate(namespace_separator=None)
    parser.buffer_text = True
    parser.ordered_attributes = False
    stack: list[Element] = []
    roots: list[Element] = []
    count, elements_at_most, deepest = 0, limit("elements"), limit("depth")

    def begin(tag: str, attributes: dict[str, str]) -> None:
        nonlocal count
        count += 1
        if count > elements_at_most:
            refuse(path, parser.CurrentLineNumber, f"it has {exceeded('elements', count)}")
        if len(stack) >= deepest:
            refuse(path, parser.CurrentLineNumber, f"elements nest {exceeded('depth', len(stack) + 1)}")
        if (words := exceeded("attributes", len(attributes))) is not None:
            refuse(path, parser.CurrentLineNumber, f"<{_cut(tag)}> has {words}")
        element = Element(tag, attributes, parser.CurrentLineNumber, path)
        (stack[-1].children if stack else roots).append(element)
        stack.append(element)

    def text(data: str) -> None:
        if stack:
            stack[-1].pieces.append(data)

    def doctype(*_: object) -> None:
        refuse(path, parser.CurrentLineNumber, "a document type (<!DOCTYPE ...>) is not read: it may define entities")

    parser.StartElementHandler = begin
    parser.EndElementHandler = lambda _: stack.pop()
    parser.CharacterDataHandler = text
    parser.StartDoctypeDeclHandler = doctype
    parser.EntityDeclHandler = doctype
    try:
        parser.Parse(content, True)
    except expat.ExpatError as error:
        raise _Malformed(f"it is not well-formed XML: {expat.ErrorString(error.code)}", error.lineno) from error
    except FileFormatError:  # is a ValueError too, and says what is wrong
        raise
    except (ValueError, LookupError) as error:  # an encoding that is unknown, or that the content does not keep to
        refuse(path, parser.CurrentLineNumber, f"it cannot be decoded: {error}")
    return roots[0]
