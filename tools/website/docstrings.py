"""Docstrings as Sphinx needs them: what they write as they like and docutils or napoleon would misread."""

from __future__ import annotations

import re

# Signs that docstrings use as they are and that mean something to docutils: bars, stars, underscores at a word's end.
_CODE = re.compile(r"(``.+?``|`[^`]+`)")
_SIGNS = re.compile(r"(?<!\\)([*|]|_(?=\W|$))")
# A page of docs/, as a docstring names it.
_PAGE = re.compile(r"(?<!`)\bdocs/([\w/-]+)\.md\b")
# Napoleon takes the words before a colon for a type, and docutils the words before the last space of a field's name;
# these two stand for colon and space until both are done.
COLON, SPACE = "\ue000", "\ue001"
_KIND = r"(?:[A-Z]\w*(?:Error|Warning)|Interrupted)"
_RAISED = re.compile(rf"(?:^|(?<=[.;] ))(?={_KIND}(?:, {_KIND})*: )")
_NAMES = re.compile(r"^( +)(\w+(?:, \w+)+)(?=:)")
_SECTION = re.compile(r"^(\w+):$")
# An array as NumPy spells its type out, with or without the signs by which Sphinx shortens names.
_ARRAY = re.compile(
    r"~?(?:numpy\.)?ndarray\[tuple\[~?(?:typing\.)?Any, \.\.\.\], ~?(?:numpy\.)?dtype\[~?(?:\w+\.)*(\w+)\]\]"
)


def literal(line: str) -> str:
    """A line of prose with those signs said literally; what stands between backticks is left alone."""
    pieces = _CODE.split(line)
    return "".join(p if n % 2 else _SIGNS.sub(r"\\\1", p) for n, p in enumerate(pieces))


def plain(lines: list[str]) -> list[str]:
    """Prose of a docstring with those signs said literally, and with links; examples and code are left alone."""
    found, example = [], False
    for line in lines:
        example = line.lstrip().startswith(">>>") or (example and bool(line.strip()))
        if not example and not line.lstrip().startswith((":", "..", "* ")):
            line = _PAGE.sub(r":doc:`/\1`", literal(line))
        found.append(line)
    return found


def sections(lines: list[str]) -> list[str]:
    """The sections of a docstring so that napoleon reads what they say: one entry for each error, attributes that are
    described together, prose under Returns."""
    found: list[str] = []
    at = 0
    while at < len(lines):
        head = _SECTION.match(lines[at])
        found.append(lines[at])
        at += 1
        if head is None:
            continue
        end = at
        while end < len(lines) and (lines[end].startswith(" ") or not lines[end].strip()):
            end += 1
        body, at = lines[at:end], end
        if head[1] == "Raises":
            body = raised(body)
        elif head[1] == "Attributes":
            body = [_NAMES.sub(lambda names: names[1] + names[2].replace(", ", f",{SPACE}"), line) for line in body]
        elif head[1] == "Returns":
            body = [line.replace(":", COLON) for line in body]
        found += body
    return found


def raised(lines: list[str]) -> list[str]:
    """The entries of a section Raises, each on a line of its own, with the blank lines that end it."""
    text = " ".join(line.strip() for line in lines if line.strip())
    entries = [entry.strip() for entry in _RAISED.split(text) if entry.strip()]
    return [f"    {entry}" for entry in entries] + ["" for line in lines if not line.strip()][:1]


def restored(line: str) -> str:
    """A line behind napoleon."""
    return line.replace(COLON, ":")


def short(annotation: str) -> str:
    """A type with arrays as they are written in the sources."""
    return _ARRAY.sub(r"NDArray[\1]", annotation)
