"""Inputs changed by chance, over all readers, stores, servers and files of results: each is read, or refused by a typed
error; none ends the process.

`python tests/python/damaged.py [--count N] [--seed S] [KIND ...]` makes N changes of the inputs of each kind. Every
kind runs in a process of its own, which writes down what it is about to read: one that ends early names its input.
"""

from __future__ import annotations

import argparse
import copy
import json
import random
import re
import shutil
import subprocess
import sys
import tempfile
import time
import traceback
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

import partita as pt
from partita.errors import FileFormatError, PartitaError
from partita.files import _MARK, BLANK, Allowance, intact_folder, sealed
from partita.results.formats.matlab_elements import unpacked

HERE = Path(__file__).parent
ROOM = 4 * 10**9
"""Bytes of memory of one process: far above what any input may take."""
SLOW = 10.0
"""Seconds after which an input is reported as slow, which is no error."""

NUMBERS = (
    "0", "-1", "1", "1e-320", "1e-30", "1e30", "1e60", "1e61", "1e200", "1e308", "-1e308", "1e400", "inf", "-inf",
    "nan", "9" * 400, "4294967296", "-2147483649", "9223372036854775808", "100000000", "0x10", "1_0", "1e", "",
)  # fmt: skip
WORDS = (
    "", " ", "$\\frac$", "$x_{", "a" * 5000, "é", "\u202e", "true", "none", "..", "/etc/passwd", "a/b", "%s", "{0}",
    "world", "ground", "<b>", "\\", "nan", "A.x", "0",
)  # fmt: skip
VALUES: tuple[Any, ...] = (
    None, "", "x", -1, 0, 3, 1.5, 1e300, -1e300, 10**30, 10**400, True, False, [], {}, [[]], [None], ["x"], [1, 2, 3],
    {"not finite": "nan"}, {"a": {}}, "NaN", "Infinity", "$\\frac$", "\x00", "é" * 300, [[1.0], [2.0]],
)  # fmt: skip
_NUMBER = re.compile(rb"(?<![\w.])[-+]?\d+\.?\d*(?:[eE][-+]?\d+)?")
_TEXT = re.compile(rb"\"[^\"\n]*\"|'[^'\n]*'|(?<=>)[^<\n]+(?=<)")
_WORD = re.compile(rb"[A-Za-z_][\w:-]*")


class Unchanged(random.Random):
    """Chance that changes nothing: what is read then shows that the others are refused for their changes."""


def changed(content: bytes, others: list[bytes], rng: random.Random) -> bytes:
    """One to three changes of bytes, numbers, words or lines."""
    if isinstance(rng, Unchanged):
        return content
    for _ in range(rng.choice((1, 1, 1, 2, 3))):
        content = rng.choice(CHANGES)(content, others, rng)
    return content


def _bytes(content: bytes, others: list[bytes], rng: random.Random) -> bytes:
    at = rng.randrange(len(content) + 1)
    size = min(int(2 ** rng.uniform(0, 12)), len(content) - at)
    kind = rng.randrange(6)
    if kind == 0 and at < len(content):
        return content[:at] + bytes([content[at] ^ (1 << rng.randrange(8))]) + content[at + 1 :]
    if kind == 1:
        return content[:at] + content[at + size :]
    if kind == 2:
        return content[:at] + content[at : at + size] * 2 + content[at + size :]
    if kind == 3:
        return content[:at] + rng.randbytes(rng.randrange(1, 9)) + content[at:]
    if kind == 4:
        return content[:at]
    other = rng.choice(others)
    start = rng.randrange(len(other) + 1)
    return content[:at] + other[start : start + size] + content[at + size :]


def _found(pattern: re.Pattern[bytes], by: Callable[[bytes, random.Random], bytes]) -> Any:
    def change(content: bytes, others: list[bytes], rng: random.Random) -> bytes:
        spans = [found.span() for found in pattern.finditer(content)]
        if not spans:
            return _bytes(content, others, rng)
        first, last = rng.choice(spans)
        return content[:first] + by(content[first:last], rng) + content[last:]

    return change


