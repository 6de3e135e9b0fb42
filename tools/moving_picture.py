"""Mechanisms in motion as small animated SVGs: the picture at the top of the README, and its tiles; `make picture`.

Each body is a group that the picture moves through the poses of one turn of its crank; arrows are reactions. Planar
mechanisms only: seen along their normal, a body is a shape that slides and turns.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Sequence
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import partita as pt
from partita.viewer import scene
from partita.viewer.pose import Pose

Floats = NDArray[np.float64]

ROOT = Path(__file__).parents[1]
WHERE = ROOT / "docs" / "pictures" / "moving.svg"
SPACE = "http://www.w3.org/2000/svg"
POSES = 60
"""Of one turn: six degrees each."""
SECONDS = 5.0
"""Of one turn, on the screen and in the mechanism."""
FOREVER = f'dur="{SECONDS:g}s" repeatCount="indefinite"'
WIDTH, HEIGHT, MARGIN = 900, 330, 26
TILE = 300, 220
"""Width and height of a tile."""
TILES = (
    ("jansen-leg", "O"),
    ("engine-radial-five", "main"),
    ("klann-leg", "M"),
    ("windscreen-wiper", "A"),
    ("jaw-crusher", "A"),
    ("hoekens", "A"),
)
"""Mechanisms of the tiles, and the joint of each that turns once."""
ROD = 13
LONGEST = 74
"""Pixels of the largest reaction."""
MACHINES = (("jansen-pair", "O"), ("engine-v-twin", "main"))
"""Mechanisms side by side, and the joint that turns once."""

STYLE = """
.edge{stroke:#3c4854;stroke-width:1.4}.ground{stroke:#7a8690;stroke-width:1.6;fill:none}
.foot{fill:#eef1f4;stroke:#7a8690;stroke-width:1.3}.pin{fill:#f4f6f8;stroke:#3c4854;stroke-width:1.6}
.path{fill:none;stroke:#7d93a8;stroke-width:1.2}.force{stroke:#c4362d;stroke-width:2.4;fill:none}.head{fill:#c4362d}
@media (prefers-color-scheme:dark){.edge{stroke:#0a0d10}.foot{fill:#2a333b}.path{stroke:#6f8aa3}
.force{stroke:#ff7a6e}.head{fill:#ff7a6e}}
"""
COLOURS = ("#8fb0d0", "#a3c4a0", "#d3bd8c", "#b3a6d0", "#8fc2c2", "#d0a3b0", "#b7c48c", "#a5b1bf")


def turning(name: str, joint: str) -> Any:
    """One turn of a mechanism at constant speed, with its reactions."""
    entry = pt.catalogue.entry(name)
    m = entry.mechanism()
    for force in [force for force in m.forces.values() if force.kind == "torque"]:
        force.remove()
    m.add_drive(joint, velocity=2.0 * np.pi / SECONDS)
    start = m.assemble(rates={joint: 2.0 * np.pi / SECONDS})
    run = m.simulate(SECONDS, initial=start, t_eval=np.linspace(0.0, SECONDS, POSES + 1))
    assert run.success, run.message
    return run


class Machine:
    """A run as groups of an SVG, placed in a frame of the picture."""

    def __init__(self, run: Any, left: float, width: float, height: float = HEIGHT) -> None:
        self.run = run
        self.scene = scene.describe(run, None, packed=False)
        self.pose = Pose(self.scene)
        view = self.scene["view"]
        self.right, self.up = (np.array(view[word], dtype=float) for word in ("right", "up"))
        planar = self.pose.extent() @ np.array([self.right, self.up]).T
        low, high = planar.min(axis=0), planar.max(axis=0)
        room = np.array([width - 2 * MARGIN, height - 2 * MARGIN - 14.0])
        self.scale = float((room / (high - low)).min())
        self.middle, self.centre = (low + high) / 2, np.array([left + width / 2, height / 2 - 6.0])
        self.unit = self.pose.typical_force()

    def pixels(self, points: Any) -> Floats:
        """Places in the picture (..., 2) of points of the world (..., 3)."""
        planar = np.asarray(points, dtype=float) @ np.array([self.right, self.up]).T
        moved: Floats = self.centre + self.scale * (planar - self.middle) * [1.0, -1.0]
        return moved

    def drawn(self) -> Iterator[str]:
        """Paths, supports and rails, bodies with their pins, reactions: from below to above."""
        for stroke in self.pose.strokes(0.002 * self.scene["size"]):
            if len(stroke) > 1:
                yield f'<path class="path" d="M{line(self.pixels(stroke))}"/>'
        for joint in self.scene["joints"]:
            yield from self.support(joint)
        order = sorted(range(len(self.scene["bodies"])), key=lambda b: self.scene["bodies"][b]["kind"] != "plate")
        for body in order:
            yield self.body(body)
        for j in range(len(self.scene["joints"])):
            yield self.pin(j)
        for j in range(len(self.scene["joints"])):
            yield self.arrow(j)

    def support(self, joint: Any) -> Iterator[str]:
        if joint["rail"] and joint["parent"] < 0:
            p, q = self.pixels(joint["rail"])
            yield f'<path class="ground" d="M{line([p, q])}"/>' + hatch(*((p, q) if p[0] <= q[0] else (q, p)), 9.0)
        elif joint["parent"] < 0 and joint["atParent"] is not None:
            x, y = self.pixels(joint["atParent"])
            yield f'<path class="foot" d="M{line([(x, y), (x - 10, y + 18), (x + 10, y + 18)])}Z"/>'
            yield hatch(np.array([x - 16, y + 18]), np.array([x + 16, y + 18]), 0.0)

    def body(self, body: int) -> str:
        """A body in its own axes about its origin, and how it moves."""
        figure, colour = self.scene["bodies"][body], COLOURS[body % len(COLOURS)]
        turn = self.pose.turned(0, body, np.array(figure["points"]))
        shape = self.scale * (turn @ np.array([self.right, self.up]).T) * [1.0, -1.0]
        slides = any(joint["child"] == body and joint["rail"] for joint in self.scene["joints"])
        if slides:
            inner = self.block(body, shape, colour)
        elif figure["kind"] == "plate":
            inner = f'<path d="M{line(shape)}Z" fill="{colour}" class="edge" stroke-linejoin="round"/>'
        else:
            inner = "".join(
                f'<path d="M{line([shape[0], end])}" class="edge" stroke-width="{ROD + 2.6:g}" stroke-linecap="round" '
                f'style="stroke-width:{ROD + 2.6:g}"/><path d="M{line([shape[0], end])}" stroke="{colour}" '
                f'stroke-width="{ROD}" stroke-linecap="round"/>'
                for end in shape[1:]
            )
        axis = np.cross(self.right, self.up)
        first = self.pose.turned(0, body, self.right)
        now = np.array([self.pose.turned(frame, body, self.right) for frame in range(POSES + 1)])
        angle = np.unwrap(np.arctan2(np.cross(first, now) @ axis, now @ first))
        origin = self.pixels(np.array([self.pose.placed(f, body, np.zeros(3)) for f in range(POSES + 1)]))
        return f"<g>{motion('translate', origin)}<g>{motion('rotate', -np.degrees(angle)[:, None])}{inner}</g></g>"

    def block(self, body: int, shape: Floats, colour: str) -> str:
        """The block of a slide, along its rail."""
        joint = next(joint for joint in self.scene["joints"] if joint["child"] == body and joint["rail"])
        p, q = self.pixels(joint["rail"])
        lean = np.degrees(np.arctan2(*(q - p)[::-1]))
        x, y = shape[0]
        return (
            f'<rect x="-20" y="-13" width="40" height="26" fill="{colour}" class="edge" '
            f'transform="translate({x:.1f},{y:.1f}) rotate({lean:.1f})"/>'
        )

    def seats(self, joint: int) -> Floats:
        return self.pixels(np.array([self.pose.seat(frame, joint) for frame in range(POSES + 1)]))

    def pin(self, joint: int) -> str:
        if self.scene["joints"][joint]["rail"]:
            return ""
        place = self.seats(joint)
        if np.ptp(place, axis=0).max() < 0.05:
            x, y = place[0]
            return f'<circle class="pin" cx="{x:.1f}" cy="{y:.1f}" r="6"/>'
        return f'<g>{motion("translate", place)}<circle class="pin" r="6"/></g>'

    def arrow(self, joint: int) -> str:
        """The reaction on the child, from the joint."""
        name = self.scene["joints"][joint]["name"]
        force = self.run.joint(name).force @ np.array([self.right, self.up]).T * [1.0, -1.0]
        foot, tip = self.seats(joint), self.seats(joint) + LONGEST * force / (1.1 * self.unit)
        if not np.isfinite(tip).all() or np.linalg.norm(tip - foot, axis=1).max() < 8.0:
            return ""
        values = {"x1": foot[:, 0], "y1": foot[:, 1], "x2": tip[:, 0], "y2": tip[:, 1]}
        moves = "".join(
            f'<animate attributeName="{key}" values="{listed(v[:, None])}" {FOREVER}/>' for key, v in values.items()
        )
        return f'<line class="force" marker-end="url(#tip)">{moves}</line>'


def line(points: Any) -> str:
    return "L".join(f"{x:.1f},{y:.1f}" for x, y in points)


def hatch(p: Floats, q: Floats, below: float) -> str:
    """A ground line from left to right with strokes below it."""
    along = (q - p) / np.linalg.norm(q - p)
    down = np.array([-along[1], along[0]])
    p, q = p + below * down, q + below * down
    feet = [p + s * along for s in np.arange(7.0, float(np.linalg.norm(q - p)) + 1.0, 8.0)]
    strokes = "".join(f"M{line([at, at - 7 * along + 7 * down])}" for at in feet)
    return f'<path class="ground" d="M{line([p, q])}{strokes}"/>'


def listed(values: Floats) -> str:
    return ";".join(",".join(f"{x:.1f}".removesuffix(".0") for x in row) for row in values)


def motion(kind: str, values: Floats) -> str:
    return f'<animateTransform attributeName="transform" type="{kind}" values="{listed(values)}" {FOREVER}/>'


WORDS = "a walking linkage and a V-twin engine with the reactions of their joints as arrows"


def picture(machines: Sequence[tuple[str, str]] = MACHINES, width: int = WIDTH, height: int = HEIGHT) -> str:
    """The text of a picture."""
    share = width / len(machines)
    words = WORDS if machines == MACHINES else f"{machines[0][0]}: one turn, with its reactions as arrows"
    parts = [
        f'<svg xmlns="{SPACE}" viewBox="0 0 {width} {height}" role="img" aria-label="{escape(words)}">',
        f"<style>{STYLE}</style>",
        '<defs><marker id="tip" viewBox="0 0 10 10" refX="8" refY="5" markerWidth="4.4" markerHeight="4.4" '
        'orient="auto"><path class="head" d="M0,0L10,5L0,10Z"/></marker></defs>',
    ]
    for i, (name, joint) in enumerate(machines):
        parts += [f'<g id="{escape(name)}">', *Machine(turning(name, joint), i * share, share, height).drawn(), "</g>"]
    return "\n".join([*filter(None, parts), "</svg>", ""])


def main(arguments: list[str]) -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=WHERE)
    options = parser.parse_args(arguments)
    options.out.parent.mkdir(parents=True, exist_ok=True)
    options.out.write_text(picture(), encoding="utf-8")
    print(f"{options.out}: {options.out.stat().st_size // 1000} kB")
    for machine in TILES:
        tile = options.out.with_name(f"tile-{machine[0]}.svg")
        tile.write_text(picture((machine,), *TILE), encoding="utf-8")
        print(f"{tile}: {tile.stat().st_size // 1000} kB")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
