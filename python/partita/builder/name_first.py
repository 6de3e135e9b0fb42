"""Elements whose name may be left out: given, it comes first, as of all other elements."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable
from typing import Any, Concatenate, ParamSpec, Protocol, TypeVar, cast, overload

from .drawing import Drawing
from .measures import Along, Coordinate, Cosine, Distance
from .records import GROUND, Body, Joint

P = ParamSpec("P")
R_co = TypeVar("R_co", covariant=True)


class Bound(Protocol[P, R_co]):
    """The method of a mechanism: with or without a name in front."""

    @overload
    def __call__(self, *args: P.args, **kwargs: P.kwargs) -> R_co: ...
    @overload
    def __call__(self, name: str, /, *args: P.args, **kwargs: P.kwargs) -> R_co: ...


class NameFirst(Protocol[P, R_co]):
    """The same in the class."""

    @overload
    def __get__(self, drawing: None, owner: Any = None, /) -> Callable[Concatenate[Any, P], R_co]: ...
    @overload
    def __get__(self, drawing: Drawing, owner: Any = None, /) -> Bound[P, R_co]: ...
    def __call__(self, drawing: Drawing, /, *args: P.args, **kwargs: P.kwargs) -> R_co: ...


def name_first(joined: int) -> Callable[[Callable[Concatenate[Any, P], R_co]], NameFirst[P, R_co]]:
    """Let a method that begins with `joined` joints, bodies or measurements, and whose `name` is optional, take the
    name as first argument too: `m.add_torque("motor", hinge, 5.0)` besides `m.add_torque(hinge, 5.0, name="motor")`.

    The name is recognised by what follows it: as many things that can be joined, or their keyword, or more arguments
    than there are without it.
    """

    def changed(method: Callable[Concatenate[Any, P], R_co]) -> NameFirst[P, R_co]:
        parameters = list(inspect.signature(method).parameters.values())[1:]
        first = parameters[0].name
        most = sum(p.kind is p.POSITIONAL_OR_KEYWORD for p in parameters)

        @functools.wraps(method)
        def call(self: Drawing, *args: Any, **kwargs: Any) -> R_co:
            if args and isinstance(args[0], str) and "name" not in kwargs:
                after = args[1 : 1 + joined]
                named = len(after) == joined and all(_can_be_joined(self, item) for item in after)
                if named or first in kwargs or len(args) > most:
                    args, kwargs = args[1:], {**kwargs, "name": args[0]}
            return method(self, *args, **kwargs)

        return cast("NameFirst[P, R_co]", call)

    return changed


def _can_be_joined(drawing: Drawing, item: Any) -> bool:
    """Whether it is a joint, a body or a measurement, or the name of a joint or body."""
    d = drawing._description
    if isinstance(item, str):
        return item in d.joints or item in d.bodies or item == GROUND
    return isinstance(item, (Body, Joint, Coordinate, Distance, Along, Cosine))
