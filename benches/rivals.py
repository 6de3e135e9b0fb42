"""The same planar linkages in other programs, each in an environment of its own, at equal error with 201 outputs.

`make peers` makes the environments in out/peers; a program that is not there is left out with a word. Each script in
`peers/` knows its program and the settings that are best for it there; it reads the linkage as plain data (pins in a
tree, pins that close loops) and prints seconds and error of each setting. What counts is the error of the first body's
angle at the end; reference angles are those of the catalogue.
"""

from __future__ import annotations

import json
import math
import os
import subprocess
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from planar import Pin, Problem, Spring, Tried
from timing import fastest

import partita as pt
from partita.catalogue import andrews, four_bar, n_four_bar

ENVIRONMENTS = Path(os.environ.get("PARTITA_PEERS", Path(__file__).parents[1] / "out" / "peers"))
PEERS = ("casadi", "exudyn", "mujoco", "pinocchio", "drake")
OUTPUTS = 201
PATIENCE = 300.0
"""Seconds for one program on one linkage, generating and compiling included."""
AIM = 1e-6
"""Error that is compared at [rad]; for a program that does not reach it, its smallest one."""
TOLERANCES = tuple(10.0**-i for i in range(2, 13))


@dataclass(frozen=True)
class Linkage:
    """An entry of the catalogue, the body whose angle counts, and by how much it has turned at the end [rad]."""

    title: str
    name: str
    first: str
    duration: float
    turned: float
    loops: int | None = None


LINKAGES = (
    Linkage("four-bar", "four-bar", "crank", 10.0, four_bar.CRANK[10.0][0] - math.pi / 3.0),
    Linkage("Andrews' squeezer", "andrews-squeezer", "OF", 0.03, andrews.ANGLES["beta"] - andrews.START["beta"]),
    Linkage(
        "chain N = 40",
        "n-four-bar",
        "upright 0",
        10.0,
        -float(n_four_bar.lean(40, np.array([0.0, 10.0]))[-1]),
        loops=40,
    ),
)


@dataclass(frozen=True)
class Compared:
    """The fastest setting of a program at the error that is compared at, and Partita's at this error."""

    peer: str
    setting: str
    seconds: float
    error: float
    rtol: float
    own: float
    own_error: float

    @property
    def ratio(self) -> float:
        """How many times slower the program is."""
        return self.seconds / self.own


def linkage(of: Linkage) -> tuple[Problem, pt.Mechanism, pt.State]:
    """The linkage as plain data, and as a mechanism with its start."""
    entry = pt.catalogue.entry(of.name, **({} if of.loops is None else {"loops": of.loops}))
    m = entry.mechanism()
    start = entry.initial(m)
    here = m.simulate(1e-6, t_eval=[0.0], initial=start)
    spec: dict[str, Any] = m.to_spec()
    first = next(b["name"] for b in spec["bodies"] if b["name"] == of.first)
    names = [first, *(b["name"] for b in spec["bodies"] if b["name"] != first)]
    number = {"ground": -1, **{name: i for i, name in enumerate(names)}}
    drawn = {b["name"]: b for b in spec["bodies"]}

    def world(body: str, point: list[float]) -> np.ndarray:
        if body == "ground":
            return np.array(point[:2])
        b = drawn[body]
        return (np.array(b["position"]) + np.array(b["orientation"]) @ np.array(point))[:2]

    pins = [Pin(number[j["parent"]], number[j["child"]], np.array(j["point"])[:2]) for j in spec["joints"]]
    tree, loops, reached = [], [], {-1}
    rest = pins
    while rest:
        # breadth first; the pin that reaches a body becomes one of the tree
        ready = [p for p in rest if (p.parent in reached) or (p.child in reached)]
        for p in ready:
            if p.parent in reached and p.child in reached:
                loops.append(p)
            elif p.parent in reached:
                tree.append(p)
                reached.add(p.child)
            else:
                tree.append(Pin(p.child, p.parent, p.point))
                reached.add(p.parent)
        rest = [p for p in rest if p not in ready]
    forces = spec.get("forces", [])
    child = {j["name"]: number[j["child"]] for j in spec["joints"]}
    problem = Problem(
        bodies=names,
        masses=np.array([drawn[n]["mass"] for n in names]),
        inertias=np.array([drawn[n]["inertia"][2][2] for n in names]),
        centres=np.array([world(n, drawn[n]["com"]) for n in names]),
        angles=np.array([math.atan2(drawn[n]["orientation"][1][0], drawn[n]["orientation"][0][0]) for n in names]),
        rates=np.array([here.body(n).angular_velocity[0, 2] for n in names]),
        tree=tree,
        loops=loops,
        gravity=np.array(spec["gravity"])[:2],
        times=np.linspace(0.0, of.duration, OUTPUTS),
        turned=of.turned,
        springs=[
            Spring(
                number[f["body1"]],
                world(f["body1"], f["point1"]),
                number[f["body2"]],
                world(f["body2"], f["point2"]),
                f["stiffness"],
                f["length"],
            )
            for f in forces
            if f["kind"] == "spring"
        ],
        torques={child[f["joint"]]: f["value"]["constant"] for f in forces if f["kind"] == "torque"},
    )
    return problem, m, start


