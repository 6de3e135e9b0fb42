"""What has been said about a mechanism so far: the common ground of all `add_...` methods."""

from __future__ import annotations

from typing import Any

from .checks import name_of
from .records import GROUND, Body, Description
from .vectors import field


class Drawing:
    """A description that grows; `Mechanism` is what people use."""

    def __init__(self, name: str, gravity: Any) -> None:
        element = name_of("mechanism", name)
        constant, changing = field(element, gravity)
        self._description = Description(element.name, constant, changing)
        self._ground = Body(GROUND, self)

    @property
    def name(self) -> str:
        """The mechanism's name."""
        return self._description.name

    @property
    def gravity(self) -> tuple[float, float, float]:
        """Acceleration of gravity in world axes [m/s^2]; (0, 0, 0) where it was given over time."""
        x, y, z = self._description.gravity.tolist()
        return x, y, z

    @property
    def ground(self) -> Body:
        """The world, to be named as a parent or child."""
        return self._ground

    @property
    def bodies(self) -> tuple[str, ...]:
        """Names of the bodies, in the order in which they were added."""
        return tuple(self._description.bodies)

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the joints."""
        return tuple(self._description.joints)

    @property
    def couplings(self) -> tuple[str, ...]:
        """Names of the couplings."""
        return tuple(self._description.couplings)

    @property
    def drives(self) -> tuple[str, ...]:
        """Names of the drives."""
        return tuple(self._description.drives)

    @property
    def forces(self) -> tuple[str, ...]:
        """Names of the springs, torques and forces."""
        return tuple(self._description.forces)

    def __repr__(self) -> str:
        d = self._description
        return (
            f"{type(self).__name__}({d.name!r}: {len(d.bodies)} bodies, {len(d.joints)} joints, {len(d.drives)} "
            f"drives, {len(d.forces)} forces)"
        )
