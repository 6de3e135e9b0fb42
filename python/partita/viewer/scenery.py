"""What a mechanism meets, in a film: floors and balls of contacts, wheels of tyres, stops."""

from __future__ import annotations

from functools import partial
from itertools import combinations
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from .pose import Pose
from .sheet import FOOT, GROUND, Sheet

FloatArray = NDArray[np.float64]

EDGE_ON = 0.08
"""A plane whose normal is farther from the line of sight is drawn as a line. Scale: cosine of the angle. Reason: a
disc of that slope is as thin as its edge."""


class Drawn(Protocol):
    """What of a stage is used here."""

    pose: Pose
    back: FloatArray
    right: FloatArray
    up: FloatArray
    radius: float
    scale: float

    def at(self, points: Any) -> FloatArray:
        """Pixels of points."""

    def solid(self, sheet: Sheet, frame: int, body: int, part: Any) -> None:
        """A part of a body."""

    def depth(self, points: Any) -> float:
        """How near points are."""


def scenery(stage: Drawn, sheet: Sheet, frame: int, width: float) -> None:
    """Floors at once, behind all else; parts and stops in their depth. `width` is that of a fine line in pixels."""
    scene, pose = stage.pose.scene, stage.pose
    for floor in scene["floors"]:
        normal = pose.turned(frame, floor["body"], np.array(floor["normal"]))
        pixels = stage.at(pose.placed(frame, floor["body"], np.array(floor["points"])))
        if abs(normal @ stage.back) > EDGE_ON:
            sheet.polygon(pixels, FOOT, GROUND, width)
            continue
        p, q = max(combinations(pixels, 2), key=lambda ends: float(np.hypot(*(ends[1] - ends[0]))))
        down = np.array([-normal @ stage.right, normal @ stage.up])
        forward = (q - p)[0] * down[1] - (q - p)[1] * down[0] > 0
        if floor["body"] < 0:
            sheet.ground(p if forward else q, q if forward else p, 3.4 * stage.radius * stage.scale, width)
        else:  # only the ground, which rests, is hatched
            sheet.line([p, q], GROUND, 1.5 * width)
    for extra in scene["parts"]:
        stage.solid(sheet, frame, extra["body"], extra["part"])
    for stop in scene["stops"]:
        ends = pose.placed(frame, stop["body"], np.array(stop["points"]))
        sheet.add(
            stage.depth(ends) + 1.0,
            partial(sheet.line, stage.at(ends), GROUND, max(2.5 * width, 0.7 * stage.radius * stage.scale)),
        )
