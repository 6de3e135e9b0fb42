"""Problems with known answers.

Each entry is a mechanism, its start, and numbers from closed forms, extended precision or other programs that its
motion must reproduce. Those of the zoo state the results of the theory of mechanisms: mobility, redundancy and which
reactions are unique. They show how mechanisms are described, and they verify this build of Partita.

>>> import partita as pt
>>> pt.catalogue.names()[:3]
['agile-eye', 'andrews-squeezer', 'antiparallelogram']
>>> m = pt.catalogue.load("n-four-bar", loops=3)
"""

from __future__ import annotations

import difflib
import inspect
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from ..errors import ArgumentError, UnknownNameError
from ..numeric import shown
from . import (
    andrews,
    branch_four_bar,
    bricard,
    car_axis,
    four_bar,
    holding,
    n_four_bar,
    planar_pendulum,
    reference_four_bar,
    rssr,
    slider_crank,
    spatial_four_bar,
    spatial_slider_crank,
    spring_four_bar,
    stephenson_six_bar,
    three_rrr,
    watt_six_bar,
    zoo,
)
from .entry import Check, Entry, Measurement
from .truth import Truth

if TYPE_CHECKING:
    from ..mechanism import Mechanism

__all__ = ["Check", "Entry", "Measurement", "Truth", "about", "entry", "load", "names"]

_ENTRIES: dict[str, Callable[..., Entry]] = {
    "andrews-squeezer": andrews.entry,
    "bricard": bricard.entry,
    "car-axis": car_axis.entry,
    "double-four-bar": n_four_bar.double,
    "four-bar": four_bar.entry,
    "four-bar-spring": spring_four_bar.entry,
    "grashof-four-bar": branch_four_bar.entry,
    "n-four-bar": n_four_bar.entry,
    "planar-pendulum": planar_pendulum.entry,
    "reference-four-bar": reference_four_bar.entry,
    "rssr": rssr.entry,
    "slider-crank": slider_crank.entry,
    "spatial-four-bar": spatial_four_bar.entry,
    "spatial-slider-crank": spatial_slider_crank.entry,
    "stephenson-six-bar": stephenson_six_bar.entry,
    "three-rrr": three_rrr.entry,
    "watt-six-bar": watt_six_bar.entry,
    **holding.ENTRIES,
    **zoo.ENTRIES,
}


def names() -> list[str]:
    """Names of all entries, in alphabetical order."""
    return sorted(_ENTRIES)


def entry(name: str, **parameters: Any) -> Entry:
    """The entry `name`: mechanism, start, run and checks. The first words of a name are enough where one entry alone
    begins with them: "scissor" for "scissor-lift".

    Parameters: "n-four-bar" takes `loops`, the number of four-bars in the chain (40 if not given); others take none.

    Raises:
        UnknownNameError: there is no such entry; the message lists the most similar names.
        ArgumentError: the entry does not have this parameter, or its value is impossible.
    """
    beginning = [known for known in _ENTRIES if isinstance(name, str) and name and known.startswith(f"{name}-")]
    if isinstance(name, str) and name not in _ENTRIES and len(beginning) == 1:
        name = beginning[0]
    if not isinstance(name, str) or name not in _ENTRIES:
        near = difflib.get_close_matches(shown(name), names(), n=3)
        hint = (
            f"did you mean {' or '.join(map(repr, near))}?"
            if near
            else f"`partita list` and pt.catalogue.names() name all {len(names())}"
        )
        raise UnknownNameError(f"the catalogue has no entry {shown(name)}; {hint}", name=shown(name), known=names())
    make = _ENTRIES[name]
    known = list(inspect.signature(make).parameters)
    for parameter in parameters:
        if parameter not in known:
            takes = f"it takes {', '.join(known)}" if known else "it takes no parameters"
            raise ArgumentError(f"{name!r} has no parameter {parameter!r}; {takes}", argument=parameter)
    return make(**parameters)


def load(name: str, **parameters: Any) -> Mechanism:
    """The mechanism of entry `name`, drawn in its starting position; `entry(name).initial(m)` is its start with rates.

    >>> import partita as pt
    >>> m = pt.catalogue.load("four-bar")
    >>> state = pt.catalogue.entry("four-bar").initial(m)

    Parameters and errors as for `entry`.
    """
    return entry(name, **parameters).mechanism()


def about(name: str, **parameters: Any) -> str:
    """Description of entry `name`: title, source, run, checks with tolerances and their reasons, notes."""
    return entry(name, **parameters).about()
