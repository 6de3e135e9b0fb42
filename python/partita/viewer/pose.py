"""Positions of all objects of a scene at an output: the counterpart in Python, for films, of the scripts of the
page."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..tolerance import HALFWAY_ALONG, LEAST_DIVISOR, VISIBLE

FloatArray = NDArray[np.float64]

MOST_PATHS = 6


class Pose:
    """A scene whose tables are arrays; points of body -1 are in the world."""

    def __init__(self, scene: Mapping[str, Any]) -> None:
        self.scene = scene
        self.tables: Mapping[str, FloatArray] = scene["tables"]
        self.t = self.tables["t"][:, 0]
        nt = len(self.t)
        self.position = self.tables["position"].reshape(nt, -1, 3)
        x, y, z, w = np.moveaxis(self.tables["turn"].reshape(nt, -1, 4), 2, 0)
        self.rotation = np.stack(
            [
                np.stack([1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)], axis=-1),
                np.stack([2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)], axis=-1),
                np.stack([2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)], axis=-1),
            ],
            axis=-2,
        )
        kinds = [body["kind"] for body in scene["bodies"]]
        reported = {wheel["body"] for wheel in scene["wheels"] if not wheel["ring"]}
        reported |= {line["body"] for line in scene["lines"] if line["look"] == "cam"}
        reported |= {extra["body"] for extra in scene["parts"]}
        self.hidden = {b for b in reported if b >= 0 and kinds[b] == "ball"}

    def turned(self, frame: int, body: int, directions: FloatArray) -> FloatArray:
        """Directions (..., 3) of a body, in the world."""
        return directions if body < 0 else directions @ self.rotation[frame, body].T

    def placed(self, frame: int, body: int, points: FloatArray) -> FloatArray:
        """Points (..., 3) of a body, in the world."""
        return points if body < 0 else points @ self.rotation[frame, body].T + self.position[frame, body]

    def path(self, body: int, point: Any) -> FloatArray:
        """A point of a body over time (nt, 3)."""
        p = np.asarray(point, dtype=float)
        if body < 0:
            return np.broadcast_to(p, (len(self.t), 3))
        return np.einsum("tij,j->ti", self.rotation[:, body], p) + self.position[:, body]

    def seat(self, frame: int, joint: int) -> FloatArray:
        """Where a joint is drawn."""
        of = self.scene["joints"][joint]
        return self.placed(frame, of["child"], np.array(of["seat"] or of["at"]))

    def middle(self) -> FloatArray:
        """The middle of all bodies over time (nt, 3)."""
        return np.mean([self.path(b, body["com"]) for b, body in enumerate(self.scene["bodies"])], axis=0)

    def extent(self, about: FloatArray | None = None) -> FloatArray:
        """Points visible in a picture of the whole run (n, 3), as opposed to points (nt, 3) that may move."""
        scene, cloud = self.scene, []
        step = max(1, len(self.t) // 200)
        for joint in scene["joints"]:
            cloud.append(self.path(joint["child"], joint["seat"] or joint["at"])[::step])
            cloud += [self.path(joint["parent"], end)[::step] for end in joint["rail"] or ()]
        for b, body in enumerate(scene["bodies"]):
            cloud += [self.path(b, point)[::step] for point in body["points"]]
        for both in (*scene["springs"], *scene["rods"]):
            cloud += [self.path(both[f"body{i}"], both[f"point{i}"])[::step] for i in (1, 2)]
        cloud += [self.path(point["body"], point["at"])[::step] for point in scene["points"]]
        for line in scene["lines"]:
            cloud += [self.path(line["body"], point)[::step] for point in line["points"][::6]]
        for mark in (*scene["floors"], *scene["stops"]):
            cloud += [self.path(mark["body"], point)[::step] for point in mark["points"]]
        for extra in scene["parts"]:
            cloud += [self.path(extra["body"], p)[::step] for p in corners(extra["part"])]
        for wheel in scene["wheels"]:
            cloud += [self.path(wheel["body"], p)[::step] for p in corners({**wheel, "length": wheel["width"]}, 1.15)]
        for solid in scene["solids"]:
            cloud += [self.path(solid["body"], p)[::step] for part in solid["parts"] for p in corners(part)]
        if about is not None:
            cloud = [path - about[::step] for path in cloud]
        points = np.concatenate(cloud) if cloud else np.zeros((1, 3))
        points = points[np.isfinite(points).all(axis=1)]
        return points if len(points) else np.zeros((1, 3))

    def travels(self) -> bool:
        """Whether it is not connected to the ground and moves farther than twice its own extent."""
        ends = [(joint["parent"], joint["child"]) for joint in self.scene["joints"] if joint["kind"] != "free"]
        if any(-1 in pair for pair in ends) or not self.scene["bodies"]:
            return False
        whole, near = (float(np.linalg.norm(np.ptp(self.extent(about), axis=0))) for about in (None, self.middle()))
        return whole > 2 * near

    def strokes(self, least: float) -> list[FloatArray]:
        """Strokes (n, 3) of the paths to trace, dots where n is 1: of the requested points, or of moving joints if
        these are few and no path is tangled."""
        asked = [self.path(point["body"], point["at"]) for point in self.scene["points"]]
        if asked:
            return [stroke for path in asked for stroke in strokes_of(path, self.t, least)]
        paths: list[FloatArray] = []
        found: list[FloatArray] = []
        for joint in self.scene["joints"]:
            path = self.path(joint["child"], joint["seat"] or joint["at"])
            there = path[np.isfinite(path).all(axis=1)]
            moves = len(there) > 1 and float(np.ptp(there, axis=0).max()) > least
            if moves and not any(np.allclose(path, other, atol=least, equal_nan=True) for other in paths):
                paths.append(path)
                drawn = strokes_of(path, self.t, least)
                found += [] if is_tangled(drawn, self.scene["size"]) else drawn
        return found if len(paths) <= MOST_PATHS else []

    def typical_force(self) -> float:
        """A large reaction [N]; 0 where there is none."""
        sizes = np.linalg.norm(self.tables["force"].reshape(-1, 3), axis=1)
        loads = [np.linalg.norm(self.tables[f"load{n}"][:, 3:], axis=1) for n in range(len(self.scene["loads"]))]
        for several in (sizes, np.concatenate([np.zeros(1), *loads])):
            real = several[np.isfinite(several) & (several > 0)]
            if len(real):
                return float(np.quantile(real, 0.95))
        return 0.0

    def pushes(self, frame: int, reaction: Any, load: Any) -> Iterator[tuple[FloatArray, FloatArray, Any, bool]]:
        """Point, force and colour of every reaction and load, and whether it is not unique."""
        forces = self.tables["force"][frame].reshape(-1, 3)
        for joint, force in zip(self.scene["joints"], forces, strict=True):
            yield self.placed(frame, joint["child"], np.array(joint["at"])), force, reaction, bool(joint["open"][0])
        for n in range(len(self.scene["loads"])):
            row = self.tables[f"load{n}"][frame]
            yield row[:3], row[3:], load, False

    @staticmethod
    def arcs(points: FloatArray) -> Iterator[tuple[FloatArray, FloatArray]]:
        """Pieces of the arcs from hinge to hinge about the first point."""
        centre, seats = points[0], points[1:]
        for i in range(len(seats) if len(seats) > 2 else 1):
            a, b = seats[i] - centre, seats[(i + 1) % len(seats)] - centre
            cosine = a @ b / max(float(np.linalg.norm(a) * np.linalg.norm(b)), LEAST_DIVISOR)
            angle = float(np.arccos(np.clip(cosine, -1.0, 1.0)))
            if np.sin(angle) < VISIBLE:
                yield centre + a, centre + b
                continue
            s = np.linspace(0.0, 1.0, 13)[:, None]
            arc = centre + (np.sin((1 - s) * angle) * a + np.sin(s * angle) * b) / np.sin(angle)
            yield from pairwise(arc)

    @staticmethod
    def teeth(
        wheel: Mapping[str, Any], centre: FloatArray, axis: FloatArray, first: FloatArray, back: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Outline (n, 3) of the visible face of a wheel, and the centre of that face."""
        n = wheel["teeth"]
        second = np.cross(axis, first)
        face = centre + (0.5 if axis @ back >= 0 else -0.5) * wheel["width"] * axis
        if n:
            parts = np.array([-0.28, -0.13, 0.13, 0.28])
            angle = (wheel["phase"] + (np.arange(n)[:, None] + parts) * 2.0 * np.pi / n).ravel()
            inwards = -1.0 if wheel["ring"] else 1.0
            height = np.tile([-1.1, 0.9, 0.9, -1.1], n) * 2.0 * wheel["radius"] / n
            radius = wheel["radius"] + inwards * height
        else:
            angle = np.linspace(0.0, 2.0 * np.pi, 49)[:-1]
            radius = np.full(48, wheel["radius"])
        return face + np.outer(radius * np.cos(angle), first) + np.outer(radius * np.sin(angle), second), face

    @staticmethod
    def rim(wheel: Mapping[str, Any], centre: FloatArray, axis: FloatArray, first: FloatArray) -> FloatArray:
        """Outside of a ring with teeth inside."""
        angle = np.linspace(0.0, 2.0 * np.pi, 97)[:-1]
        radius = wheel["radius"] * (1.0 + 6.0 / max(1, wheel["teeth"]))
        return centre + radius * (np.outer(np.cos(angle), first) + np.outer(np.sin(angle), np.cross(axis, first)))