def _quoted(text: bytes, rng: random.Random) -> bytes:
    quote = text[:1] if text[:1] in b"\"'" else b""
    return quote + rng.choice((*WORDS, *NUMBERS, "1 2 3", "inf inf inf", "1e308 0 0")).encode() + quote


def _lines(content: bytes, others: list[bytes], rng: random.Random) -> bytes:
    lines = content.split(b"\n")
    i, j = rng.randrange(len(lines)), rng.randrange(len(lines))
    kind = rng.randrange(4)
    if kind == 0:
        del lines[i]
    elif kind == 1:
        lines.insert(j, lines[i])
    elif kind == 2:
        lines[i], lines[j] = lines[j], lines[i]
    else:
        lines[i:i] = rng.choice(others).split(b"\n")[j : j + 3]
    return b"\n".join(lines)


def _word(content: bytes, others: list[bytes], rng: random.Random) -> bytes:
    spans = [found.span() for found in _WORD.finditer(content)]
    if not spans:
        return _bytes(content, others, rng)
    (first, last), (a, b) = rng.choice(spans), rng.choice(spans)
    return content[:first] + content[a:b] + content[last:]


_number = _found(_NUMBER, lambda text, rng: rng.choice(NUMBERS).encode())
CHANGES = (_bytes, _number, _number, _found(_TEXT, _quoted), _lines, _word)


def changed_data(data: Any, rng: random.Random) -> Any:
    """Something else in one place of plain data."""
    data = copy.deepcopy(data)
    if isinstance(rng, Unchanged):
        return data
    owner, key, at = None, None, data
    while isinstance(at, (dict, list)) and len(at) and (owner is None or rng.random() < 0.85):
        owner, key = at, rng.choice(list(at)) if isinstance(at, dict) else rng.randrange(len(at))
        at = at[key]
    if owner is None:
        return rng.choice(VALUES)
    if rng.random() < 0.15:
        del owner[key]
    elif isinstance(owner, list) and rng.random() < 0.15:
        owner.append(copy.deepcopy(at))
    else:
        owner[key] = rng.choice(VALUES)
    return data


# Each kind: how to set out, which returns one case by a generator of numbers by chance; the case is then run.
Case = Callable[[], Any]
Kind = Callable[[Path], Callable[[random.Random], tuple[Any, Case]]]


def _model(seeds: dict[str, bytes]) -> Kind:
    """Files of a model, changed beside what they name."""

    def begin(folder: Path) -> Callable[[random.Random], tuple[Any, Case]]:
        shutil.copytree(HERE / "format_files", folder, dirs_exist_ok=True)
        for name, content in seeds.items():
            (folder / name).write_bytes(content)
        others = list(seeds.values())

        def case(rng: random.Random) -> tuple[Any, Case]:
            name = rng.choice(sorted(seeds))
            content = changed(seeds[name], others, rng)
            path = folder / f"changed{Path(name).suffix}"
            path.write_bytes(content)
            return content, lambda: used(pt.load(path, root=folder, base=rng.choice(("fixed", "free"))))

        return case

    return begin


def used(m: pt.Mechanism) -> None:
    """What one does with a mechanism first."""
    str(m.reading)
    m.to_spec()
    m.compile()
    str(m.report())


def _files(*suffixes: str) -> dict[str, bytes]:
    return {p.name: p.read_bytes() for p in sorted((HERE / "format_files").iterdir()) if p.suffix in suffixes}


def _toml() -> dict[str, bytes]:
    names = ("four-bar", "slider-crank", "andrews", "heavy-top", "parallel-ankle")
    from partita.io.toml_writer import document

    found = {f"{name}.toml": document(pt.catalogue.load(name)).encode() for name in names}
    m = pt.catalogue.load("four-bar")
    m.add_body("ball", mass=1.0, inertia=(1.0, 1.0, 1.0))
    m.add_spherical("S", m.ground, "ball", point=(0, 0, 0))
    m.add_torque("A", ([0.0, 1.0], [2.0, 3.0]))
    m.add_sensor("tip", ("ball", (1, 0, 0)), "acceleration")
    found["more.toml"] = document(m).encode()
    return found


