"""One position in the form of a run with a single output: what pages and pictures of a drawing are made of."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..naming import Names
from ..webpage import whole_page
from .hints import solids, traced
from .page import SCRIPTS
from .pose import Pose
from .scene import describe
from .slim import slim
from .stage import FINER, Stage

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Gap:
    """Two points that a joint or a distance should bring together, apart as drawn."""

    label: str
    ends: tuple[FloatArray, FloatArray]
    """In the world of the drawing [m]."""


@dataclass(frozen=True)
class StillBody:
    """A body in one position."""

    position: FloatArray  # (1, 3)
    rotation: FloatArray  # (1, 3, 3)

    def point(self, point: Any) -> FloatArray:
        """A point in body axes, in the world (1, 3)."""
        return self.position + self.rotation @ np.asarray(point, dtype=float)


@dataclass(frozen=True)
class StillJoint:
    """A joint in one position, without loads."""

    kind: str
    point: FloatArray  # (1, 3)
    position: FloatArray  # (1, coordinates)
    force: FloatArray = field(default_factory=lambda: np.zeros((1, 3)))
    moment: FloatArray = field(default_factory=lambda: np.zeros((1, 3)))
    determined: NDArray[np.bool_] = field(default_factory=lambda: np.ones(6, dtype=bool))

    def in_frame(self, axes: str) -> StillJoint:
        """The same: there are no loads to turn."""
        return self


@dataclass(frozen=True)
class Still:
    """A mechanism in one position; where its loops do not close, as drawn, with its `gaps` and the reason."""

    title: str
    summary: Mapping[str, Any]
    spec: Mapping[str, Any]
    t: FloatArray
    q: FloatArray  # (1, nq)
    v: FloatArray  # (1, nv)
    bodies: Mapping[str, StillBody]
    joints: Mapping[str, StillJoint]
    closure: FloatArray  # (1,)
    measure: FloatArray  # (1, nv)
    sigma: FloatArray  # (1,)
    sqrt_mu: FloatArray  # (1,)
    independent: NDArray[np.int64]  # (1, degrees of freedom)
    message: str = ""
    gaps: Sequence[Gap] = ()

    partitions: Sequence[Any] = ()
    has_energy: bool = False
    certificate: None = None
    """A position is no run: there is nothing to certify."""

    @property
    def success(self) -> bool:
        """Whether the loops are closed."""
        return not self.message

    @cached_property
    def names(self) -> Names:
        """Names of what there is."""
        return Names.from_summary(self.summary, self.q.shape[1], self.v.shape[1], 0)

    def body(self, name: str) -> StillBody:
        """A body by name; the ground rests."""
        if name == "ground":
            return StillBody(np.zeros((1, 3)), np.eye(3)[None])
        return self.bodies[name]

    def joint(self, name: str) -> StillJoint:
        """A joint by name."""
        return self.joints[name]

    def applied_forces(self) -> Mapping[str, tuple[FloatArray, FloatArray]]:
        """None: a position has no loads."""
        return {}


def still_page(
    still: Still,
    title: str | None = None,
    shapes: Mapping[str, Any] | None = None,
    points: Mapping[str, Any] | None = None,
) -> str:
    """The page of a run, with one pose; see `partita.viewer.html` for `shapes` and `points`."""
    scene = _scene(still, title, shapes, points, packed=True)
    return whole_page(__package__, scene["title"], slim(scene), SCRIPTS)


def scene_of(still: Still, title: str | None = None) -> dict[str, Any]:
    """What is drawn of a position, without the arrays of a run: for pages that move it themselves."""
    scene = _scene(still, title, None, None, packed=False)
    return {key: value for key, value in slim(scene).items() if key != "tables"}


@dataclass(frozen=True)
class Picture:
    """A picture in front of a fixed camera: an image of Pillow, and where its pixels are."""

    image: Any
    across: tuple[float, float]
    """Coordinates of its left and right edge along `axes[0]` [m]."""
    up: tuple[float, float]
    """Coordinates of its lower and upper edge along `axes[1]` [m]."""
    axes: tuple[FloatArray, FloatArray]
    """Directions in the world to the right and upwards."""
    labels: Mapping[str, tuple[float, float]]
    """Names of joints and gaps, and where they are in the picture [m]."""


def picture(
    still: Still,
    size: tuple[int, int],
    title: str,
    shapes: Mapping[str, Any] | None = None,
    points: Mapping[str, Any] | None = None,
) -> Picture:
    """The position painted as in a film, with a place for each name. Needs Pillow."""
    scene = _scene(still, None, shapes, points, packed=False) | {"title": title}
    pose = Pose(scene)
    stage = Stage(pose, size, forces=False, factor=1.0)
    width, height = (0.5 * pixels * FINER / stage.scale for pixels in size)
    middle = stage.middle + np.array([0.0, 6 * FINER / stage.scale])  # `Stage.at` leaves room for the title

    def at(point: Any) -> tuple[float, float]:
        return float(point @ stage.right), float(point @ stage.up)

    labels = {joint["name"]: at(pose.seat(0, j)) for j, joint in enumerate(scene["joints"]) if joint["kind"] != "free"}
    labels |= {point["name"]: at(pose.placed(0, point["body"], np.array(point["at"]))) for point in scene["points"]}
    return Picture(
        stage.picture(0),
        (float(middle[0] - width), float(middle[0] + width)),
        (float(middle[1] - height), float(middle[1] + height)),
        (stage.right, stage.up),
        labels,
    )


def _scene(
    still: Still,
    title: str | None,
    shapes: Mapping[str, Any] | None,
    points: Mapping[str, Any] | None,
    packed: bool,
) -> dict[str, Any]:
    bodies = list(still.names.bodies)
    marks = traced(points, bodies)
    marks += [{"name": gap.label, "body": -1, "at": (0.5 * (gap.ends[0] + gap.ends[1])).tolist()} for gap in still.gaps]
    scene = describe(still, title, solids(shapes, bodies), marks, packed)  # type: ignore[arg-type]
    scene["lines"] = [
        *scene["lines"],
        *(
            {"body": -1, "points": [end.tolist() for end in gap.ends], "closed": False, "look": "belt"}
            for gap in still.gaps
        ),
    ]
    return scene | {"warning": still.message}