def corners(part: Mapping[str, Any], wider: float = 1.0) -> FloatArray:
    """Points of a solid in body axes that bound it in the picture (n, 3)."""
    kind = part.get("kind")
    if kind == "mesh":
        points = np.reshape(part["points"], (-1, 3))
        return points[:: max(1, len(points) // 50)]
    if kind == "plate":
        return np.array(part["points"])
    if kind == "rod":
        return np.array([part["start"], part["end"]])
    centre = np.array(part["center"])
    if "axis" not in part:
        r = 0.5 * float(np.linalg.norm(part["size"])) if kind == "box" else part["radius"]
        return centre + r * np.concatenate([np.eye(3), -np.eye(3)])
    axis = np.array(part["axis"])
    u = np.cross(axis, [1.0, 0, 0] if abs(axis[0]) < HALFWAY_ALONG else [0, 1.0, 0])
    u /= np.linalg.norm(u)
    angle = np.linspace(0.0, 2.0 * np.pi, 9)[:-1]
    rim = wider * part["radius"] * (np.outer(np.cos(angle), u) + np.outer(np.sin(angle), np.cross(axis, u)))
    half = 0.5 * part["length"] * axis
    return np.concatenate([centre + rim + half, centre + rim - half])


FARTHEST = np.pi / 4
"""Where a path turns farther than this at both ends of a step, no line is drawn."""
FINEST = 0.12
"""A stroke turns by less than this angle [rad] from point to point."""
CELLS = 50
"""Resolution of a path, as a fraction of the extent of the scene."""
TANGLE = 9
"""A path that covers many more of these cells than its own extent is a tangle."""


def strokes_of(points: FloatArray, t: FloatArray, least: float) -> list[FloatArray]:
    """A path (nt, 3) as strokes: smooth through the outputs (Hermite, with rates estimated from their neighbours), or
    single points where the outputs are too far apart for a line. Steps shorter than `least` do not affect the
    direction."""
    n = len(points)
    steps = np.diff(points, axis=0)
    sizes = np.linalg.norm(steps, axis=1)
    turns, rates = np.zeros(n), np.zeros((n, 3))
    if n > 2:
        both = (sizes[1:] > least) & (sizes[:-1] > least)
        cosine = np.sum(steps[1:] * steps[:-1], axis=1) / np.where(both, sizes[1:] * sizes[:-1], 1.0)
        turns[1:-1] = np.where(both, np.arccos(np.clip(cosine, -1.0, 1.0)), 0.0)
        rates[1:-1] = (points[2:] - points[:-2]) / (t[2:] - t[:-2])[:, None]
    whole = np.asarray(np.isfinite(points).all(axis=1))
    found: list[FloatArray] = []
    stroke: list[FloatArray] = []

    def flush() -> None:
        if stroke:
            found.append(np.array(stroke))
            stroke.clear()

    for i in range(n):
        if not whole[i]:
            flush()
            continue
        stroke.append(points[i])
        if i + 1 == n or not whole[i + 1]:
            continue
        first, last = i > 0 and bool(whole[i - 1]), i < n - 2 and bool(whole[i + 2])
        inner = first and last
        most = max(turns[i], turns[i + 1])
        alone = not (first or last)  # of two outputs alone nothing between is known
        if alone or (min(turns[i], turns[i + 1]) if inner else most) > FARTHEST:
            flush()
        elif inner:
            h, pieces = t[i + 1] - t[i], min(12, int(np.ceil(most / FINEST)))
            for s in np.arange(1, pieces) / max(1, pieces):
                r = 1.0 - s
                ends = r * r * (1 + 2 * s) * points[i] + s * s * (3 - 2 * s) * points[i + 1]
                stroke.append(ends + h * (r * r * s * rates[i] - s * s * r * rates[i + 1]))
    flush()
    return found


def is_tangled(strokes: list[FloatArray], size: float) -> bool:
    """Whether a path covers so much that drawing all of it is meaningless."""
    if not strokes:
        return False
    points = np.concatenate(strokes)
    own = CELLS * float(np.linalg.norm(np.ptp(points, axis=0))) / size
    return own > 5 and len(np.unique(np.floor(CELLS * points / size), axis=0)) > TANGLE * own
