"""The links of a rendered site: each leads to a file and a place in it, and nothing is fetched to draw a page."""

from __future__ import annotations

from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

# What a browser fetches by itself; the rest waits for a click.
FETCHED = {("script", "src"), ("img", "src"), ("iframe", "src"), ("source", "src")}
# The reference of the core: its pages are checked by rustdoc.
OTHERS = "rust"
# Animated pages, and what may stand behind # that is no place in them: they begin to move.
LIVE, SAID = "live", {"play"}


class Page(HTMLParser):
    """Ids and links of one page."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.ids: set[str] = set()
        self.links: list[tuple[str, bool]] = []
        self.feed(path.read_text("utf-8"))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Collect what the tag is called and where it leads."""
        given = {name: value or "" for name, value in attrs}
        self.ids |= {given[key] for key in ("id", "name") if key in given}
        loaded = tag == "link" and given.get("rel") in ("stylesheet", "icon", "preload")
        for key in ("href", "src"):
            if key in given:
                self.links.append((given[key], loaded or (tag, key) in FETCHED))


def broken_links(site: Path) -> list[str]:
    """A line for each link that leads nowhere, or that a browser would need a network for."""
    paths = [path for path in sorted(site.rglob("*.html")) if path.relative_to(site).parts[0] != OTHERS]
    if not paths:
        return [f"{site} holds no pages"]
    pages = {path.resolve(): Page(path) for path in paths}
    return [
        f"{path.relative_to(site.resolve())}: {what}"
        for path, page in pages.items()
        for what in _wrong(path, page, pages)
    ]


def _wrong(path: Path, page: Page, pages: dict[Path, Page]) -> Iterator[str]:
    for link, fetched in dict.fromkeys(page.links):
        parts = urlsplit(link)
        if parts.scheme or parts.netloc:
            if fetched and parts.scheme != "data":
                yield f"fetches {link}"
            continue
        target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
        if not target.is_file():
            yield f"{link} leads nowhere"
        elif target.parent.name == LIVE and parts.fragment in SAID:
            continue
        elif parts.fragment and target in pages and unquote(parts.fragment) not in pages[target].ids:
            yield f"{link} names a place that is not there"
