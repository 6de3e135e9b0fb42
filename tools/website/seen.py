"""The rendered site in a browser: every page on a desktop and a phone, light and dark, and the search tried."""

from __future__ import annotations

import functools
import http.server
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from time import monotonic, sleep
from typing import Any
from urllib.parse import quote

QUESTIONS = Path(__file__).with_name("site_page.js").read_text(encoding="utf-8")

# What people type into the search box -> where one of the first results must lead.
SEARCHES = {
    "simulate": "reference/mechanism/mechanism-runs.html#partita.Mechanism.simulate",
    "Result.joint": "reference/results/result.html#partita.Result.joint",
    "add_revolute": "reference/mechanism/mechanism-joints.html#partita.Mechanism.add_revolute",
    "Certificate": "reference/results/certificate.html#partita.results.Certificate",
    "inertia of a disc": "find.html#inertia-of-a-disc",
    "contact": "find.html#contact",
    "flexible": "find.html#flexible-bodies",
    "events": "find.html#events",
    "control": "find.html#control",
    "CAD": "find.html#cad",
    "over-constrained": "",
    "redundant": "",
}
FIRST = 3
"""Among so many results the right one must stand."""
PATIENCE = 20.0
"""Seconds that a page may take to answer."""


class _Quiet(http.server.SimpleHTTPRequestHandler):
    """Hands out files without a word."""

    def log_message(self, format: str, *args: Any) -> None:
        """Nothing."""


@contextmanager
def served(site: Path) -> Iterator[str]:
    """The address of the site on this machine, as long as the block lasts."""
    handler = functools.partial(_Quiet, directory=str(site))
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        thread = threading.Thread(target=server.serve_forever, daemon=True)
        thread.start()
        try:
            yield f"http://127.0.0.1:{server.server_port}/"
        finally:
            server.shutdown()
            thread.join()


def faults(site: Path, chromium: Any, shots: Path | None = None) -> list[str]:
    """A line for each thing that a reader would stumble over. `chromium` is the module that drives the browser."""
    found: list[str] = []
    with served(site) as address, chromium.Chromium() as browser:
        for page in pages(site):
            found += _page(browser, address, page, chromium)
        for page in [*pages(site, "gallery"), *pages(site, "guide"), "index.html"]:
            found += _live(browser, address, page, chromium)
        found += _playground(browser, address, "playground.html", chromium)
        for words, wanted in SEARCHES.items():
            found += _search(browser, address, words, wanted)
        if shots is not None:
            pictures(browser, address, site, shots, chromium)
        found += _offline(browser, site, chromium)
    return found


def pages(site: Path, under: str = "") -> list[str]:
    """Addresses of the pages, relative to the site: those that Sphinx made."""
    apart = {"live", "rust", "files", "_static"}
    found = [path.relative_to(site) for path in sorted((site / under).rglob("*.html"))]
    wanted = [path for path in found if path.parts[0] not in apart]
    return [path.as_posix() for path in wanted if not (under and path.name == "index.html")]


def _page(browser: Any, address: str, page: str, chromium: Any) -> list[str]:
    """A page on both screens in both schemes; of the gallery, whose pages are alike, on two of the four."""
    every = [(s, c) for s in (chromium.DESKTOP, chromium.PHONE) for c in ("light", "dark")]
    alike = page.startswith("gallery/") and not page.endswith("index.html")
    found: list[str] = []
    for screen, scheme in every[1:3] if alike else every:
        browser.open(address + quote(page), screen, scheme)
        where = f"{page}, {'phone' if screen is chromium.PHONE else 'desktop'}, {scheme}"
        found += [f"{where}: {word}" for word in browser.value(QUESTIONS)]
        found += [f"{where}: console: {word}" for word in browser.reported]
    return found


def _live(browser: Any, address: str, page: str, chromium: Any) -> list[str]:
    """The animated page inside a page of the gallery or the guide: is it there, and does it move?"""
    browser.open(address + quote(page), chromium.DESKTOP)
    live = "document.querySelector('iframe.live')"
    frame = f"{live}.contentWindow.partita"
    if not browser.value(f"!!{live}"):
        return [f"{page}: no animated page in it"]
    found = []
    if browser.value(f"{live}.getBoundingClientRect().top < window.innerHeight"):
        if not _started(browser, frame):
            return [f"{page}: its animated page does not start"]
        if (down := browser.value("window.scrollY")) > 0:
            found.append(f"{page}: it opens {down:.0f} px below its title")
    browser.value(f"{live}.scrollIntoView()")
    if not _started(browser, frame):
        return [f"{page}: its animated page does not start"]
    moved = browser.value(f"(() => {{ {frame}.show(0); const a = {frame}.time(); {frame}.show(1e9); "
                          f"return {frame}.time() - a; }})()")  # fmt: skip
    if not moved > 0.0:
        found.append(f"{page}: its animated page has no time to go through")
    if not browser.value(f"{frame}.size()[0] > 100 && {frame}.size()[1] > 100"):
        found.append(f"{page}: its drawing is too small to see")
    return found + [f"{page}: console: {word}" for word in browser.reported]


