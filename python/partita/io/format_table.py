"""The table of a file format: what becomes of each element and attribute. Readers walk a file by it.

What a table does not have is reported as unknown and taken out, so a reader sees only what its table says it applies.
An element that is applied or drawn is described by the context of its name, any other with all inside it by its row.
The page docs/formats.md is written from the same tables.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from .reading import Reading, Remark
from .xmltree import Element

APPLIED = "applied"
"""The model has it."""
COMPILED = "compiled"
"""Dropped where it acts; the reader says so of the compiled value, since defaults and other elements contribute."""
DROPPED = "dropped"
"""The model lacks it, and moves otherwise: a remark says what it would have done."""
BOUNDS = "bounds"
"""The model lacks it; it acts at limits, in contacts or when driven: a remark."""
OTHER = "not read"
"""The model lacks it and moves the same: a remark."""
LOOKS = "looks"
"""It is drawn, or is looks alone, with all inside it: no remark."""
NO_EFFECT = "no effect"
"""Nothing that moves depends on it, nor on what is inside it: no remark."""
REFUSED = "refused"
"""A file that has it is refused."""
RULES = (APPLIED, COMPILED, DROPPED, BOUNDS, OTHER, LOOKS, NO_EFFECT, REFUSED)

_KINDS = {DROPPED: "motion", BOUNDS: "bounds", OTHER: "other"}
"""Kinds of the remarks on what is dropped."""
_ITEM = re.compile(r"(@?[\w:.-]+|#)(\*?)(?:=([\w/]+))?(?:\(([^)]*)\))?(?:\[([\d.]*)-([\d.]*)\])?")
"""`@attribute`, `@first:` (all attributes of this namespace), `element`, `element*` (any number), `element=context`
(described under that name), `#` (text);
A context `whole`, which no table has, is an element with all inside it.
`(value)`: the default, `(0|none)` one of several; `[1.5-1.6]`: versions of the format."""
_LONG = 500
"""Characters of the content of an element in a remark; a report shows fewer."""
_NAMESPACES = ("xmlns", "xmlns:", "xml:")

Rows = tuple[tuple[str, str, str], ...]
"""Rules of a context: (rule, items, what they do)."""


@dataclass(frozen=True)
class Item:
    """What becomes of an element, an attribute or a text."""

    name: str
    rule: str
    effect: str
    context: str
    many: bool
    defaults: tuple[str, ...] | None
    since: tuple[int, ...]
    until: tuple[int, ...]

    def rank(self, version: tuple[int, ...] | None) -> int:
        """2 where this version of the format has it, 1 where only later ones have it, 0 where it is gone."""
        if version is None or self.since <= version <= (self.until or version):
            return 2
        return int(self.since > version)

    def is_default(self, value: str) -> bool:
        """Whether this value says what holds without it."""
        return self.defaults is not None and any(_same(value, default) for default in self.defaults)


class Table:
    """The rules of a format, by context: the kind of element in which something stands.

    A context `joint[fixed]` holds in addition, and before others, for elements `joint` of type "fixed". A context has
    also what those have that it is `like`, unless it says otherwise.
    """

    def __init__(
        self, kind: str, root: str, contexts: Mapping[str, Rows], like: Mapping[str, str] | None = None
    ) -> None:
        self.kind, self.root, self.like = kind, root, dict(like or {})
        self.contexts = {context: tuple(_items(rows)) for context, rows in contexts.items()}
        unknown = {item.rule for items in self.contexts.values() for item in items} - set(RULES)
        assert not unknown, unknown
        self._found: dict[tuple[str, str, tuple[int, ...] | None], dict[str, Item]] = {}

    def items(self, context: str, kind: str = "", version: tuple[int, ...] | None = None) -> Mapping[str, Item]:
        """What may stand in an element of this context and type, by name: `@attribute`, `element`, `#`."""
        key = (context, kind, version)
        if key not in self._found:
            rows = (*self._rows(context), *self.contexts.get(f"{context}[{kind}]", ()))
            self._found[key] = {}
            for least in (1, 2):
                self._found[key] |= {item.name: item for item in rows if item.rank(version) == least}
        return self._found[key]

    def _rows(self, context: str) -> tuple[Item, ...]:
        """The rows of a context, after those of what it is like."""
        above = self._rows(self.like[context]) if context in self.like else ()
        return (*above, *self.contexts.get(context, ()))

    def visit(self, root: Element, reading: Reading, version: tuple[int, ...] | None = None, cut: bool = True) -> None:
        """Report what is dropped or not known, refuse what is refused; `cut` takes all but what is applied or drawn out
        of the tree."""
        waiting = [(root, self.root, "")]
        while waiting:
            element, context, owner = waiting.pop()
            items = self.items(context, element.get("type"), version)
            where = _titled(element, owner)
            inside = "" if element is root else where
            for key, value in list(element.attributes.items()):
                if key.startswith(_NAMESPACES):
                    continue
                subject = f"{where} {key} {_short(value.strip())}".rstrip()
                item = items.get(f"@{key}") or items.get(f"@{key.partition(':')[0]}:")
                found = self._judge(reading, item, element, subject, value, version)
                if cut and not found:
                    del element.attributes[key]
            words = element.text.strip()
            if words and "#" not in items:
                self._judge(reading, None, element, f"{where} text {_short(words)}", words, version)
            seen: set[str] = set()
            kept: list[Element] = []
            inner: list[tuple[Element, str, str]] = []
            for child in element.children:
                item = items.get(child.tag) or items.get(f"{child.tag.partition(':')[0]}:")
                again = item is not None and not item.many and child.tag in seen
                seen.add(child.tag)
                subject = content(child, inside)
                if again and item is not None and item.rule != REFUSED:
                    text = f"more than one <{child.tag}>; the first is used"
                    reading.dropped.append(remark(reading, child, text, subject, "motion"))
                    continue
                if self._judge(reading, item, child, subject, _value(child), version):
                    kept.append(child)
                    if item is not None and item.context in self.contexts:
                        inner.append((child, item.context, inside))
            waiting += reversed(inner)
            if cut:
                element.children = kept

    def _judge(
        self,
        reading: Reading,
        item: Item | None,
        at: Element,
        subject: str,
        value: str,
        version: tuple[int, ...] | None,
    ) -> bool:
        """Whether this is read; else it is reported, where it says more than its default."""
        if item is None:
            kind = " ".join([self.kind, *([".".join(map(str, version))] if version else [])])
            reading.dropped.append(remark(reading, at, f"not known to {kind}, and ignored", subject, "unknown"))
            return False
        if item.rank(version) == 1:
            text = f"belongs to {self.kind} {'.'.join(map(str, item.since))} and later; it is read as there"
            reading.changed.append(remark(reading, at, text, subject, "changed"))
        if item.rule in (APPLIED, COMPILED, LOOKS):
            return True
        if item.rule == NO_EFFECT or item.is_default(value):
            return False
        if item.rule == REFUSED:
            at.fail(item.effect)
        reading.dropped.append(remark(reading, at, item.effect, subject, _KINDS[item.rule]))
        return False


def _items(rows: Rows) -> Iterator[Item]:
    for rule, names, effect in rows:
        at = 0
        while at < len(names):
            if names[at].isspace():
                at += 1
                continue
            found = _ITEM.match(names, at)
            assert found is not None, names[at:]
            name, many, context, default, since, until = found.groups()
            defaults = None if default is None else tuple(default.split("|"))
            bounds = (number(since or ""), number(until or ""))
            yield Item(name, rule, effect, context or name, bool(many), defaults, *bounds)
            at = found.end()


def remark(reading: Reading, at: Element, text: str, name: str, kind: str) -> Remark:
    """A remark on an element, which may stand in another file than the one that is read."""
    if at.path == reading.path:
        return Remark(at.line, text, name, kind)
    return Remark(None, text, f"{name} in {at.path.name}, line {at.line}", kind)


def number(version: str) -> tuple[int, ...]:
    """A version such as 1.10 as something that can be compared."""
    return tuple(int(word) for word in version.split(".") if word)


def _same(value: str, default: str) -> bool:
    """Whether two texts are the same words or numbers."""

    def plain(words: str) -> list[float | str]:
        found: list[float | str] = []
        for word in words.lower().split():
            try:
                found.append(float(word))
            except ValueError:
                found.append({"true": "1", "false": "0"}.get(word, word))
        return [{"1": 1.0, "0": 0.0}.get(x, x) if isinstance(x, str) else x for x in found]

    return plain(value) == plain(default)


def _titled(element: Element, owner: str) -> str:
    """What an element is called in a remark: with its name, or with those of the one that it belongs to."""
    name = element.get("name")
    if name:
        return f'{element.tag} "{name}"'
    return f"{owner} {element.tag}" if owner else f"<{element.tag}>"


def content(element: Element, owner: str = "") -> str:
    """An element with what it says, shortened."""
    inner: list[str] = []
    waiting = [element]
    while waiting and sum(map(len, inner)) <= _LONG:
        one = waiting.pop()
        words = [
            f"{key} {value.strip()}" for key, value in one.attributes.items() if one is not element or key != "name"
        ]
        words += [" ".join(one.text.split())] if one.text.strip() else []
        inner += [", ".join(words)] if one is element else [" ".join([one.tag, *words])]
        waiting += reversed(one.children)
    inner = [words for words in inner if words]
    title, inside = _titled(element, owner), ", ".join(inner)
    if len(inside) > _LONG or waiting:
        inside = f"{_short(inside)} {_size(element)} in all"
    return f"{title} ({inside})" if inside else title


def _size(element: Element) -> int:
    """How many elements and attributes an element has inside."""
    found, waiting = 0, [element]
    while waiting:
        one = waiting.pop()
        found += len(one.attributes) + len(one.children)
        waiting += one.children
    return found


def _value(element: Element) -> str:
    """The text of an element that has nothing else."""
    return "\0" if element.children or element.attributes else element.text


def _short(words: str) -> str:
    return words if len(words) <= _LONG else f"{words[: _LONG - 3]}..."