def _usd() -> dict[str, bytes]:
    from usd_files import body, drive, four_bar, joint, points, prim, usd

    more = usd(
        body("a"),
        prim("Xform", "b", more="prepend references = </World/a>"),
        joint("RevoluteJoint", "j", ("", "a"), points("(0, 0, 0)", "(1, 0, 0)"), drive("angular", stiffness=3.0)),
        joint("FixedJoint", "k", ("a", "b"), points("(1, 0, 0)", "(0, 0, 0)")),
    )
    return {"four.usda": four_bar().encode(), "more.usda": more.encode()}


def _usdc(folder: Path) -> dict[str, bytes]:
    from pxr import Sdf

    found = {}
    for name, content in _usd().items():
        (folder / name).write_bytes(content)
        path = folder / f"{Path(name).stem}.usdc"
        Sdf.Layer.FindOrOpen(str(folder / name)).Export(str(path))
        found[path.name] = path.read_bytes()
    return found


SIDECAR = b"""closed_loop: [[here, there]]
type: ["3d"]
name: [knee]
name_mot: [A]
gravity: [0.0, 0.0, -9.81]
springs:
  - {name: s, joint: A, stiffness: 3.0, damping: 0.1, angle: 0.2}
  - {name: t, from: [crank, 0.0, 0.0, 0.1], to: [rocker, 0.0, 0.0, 0.0], stiffness: 200.0, damping: 1.0, length: 0.3}
weightless: [crank]
drawing_tolerance: 1.0e-4
"""


def sidecar(folder: Path) -> Callable[[random.Random], tuple[Any, Case]]:
    from test_urdf import ends, tree

    model = folder / "robot.urdf"
    model.write_text(tree(ends("here", "there")), "utf-8")

    def case(rng: random.Random) -> tuple[Any, Case]:
        content = changed(SIDECAR, [SIDECAR], rng)
        (folder / "robot.yaml").write_bytes(content)
        return content, lambda: used(pt.load(model))

    return case


def a_run() -> pt.Result:
    m = pt.catalogue.load("four-bar")
    m.add_body("$\\frac$", mass=1.0, inertia=(1.0, 1.0, 1.0))
    m.add_spherical("S", m.ground, "$\\frac$", point=(0, 0, 0))
    m.add_sensor("tip", ("$\\frac$", (1, 0, 0)), "acceleration")
    return m.simulate(0.1, t_eval=[0.0, 0.05, 0.1])


def resealed(content: bytes) -> bytes:
    """The seal of a changed file as it should be."""
    mark = _MARK.search(content)
    return content if mark is None else sealed(content[: mark.start()] + BLANK.encode() + content[mark.end() :])


def looked_at(run: pt.Result, folder: Path, rng: random.Random) -> None:
    """What one does with a result."""
    used = [str(run.certificate), repr(run), run.notes, run.partitions, run.energy.total, run.units, run.state()]
    for name in run.names.joints:
        used += [run.joint(name).force, run.joint(name).position, repr(run.joint(name))]
    used += [run.body(name).position for name in run.names.bodies]
    if rng.random() < 0.2:
        run.to_html(folder / "page.html")
    if rng.random() < 0.05:
        run.plot(path=folder / "figure.svg")


def result(suffix: str) -> Kind:
    """Stored results, sealed anew in nine of ten."""

    def begin(folder: Path) -> Callable[[random.Random], tuple[Any, Case]]:
        source, path = folder / f"run{suffix}", folder / f"changed{suffix}"
        a_run().save(source)
        if suffix == ".zarr":
            files = {p.relative_to(source).as_posix(): p.read_bytes() for p in source.rglob("*") if p.is_file()}

        def case(rng: random.Random) -> tuple[Any, Case]:
            if suffix == ".zarr":
                name = rng.choice(sorted(files))
                content: Any = dict(files)
                content[name] = changed(files[name], list(files.values()), rng)
                if suffix == ".zarr" and name != ".zmetadata" and rng.random() < 0.3:
                    content[".zmetadata"] = changed(files[".zmetadata"], [files[".zmetadata"]], rng)
                shutil.rmtree(path, ignore_errors=True)
                for one, inside in sealed_folder(content).items():
                    (path / one).parent.mkdir(parents=True, exist_ok=True)
                    (path / one).write_bytes(inside)
            else:
                before = source.read_bytes()
                if suffix == ".mat" and rng.random() < 0.7:  # what is packed cannot be changed without notice
                    before = unpacked(before, Allowance(source, len(before)))
                if suffix == ".json" and rng.random() < 0.7:
                    content = json.dumps(changed_data(json.loads(before), rng)).encode()
                else:
                    content = changed(before, [before], rng)
                path.write_bytes(resealed(content) if rng.random() < 0.9 or isinstance(rng, Unchanged) else content)
            return content, lambda: looked_at(pt.load_result(path), folder, rng)

        return case

    return begin


