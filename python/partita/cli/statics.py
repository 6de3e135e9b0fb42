"""`partita equilibrium | modes`: where a mechanism rests, and its small motions there."""

from __future__ import annotations

import argparse
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..naming import listed
from .assemble import account, words
from .models import open_as_asked, start_of
from .printing import print_json

if TYPE_CHECKING:
    from ..analyses.equilibrium import Equilibrium
    from ..analyses.modes import Mode, Modes


def equilibrium(arguments: argparse.Namespace) -> int:
    """Print the equilibrium that is found from the start, with the forces of all joints."""
    found, names = _found(arguments)
    forces = {name: found.joint(name).force[0].tolist() for name in names}
    if arguments.json:
        values = [[x.real, x.imag] for x in found.eigenvalues]
        about = {"stable": found.stable, "indifferent": found.indifferent, "eigenvalues": values, "forces": forces}
        print_json(account(found.state) | about)
        return 0
    print(found)
    print(*words(found.state), sep="\n")
    print("forces on the second body of each joint, world axes [N]")
    width = max(map(len, names), default=0)
    for name, force in forces.items():
        print(f"  {name:<{width}}  " + "  ".join(f"{x:>14.7g}" for x in force))
    return 0


def modes(arguments: argparse.Namespace) -> int:
    """Print frequencies and shapes of the small motions about the equilibrium that is found from the start."""
    opened = open_as_asked(arguments.model, arguments)
    start = start_of(opened, arguments.target, arguments.rate)
    steady = start if arguments.here else opened.mechanism.equilibrium(start, stable=True)
    found = opened.mechanism.linearize(steady).modes()
    if arguments.json:
        print_json({"modes": [_plain(mode) for mode in found], "zero": found.zero})
    else:
        print(*_lines(found), sep="\n")
    if arguments.html:
        # the first that moves: the free ones are slower
        number = next((mode.number for mode in found if mode.kind != "zero"), 0)
        print(f"wrote {found.to_html(Path(arguments.html), number)}")
    return 0


def _found(arguments: argparse.Namespace) -> tuple[Equilibrium, list[str]]:
    opened = open_as_asked(arguments.model, arguments)
    start = start_of(opened, arguments.target, arguments.rate)
    found = opened.mechanism.equilibrium(start, stable=not arguments.nearest)
    return found, list(opened.mechanism.joints)


def _plain(mode: Mode) -> dict[str, Any]:
    return {
        "eigenvalue": [mode.eigenvalue.real, mode.eigenvalue.imag],
        "frequency": mode.frequency,
        "damping": mode.damping,
        "kind": mode.kind,
        "motion": mode.motion,
    }


SHOWN = 0.005
"""Bodies with a smaller part of the energy are not listed. Scale: fraction of the energy of the mode. Reason: half a
per cent, which is printed as 0 or 1."""


def _lines(found: Modes) -> list[str]:
    lines = ["mode  frequency [Hz]  damping ratio  bodies that move (share of the kinetic energy)"]
    for mode in found:
        energy = sorted(found.energy(mode.number).items(), key=lambda item: -item[1])
        most = listed([f"{name} {math.floor(100 * part + 0.5)} %" for name, part in energy[:4] if part > SHOWN])
        one = f"{mode.frequency:>14.6g}" if mode.frequency else f"{mode.kind:>14}"
        lines.append(f"{mode.number:>4}  {one}  {mode.damping:>13.4g}  {most}")
    return lines
