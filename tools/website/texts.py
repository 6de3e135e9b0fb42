"""Texts of all pages in one script: with it a search from disk shows excerpts, where pages cannot read each other."""

from __future__ import annotations

import json
from html.parser import HTMLParser
from pathlib import Path

FILE = "texts.js"
_ALONE = {"area", "base", "br", "col", "embed", "hr", "img", "input", "link", "meta", "source", "track", "wbr"}
_INLINE = {"a", "abbr", "b", "code", "em", "i", "kbd", "span", "strong", "sub", "sup"}  # words go on through them


class _Reader(HTMLParser):
    """The text of what a page has to say, in pieces that begin where something can be linked to."""

    def __init__(self) -> None:
        super().__init__()
        self.pieces: list[tuple[str, list[str]]] = []
        self.open: list[str] = []
        self.main = 0
        self.hidden = 0

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self._part(tag)
        if tag in _ALONE:
            return
        about = dict(attrs)
        self.open.append(tag)
        depth = len(self.open)
        if about.get("role") == "main" and not self.main:
            self.main = depth
            self.pieces.append(("", []))
        elif self.main and about.get("id"):
            self.pieces.append((str(about["id"]), []))
        if not self.hidden and (tag in ("script", "style") or "headerlink" in (about.get("class") or "").split()):
            self.hidden = depth

    def handle_endtag(self, tag: str) -> None:
        self._part(tag)
        if tag in _ALONE or tag not in self.open:
            return
        while self.open.pop() != tag:
            pass
        depth = len(self.open)
        self.hidden = 0 if depth < self.hidden else self.hidden
        self.main = -1 if self.main > 0 and depth < self.main else self.main

    def handle_data(self, data: str) -> None:
        if self.main > 0 and not self.hidden:
            self.pieces[-1][1].append(data)

    def _part(self, tag: str) -> None:
        """Words of two blocks are two, however close their tags stand."""
        if self.main > 0 and tag not in _INLINE:
            self.pieces[-1][1].append(" ")


def pieces(html: str) -> list[list[str]]:
    """[anchor, text] of a page in its order; the first anchor is empty."""
    reader = _Reader()
    reader.feed(html)
    found = [[anchor, " ".join("".join(words).split())] for anchor, words in reader.pieces]
    return [[anchor, text] for anchor, text in found if text or not anchor]


def write(site: Path) -> None:
    """Put the script beside the others of a rendered site."""
    found = {}
    for page in sorted(site.rglob("*.html")):
        name = page.relative_to(site)
        if name.parts[0] in ("live", "rust", "files", "_static") or name.name in ("search.html", "genindex.html"):
            continue
        found[name.as_posix()] = pieces(page.read_text(encoding="utf-8"))
    text = json.dumps(found, ensure_ascii=False, separators=(",", ":")).replace("\u2028", " ").replace("\u2029", " ")
    (site / "_static" / FILE).write_text(f"window.partitaTexts={text};\n", encoding="utf-8")
