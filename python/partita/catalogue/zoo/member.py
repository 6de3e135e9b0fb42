"""Notation of a mechanism of the zoo: a function that draws it, and the results of theory."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from ...mechanism import Mechanism
from ...state import State
from ..entry import Check, Entry
from ..truth import Truth
from .checks import checks

Draw = Callable[[Mechanism], None]
Theme = dict[str, Callable[[], Entry]]
DOWN = (0.0, -9.81, 0.0)
FALL = (0.0, 0.0, -9.81)
OPTIONS = {"rtol": 1e-9, "atol": 1e-11}


def member(
    theme: Theme,
    name: str,
    title: str,
    truth: Truth,
    *,
    rates: Mapping[str, Any] | None = None,
    gravity: tuple[float, float, float] = DOWN,
    notes: str = "",
    samples: int = 201,
    seconds: float = 10.0,
    more: Sequence[Check] = (),
) -> Callable[[Draw], Draw]:
    """Register the mechanism that the decorated function draws: closed as drawn, it starts with `rates` and runs
    for `seconds`. Curves over time keep their shape where nothing turns more than 20 degrees from one output to the
    next: fast rotation needs more `samples` and, as pages hold 1500, fewer seconds. `more` checks are closed forms of
    its own."""

    def enter(draw: Draw) -> Draw:
        def build() -> Mechanism:
            m = Mechanism(name, gravity=gravity)
            draw(m)
            return m

        def start(m: Mechanism) -> State:
            return m.assemble(rates=rates)

        def entry() -> Entry:
            return Entry(
                name=name,
                title=title,
                source=truth.source,
                duration=seconds,
                build=build,
                start=start,
                checks=(*checks(truth), *more),
                options=OPTIONS,
                notes=notes,
                truth=truth,
                samples=samples,
            )

        theme[name] = entry
        return draw

    return enter
