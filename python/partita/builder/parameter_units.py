"""Units of the parameters of a compiled model by name, with which `with_parameters` converts text."""

from __future__ import annotations

from ..units.door import SI
from .couplings import factor_units
from .joints import effort_of
from .measures import measure_unit
from .records import CouplingRecord, Description, LoadRecord, TorqueRecord
from .rotors import rotor_units

_OF_BODIES = {"mass": "kg", "com": "m", "inertia": "kg m^2"}


def parameter_unit(d: Description, name: str) -> SI:
    """SI unit of a parameter; "" for a number without one and for unknown parameters."""
    if name == "gravity":
        return "m/s^2"
    owner, _, word = name.rpartition(".")
    if owner in d.bodies and word in _OF_BODIES:
        return _OF_BODIES[word]
    if word.startswith("point") or (owner in d.joints and word == "pitch"):
        return "m"
    if owner in d.couplings and (unit := _of_coupling(d, d.couplings[owner], word)) is not None:
        return unit
    if owner in d.rotors:
        units = rotor_units(d, d.rotors[owner].joint, d.rotors[owner].coordinate)
        return units.get(word, "")
    if (drive := d.drives.get(owner)) is not None and word in ("position", "velocity"):
        unit = measure_unit(d, drive.measure)
        return unit if word == "position" else f"{unit or '1'}/s"
    match d.forces.get(owner):
        case TorqueRecord(joint=joint, coordinate=i):
            return effort_of(d.joints[joint], i) if word == "value" else ""
        case LoadRecord() as load:
            return load.units.get(word, "")
        case None:
            return ""
    return "N" if word == "value" else ""


def _of_coupling(d: Description, coupling: CouplingRecord, word: str) -> SI | None:
    """None unless it is a number of a coupling."""
    if coupling.kind not in ("linear", "roll"):
        return None
    if word in ("radius", "radius1", "radius2", "length", "center"):
        return "m"
    units = [measure_unit(d, term) for term in coupling.terms]
    factors = factor_units(units) if units else []
    own: dict[str, SI] = {"factors": factors, "offset": units[0], "ratio": factors[-1]} if units else {}
    return own.get(word)