def own(of: Linkage, problem: Problem, m: pt.Mechanism, start: pt.State) -> list[Tried]:
    """Runs of `m.simulate` at each tolerance."""
    found = []
    for rtol in TOLERANCES:

        def run(rtol: float = rtol) -> pt.Result:
            return m.simulate(of.duration, t_eval=problem.times, initial=start, rtol=rtol, atol=rtol / 100.0)

        result = run()
        rotation = result.body(of.first).rotation[-1]
        error = problem.error(math.atan2(rotation[1, 0], rotation[0, 0])) if result.success else math.inf
        found.append(Tried(f"{rtol:.0e}", fastest(run, 0.3), error))
    return found


def tried(peer: str, problem: Path) -> dict[str, Any] | str:
    """What a peer found, or why it did not."""
    python = ENVIRONMENTS / peer / "bin" / "python"
    if not python.exists():
        return f"{peer} is not installed here (make peers)"
    script = Path(__file__).parent / "peers" / f"{peer}_peer.py"
    command = [str(python), "-W", "ignore", str(script), str(problem)]
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parent)}
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=False, env=environment, timeout=PATIENCE)
    except subprocess.TimeoutExpired:
        return f"{peer} was stopped after {PATIENCE:g} s"
    if done.returncode:
        return f"{peer} stopped: {(done.stderr.strip().splitlines() or ['no message'])[-1]}"
    found: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return found


@dataclass(frozen=True)
class Comparison:
    """All programs on one linkage: what they do at equal error or why they did not, and every setting tried."""

    rows: list[Compared | str]
    curves: dict[str, list[Tried]]


def compared(of: Linkage, folder: Path) -> Comparison:
    """All peers on one linkage."""
    problem, m, start = linkage(of)
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{of.name}.json"
    problem.write(path)
    ours = own(of, problem, m, start)
    rows: list[Compared | str] = []
    curves = {"Partita": ours}
    for peer in PEERS:
        found = tried(peer, path)
        if isinstance(found, str):
            rows.append(found)
            continue
        theirs = [Tried(**x) for x in found["tried"] if math.isfinite(x["error"])]
        if not theirs:
            rows.append(f"{found['peer']} finished no run")
        for kind in dict.fromkeys(x.kind for x in theirs):
            title = ", ".join(x for x in (found["peer"], kind) if x)
            curves[title] = [x for x in theirs if x.kind == kind]
            best = at_error(curves[title])
            near = min((x for x in ours if x.error <= max(best.error, AIM)), key=lambda x: x.seconds)
            setting = float(near.setting)
            rows.append(Compared(title, best.setting, best.seconds, best.error, setting, near.seconds, near.error))
    return Comparison(rows, curves)


def at_error(tried: list[Tried]) -> Tried:
    """The fastest of the settings that reach the error; the most accurate one where none does."""
    good = [x for x in tried if x.error <= AIM]
    return min(good, key=lambda x: x.seconds) if good else min(tried, key=lambda x: x.error)
