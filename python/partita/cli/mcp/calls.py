"""What each tool computes, in the child process of its call."""

from __future__ import annotations

import tempfile
import warnings
from collections.abc import Callable, Iterator, Mapping
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import ArgumentError, PartitaError
from ...io.toml import parse
from ...mechanism import Mechanism, load
from ...naming import index_of
from ...options import positive
from ...results import Result
from ...state import State
from ..assemble import account
from ..models import Opened
from .folder import Folder
from .limits import ANSWER, FILE, MEMBERS, OUTPUTS, TEXT, Limits
from .tools import MODELS

Arguments = Mapping[str, Any]

EXAMPLE = """[mechanism]
partita = 1
name = "pendulum"

[[rod]]
name = "rod"
start = [0, 0, 0]
end = [1, 0, 0]
mass = 1.0

[[joint]]
name = "A"
type = "revolute"
parent = "ground"
child = "rod"
point = [0, 0, 0]
axis = [0, 0, 1]
"""
"""Shown by `describe` without a model."""

_OPTIONS = ("rtol", "atol", "method")


def call(tool: str, arguments: Arguments, folder: Folder, limits: Limits) -> dict[str, Any]:
    """The answer of a tool whose arguments have passed its schema, as `plain` data; pictures are bytes under "png".
    Raises `PartitaError`."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # verdicts, losses and changes are part of the answer
        if not any(word in arguments for word in MODELS):
            return _about(folder, limits)
        return _CALLS[tool](_opened(arguments, folder), arguments, folder)


def _about(folder: Folder, limits: Limits) -> dict[str, Any]:
    """What there is, for a client that has no model yet."""
    from ... import catalogue

    return {
        "files": folder.models(),
        "catalogue": {name: catalogue.entry(name).title for name in catalogue.names()},
        "example": EXAMPLE,
        "limits": {
            "seconds": limits.seconds,
            "megabytes": limits.megabytes,
            "outputs": OUTPUTS,
            "members": MEMBERS,
            "characters of a model": TEXT,
            "bytes of a file": FILE,
            "bytes of an answer": ANSWER,
        },
    }


def _opened(arguments: Arguments, folder: Folder) -> Opened:
    if "model" in arguments:
        return Opened(parse(arguments["model"], Mechanism, "model"))
    if "file" in arguments:
        return Opened(load(folder.model(arguments["file"]), root=folder.path))
    from ... import catalogue

    entry = catalogue.entry(arguments["catalogue"])
    return Opened(entry.mechanism(), entry)


def _start(opened: Opened, arguments: Arguments, parameters: Mapping[str, Any] | None = None) -> State | None:
    """The initial state; None: as drawn, at rest."""
    near = opened.initial()
    targets, rates = arguments.get("targets", {}), arguments.get("rates", {})
    if not targets and not rates and parameters is None:
        return near
    return opened.mechanism.assemble(targets, rates, near, parameters=parameters)


def _run(opened: Opened, arguments: Arguments, parameters: Mapping[str, Any] | None = None) -> Result:
    start = _start(opened, arguments, parameters)
    options: dict[str, Any] = {} if opened.entry is None else dict(opened.entry.options)
    options |= {name: arguments[name] for name in _OPTIONS if name in arguments}
    if "duration" in arguments:
        duration = positive("duration", arguments["duration"], "s")
    elif opened.entry is not None:
        duration = opened.entry.duration
    else:
        raise ArgumentError("a model specifies no duration; add duration, such as 2.0 [s]", argument="duration")
    t0 = 0.0 if start is None else start.t
    times = np.linspace(t0, t0 + duration, int(arguments.get("outputs", 101)))
    return opened.mechanism.simulate(duration, t_eval=times, initial=start, parameters=parameters, **options)


def _judged(run: Result) -> dict[str, Any]:
    """How a run went."""
    certificate = run.certificate
    return {
        "title": run.title,
        "status": run.status,
        "success": run.success,
        "message": run.message,
        "verdict": certificate.verdict,
        "notes": certificate.notes,
        "findings": certificate.findings,
        "certificate": str(certificate).splitlines(),
        "options": {name: value for name, value in run.options.items() if value is not None},
        "switches": [str(change) for change in run.partitions if change.is_switch],
        "work": run.counters,
        "outputs": len(run.t),
        "t_end": run.t[-1] if len(run.t) else None,
    }


def _describe(opened: Opened, arguments: Arguments, folder: Folder) -> dict[str, Any]:
    m = opened.mechanism
    found: dict[str, Any] = {"name": m.name}
    for word in ("bodies", "joints", "couplings", "drives", "forces", "sensors"):
        table = getattr(m, word)
        found[word] = {name: repr(table[name]) for name in table}
    found["remarks"] = [str(remark) for remark in m.remarks]
    model = m.compile()
    summary = model.summary
    found |= {name: summary[name] for name in ("planar", "mobility", "coordinates", "velocities", "notes")}
    found["parameters"] = model.parameters
    return found


def _check(opened: Opened, arguments: Arguments, folder: Folder) -> dict[str, Any]:
    found = opened.mechanism.check(opened.initial()).to_dict()
    if found["reading"] is not None:
        found["reading"]["path"] = arguments["file"]
    return found


def _report(opened: Opened, arguments: Arguments, folder: Folder) -> dict[str, Any]:
    report = opened.mechanism.report(_start(opened, arguments))
    return report.to_dict() | {"text": str(report)}


def _assemble(opened: Opened, arguments: Arguments, folder: Folder) -> dict[str, Any]:
    state = _start(opened, arguments) or opened.mechanism.assemble()
    return account(state) | {"assembly": state.assembly}


def _simulate(opened: Opened, arguments: Arguments, folder: Folder) -> dict[str, Any]:
    run = _run(opened, arguments)
    return _judged(run) | {
        "t": run.t,
        "coordinates": dict(zip(run.names.coordinates, run.q.T, strict=True)),
        "velocities": dict(zip(run.names.velocities, run.v.T, strict=True)),
    }


def _wanted(run: Result, arguments: Arguments) -> list[str]:
    """Names of the joints that the call asks for."""
    known = run.names.joints
    return [known[index_of(name, known, "joint")] for name in arguments.get("joints", known)]


def _sizes(values: Any, determined: Any) -> Any:
    """Magnitudes (nt,) of the components that have a unique value."""
    return np.linalg.norm(values[:, determined], axis=1)


def _largest(values: Any, determined: Any) -> float | None:
    """Largest magnitude; None where no component has a unique value, or there is no output."""
    return float(np.max(_sizes(values, determined))) if len(values) and np.any(determined) else None


def _parts(run: Result, name: str) -> Iterator[tuple[str, Any, Any]]:
    """Force and moment of a joint (nt, 3), with the components that are determined (3,)."""
    joint = run.joint(name)
    yield "force", joint.force, joint.determined[:3]
    yield "moment", joint.moment, joint.determined[3:]


def _reactions(opened: Opened, arguments: Arguments, folder: Folder) -> dict[str, Any]:
    run = _run(opened, arguments)
    series = bool(arguments.get("series"))
    found: dict[str, dict[str, Any]] = {}
    for name in _wanted(run, arguments):
        found[name] = {}
        for word, values, determined in _parts(run, name):
            largest = _largest(values, determined)
            found[name][word] = {
                "largest": largest,
                "t": None if largest is None else run.t[int(np.argmax(_sizes(values, determined)))],
                "components": np.where(determined, np.max(np.abs(values), axis=0, initial=0.0), np.nan),
                "determined": determined,
            } | ({"values": np.where(determined, values, np.nan)} if series else {})
    return _judged(run) | ({"t": run.t} if series else {}) | {"axes": "world", "joints": found}


def _sweep(opened: Opened, arguments: Arguments, folder: Folder) -> dict[str, Any]:
    grid = arguments["parameters"]
    count = int(np.prod([float(len(values)) for values in grid.values()]))
    if count > MEMBERS:
        raise ArgumentError(
            f"parameters: the grid has {count} members, more than {MEMBERS}; give fewer values", argument="parameters"
        )
    members = []
    for values in product(*grid.values()):
        parameters = dict(zip(grid, values, strict=True))
        found: dict[str, Any] = {"parameters": parameters}
        try:
            run = _run(opened, arguments, parameters)
            found["joints"] = {
                name: {word: _largest(values, determined) for word, values, determined in _parts(run, name)}
                for name in _wanted(run, arguments)
            }
            found |= {"verdict": run.certificate.verdict, "status": run.status, "message": run.message}
        except PartitaError as error:
            found["failed"] = str(error)
        members.append(found)
    if all("failed" in member for member in members):
        raise ArgumentError(
            f"every member failed; the first, {members[0]['parameters']}: {members[0]['failed']}", argument="parameters"
        )
    return {"count": count, "members": members}


def _pictured(arguments: Arguments, draw: Callable[[Path], object]) -> dict[str, Any]:
    """A figure as bytes (png) or text (svg)."""
    kind = arguments.get("format", "png")
    with tempfile.TemporaryDirectory() as own:
        path = Path(own) / f"figure.{kind}"
        draw(path)
        content = path.read_bytes()
    return {kind: content if kind == "png" else content.decode("utf-8")}


def _draw(opened: Opened, arguments: Arguments, folder: Folder) -> dict[str, Any]:
    m = opened.mechanism
    state = _start(opened, arguments)
    why = None
    if state is None:
        try:
            state = m.assemble()
        except PartitaError as error:
            why = str(error)
    return {"closes": why is None, "why": why} | _pictured(arguments, lambda path: m.plot(path, state=state))


def _plot(opened: Opened, arguments: Arguments, folder: Folder) -> dict[str, Any]:
    run = _run(opened, arguments)
    words = arguments.get("what", ())
    return _judged(run) | _pictured(arguments, lambda path: run.plot(*words, path=path))


def _export(opened: Opened, arguments: Arguments, folder: Folder) -> dict[str, Any]:
    m, kind = opened.mechanism, arguments["format"]
    name = arguments.get("to", f"mechanism.{kind}")
    if Path(name).suffix.lower() != f".{kind}":
        raise ArgumentError(f"to {name!r} must end in .{kind}, as the format says", argument="to")
    folder.inside(name)  # before a long run, not after
    found: dict[str, Any] = {}
    with tempfile.TemporaryDirectory() as own:
        path = Path(own) / Path(name).name
        if kind in ("toml", "urdf"):
            written = m.save(path)
            found |= {"changed": written.changed, "dropped": written.dropped}
        elif kind == "c":
            m.export_c(path, initial=_start(opened, arguments))
        elif "duration" in arguments or opened.entry is not None:
            run = _run(opened, arguments)
            run.to_html(path)
            found |= _judged(run)
        else:
            m.to_html(path, state=_start(opened, arguments))
        contents = {file.name: file.read_bytes() for file in sorted(Path(own).iterdir(), key=lambda f: f != path)}
    if "to" in arguments:
        return found | {"written": folder.new(name, contents)}
    return found | {"files": {file: content.decode("utf-8") for file, content in contents.items()}}


_CALLS: dict[str, Callable[[Opened, Arguments, Folder], dict[str, Any]]] = {
    "describe": _describe,
    "check": _check,
    "draw": _draw,
    "assemble": _assemble,
    "run": _simulate,
    "report": _report,
    "reactions": _reactions,
    "sweep": _sweep,
    "plot": _plot,
    "export": _export,
}
