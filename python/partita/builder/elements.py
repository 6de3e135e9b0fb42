"""Elements added to a mechanism, by name: `Mechanism.bodies`, `joints`, `couplings`, `rotors`,
`drives`, `forces`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, Generic, NoReturn, TypeVar

from ..numeric import shown
from . import changes
from .checks import Element, find
from .drawing import Drawing
from .records import Handle

H = TypeVar("H", bound=Handle)


class Elements(Mapping[str, H], Generic[H]):
    """The elements of one kind by name, in the order of addition: a mapping of the present content.

    >>> import partita as pt
    >>> m = pt.Mechanism("pendulum")
    >>> rod = m.add_rod("rod", start=(0, 0, 0), end=(1, 0, 0), mass=1.0)
    >>> hinge = m.add_revolute("A", m.ground, rod, point=(0, 0, 0))
    >>> m.bodies
    <bodies: rod>
    >>> m.bodies["rod"].mass = "2 kg"
    >>> rod.mass, m.joints["A"].axis.tolist()
    (2.0, [0.0, 0.0, 1.0])
    >>> m.joints.remove("A")
    >>> len(m.joints)
    0
    """

    def __init__(self, mechanism: Drawing, kind: type[H], word: str) -> None:
        self._mechanism, self._kind, self._word = mechanism, kind, word

    @property
    def _table(self) -> Mapping[str, Any]:
        found: Mapping[str, Any] = getattr(self._mechanism._description, self._kind.table)
        return found

    def __getitem__(self, name: str | H) -> H:
        """The element of this name; `UnknownNameError` with the nearest one if there is none."""
        return self._kind(self._name(name), self._mechanism)

    def __iter__(self) -> Iterator[str]:
        return iter(tuple(self._table))

    def __len__(self) -> int:
        return len(self._table)

    def __delitem__(self, name: str | H) -> None:
        self.remove(name)

    def __setitem__(self, name: str, value: object) -> NoReturn:
        """Refused: elements are added by the methods of the mechanism."""
        bodies = "add_body, add_rod or add_solid"
        verb = bodies if self._word == "body" else f"the method that makes such a {self._word}"
        Element(self._word, str(name)).fail(f"it cannot be assigned; use {verb}, or set the attributes of one")

    def remove(self, name: str | H) -> None:
        """Remove an element from the mechanism, as if it had never been added.

        Raises `DescriptionError` where others refer to it, with their names: a drive to its joint, a joint to its
        bodies. `UnknownNameError`: there is none of this name.
        """
        changes.remove(self._mechanism, self._kind.table, self._name(name))

    def _name(self, name: Any) -> str:
        if isinstance(name, Handle) and (name.table != self._kind.table or name.mechanism is not self._mechanism):
            return find(self._word, f"{shown(name)} of another kind or mechanism", self._table)
        if isinstance(name, Handle):
            name = name.name
        return find(self._word, name if isinstance(name, str) else shown(name), self._table)

    def __repr__(self) -> str:
        return f"<{self._kind.table}: {', '.join(self) or 'none'}>"
