"""Common part of all pages: one file that loads nothing, with its data, style and scripts in it."""

from __future__ import annotations

import json
import sys
import tempfile
import webbrowser
from collections.abc import Mapping, Sequence
from html import escape
from importlib import resources
from pathlib import Path
from typing import Any

from .files import put

HEAD = """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta http-equiv="Content-Security-Policy" content="{allowed}">
<title>{title}</title>
<style>
{style}
</style>
</head>
<body>
"""


def whole_page(
    package: str,
    title: str,
    data: Mapping[str, Any],
    scripts: Sequence[str | tuple[str, str]],
    module: str | None = None,
    below: tuple[str, Sequence[str]] | None = None,
    connects: str = "",
) -> str:
    """The page of a package: its `page.html` (what is seen) and `style.css`, the data as JSON in an element "data",
    these scripts of it (or of another package, with its name) in one function, and a WebAssembly module in base 64 in
    an element "module". `{{TITLE}}` in what is seen stands for the title, which is escaped; data are escaped so that
    they cannot end their element. `below`: another package, whose style and these scripts come first. `connects`: what
    the page may load besides, in the words of a content security policy; of pages that are files nothing.
    """
    allowed = "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'"
    if module is not None:
        allowed += " 'wasm-unsafe-eval'"
    if connects:
        allowed += f"; {connects}"
    other, shared = below or (package, ())
    style = "\n".join(part_of(name, "style.css") for name in dict.fromkeys((other, package)))
    parts = [
        HEAD.format(allowed=allowed, title=escape(title), style=style),
        part_of(package, "page.html").replace("{{TITLE}}", escape(title)),
        # Inside a script element only "<" could end the data early; JSON allows it escaped.
        _element("application/json", "data", json.dumps(data, allow_nan=False, separators=(",", ":"))),
    ]
    if module is not None:
        parts.append(_element("application/wasm", "module", module))
    # a module is compiled while the page loads, and awaited
    start = "(function () {" if module is None else "(async function () {"
    own = [(package, script) if isinstance(script, str) else script for script in scripts]
    files = [("partita", "tolerance.js"), *((other, name) for name in shared), *own]
    lines = [part_of(*file) for file in files]
    parts += ["<script>", start, '"use strict";', *lines, "}());", "</script>"]
    return "\n".join([*parts, "</body>", "</html>", ""])


def part_of(package: str, name: str) -> str:
    """A file of a package."""
    return resources.files(package).joinpath(name).read_text(encoding="utf-8")


def _element(kind: str, name: str, text: str) -> str:
    return f'<script type="{kind}" id="{name}">' + text.replace("<", "\\u003c") + "</script>"


class Page:
    """A page that was opened: `path` is its file; in a notebook it displays itself."""

    def __init__(self, path: Path, html: str) -> None:
        self.path = path
        self._html = html

    def _repr_html_(self) -> str:
        """The page in a frame of its own."""
        return (
            f'<iframe srcdoc="{escape(self._html, quote=True)}" title="mechanism" '
            f'style="width:100%;height:520px;border:1px solid #8888"></iframe>'
        )

    def __repr__(self) -> str:
        return f"<page {self.path}>"


def opened(html: str) -> Page:
    """The page in a temporary file, opened in the browser; in a notebook the cell displays it."""
    page = Page(put(Path(tempfile.mkdtemp(prefix="partita-")) / "mechanism.html", html.encode("utf-8")), html)
    if not in_notebook():
        webbrowser.open(page.path.as_uri())
    return page


def in_notebook() -> bool:
    """Whether a kernel of Jupyter displays what a cell returns."""
    shell = getattr(sys.modules.get("IPython"), "get_ipython", lambda: None)()
    return shell is not None and hasattr(shell, "kernel")
