"""Common part of all pages: one file that loads nothing, with its data, style and scripts in it."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from html import escape
from importlib import resources
from typing import Any

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
    package: str, title: str, data: Mapping[str, Any], scripts: Sequence[str], module: str | None = None
) -> str:
    """The page of a package: its `page.html` (what is seen) and `style.css`, the data as JSON in an element "data",
    these scripts of it in one function, and a WebAssembly module in base 64 in an element "module". `{{TITLE}}` in
    what is seen stands for the title, which is escaped; data are escaped so that they cannot end their element.
    """
    allowed = "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'"
    if module is not None:
        allowed += " 'wasm-unsafe-eval'"
    parts = [
        HEAD.format(allowed=allowed, title=escape(title), style=part_of(package, "style.css")),
        part_of(package, "page.html").replace("{{TITLE}}", escape(title)),
        # Inside a script element only "<" could end the data early; JSON allows it escaped.
        _element("application/json", "data", json.dumps(data, allow_nan=False, separators=(",", ":"))),
    ]
    if module is not None:
        parts.append(_element("application/wasm", "module", module))
    # a module is compiled while the page loads, and awaited
    start = "(function () {" if module is None else "(async function () {"
    parts += ["<script>", start, '"use strict";', *(part_of(package, name) for name in scripts), "}());", "</script>"]
    return "\n".join([*parts, "</body>", "</html>", ""])


def part_of(package: str, name: str) -> str:
    """A file of a package."""
    return resources.files(package).joinpath(name).read_text(encoding="utf-8")


def _element(kind: str, name: str, text: str) -> str:
    return f'<script type="{kind}" id="{name}">' + text.replace("<", "\\u003c") + "</script>"
