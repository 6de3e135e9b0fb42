"""The page of a model file: what it shows after each save, and the error where the file cannot be shown."""

from __future__ import annotations

import json
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..errors import PartitaError
from ..mechanism import Mechanism
from ..mechanism.check import Check
from ..serving import HTML, JSON, Content, serving
from ..webpage import whole_page

LOOKED_EVERY = 0.2
"""Seconds between two looks at the file."""
PATIENCE = 20.0
"""Seconds that a question of the page waits for news."""
AROUND = 2
"""Lines of the file shown before and after the one that is wrong."""
SCRIPTS = ("watch.js",)
Drawn = tuple[str, Check]
"""A page as text, and the findings on the mechanism."""


@dataclass(frozen=True)
class Shown:
    """What the page shows since a save."""

    number: int
    at: str
    message: str
    remarks: tuple[str, ...] = ()
    error: bool = False
    excerpt: tuple[tuple[int, str], ...] = ()
    line: int | None = None
    page: int = 0

    @property
    def data(self) -> dict[str, Any]:
        """For the page."""
        return {**self.__dict__, "remarks": list(self.remarks), "excerpt": [list(x) for x in self.excerpt]}


class WatchPage:
    """A page of a file. `follow` looks at the file and draws until it is interrupted.

    `drawn` makes the page of a mechanism; `loaded` reads the file.
    """

    def __init__(
        self,
        path: Path,
        loaded: Callable[[], Mechanism],
        drawn: Callable[[Mechanism], Drawn],
        port: int = 0,
    ) -> None:
        self.path, self._loaded, self._drawn = path, loaded, drawn
        self._news = threading.Condition()
        self._shown = Shown(0, "", "reading the file")
        self._pages: dict[int, bytes] = {}
        self._server = serving(Content(self._read), port, "partita watch")

    @property
    def url(self) -> str:
        """Address of the page."""
        return self._server.url

    def close(self) -> None:
        """Stop serving."""
        with self._news:
            self._news.notify_all()
        self._server.end()

    def follow(self, report: Callable[[Shown], None]) -> None:
        """Draw the file now and after each save, until Ctrl+C; `report` is called after each."""
        before: tuple[int, int] | None = None
        while True:
            now = self._stamp()
            if now != before:
                before = now
                report(self.look())
            time.sleep(LOOKED_EVERY)

    def look(self) -> Shown:
        """Read the file and draw it; what is wrong with it is shown on the page."""
        at, number = time.strftime("%H:%M:%S"), self._shown.number + 1
        try:
            page, findings = self._drawn(self._loaded())
            shown = Shown(number, at, _counted(findings), tuple(findings.remarks), page=number)
            pages = {number: page.encode("utf-8")}
        except PartitaError as error:
            line = getattr(error, "line", None)
            shown = Shown(number, at, error.message, (), True, self._around(line), line, self._shown.page)
            pages = self._pages  # the last one that could be drawn stays
        with self._news:
            self._shown, self._pages = shown, pages
            self._news.notify_all()
        return shown

    def _stamp(self) -> tuple[int, int] | None:
        """What changes when the file is saved; None where it is missing, as for an instant while some editors save."""
        try:
            about = self.path.stat()
        except OSError:
            return None
        return about.st_mtime_ns, about.st_size

    def _around(self, line: int | None) -> tuple[tuple[int, str], ...]:
        """The lines of the file about one of them."""
        try:
            lines = self.path.read_text(encoding="utf-8", errors="replace").splitlines()
        except OSError:
            return ()
        if line is None or not 1 <= line <= len(lines):
            return ()
        first, last = max(1, line - AROUND), min(len(lines), line + AROUND)
        return tuple((i, lines[i - 1]) for i in range(first, last + 1))

    def _read(self, path: str) -> tuple[bytes, str] | None:
        if path == "":
            allowed = "connect-src 'self'; frame-src 'self'"
            data = {"file": self.path.name}
            return whole_page(__package__, self.path.name, data, SCRIPTS, connects=allowed).encode("utf-8"), HTML
        what, _, number = path.partition("/")
        if not number.isascii() or not number.isdigit():
            return None
        if what == "since":
            with self._news:
                self._news.wait_for(lambda: self._shown.number != int(number), PATIENCE)
                return json.dumps(self._shown.data, allow_nan=False).encode("utf-8"), JSON
        page = self._pages.get(int(number)) if what == "page" else None
        return None if page is None else (page, HTML)


def _counted(findings: Check) -> str:
    """Degrees of freedom and redundancy in a line, or why the loops do not close."""
    if not findings.closes or findings.report is None:
        return f"does not close: {findings.why}"
    report = findings.report.to_dict()
    mobility, redundant = report["mobility"], report["joint_rows"] - report["joint_rank"]
    words = f"{mobility} degree{'' if mobility == 1 else 's'} of freedom"
    return f"{words}, {redundant} of {report['joint_rows']} constraints redundant" if redundant else words
