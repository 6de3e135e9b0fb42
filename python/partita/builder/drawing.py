"""The description of a mechanism so far: the common base of all `add_...` methods."""

from __future__ import annotations

from typing import Any

from .checks import name_of, number
from .records import GROUND, LARGEST_TOLERANCE, Body, Description
from .vectors import field


class Drawing:
    """A growing description; users work with `Mechanism`."""

    def __init__(self, name: str, gravity: Any, drawing_tolerance: float) -> None:
        element = name_of("mechanism", name)
        constant, changing = field(element, gravity)
        tolerance = number(element, "drawing_tolerance", drawing_tolerance, least=0.0)
        if tolerance > LARGEST_TOLERANCE:
            element.fail(
                f"drawing_tolerance is {tolerance:g} (radians, and fractions of lengths); beyond "
                f"{LARGEST_TOLERANCE:g} the drawing describes another mechanism"
            )
        self._description = Description(element.name, constant, changing, tolerance)
        self._ground = Body(GROUND, self)

    @property
    def name(self) -> str:
        """The mechanism's name."""
        return self._description.name

    @property
    def gravity(self) -> tuple[float, float, float]:
        """Acceleration of gravity in world axes [m/s^2]; (0, 0, 0) where it was given over time. Set it as in
        `Mechanism(name, gravity)`."""
        x, y, z = self._description.gravity.tolist()
        return x, y, z

    @gravity.setter
    def gravity(self, value: Any) -> None:
        constant, changing = field(name_of("mechanism", self.name), value)
        d = self._description
        d.gravity, d.changing_gravity, d.version = constant, changing, d.version + 1

    @property
    def drawing_tolerance(self) -> float:
        """Allowed error of the drawing, in radians and in fractions of the characteristic lengths."""
        return self._description.drawing_tolerance

    @property
    def ground(self) -> Body:
        """The world, as a parent or child."""
        return self._ground

    def __repr__(self) -> str:
        d = self._description
        return (
            f"{type(self).__name__}({d.name!r}: {len(d.bodies)} bodies, {len(d.joints)} joints, {len(d.drives)} "
            f"drives, {len(d.forces)} forces)"
        )
