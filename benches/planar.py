"""A planar linkage of pins as plain data, read by the scripts of the peers; numpy is all they share."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from pathlib import Path
from time import perf_counter
from typing import Any, TypeVar

import numpy as np

T = TypeVar("T")
GROUND = -1


@dataclass(frozen=True)
class Pin:
    """A pin at `point` of the drawing between two bodies, by number; -1 is the ground."""

    parent: int
    child: int
    point: np.ndarray


@dataclass(frozen=True)
class Spring:
    """A spring between two points of the drawing."""

    body1: int
    point1: np.ndarray
    body2: int
    point2: np.ndarray
    stiffness: float
    length: float


@dataclass(frozen=True)
class Tried:
    """One setting: seconds of a run with all outputs, and the error of the first angle at the end. Settings of one kind
    compete with each other."""

    setting: str
    seconds: float
    error: float
    kind: str = ""


@dataclass(frozen=True)
class Problem:
    """Bodies by number: mass, moment of inertia, centre of mass, angle and rate of turning at the start."""

    bodies: list[str]
    masses: np.ndarray
    inertias: np.ndarray
    centres: np.ndarray
    angles: np.ndarray
    rates: np.ndarray
    tree: list[Pin]
    loops: list[Pin]
    gravity: np.ndarray
    times: np.ndarray
    turned: float
    """Angle by which the first body has turned at the end, up to whole turns."""
    springs: list[Spring] = field(default_factory=list)
    torques: dict[int, float] = field(default_factory=dict)

    def error(self, angle: float) -> float:
        """Of the first body's angle at the end."""
        return abs(math.remainder(angle - self.angles[0] - self.turned, 2.0 * math.pi))

    def relative_rate(self, pin: Pin) -> float:
        """Of a pin at the start."""
        return float(self.rates[pin.child] - (0.0 if pin.parent < 0 else self.rates[pin.parent]))

    def write(self, path: Path) -> None:
        """As JSON."""
        path.write_text(json.dumps(asdict(self), default=lambda x: x.tolist()), encoding="utf-8")

    @classmethod
    def read(cls, path: str) -> Problem:
        """From JSON."""
        d: dict[str, Any] = json.loads(Path(path).read_text(encoding="utf-8"))
        arrays = ("masses", "inertias", "centres", "angles", "rates", "gravity", "times")
        d |= {name: np.array(d[name]) for name in arrays}
        for name in ("tree", "loops"):
            d[name] = [Pin(x["parent"], x["child"], np.array(x["point"])) for x in d[name]]
        points = ("point1", "point2")
        d["springs"] = [Spring(**x | {name: np.array(x[name]) for name in points}) for x in d["springs"]]
        d["torques"] = {int(i): x for i, x in d["torques"].items()}
        return cls(**d)


def timed(call: Callable[[], T], patience: float = 0.5, longest: float = 20.0) -> tuple[float, T]:
    """Seconds of the fastest of several calls, and what the last one returned."""
    began, best, count = perf_counter(), float("inf"), 0
    while True:
        start = perf_counter()
        found = call()
        best = min(best, perf_counter() - start)
        count += 1
        spent = perf_counter() - began
        if spent > longest or (count >= 3 and spent > patience):
            return best, found


def report(found: list[Tried], words: str) -> None:
    """One line of JSON."""
    print(json.dumps({"peer": words, "tried": [asdict(x) for x in found]}))
