"""What an FMU says of itself: its variables, `modelDescription.xml` of FMI 2.0 and 3.0, and a page for readers."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from html import escape
from itertools import groupby

from .. import _core
from .skeleton import quoted, text
from .skeleton import words as numbers

_UNITS = {
    "m": {"m": 1},
    "rad": {"rad": 1},
    "s": {"s": 1},
    "m/s": {"m": 1, "s": -1},
    "rad/s": {"rad": 1, "s": -1},
    "N": {"kg": 1, "m": 1, "s": -2},
    "N.m": {"kg": 1, "m": 2, "s": -2},
    "J": {"kg": 1, "m": 2, "s": -2},
    "kg": {"kg": 1},
    "kg m^2": {"kg": 1, "m": 2},
    "m/s^2": {"m": 1, "s": -2},
    "rad/s^2": {"rad": 1, "s": -2},
    "N/m": {"kg": 1, "s": -2},
    "N s/m": {"kg": 1, "s": -1},
    "N m/rad": {"kg": 1, "m": 2, "s": -2, "rad": -1},
    "N m s/rad": {"kg": 1, "m": 2, "s": -1, "rad": -1},
}
_KINDS = {
    "input": 'causality="input" variability="continuous"',
    "output": 'causality="output" variability="continuous" initial="calculated"',
    "parameter": 'causality="parameter" variability="fixed" initial="exact"',
    "independent": 'causality="independent" variability="continuous"',
}
_TITLES = {"input": "Inputs", "output": "Outputs", "parameter": "Parameters", "independent": "Time"}


@dataclass(frozen=True)
class Variable:
    """A variable: its name, its causality, what it is a number of, its unit, its meaning, the number of its first value
    among all, how many values it has, and their start values, if they have any."""

    name: str
    causality: str
    of: str
    unit: str
    words: str
    number: int
    size: int = 1
    starts: tuple[float, ...] = ()

    @property
    def reference(self) -> str:
        """Its value reference, as an attribute."""
        return f'valueReference="{self.number}"'

    @property
    def values(self) -> str:
        """Unit and start values, as attributes."""
        unit = f' unit="{self.unit}"' if self.unit in _UNITS else ""
        return unit + (f' start="{numbers(self.starts)}"' if self.starts else "")


@dataclass(frozen=True)
class Described:
    """An FMU: names, identification, default experiment and variables."""

    name: str
    token: str
    identifier: str
    experiment: Mapping[str, float]
    variables: list[Variable]

    def of(self, causality: str) -> list[Variable]:
        """The variables of one causality."""
        return [x for x in self.variables if x.causality == causality]


def arrays(variables: Iterable[Variable]) -> list[Variable]:
    """The numbers of one quantity, of one unit, as one variable (FMI 3.0); others as they are."""
    found: list[Variable] = []
    for (causality, of), group in groupby(variables, lambda x: (x.causality, x.of)):
        members = list(group)
        if len(members) == 1 or len({x.unit for x in members}) > 1:
            found += members
            continue
        first, starts = members[0], tuple(start for x in members for start in x.starts)
        found.append(Variable(of, causality, of, first.unit, first.words, first.number, len(members), starts))
    return found


def xml(d: Described, version: str) -> str:
    """`modelDescription.xml`."""
    head, variable, structure = _VERSIONS[version]
    used = dict.fromkeys(x.unit for x in d.variables if x.unit in _UNITS)
    lines = ['<?xml version="1.0" encoding="UTF-8"?>', *head(d), "  <UnitDefinitions>"]
    for unit in used or ["m"]:
        base = " ".join(f'{key}="{power}"' for key, power in _UNITS[unit].items())
        lines.append(f'    <Unit name="{unit}"><BaseUnit {base}/></Unit>')
    times = " ".join(f'{key}="{text(value)}"' for key, value in d.experiment.items())
    lines += [
        "  </UnitDefinitions>",
        "  <LogCategories>",
        '    <Category name="logStatusWarning"/>',
        '    <Category name="logStatusDiscard"/>',
        '    <Category name="logStatusError"/>',
        "  </LogCategories>",
        f"  <DefaultExperiment {times}/>",
        "  <ModelVariables>",
        *(variable(x) for x in d.variables),
        "  </ModelVariables>",
        "  <ModelStructure>",
        *structure(d),
        "  </ModelStructure>",
        "</fmiModelDescription>",
        "",
    ]
    return "\n".join(lines)


def _tool() -> str:
    return f'generationTool="Partita {_core.version()}" variableNamingConvention="flat"'


def _head_2(d: Described) -> list[str]:
    return [
        f'<fmiModelDescription fmiVersion="2.0" modelName={quoted(d.name)} guid="{d.token}" {_tool()}'
        ' numberOfEventIndicators="0">',
        f'  <CoSimulation modelIdentifier="{d.identifier}" canHandleVariableCommunicationStepSize="true"'
        ' canInterpolateInputs="true" canGetAndSetFMUstate="true" canSerializeFMUstate="true"/>',
    ]


def _variable_2(x: Variable) -> str:
    return (
        f"    <ScalarVariable name={quoted(x.name)} {x.reference} {_KINDS[x.causality]} description={quoted(x.words)}>"
        f"<Real{x.values}/></ScalarVariable>"
    )


def _structure_2(d: Described) -> list[str]:
    indices = [i for i, x in enumerate(d.variables, 1) if x.causality == "output"]
    lines: list[str] = []
    for part in ("Outputs", "InitialUnknowns"):
        if indices:
            lines += [f"    <{part}>", *(f'      <Unknown index="{i}"/>' for i in indices), f"    </{part}>"]
    return lines


def _head_3(d: Described) -> list[str]:
    return [
        f'<fmiModelDescription fmiVersion="3.0" modelName={quoted(d.name)} instantiationToken="{d.token}" {_tool()}>',
        f'  <CoSimulation modelIdentifier="{d.identifier}" canHandleVariableCommunicationStepSize="true"'
        ' canGetAndSetFMUState="true" canSerializeFMUState="true"/>',
    ]


def _variable_3(x: Variable) -> str:
    size = f'><Dimension start="{x.size}"/></Float64>' if x.size > 1 else "/>"
    return (
        f"    <Float64 name={quoted(x.name)} {x.reference} {_KINDS[x.causality]}"
        f" description={quoted(x.words)}{x.values}{size}"
    )


def _structure_3(d: Described) -> list[str]:
    return [f"    <{part} {x.reference}/>" for part in ("Output", "InitialUnknown") for x in d.of("output")]


_Lines = Callable[[Described], list[str]]
_VERSIONS: dict[str, tuple[_Lines, Callable[[Variable], str], _Lines]] = {
    "2.0": (_head_2, _variable_2, _structure_2),
    "3.0": (_head_3, _variable_3, _structure_3),
}
VERSIONS = tuple(_VERSIONS)
"""Versions of FMI that are written."""


def page(d: Described, version: str) -> str:
    """`documentation/index.html`: the variables with their units and meanings."""
    lines = [
        '<!DOCTYPE html><html lang="en"><head><meta charset="utf-8">',
        f"<title>{escape(d.name)}</title></head><body>",
        f"<h1>{escape(d.name)}</h1>",
        f"<p>A mechanism for co-simulation (FMI {version}), written by Partita {_core.version()}.</p>",
    ]
    for causality, title in _TITLES.items():
        if not d.of(causality):
            continue
        lines += [f"<h2>{title}</h2><table>", "<tr><th>name</th><th>unit</th><th>meaning</th><th>start</th></tr>"]
        for x in d.of(causality):
            name = escape(x.name) + (f" ({x.size} numbers)" if x.size > 1 else "")
            cells = (name, escape(x.unit), escape(x.words), numbers(x.starts))
            lines.append("<tr>" + "".join(f"<td>{cell}</td>" for cell in cells) + "</tr>")
        lines.append("</table>")
    return "\n".join([*lines, "</body></html>", ""])
