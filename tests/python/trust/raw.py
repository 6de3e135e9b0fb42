"""No raw errors

Numbers out of range, arguments of the wrong type, damaged files: each raises a typed error with a message, never a raw
error of Python or NumPy, and never yields an invented number.
"""

from __future__ import annotations

import json
import math
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from drawings import GENERAL, four_bar, pendulum, swing

import partita as pt
from partita import results
from partita.errors import (
    ArgumentError,
    DescriptionError,
    FileFormatError,
    MissingFileError,
    PartitaError,
    UnknownNameError,
)

from .case import Case, Held, done, refused, right


def asked(name: str, title: str, error: type[PartitaError], words: str, call: Callable[[], Any]) -> Case:
    @refused(title, error, words)
    def ask() -> Iterator[Held]:
        call()
        yield from ()

    return replace(ask, name=name)


def body(**change: Any) -> Any:
    m = pt.Mechanism("body")
    return m.add_body("b", **{"mass": 1.0, "inertia": (1.0, 1.0, 1.0), **change})


def hinged(**change: Any) -> Any:
    m = pt.Mechanism("hinged")
    rod = m.add_rod("rod", start=(0, 0, 0), end=(1, 0, 0), mass=1.0)
    return m.add_revolute("A", m.ground, rod, **{"point": (0, 0, 0), **change})


CASES = [
    asked("inertia", "an inertia of 1e308", DescriptionError, "use other units", lambda: body(inertia=(1e308,) * 3)),
    asked(
        "impossible", "an inertia that no body can have", DescriptionError, "inertia", lambda: body(inertia=(1, 1, 3))
    ),
    asked("nan_mass", "a mass that is NaN", DescriptionError, "give a finite number", lambda: body(mass=math.nan)),
    asked("no_axis", "an axis (0, 0, 0)", DescriptionError, "has no direction", lambda: hinged(axis=(0, 0, 0))),
    asked("nan_axis", "an axis with NaN", DescriptionError, "axis", lambda: hinged(axis=(0, 0, math.nan))),
    asked(
        "no_length",
        "a rod whose ends are one point",
        DescriptionError,
        "rod",
        lambda: pt.Mechanism("m").add_rod("rod", (1, 2, 3), (1, 2, 3), 1.0),
    ),
    asked("text_time", '`t="x"`', ArgumentError, "t must be", lambda: pendulum().assemble(t="x")),  # type: ignore[arg-type]
    asked("backwards", "a run of -1 s", ArgumentError, "duration", lambda: pendulum().simulate(-1.0)),
    asked("no_time", "a run of NaN seconds", ArgumentError, "duration", lambda: pendulum().simulate(math.nan)),
    asked("no_tolerance", "rtol 0", ArgumentError, "rtol", lambda: pendulum().simulate(1.0, rtol=0.0)),
    asked(
        "outputs_outside",
        "outputs after the end",
        ArgumentError,
        "t_eval",
        lambda: pendulum().simulate(1.0, t_eval=[0.0, 2.0]),
    ),
    asked(
        "outputs_unsorted",
        "outputs that go back",
        ArgumentError,
        "t_eval",
        lambda: pendulum().simulate(1.0, t_eval=[0.5, 0.2]),
    ),
    asked(
        "unknown_joint",
        "the rate of a joint that is not there",
        UnknownNameError,
        "known",
        lambda: pendulum().assemble(rates={"B": 1.0}),
    ),
    asked(
        "foreign_state",
        "the state of another mechanism",
        ArgumentError,
        "make the state with assemble",
        lambda: pendulum().simulate(1.0, initial=four_bar(GENERAL).assemble()),
    ),
    asked(
        "nan_state", "a state with NaN", ArgumentError, "give finite numbers", lambda: pt.State(0.0, [math.nan], [0.0])
    ),
    asked(
        "missing_file",
        "a result that is not there",
        MissingFileError,
        "there.json",
        lambda: results.load_result("not/there.json"),
    ),
    asked(
        "empty",
        "a mechanism without bodies",
        DescriptionError,
        "it has no bodies",
        lambda: pt.Mechanism("empty").simulate(1.0),
    ),
    asked(
        "huge_rate",
        "a start at 1e200 rad/s",
        ArgumentError,
        "is not a finite number at t = 0",
        lambda: done(pendulum().simulate(1.0, initial=pt.State(0.0, [0.0], [1e200], ["A"]))),
    ),
]


@right("axes of 1e-170 and of 1e150", "the same pendulum with an axis of 1, by elliptic functions")
def long_and_short_axes() -> Iterator[Held]:
    for size in (1e-170, 1e150):
        m = pt.Mechanism("pendulum")
        rod = m.add_rod("rod", start=(0, 0, 0), end=(np.sin(1.0), -np.cos(1.0), 0), mass=1.0)
        m.add_revolute("A", m.ground, rod, point=(0, 0, 0), axis=(0, 0, size))
        run = done(m.simulate(2.0))
        yield Held(f"{size:g}", run.q[:, 0] + 1.0, swing(run.t, 1.0), 1e-7)


def damaged(name: str, title: str, words: str, ending: str, harm: Callable[[bytes], bytes]) -> Case:
    @refused(title, FileFormatError, words)
    def ask() -> Iterator[Held]:
        with tempfile.TemporaryDirectory() as folder:
            path = pendulum().simulate(0.2, t_eval=np.linspace(0, 0.2, 5)).save(Path(folder) / f"run{ending}")
            path.write_bytes(harm(path.read_bytes()))
            results.load_result(path)
        yield from ()

    return replace(ask, name=name)


def flipped(content: bytes) -> bytes:
    # the last bit of a digit, so that what is there can still be read
    index = next(i for i in range(len(content) // 2, len(content)) if content[i] in b"0123456789")
    return content[:index] + bytes([content[index] ^ 1]) + content[index + 1 :]


def edited(content: bytes) -> bytes:
    result = json.loads(content)
    result["success"] = True
    return json.dumps(result).encode()


CASES += [
    damaged("flip_json", "a stored result (JSON) with one bit flipped", "checksum", ".json", flipped),
    damaged("flip_nc", "a stored result (NetCDF) with one bit flipped", "checksum", ".nc", flipped),
    damaged("cut_json", "a stored result (JSON) cut in half", "run.json", ".json", lambda x: x[: len(x) // 2]),
    damaged("cut_nc", "a stored result (NetCDF) cut in half", "run.nc", ".nc", lambda x: x[: len(x) // 2]),
    damaged("edited", "a stored result written anew with another word in it", "checksum", ".json", edited),
    damaged("other", "a picture in place of a result", "run.nc", ".nc", lambda x: b"\x89PNG\r\n" + bytes(100)),
]