def sealed_folder(files: dict[str, bytes]) -> dict[str, bytes]:
    """A changed folder with the seal that it should have."""
    import hashlib

    from partita.files import _joined

    mark = next((found for content in files.values() if (found := _MARK.search(content))), None)
    if mark is None:
        return files
    blank = {name: content.replace(mark[0], BLANK.encode()) for name, content in files.items()}
    seal = b"sha256:" + hashlib.sha256(_joined(blank)).hexdigest().encode()
    found = {name: content.replace(BLANK.encode(), seal) for name, content in blank.items()}
    assert intact_folder(found) is not False
    return found


def _stored(folder: Path, source: Path, use: Callable[[Path], Any]) -> Callable[[random.Random], tuple[Any, Case]]:
    names = sorted(p.name for p in source.iterdir() if p.is_file() and p.stat().st_size and p.name != "lock")
    contents = {name: (source / name).read_bytes() for name in names}

    def case(rng: random.Random) -> tuple[Any, Case]:
        name, path = rng.choice(names), folder / "changed"
        shutil.rmtree(path, ignore_errors=True)
        shutil.copytree(source, path)
        if name.endswith(".json") and rng.random() < 0.7:
            content = json.dumps(changed_data(json.loads(contents[name]), rng)).encode()
        else:
            content = changed(contents[name], list(contents.values()), rng)
        (path / name).write_bytes(resealed(content))
        return (name, content), lambda: use(path)

    return case


def ensemble_store(folder: Path) -> Callable[[random.Random], tuple[Any, Case]]:
    m = pt.catalogue.load("grashof-four-bar")
    first = m.compile().velocity_names[0]
    states = [m.assemble(rates={first: rate}) for rate in (0.1, 0.2, 0.3)]

    def run(path: Path) -> Any:
        return m.ensemble(states=states, t_eval=[0.0, 0.01, 0.02], store=path)

    run(folder / "whole")
    return _stored(folder, folder / "whole", run)


def study(x: float) -> dict[str, Any]:
    """A member of a sweep."""
    return {"y": 2.0 * x, "z": np.array([x, 1.0])}


def sweep_store(folder: Path) -> Callable[[random.Random], tuple[Any, Case]]:
    pt.sweep(study, {"x": [1.0, 2.0, 3.0]}, store=folder / "whole")
    return _stored(folder, folder / "whole", lambda path: str(pt.load_sweep(path)))


def drawing_page(folder: Path) -> Callable[[random.Random], tuple[Any, Case]]:
    """What the page sends: data, and bytes on the wire."""
    import socket

    from sketches import bar, drawing, place

    good = drawing(
        nodes=[place("A", 0, 0, True), place("B", 1, 0), place("C", 2, 1), place("D", 2, 0, True)],
        bars=[bar("AB", "A", "B"), bar("BC", "B", "C"), bar("CD", "C", "D")],
        motors=[{"name": "m", "node": "A", "bar": "AB", "rate": 2.0}],
        springs=[{"name": "s", "a": "B", "b": "D", "stiffness": 1.0, "damping": 0.0, "length": None}],
    )
    page = pt.draw(browser=False)
    host, _, rest = page.url.removeprefix("http://").partition("/")
    name, _, port = host.partition(":")

    def ask(content: bytes) -> None:
        with socket.create_connection((name, int(port)), timeout=30) as wire:
            wire.sendall(content)
            wire.shutdown(socket.SHUT_WR)
            found = b""
            while piece := wire.recv(65536):
                found += piece
        assert b"Traceback" not in found and not found.startswith(b"HTTP/1.1 500"), found[:300]

    def case(rng: random.Random) -> tuple[Any, Case]:
        data = changed_data(good, rng)
        body = json.dumps(data).encode()
        if rng.random() < 0.3:
            body = changed(body, [body], rng)
        what = rng.choice(("drawing", "drawing", "drawing", "run"))
        head = f"POST /{rest}{what} HTTP/1.1\r\nHost: {host}\r\nContent-Type: application/json\r\nContent-Length: "
        content = head.encode() + str(len(body)).encode() + b"\r\nConnection: close\r\n\r\n" + body
        if rng.random() < 0.3:
            content = changed(content, [content], rng)
        return content, lambda: ask(content)

    return case


