"""Stiff mechanisms at equal error: Partita beside SciPy, SUNDIALS (CVODE and IDA) and Exudyn (generalised alpha).

Solvers of other programs that need rates get Partita's own, as C (`m.export_c`), and make Jacobians by differences;
what they cost is what they call. Partita's cost is its evaluations and k for each Jacobian, k the degrees of freedom.
Their seconds hold the calls from Python; `least` has the evaluations alone, at the speed of C.
"""

from __future__ import annotations

import json
import math
import os
import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp
from stiff_problems import MU, PROBLEMS, Stiff
from stiff_rates import Known, Rates, TooManyCalls, Tried
from timing import once

import partita as pt

ENVIRONMENTS = Path(os.environ.get("PARTITA_PEERS", Path(__file__).parents[1] / "out" / "peers"))
AIMS = (1e-4, 1e-6, 1e-8)
"""Errors that are compared at, as parts of how much positions and rates change at most."""
TOLERANCES = tuple(10.0**-e for e in range(3, 12))
EXPLICIT = (1e-5, 1e-7, 1e-9)
LONGEST, PATIENCE = 6.0, 240.0
"""Seconds of a run after which less error is not asked for, and of another program on one problem."""
REPEAT = """
void {name}_repeat(long n, double t, const double *q, const double *v, double *qdot, double *vdot) {{
    for (long i = 0; i < n; i++) {{
        {name}_rates(q, v, qdot);
        {name}_accelerations(t, q, v, vdot);
    }}
}}
"""


@dataclass(frozen=True)
class Measured:
    """All programs on one problem: every setting tried, or why a program is not there."""

    title: str
    dof: int
    agrees: float
    curves: dict[str, list[Tried]]
    missing: list[str]

    def at(self, aim: float, name: str, by: str) -> Tried | None:
        """The cheapest setting of a program that reaches an error."""
        good = [x for x in self.curves.get(name, []) if x.error <= aim]
        return min(good, key=lambda x: getattr(x, by)) if good else None


def known(stiff: Stiff, folder: Path) -> tuple[Known, pt.Mechanism, pt.State]:
    """The problem as plain data, with its end by Radau IIA at rtol 1e-13."""
    m, start = stiff.ready()
    run = m.simulate(stiff.duration, initial=start, method="radau", rtol=1e-13, atol=1e-15)
    if not run.success:
        raise RuntimeError(f"{stiff.title}: {run.message}")
    change = [max(float(np.max(np.ptp(x, axis=0))), 1e-12) for x in (run.q, run.v)]
    sizes = [min(change[0], 1.0)] * run.q.shape[1] + [change[1]] * run.v.shape[1]
    found = Known(
        stiff.title,
        stiff.duration,
        [*run.q[0].tolist(), *run.v[0].tolist()],
        [*run.q[-1].tolist(), *run.v[-1].tolist()],
        sizes,
        run.q.shape[1],
        mu=MU,
    )
    if "Pol" not in stiff.title:
        found.name = "".join(c if c.isalnum() else "_" for c in stiff.title)
        source = folder / f"{found.name}.c"
        m.export_c(source, initial=start, name=found.name)
        source.write_text(source.read_text(encoding="utf-8") + REPEAT.format(name=found.name), encoding="utf-8")
        library = source.with_suffix(".so")
        compiler = shutil.which("cc") or shutil.which("gcc") or "cc"
        subprocess.run([compiler, "-O2", "-shared", "-fPIC", "-o", str(library), str(source), "-lm"], check=True)
        found.library = str(library.resolve())
    if "wishbone" in stiff.title:
        found.planar = m.to_spec()
    return found, m, start


def own(data: Known, m: pt.Mechanism, start: pt.State, method: str) -> list[Tried]:
    """Runs of `m.simulate` by one method."""
    k = m.compile().summary["mobility"]
    found = []
    for rtol in EXPLICIT if method == "dop853" else TOLERANCES:

        def run(rtol: float = rtol) -> pt.Result:
            return m.simulate(
                data.duration, t_eval=[0.0, data.duration], initial=start, method=method, rtol=rtol, atol=rtol / 100.0
            )

        seconds, result = once(run)
        if seconds < 0.5:
            seconds = min(seconds, once(run)[0], once(run)[0])
        if result.success:
            c = result.counters
            cost = c["evaluations"] + k * c["jacobians"]
            error = data.error([*result.q[-1], *result.v[-1]])
            found.append(Tried(method, f"rtol {rtol:.0e}", seconds, error, c["evaluations"], c["jacobians"], cost, 0.0))
        if seconds > LONGEST and error <= AIMS[-1]:
            break
    return found


def scipy(data: Known, method: str) -> list[Tried]:
    """Runs of `solve_ivp`."""
    found, each = [], Rates(data).each()
    for rtol in TOLERANCES:
        rates = Rates(data)

        def run(rtol: float = rtol, rates: Rates = rates) -> Any:
            return solve_ivp(
                rates, (0.0, data.duration), data.y0, method, [data.duration], rtol=rtol, atol=rtol / 100.0
            )

        try:
            seconds, done = once(run)
        except TooManyCalls:
            break
        if done.success:
            calls = rates.calls
            error = data.error(done.y[:, -1])
            found.append(Tried(method, f"rtol {rtol:.0e}", seconds, error, calls, done.njev, calls, calls * each))
        if seconds > LONGEST:
            break
    return found


def peer(name: str, script: str, path: Path) -> dict[str, Any] | str:
    """What another program found, or why it did not."""
    python = ENVIRONMENTS / name / "bin" / "python"
    if not python.exists():
        return f"{name} is not installed here (make peers)"
    here = Path(__file__).parent
    try:
        done = subprocess.run(
            [str(python), "-W", "ignore", str(here / "peers" / script), str(path)],
            capture_output=True,
            text=True,
            check=False,
            env={**os.environ, "PYTHONPATH": str(here)},
            timeout=PATIENCE,
        )
    except subprocess.TimeoutExpired:
        return f"{name} was stopped after {PATIENCE:g} s"
    if done.returncode:
        return f"{name} stopped: {(done.stderr.strip().splitlines() or ['no message'])[-1]}"
    found: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return found


def measured(stiff: Stiff, folder: Path) -> Measured:
    """All programs on one problem."""
    folder.mkdir(parents=True, exist_ok=True)
    data, m, start = known(stiff, folder)
    path = folder / f"stiff-{PROBLEMS.index(stiff)}.json"
    data.write(path)
    explicit = [] if data.library is None else own(data, m, start, "dop853")
    agrees = min((x.error for x in explicit), default=math.nan)
    curves = {"radau": own(data, m, start, "radau"), "auto": own(data, m, start, "auto"), "dop853": explicit}
    missing = []
    if data.library is None:
        missing.append("dop853 would take 10 million evaluations of a function in Python")
    for method in ("Radau", "BDF"):
        curves[f"SciPy {method}"] = scipy(data, method)
    for name, script in (("sundae", "sundae_peer.py"), ("exudyn", "exudyn_stiff_peer.py")):
        if name == "exudyn" and not data.planar:
            missing.append("Exudyn: only the wishbone is drawn in it")
            continue
        found = peer(name, script, path)
        if isinstance(found, str):
            missing.append(found)
            continue
        tried = [Tried(**x) for x in found["tried"] if math.isfinite(x["error"])]
        for kind in dict.fromkeys(x.kind for x in tried):
            curves[f"{found['peer']}: {kind}"] = [x for x in tried if x.kind == kind]
    return Measured(stiff.title, m.compile().summary["mobility"], agrees, curves, missing)
