"""Display in a notebook: small tables, every user text escaped."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape

LONGEST = 500
"""Letters of an entry."""
NAMES = 8
"""Names that are shown before the rest is counted."""
MOST_ROWS = 24
"""Coordinates of a state that are listed before the rest is counted."""


def table(title: str, rows: Iterable[tuple[str, str]]) -> str:
    """A table of two columns under a title."""
    body = "".join(
        f'<tr><th style="text-align:left">{_safe(name)}</th><td style="text-align:left">{_safe(entry)}</td></tr>'
        for name, entry in rows
    )
    return f"<table><caption><b>{_safe(title)}</b></caption><tbody>{body}</tbody></table>"


def lines(text: str) -> str:
    """Preformatted text."""
    return f'<pre style="white-space:pre-wrap">{escape(text)}</pre>'


def names(words: Sequence[str]) -> str:
    """How many, and the first of them."""
    shown = ", ".join(_cut(word, 40) for word in words[:NAMES])
    more = f" and {len(words) - NAMES} more" if len(words) > NAMES else ""
    return f"{len(words)}: {shown}{more}" if words else "none"


def _safe(text: str) -> str:
    return escape(_cut(text, LONGEST))


def _cut(text: str, longest: int) -> str:
    return text if len(text) <= longest else f"{text[: longest - 4]} ..."