def assistant(folder: Path) -> Callable[[random.Random], tuple[Any, Case]]:
    """Calls of the server for assistants, as a child process answers them."""
    from partita.cli.mcp.folder import Folder
    from partita.cli.mcp.limits import Limits
    from partita.cli.mcp.server import refusal
    from partita.cli.mcp.tools import TOOLS
    from partita.cli.mcp.worker import answer

    (folder / "a.toml").write_bytes(_toml()["four-bar.toml"])
    own, limits = Folder(folder), Limits()
    calls: list[dict[str, Any]] = [
        {"tool": tool, "arguments": {"catalogue": "four-bar", **more}}
        for tool in TOOLS
        for more in ({}, {"duration": 0.1, "outputs": 3}, {"joints": ["A"]}, {"targets": {"A": 0.1}})
        if set(more) <= set(TOOLS[tool][1]["properties"])
    ]

    def asked(call: Any) -> None:
        given = call if isinstance(call, dict) else {}
        if not isinstance(given.get("arguments"), dict) or not isinstance(given.get("tool"), str):
            return
        found = refusal(call["tool"], call["arguments"]) or answer(call, own, limits)
        kind = found.get("error", {}).get("kind", "") if isinstance(found, dict) else ""
        raw = not hasattr(pt.errors, kind) and kind not in ("", "MemoryError", "OSError")
        assert not raw, json.dumps(found)[:400]
        json.dumps(found, allow_nan=False)

    def case(rng: random.Random) -> tuple[Any, Case]:
        call = rng.choice(calls)
        if rng.random() < 0.4:
            text = changed(_TOML["four-bar.toml"], list(_TOML.values()), rng).decode("utf-8", "replace")
            call = {"tool": call["tool"], "arguments": {**call["arguments"], "model": text}}
            call["arguments"].pop("catalogue", None)
        else:
            call = changed_data(call, rng)
        return call, lambda: asked(call)

    _TOML = _toml()
    return case


def kinds() -> dict[str, Kind]:
    """All kinds by their names; those whose packages are missing are left out."""
    from importlib.util import find_spec

    def has(*names: str) -> bool:
        return all(find_spec(name) is not None for name in names)

    found: dict[str, Kind] = {
        "urdf": _model(_files(".urdf")),
        "sdf": _model(_files(".sdf")),
        "toml": lambda folder: _model(_toml())(folder),
        "ensemble": ensemble_store,
        "drawing": drawing_page,
        "json": result(".json"),
        "csv": result(".csv"),
        "mat": result(".mat"),
    }
    if has("yaml"):
        found["yaml"] = sidecar
    if has("mujoco"):
        found["mjcf"] = _model(_files(".mjcf"))
    if has("pxr"):
        found["usda"] = lambda folder: _model(_usd())(folder)
        found["usdc"] = lambda folder: _model(_usdc(folder))(folder)
    if has("xarray"):
        found["sweep"] = sweep_store
    if has("xarray", "h5netcdf", "h5py"):
        found["nc"] = result(".nc")
    if has("xarray", "zarr"):
        found["zarr"] = result(".zarr")
    if has("pyarrow"):
        found["parquet"] = result(".parquet")
    if has("mcp", "jsonschema"):
        found["mcp"] = assistant
    return found


