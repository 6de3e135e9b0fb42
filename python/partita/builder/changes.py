"""Elements read, changed and removed after they were added.

A change repeats the call that made the element with one argument changed, and the calls of all elements that refer to
it: so a changed mechanism equals one that was drawn so from the start. It happens on a copy of the description; a
refused change leaves everything unchanged.
"""

from __future__ import annotations

import copy
import difflib
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from typing import Any, NoReturn

import numpy as np

from ..errors import UnknownAttributeError
from ..sensing import uses
from .bodies import density_of
from .calls import call_of, kind_of, readers, referring, words_of
from .checks import Element, find, vector
from .drawing import Drawing
from .records import GROUND, BodyRecord, Handle, JointRecord, Point, Ref
from .sampled import JoinedTable, SampledTable

_WORDS = {
    "bodies": "body",
    "joints": "joint",
    "couplings": "coupling",
    "rotors": "rotor",
    "drives": "drive",
    "forces": "force",
    "sensors": "sensor",
}
_COMPLIANCE = ["m/N"] * 3 + ["rad/(N m)"] * 3


def words(mechanism: Drawing, handle: Handle) -> list[str]:
    """What can be read of an element."""
    if handle.name == GROUND and handle.table == "bodies":
        return []
    record = _record(mechanism, handle)
    return ["kind", *words_of(type(mechanism), record), *_derived(record)]


def read(mechanism: Drawing, handle: Handle, word: str) -> Any:
    """The arguments of an element, in SI; arrays are copies."""
    if handle.name == GROUND and handle.table == "bodies":
        _unknown(handle, "ground", word, [])
    record = _record(mechanism, handle)
    if word == "kind":
        return kind_of(record)
    derived = _derived(record)
    if word in derived or (word in _BY_MASS and word in (derived := _of_solid(record))):
        return _shown(mechanism, derived[word])
    known = words_of(type(mechanism), record)
    if word not in known:
        _unknown(handle, kind_of(record), word, ["kind", *known, *derived])
    value = call_of(record)[1].get(word, known[word])
    return _shown(mechanism, value)


def content(mechanism: Drawing, handle: Handle) -> str:
    """Kind and arguments of an element in one line; those that have their default are left out."""
    if handle.name == GROUND and handle.table == "bodies":
        return "the world"
    record = _record(mechanism, handle)
    known, given = words_of(type(mechanism), record), call_of(record)[1]
    parts = []
    for word in known:
        value = _shown(mechanism, given.get(word, known[word]))
        if word == "name" or value is None or np.array_equal(_comparable(value), _comparable(known[word])):
            continue
        if word == "orientation":
            if not np.array_equal(value, np.eye(3)):
                parts.append("turned")
            continue
        parts.append(f"{word}={_brief(value)}")
    return f"{kind_of(record)}{', ' if parts else ''}{', '.join(parts)}"


_BRIEF = 48
"""Letters of an argument in the line of an element."""


def _comparable(value: Any) -> Any:
    return np.asarray(value) if isinstance(value, (np.ndarray, tuple, float, int)) else np.array(value, dtype=object)


def _brief(value: Any) -> str:
    if isinstance(value, Handle):
        return repr(value.name)
    if isinstance(value, Mapping) and value.get("of") == "joint":
        return repr(value["joint"])
    if isinstance(value, tuple) and len(value) == 2 and isinstance(value[0], np.ndarray):
        return f"a table of {len(value[0])}"
    if isinstance(value, np.ndarray) and value.ndim == 2:
        diagonal = np.diagonal(value)
        if value.shape[0] != value.shape[1] or not np.array_equal(value, np.diag(diagonal)):
            return f"{value.shape[0]}x{value.shape[1]}"
        value = diagonal
    if isinstance(value, np.ndarray):
        value = value.tolist()
    if isinstance(value, (list, tuple)) and all(isinstance(item, float) for item in value):
        text = f"({', '.join(f'{item:.6g}' for item in value)})"
    elif callable(value):
        text = getattr(value, "__name__", type(value).__name__)
    else:
        text = f"{value:.6g}" if isinstance(value, float) else repr(value)
    return text if len(text) <= _BRIEF else f"{text[: _BRIEF - 4]} ..."