def _playground(browser: Any, address: str, page: str, chromium: Any) -> list[str]:
    """The playground inside a page: does it run?"""
    browser.open(address + quote(page), chromium.DESKTOP)
    browser.value("document.querySelector('iframe.live')?.scrollIntoView()")
    frame = "document.querySelector('iframe.live')?.contentWindow.playground"
    if not _started(browser, frame):
        return [f"{page}: its playground does not start"]
    sleep(0.5)
    found = [] if browser.value(f"{frame}.motion.t > 0") else [f"{page}: its playground does not move"]
    return found + [f"{page}: console: {word}" for word in browser.reported]


def _started(browser: Any, frame: str) -> bool:
    """Wait for a page inside another one; whether it came."""
    until = monotonic() + PATIENCE
    while not browser.value(f"!!{frame} && {frame.rpartition('.')[0]}.document.readyState === 'complete'"):
        if monotonic() > until:
            return False
        sleep(0.05)
    browser.rest_a_frame()
    return True


def results(browser: Any, address: str, words: str) -> list[str]:
    """Where the results of a search lead, in their order, relative to the site."""
    browser.open(f"{address}search.html?q={quote(words)}")
    until, before = monotonic() + PATIENCE, -1
    while monotonic() < until:
        count = browser.value("document.querySelectorAll('#search-results li').length")
        done = browser.value("/found|did not match/i.test(document.querySelector('#search-results').innerText)")
        if done and count == before:
            break
        before = count
        sleep(0.2)
    found = browser.value("[...document.querySelectorAll('#search-results li > a')].map((a) => a.href)")
    return [str(link).partition("?")[0].removeprefix(address) + _anchor(str(link)) for link in found]


def _anchor(link: str) -> str:
    query, _, place = link.partition("#")
    return f"#{place}" if place and "?" in query else ""


def _search(browser: Any, address: str, words: str, wanted: str) -> list[str]:
    """Whether what is searched for stands among the first results."""
    found = results(browser, address, words)
    if not found:
        return [f'the search finds nothing for "{words}"']
    if wanted and wanted not in found[:FIRST]:
        return [f'the search for "{words}" finds {", ".join(found[:FIRST])} before {wanted}']
    return [f'the search for "{words}": console: {word}' for word in browser.reported]


def _offline(browser: Any, site: Path, chromium: Any) -> list[str]:
    """From the disk and without a network: formulas are drawn, and nothing is asked for."""
    browser.ask("Network.enable")
    browser.ask("Network.emulateNetworkConditions", offline=True, latency=0, downloadThroughput=0, uploadThroughput=0)
    browser.open(site / "formulations.html", chromium.DESKTOP)
    drawn = browser.value("[...document.querySelectorAll('.math math')].map((e) => e.getBoundingClientRect().height)")
    found = [f"formulations.html, offline: console: {word}" for word in browser.reported]
    if not drawn or min(drawn) < 2:
        found.append("formulations.html, offline: a formula is not drawn")
    browser.open(site / "search.html", chromium.DESKTOP)
    if not browser.value("Boolean(document.getElementById('search-field')?.checkVisibility())"):
        found.append("search.html without a question: no field for one")
    for words in ("simulate", "redundant"):
        browser.open(site / "search.html", chromium.DESKTOP, "light", f"?q={words}")
        if not any(words in text.lower() for text in excerpts(browser)):
            found.append(f'search.html from disk: no excerpt for "{words}"')
    return found


def excerpts(browser: Any) -> list[str]:
    """The excerpts on a page of results, as soon as there is one for each of the first results."""
    until = monotonic() + PATIENCE
    while monotonic() < until:
        found: list[str] = browser.value(
            "[...document.querySelectorAll('#search-results p.context')].map((p) => p.innerText)"
        )
        if len(found) >= FIRST:
            return found
        sleep(0.2)
    return []


def pictures(browser: Any, address: str, site: Path, shots: Path, chromium: Any) -> None:
    """Every page outside the gallery as a picture, to be looked at."""
    shots.mkdir(parents=True, exist_ok=True)
    for page in pages(site):
        if page.startswith(("gallery/", "decisions/0")) and page not in ("gallery/index.html", "gallery/four-bar.html"):
            continue
        for screen, scheme in ((chromium.DESKTOP, "light"), (chromium.PHONE, "dark")):
            browser.open(address + quote(page), screen, scheme)
            kind = "phone" if screen is chromium.PHONE else "desktop"
            browser.picture(shots / f"{page.removesuffix('.html').replace('/', '-')}-{kind}.png", whole=True)
