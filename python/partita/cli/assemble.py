"""`partita assemble`: a closed position, or all of them."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

from ..naming import listed
from .models import open_as_asked, settings, start_of
from .printing import print_json

if TYPE_CHECKING:
    from ..state import State


def assemble(arguments: argparse.Namespace) -> int:
    """Close the loops for the given targets, and print all positions; with --all, on every branch."""
    opened = open_as_asked(arguments.model, arguments)
    if arguments.all:
        targets, rates = settings(arguments.target), settings(arguments.rate)
        found = opened.mechanism.assemblies(targets, rates, opened.initial(), inputs=arguments.inputs)
        if arguments.json:
            each = [{"branch": one.branch, "residual": one.residual, **account(one.state)} for one in found]
            print_json({"loops": found.blocks, "assemblies": each, "notes": found.notes})
        else:
            print(found)
            for number, one in enumerate(found):
                print(f"\nassembly {number}")
                print(*words(one.state), sep="\n")
        return 0
    state = start_of(opened, arguments.target, arguments.rate) or opened.mechanism.assemble()
    if arguments.json:
        print_json(account(state) | {"assembly": state.assembly})
    else:
        print(*words(state), sep="\n")
        if state.assembly:
            print(f"|Phi| {state.assembly['residual']:.1e}")
    return 0


def account(state: State) -> dict[str, Any]:
    """A state by names [rad or m, rad/s or m/s]."""
    return {
        "t": state.t,
        "coordinates": dict(zip(state.names, state.q.tolist(), strict=True)),
        "velocities": dict(zip(state.velocity_names, state.v.tolist(), strict=True)),
    }


def words(state: State) -> list[str]:
    """A line for each coordinate; its rate beside it where both have the name."""
    rates = dict(zip(state.velocity_names, state.v.tolist(), strict=True))
    width = max(map(len, (*state.names, *rates)), default=0)
    lines = [f"t = {state.t:g} s; rad and m, rad/s and m/s"]
    for name, value in zip(state.names, state.q.tolist(), strict=True):
        rate = rates.pop(name, None)
        lines.append(f"  {name:<{width}}  {value:>22.15g}" + ("" if rate is None else f"  {rate:>22.15g}"))
    if rates:
        lines.append(f"rates of {listed(list(rates))}")
        lines += [f"  {name:<{width}}  {'':>22}  {rate:>22.15g}" for name, rate in rates.items()]
    return lines
