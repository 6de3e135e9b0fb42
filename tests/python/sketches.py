"""Drawings by their elements, and someone who draws them on the page."""

import json
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from chromium import DESKTOP, Chromium

import partita as pt
from partita.sketch.drawing import EMPTY

TIGHT = {"rtol": 1e-13, "atol": 1e-14}


def drawing(**tables: Any) -> dict[str, Any]:
    """A drawing by its elements, numbered through; places are given by name."""
    data, number, ids = json.loads(json.dumps(EMPTY)), 0, dict[str, int]()
    for table in ("nodes", "bars", "slides", "motors", "springs"):
        for one in tables.get(table, ()):
            number += 1
            ids[one["name"]] = number
            links = {key: ids[one[key]] for key in ("a", "b", "node", "bar", "along") if one.get(key) is not None}
            more = {"more": [ids[x] for x in one["more"]]} if "more" in one else {}
            data[table].append({**one, **links, **more, "id": number})
    return data | {"gravity": tables.get("gravity", 9.81)}


def place(name: str, x: float, y: float, ground: bool = False) -> dict[str, Any]:
    return {"name": name, "x": x, "y": y, "ground": ground}


def bar(name: str, a: str, b: str, *more: str, mass: float = 1.0, length: float | None = None) -> dict[str, Any]:
    return {"name": name, "a": a, "b": b, "more": list(more), "mass": mass, "length": length}


def slide(name: str, node: str, along: str | None) -> dict[str, Any]:
    return {"name": name, "node": node, "along": along, "angle": 0.0, "mass": 0.4}


FOUR = {
    "nodes": [place("A", 0, 0, True), place("B", 0, 0.5), place("C", 1.8, 1.0), place("D", 1.5, 0, True)],
    "bars": [bar("crank", "A", "B"), bar("coupler", "B", "C"), bar("rocker", "D", "C")],
}
SLIDER = {
    "nodes": [place("A", 0, 0, True), place("B", 0, 0.5), place("C", 1.5, 0.0), place("E", 2.5, 0.2)],
    "bars": [bar("crank", "A", "B"), bar("rod", "B", "C")],
    "slides": [slide("guide", "C", None)],
    "motors": [{"name": "motor", "node": "A", "bar": "crank", "rate": 3.0}],
    "springs": [
        {"name": "spring", "a": "C", "b": "E", "stiffness": 40.0, "damping": 1.0, "length": 0.9},
    ],
}
# a slotted lever: the block of the crank slides along the lever
QUICK = {
    "nodes": [place("O", 0, 0, True), place("P", 0, -1, True), place("B", 0.4, 0.1), place("T", 0.7, 0.9)],
    "bars": [bar("crank", "O", "B"), bar("lever", "P", "T")],
    "slides": [slide("slot", "B", "lever")],
    "motors": [{"name": "motor", "node": "O", "bar": "crank", "rate": -2.0}],
}
# crossed bars with a pin on both, a motor between two moving bars
SCISSOR = {
    "nodes": [
        place("A", 0, 0, True),
        place("B", 1, 1),
        place("C", 0, 1),
        place("D", 1, 0),
        place("M", 0.5, 0.5),
    ],
    "bars": [bar("one", "A", "B", "M"), bar("two", "D", "C", "M")],
    "slides": [slide("floor", "D", None)],
    "motors": [{"name": "motor", "node": "M", "bar": "one", "rate": 0.3}],
}
LOADED = (
    "(async () => { for (let i = 0; !window.drawing && i < 1000; i++) await new Promise((r) => setTimeout(r, 10)); })()"
)
"""Until the page that holds the core has unpacked it."""
DRAWN = {"four-bar": FOUR, "slider-crank": SLIDER, "quick return": QUICK, "scissor": SCISSOR}


def poses(m: pt.Mechanism, seconds: float) -> np.ndarray:
    run = m.simulate(seconds, **TIGHT)
    assert run.success
    return np.array([[*run.body(b).position[-1], *np.ravel(run.body(b).rotation[-1])] for b in run.names.bodies])


class User:
    """Someone who draws: places in metres."""

    def __init__(
        self,
        browser: Chromium,
        screen: tuple[int, int, bool] = DESKTOP,
        scheme: str = "light",
        static: Path | None = None,
    ) -> None:
        """`static`: the page as a file, instead of the one that is served."""
        self.browser, self.page = browser, pt.draw(browser=False)
        browser.open(static or self.page.url, screen, scheme)
        if static:  # the core is unpacked after the page is loaded
            browser.value(LOADED)

    def __enter__(self) -> "User":
        return self

    def __exit__(self, *ended: object) -> None:
        self.browser.open("about:blank")
        self.page.close()

    def pixel(self, at: tuple[float, float]) -> tuple[float, float]:
        x, y = self.browser.value(
            f"(() => {{ const p = drawing.picture.pixel({list(at)}), view = document.getElementById('view'),"
            " b = view.getBoundingClientRect(); return [p.x + b.left, p.y + b.top]; })()"
        )
        return x, y

    def tool(self, name: str) -> None:
        self.browser.value(f"document.querySelector('[data-tool={name}]').click()")

    def drag(self, tool: str, *points: tuple[float, float]) -> None:
        self.tool(tool)
        ends = [self.pixel(at) for at in points]
        between = [((2 * a[0] + b[0]) / 3, (2 * a[1] + b[1]) / 3) for a, b in pairwise(ends)]
        self.browser.drag(ends[0], *between, *ends[1:])

    def press(self, name: str) -> None:
        self.browser.value(f"document.getElementById('{name}').click()")

    def put(self, words: str, value: float) -> None:
        self.browser.value(
            f"(() => {{ const x = document.getElementById('field-{words}'); x.value = '{value}';"
            " x.dispatchEvent(new Event('change')); })()"
        )

    def data(self) -> dict[str, Any]:
        found: dict[str, Any] = self.browser.value("drawing.sketch.data")
        return found

    def settled(self) -> None:
        """Until the core has been heard about the drawing as it is."""
        for _ in range(600):
            if not self.browser.value("drawing.link.waiting"):
                return
            self.browser.value("new Promise((r) => setTimeout(r, 50))")
        raise AssertionError("the core was not heard")

    def answer(self) -> dict[str, Any]:
        """What the core says once it has been asked about the drawing as it is."""
        self.browser.value("drawing.link.ask()")
        found: dict[str, Any] = self.browser.value("drawing.answer()")
        return found

    def four_bar(self) -> None:
        self.drag("bar", (0, 0), (0, 0.5))
        self.drag("bar", (0, 0.5), (1.5, 1.0))
        self.drag("bar", (1.5, 1.0), (1.5, 0))
        self.drag("ground", (0, 0))
        self.drag("ground", (1.5, 0))
