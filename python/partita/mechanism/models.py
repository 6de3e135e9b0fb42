"""The models of a mechanism: `compile`, and models compiled before."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from numpy.typing import ArrayLike

from .. import options as run_options
from ..builder import Builder
from ..builder.compiled import CompiledModel, compile_description
from ..builder.records import GROUND
from ..builder.remarks import remarks
from ..errors import DescriptionError
from ..extras import check_not_ending
from ..logger import logger
from ..state import Layout

_STILL = "every body is fixed to the ground"
"""Words of the core where nothing is free."""


class Modelled(Builder):
    """A builder that caches the models made of it until the description changes."""

    def __init__(self, name: str, gravity: Any, drawing_tolerance: float) -> None:
        super().__init__(name, gravity, drawing_tolerance)
        self._compiled: dict[str, tuple[int, CompiledModel, Layout]] = {}
        self._remarked: tuple[int, tuple[str, ...]] = -1, ()

    def __getstate__(self) -> dict[str, object]:
        """The description alone: models are compiled again on request."""
        return {**self.__dict__, "_compiled": {}, "_remarked": (-1, ())}

    def _looks(self) -> dict[str, Any]:
        """How bodies look by the file that they were read from."""
        reading = getattr(self, "reading", None)
        known = self._description.bodies
        return {} if reading is None else {name: x for name, x in reading.shapes.items() if name in (GROUND, *known)}

    def _remarks(self) -> tuple[str, ...]:
        """What is nearly surely a mistake in the present description, logged once."""
        version = self._description.version
        if self._remarked[0] != version:
            self._remarked = version, tuple(remarks(self._description))
            for remark in self._remarked[1]:
                logger.warning("%s", remark)
        return self._remarked[1]


def compile(self: Modelled, coordinates: str = "relative") -> CompiledModel:
    """Compile the description into equations. The model is cached until the description changes.

    Args:
        coordinates: "relative": joint coordinates of a spanning tree and loop-closure constraints (few and fast);
            "absolute": six velocities per body and the constraints of every joint (an independent check).

    Raises:
        DescriptionError: there is nothing to move, or the core finds the description inconsistent.
        ArgumentError: unknown coordinates.

    >>> import partita as pt
    >>> m = pt.Mechanism("pendulum")
    >>> rod = m.add_rod("rod", start=(0, 0, 0), end=(1, 0, 0), mass=1.0)
    >>> hinge = m.add_revolute("A", m.ground, rod, point=(0, 0, 0))
    >>> m.compile().mobility
    1
    """
    check_not_ending()
    wanted = run_options.one_of("coordinates", coordinates, run_options.COORDINATES)
    version = self._description.version
    if wanted not in self._compiled or self._compiled[wanted][0] != version:
        try:
            self._compiled[wanted] = (version, *compile_description(self._description.copy(), wanted))
        except DescriptionError as error:
            reading = getattr(self, "reading", None)
            still = not self._description.bodies or _STILL in error.message
            if reading is None or not reading.stands or not still:
                raise
            words = "nothing in the file can move" if not self._description.bodies else error.message
            raise DescriptionError(f"{words}: {reading.stands}", **error.fields) from error
    return self._compiled[wanted][1]


def layout_of(
    mechanism: Modelled, coordinates: str, parameters: Mapping[str, ArrayLike] | None = None
) -> tuple[CompiledModel, Layout]:
    """The compiled model, with these of its parameters changed, and the layout of its states."""
    model = compile(mechanism, coordinates)
    layout = mechanism._compiled[coordinates][2]
    return changed(model, layout, parameters)


def changed(
    model: CompiledModel, layout: Layout, parameters: Mapping[str, ArrayLike] | None
) -> tuple[CompiledModel, Layout]:
    """The model with these of its parameters changed, and the layout of its states."""
    if parameters is None:
        return model, layout
    model = model.with_parameters(parameters)
    return model, model._laid_out(layout)