def change(mechanism: Drawing, handle: Handle, arguments: Mapping[str, Any]) -> None:
    """Give other values to some arguments."""
    if handle.name == GROUND and handle.table == "bodies":
        _unknown(handle, "ground", next(iter(arguments), ""), [])
    record = _record(mechanism, handle)
    element = Element(_WORDS[handle.table], handle.name)
    derived, known = _derived(record), words_of(type(mechanism), record)
    for word in arguments:
        if word in ("kind", "name", "mechanism", "table"):
            element.fail(f"its {word} cannot be changed; remove the element and add another")
        if word in derived and word != "compliance":
            element.fail(f"its {word} follows from {_basis(record)}; set these")
        if word not in known and word not in derived:
            _unknown(handle, kind_of(record), word, [*known, *derived])
    new = {word: value for word, value in arguments.items() if word in known}
    with _trial(mechanism):
        if "compliance" in arguments:
            _give(mechanism, element, handle.name, arguments["compliance"])
        if not new:
            return
        method, given = call_of(record)
        if method == "add_solid" and any(new.get(word) is not None for word in _BY_MASS):
            given = {word: value for word, value in given.items() if word not in _BY_MASS}  # one replaces another
        _again(mechanism, handle.table, handle.name, method, {**given, **new}, set(new))
        if handle.table == "sensors":
            _check_order(mechanism, element)
        for table, name in referring(mechanism._description, handle.table, handle.name):
            if not (handle.table == "bodies" and table == "joints"):  # which know nothing of a body but its name
                _again(mechanism, table, name, *call_of(getattr(mechanism._description, table)[name]))


def remove(mechanism: Drawing, table: str, name: str) -> None:
    """Remove an element, unless another refers to it."""
    d = mechanism._description
    record = getattr(d, table)[name]
    carrier = _carrier(record)
    users = referring(d, table, name)
    if carrier is not None:
        users += [user for user in referring(d, "joints", carrier) if user != (table, name)]
    if table == "sensors":
        users += readers(d, name)
    if users:
        listed = ", ".join(f'{_WORDS[other]} "{own}"' for other, own in users[:8])
        more = f" and {len(users) - 8} more" if len(users) > 8 else ""
        Element(_WORDS[table], name).fail(
            f"it cannot be removed: {listed}{more} refer{'s' if len(users) == 1 else ''} to it; remove "
            f"{'that' if len(users) == 1 else 'these'} first"
        )
    with _trial(mechanism):
        _take_out(mechanism, table, name)


def _record(mechanism: Drawing, handle: Handle) -> Any:
    table = getattr(mechanism._description, handle.table)
    return table[find(_WORDS[handle.table], handle.name, table)]


def _unknown(handle: Handle, kind: str, word: str, known: list[str]) -> NoReturn:
    close = difflib.get_close_matches(word, known, n=1)
    hint = f'did you mean "{close[0]}"?' if close else f"it has: {', '.join(known) or 'nothing but its name'}"
    raise UnknownAttributeError(
        f'{_WORDS[handle.table]} "{handle.name}" ({kind}) has no "{word}"; {hint}', name=word, known=known
    )


def _derived(record: Any) -> dict[str, Any]:
    """Data derived from the arguments."""
    if isinstance(record, BodyRecord) and record.rod is not None:
        frame = {"inertia": record.inertia, "com": record.com, "position": record.position}
        return {**frame, "orientation": record.rotation, "length": record.rod[2]}
    if isinstance(record, BodyRecord) and record.solid is not None:
        return {"inertia": record.inertia, "com": record.com}
    return {"compliance": record.compliance} if isinstance(record, JointRecord) else {}


_BY_MASS = ("material", "density", "mass")


def _of_solid(record: Any) -> dict[str, Any]:
    """What is known of the mass of a solid, however it was given."""
    if not isinstance(record, BodyRecord) or record.solid is None:
        return {}
    return {"mass": record.mass, "density": density_of(record.solid)}


def _basis(record: Any) -> str:
    """The arguments from which the rest of a body is computed."""
    return "start, end and mass" if record.rod is not None else "shape and one of material, density and mass"


