"""What is asked of an animated page, whatever it shows: nothing overlaps, nothing leaves, all can be read."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from chromium import DESKTOP, PHONE, Chromium

MOST_BYTES = 1_000_000
"""What a run of ten seconds may add to the viewer's own text."""

INSIDE = (326, 660, True)
"""A page inside a page of the site, on a phone."""

SCREENS = tuple((screen, scheme) for screen in (DESKTOP, PHONE) for scheme in ("light", "dark"))
EACH_ONCE = ((DESKTOP, "light"), (PHONE, "dark"))
"""Layouts follow from the screen, colours from the scheme."""

CONTRAST, LAYOUT = (
    Path(__file__).with_name(f"page_{what}.js").read_text(encoding="utf-8") for what in ("contrast", "layout")
)


def unreached(browser: Chromium) -> list[str]:
    """Controls of the page shown that the Tab key does not reach, and those that do not show the focus."""
    wanted = browser.value(
        "(window.all = [...document.querySelectorAll('button, select, input, canvas, summary, #bars')]"
        ".filter((e) => e.checkVisibility() && !e.disabled)).length"
    )
    reached, found = set(), []
    for _ in range(wanted + 4):
        browser.press("Tab")
        at, ring, text = browser.value(
            "[all.indexOf(document.activeElement), getComputedStyle(document.activeElement).outlineStyle,"
            " document.activeElement.outerHTML.slice(0, 60)]"
        )
        if at >= 0:
            reached.add(at)
            if ring == "none":
                found.append(f"no ring around {text}")
    if len(reached) < wanted:
        found.append(f"the keyboard reaches {len(reached)} of {wanted} controls")
    return found


def faults(
    browser: Chromium,
    path: Path,
    fixed: int,
    shots: Path | None = None,
    screens: Iterable[tuple[tuple[int, int, bool], str]] = SCREENS,
) -> list[str]:
    """What is wrong with a page on two screens, light and dark, at the start, the middle and the end of its run."""
    found: list[str] = []
    added = path.stat().st_size - fixed
    if added > MOST_BYTES:
        found.append(f"{added} bytes over the fixed part")
    for screen, scheme in screens:
        name = f"{'phone' if screen is PHONE else 'desktop'}, {scheme}"
        browser.open(path, screen, scheme)
        found += [f"{name}: {word}" for word in browser.value(CONTRAST)]
        if "from output to output" in (note := browser.value("document.getElementById('note').textContent")):
            found.append(f"{name}: outputs are too far apart for a motion that can be followed: {note}")
        first, last = browser.value("(() => { const d = []; for (const t of [0, 1e9]) { partita.show(t); "
                                    "d.push(partita.time()); } return d; })()")  # fmt: skip
        for part in (0.0, 0.37, 1.0):
            browser.value(f"partita.show({first + part * (last - first)!r})")
            browser.rest_a_frame()
            found += [f"{name}, {part:.0%}: {word}" for word in browser.value(LAYOUT)]
        if (screen, scheme) == SCREENS[0]:
            found += [f"{name}: {word}" for word in unreached(browser)]
        found += [f"{name}: console: {word}" for word in browser.reported]
        if shots is not None:
            browser.value("partita.show(0)")
            browser.rest_a_frame()
            browser.picture(shots / f"{path.stem}-{name.replace(', ', '-')}.png", whole=screen is PHONE)
    return found