def run_kind(name: str, count: int, seed: int, folder: Path) -> Iterator[dict[str, Any]]:
    """The cases of one kind in this process: how each ended."""
    case = kinds()[name](folder)
    for seed_number in range(4):
        try:
            case(Unchanged(seed_number))[1]()
        except PartitaError as error:
            if isinstance(error, FileFormatError):
                raise
    for number in range(count):
        rng = random.Random(f"{name} {seed} {number}")
        content, run = case(rng)
        (folder / "current").write_bytes(repr(content).encode("utf-8", "replace"))
        began, ended, about = time.monotonic(), "read", ""
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                run()
        except PartitaError as error:
            ended, about = "refused", str(error)
            if len(about) > 5000:
                ended, about = "raw", f"a message of {len(about)} letters"
        except Exception:
            ended, about = "raw", traceback.format_exc(limit=-4)
        except BaseException as error:  # a panic of the core
            ended, about = "raw", f"{type(error).__name__}: {error}"
        yield {"kind": name, "number": number, "ended": ended, "about": about, "seconds": time.monotonic() - began}


def child(names: list[str], count: int, seed: int, folder: Path) -> None:
    """Run kinds, a line of JSON for each case."""
    import faulthandler
    import logging

    faulthandler.enable()
    logging.disable(logging.CRITICAL)
    try:
        import resource
    except ImportError:
        pass
    else:
        resource.setrlimit(resource.RLIMIT_DATA, (ROOM, resource.getrlimit(resource.RLIMIT_DATA)[1]))
    for name in names:
        own = folder / name
        own.mkdir()
        for found in run_kind(name, count, seed, own):
            print("case", json.dumps(found), flush=True)


def examined(names: list[str], count: int, seed: int, at_once: int = 1) -> tuple[dict[str, dict[str, int]], list[str]]:
    """How the cases of each kind ended, and what is wrong; so many kinds in one process."""
    counts = {name: {"read": 0, "refused": 0, "raw": 0, "slow": 0} for name in names}
    wrong: list[str] = []
    for first in range(0, len(names), at_once):
        together = names[first : first + at_once]
        with tempfile.TemporaryDirectory() as folder:
            command = [
                sys.executable,
                __file__,
                "--child",
                folder,
                "--count",
                str(count),
                "--seed",
                str(seed),
                *together,
            ]
            done = subprocess.run(command, capture_output=True, text=True, errors="replace", timeout=3600)
            cases = [json.loads(line[5:]) for line in done.stdout.splitlines() if line.startswith("case ")]
            for case in cases:
                counts[case["kind"]][case["ended"]] += 1
                if case["seconds"] > SLOW:
                    counts[case["kind"]]["slow"] += 1
                if case["ended"] == "raw":
                    wrong.append(f"{case['kind']} {seed} {case['number']}: {case['about']}")
            if done.returncode != 0 or len(cases) != count * len(together):
                name = cases[-1]["kind"] if cases else together[0]
                if cases and cases[-1]["number"] == count - 1:  # the next one had begun
                    name = together[min(together.index(name) + 1, len(together) - 1)]
                current = Path(folder) / name / "current"
                about = current.read_text("utf-8", "replace")[:2000] if current.exists() else ""
                wrong.append(
                    f"{name} {seed} {len(cases)}: ended with {done.returncode}: {done.stderr[-1500:]}\n{about}"
                )
    return counts, wrong


def main() -> int:
    parser = argparse.ArgumentParser()
    parser.add_argument("kinds", nargs="*")
    parser.add_argument("--count", type=int, default=600)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--child")
    asked = parser.parse_args()
    if asked.child:
        child(asked.kinds, asked.count, asked.seed, Path(asked.child))
        return 0
    counts, wrong = examined(asked.kinds or sorted(kinds()), asked.count, asked.seed)
    print("\n\n".join(wrong))
    for name, found in counts.items():
        print(f"{name:10}", ", ".join(f"{found[word]} {word}" for word in found))
    total = sum(found[word] for found in counts.values() for word in ("read", "refused", "raw"))
    print(f"{total} changed inputs, {len(wrong)} raw errors or ended processes")
    return int(bool(wrong))


if __name__ == "__main__":
    sys.exit(main())