def _shown(mechanism: Drawing, value: Any) -> Any:
    """A value for the user: read-only arrays, handles for elements that have no name."""
    if isinstance(value, list) and value and all(type(item) is float for item in value):
        value = np.array(value)
    if isinstance(value, np.ndarray):
        twin = value.copy()
        twin.setflags(write=False)
        return twin
    if isinstance(value, Ref) and value == Ref("bodies", GROUND):
        return mechanism.ground
    if isinstance(value, Ref):
        return getattr(mechanism, value.table)[value.name]
    if isinstance(value, SampledTable):
        return SampledTable(_shown(mechanism, value.times), _shown(mechanism, value.values), value.error)
    if isinstance(value, JoinedTable):
        return JoinedTable(_shown(mechanism, value[0]), _shown(mechanism, value[1]), value.interpolation)
    if isinstance(value, (list, tuple)) and not isinstance(value, Point):
        return type(value)(_shown(mechanism, item) for item in value)
    return copy.deepcopy(value) if isinstance(value, Mapping) else value


def _carrier(record: Any) -> str | None:
    """The joint that was added along with a drive of a body's pose."""
    given = getattr(record, "arguments", None)
    return given.get("carrier") if given is not None and hasattr(record, "measure") else None


@contextmanager
def _trial(mechanism: Drawing) -> Iterator[None]:
    """Work on a copy of the description, which replaces the original if all goes well."""
    before = mechanism._description
    mechanism._description = before.copy()
    mechanism._description.numbers.clear()
    try:
        yield
    except BaseException:
        mechanism._description = before
        raise
    mechanism._description.version = before.version + 1


def _take_out(mechanism: Drawing, table: str, name: str) -> None:
    d = mechanism._description
    record = getattr(d, table).pop(name)
    if table == "drives":
        d.driven = {key: drive for key, drive in d.driven.items() if drive != name}
    if (carrier := _carrier(record)) is not None:
        del d.joints[carrier]


def _again(
    mechanism: Drawing, table: str, name: str, method: str, given: Mapping[str, Any], new: Collection[str] = ()
) -> None:
    """Make an element again in its place, with the arguments `new`."""
    d = mechanism._description
    explicit = {key: True for key in d.explicit if key[:2] == (_WORDS[table], name) and key[2] not in new}
    orders = {each: list(getattr(d, each)) for each in (table, "joints")}
    old = getattr(d, table)[name]
    driven = list(d.driven)
    _take_out(mechanism, table, name)
    getattr(mechanism, method)(name=name, **{word: _shown(mechanism, value) for word, value in given.items()})
    d.explicit |= explicit
    if isinstance(old, JointRecord) and old.compliance is not None:
        d.joints[name] = replace(d.joints[name], compliance=old.compliance)
    carriers = _carrier(old), _carrier(getattr(d, table)[name])
    if None not in carriers:  # the joint that carries a body keeps the position of its predecessor in the list
        orders["joints"] = [carriers[1] if own == carriers[0] else own for own in orders["joints"]]
    for each, order in orders.items():
        records = getattr(d, each)
        if list(records) != order:
            ordered = {own: records[own] for own in order if own in records}
            setattr(d, each, {**ordered, **records})
    if table == "drives":
        d.driven = {key: d.driven[key] for key in [*(k for k in driven if k in d.driven), *d.driven]}


def _check_order(mechanism: Drawing, element: Element) -> None:
    """A sensor is made of sensors before it: references are not circular."""
    sensors = mechanism._description.sensors
    names = list(sensors)
    for other in uses(sensors[element.name]):
        if names.index(other) > names.index(element.name):
            element.fail(f'it was added before "{other}", so it cannot refer to it; add another sensor for that')


def _give(mechanism: Drawing, element: Element, name: str, value: Any) -> None:
    """Compliance of a joint: six numbers, or None."""
    d = mechanism._description
    if value is None:
        d.joints[name] = replace(d.joints[name], compliance=None)
        return
    numbers = vector(element, "compliance", value, _COMPLIANCE, 6)
    mechanism.add_compliance(name, numbers[:3], numbers[3:])  # type: ignore[attr-defined]
