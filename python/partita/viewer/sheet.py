"""Colours and strokes of a picture of a film, painted from far to near."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

Colour = tuple[int, int, int]

BODIES: list[Colour] = [
    (0x8F, 0xB0, 0xD0), (0xA3, 0xC4, 0xA0), (0xD3, 0xBD, 0x8C), (0xB3, 0xA6, 0xD0),
    (0x8F, 0xC2, 0xC2), (0xD0, 0xA3, 0xB0), (0xB7, 0xC4, 0x8C), (0xA5, 0xB1, 0xBF),
]  # fmt: skip
PAPER, INK, EDGE, GROUND = (255, 255, 255), (0x1D, 0x27, 0x30), (0x3C, 0x48, 0x54), (0x77, 0x82, 0x8C)
QUIET, SPRING, TRACE, FORCE = (0x56, 0x64, 0x72), (0x4D, 0x5B, 0x68), (0xA9, 0xB9, 0xC8), (0xB3, 0x26, 0x1E)
LOAD, JOINT, FOOT = (0x0B, 0x6E, 0x4F), (0xF4, 0xF6, 0xF8), (0xEE, 0xF1, 0xF4)
PALETTE = [PAPER, INK, EDGE, GROUND, QUIET, SPRING, TRACE, FORCE, LOAD, JOINT, FOOT, *BODIES]


def shade(colour: Colour, amount: float) -> Colour:
    """Mixed with white (amount > 0) or black (amount < 0)."""
    other, part = (255, amount) if amount > 0 else (0, -amount)
    return tuple(round(c * (1.0 - part) + other * part) for c in colour)  # type: ignore[return-value]


@dataclass
class Sheet:
    """The content of one picture, from far to near."""

    draw: Any
    items: list[tuple[float, int, Callable[[], object]]] = field(default_factory=list)

    def add(self, depth: float, item: Callable[[], object]) -> None:
        if np.isfinite(depth):
            self.items.append((depth, len(self.items), item))

    def paint(self) -> None:
        for _, _, item in sorted(self.items, key=lambda item: item[:2]):
            item()
        self.items.clear()

    def line(self, points: Any, colour: Colour, width: float) -> None:
        pairs = [(float(x), float(y)) for x, y in points]
        w = max(1, round(width))
        self.draw.line(pairs, fill=colour, width=w, joint="curve")
        if w > 2:  # round ends
            for x, y in (pairs[0], pairs[-1]):
                self.draw.ellipse((x - w / 2 + 0.5, y - w / 2 + 0.5, x + w / 2 - 0.5, y + w / 2 - 0.5), fill=colour)

    def polygon(self, points: Any, fill: Colour | None, edge: Colour | None = None, width: float = 1.0) -> None:
        pairs = [(float(x), float(y)) for x, y in points]
        if fill is not None:
            self.draw.polygon(pairs, fill=fill)
        if edge is not None:
            self.draw.line([*pairs, pairs[0]], fill=edge, width=max(1, round(width)), joint="curve")

    def ground(self, p: Any, q: Any, r: float, fine: float) -> None:
        """A ground line from p to q with strokes on its right; `fine` is the width of a fine line in pixels."""
        self.line([p, q], GROUND, 1.5 * fine)
        offset = q - p
        whole = float(np.hypot(*offset))
        if whole < fine:
            return
        along = offset / whole
        count = max(2, min(60, round(whole / (0.4 * r))))
        turn = np.array([-(along[0] + along[1]), along[0] - along[1]]) * 0.38 * r
        for i in range(count):
            at = p + offset * (i + 0.8) / count
            self.line([at, at + turn], GROUND, fine)

    def circle(
        self, at: Any, radius: float, fill: Colour | None, edge: Colour | None = None, width: float = 1.0
    ) -> None:
        x, y = float(at[0]), float(at[1])
        box = (x - radius, y - radius, x + radius, y + radius)
        self.draw.ellipse(box, fill=fill, outline=edge, width=max(1, round(width)))
