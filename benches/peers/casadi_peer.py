"""CasADi: symbolic equations of motion in absolute angles, C code from them, compiled and integrated.

The multipliers are eliminated by sparse factorisations in the symbols; what opens loops is damped (Baumgarte). Three
ways to integrate: CVODES on the compiled right-hand side, the fourth-order Runge-Kutta method of fixed steps with the
whole run in one compiled function, and DOP853 written in C around the compiled right-hand side, which alone is tried
on long chains, whose code takes minutes to compile.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from functools import partial
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
from planar import Problem, Tried, report, timed

DAMPING = 5.0
DERIVED = 20
"""States up to which derivatives are compiled too, without which CVODES does not begin, and whole runs."""


def equations(p: Problem) -> tuple[Any, Any]:
    """State (angles and their rates) and its derivative."""
    n = len(p.bodies)
    q, w = ca.SX.sym("q", n), ca.SX.sym("w", n)

    def turned(i: int, arm: np.ndarray) -> Any:
        c, s = ca.cos(q[i] - p.angles[i]), ca.sin(q[i] - p.angles[i])
        return ca.vertcat(c * arm[0] - s * arm[1], s * arm[0] + c * arm[1])

    centre: dict[int, Any] = {}
    for joint in p.tree:
        parent, child, point = joint.parent, joint.child, joint.point
        pin = point if parent < 0 else centre[parent] + turned(parent, point - p.centres[parent])
        centre[child] = pin + turned(child, p.centres[child] - point)

    def place(i: int, point: np.ndarray) -> Any:
        return point if i < 0 else centre[i] + turned(i, point - p.centres[i])

    energy = sum(p.masses[i] * ca.dot(ca.DM(-p.gravity), centre[i]) for i in range(n))
    for s in p.springs:
        length = ca.norm_2(place(s.body2, s.point2) - place(s.body1, s.point1))
        energy += 0.5 * s.stiffness * (length - s.length) ** 2
    force = -ca.gradient(energy, q)
    for i, torque in p.torques.items():
        force[i] += torque
    mass, h = ca.diag(ca.DM(p.inertias)), force
    for i in range(n):
        jacobian = ca.jacobian(centre[i], q)
        mass += p.masses[i] * jacobian.T @ jacobian
        rest = ca.jtimes(jacobian @ w, q, w)
        h -= p.masses[i] * jacobian.T @ rest
    gaps = [place(j.child, j.point) - place(j.parent, j.point) for j in p.loops]
    phi = ca.vertcat(*gaps)
    c = ca.jacobian(phi, q)
    rate = c @ w
    rest = ca.jtimes(rate, q, w) + 2 * DAMPING * rate + DAMPING**2 * phi
    # M and C M^-1 C^T are positive: two sparse factorisations, their orders chosen by minimum degree
    of_mass = ca.ldl(ca.sparsify(mass), True)
    free, along = ca.ldl_solve(h, *of_mass), ca.ldl_solve(ca.densify(c.T), *of_mass)
    multipliers = ca.ldl_solve(c @ free + rest, *ca.ldl(ca.sparsify(c @ ca.sparsify(along)), True))
    return ca.vertcat(q, w), ca.vertcat(w, free - along @ multipliers)


def compiled(f: Any, folder: Path, name: str) -> Any:
    """The function as C code, compiled."""
    generator = ca.CodeGenerator(f"{name}.c")
    generator.add(f)
    if f.numel_in() <= DERIVED:
        generator.add(f.jacobian())
    source = generator.generate(str(folder) + "/")
    library = folder / f"{name}.so"
    command = ["cc", "-O3", "-march=native", "-fno-math-errno", "-shared", "-fPIC", "-o", str(library), source, "-lm"]
    subprocess.run(command, check=True)
    return ca.external(f.name(), str(library))


def classical(x: Any, rate: Any, h: float, steps: int, outputs: int) -> Any:
    """The method of order four over all outputs as one function."""
    f = ca.Function("f", [x], [rate])
    y = ca.MX.sym("y", x.numel())
    k1 = f(y)
    k2 = f(y + h / 2 * k1)
    k3 = f(y + h / 2 * k2)
    k4 = f(y + h * k3)
    step = ca.Function("step", [y], [y + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)])
    several = ca.Function("several", [y], [step.fold(steps)(y)])
    return several.mapaccum("whole", outputs)


IN_C = "DOP853 in C by hand, no outputs"
DRIVER = """#include "dop853.h"
#include <stdlib.h>
#include "f.c"
static void field(const double *y, double *rate, void *work) {
    const double *in[8] = {y};
    double *out[8] = {rate};
    f(in, out, 0, work, 0);
}
int main(int count, char **words) {
    double y[N], room[MARCH_ROOM(N)], fastest = INFINITY, *work;
    const double end = atof(words[1]), rtol = atof(words[2]), begun = seconds();
    long long sizes[4];
    f_work(sizes, sizes + 1, sizes + 2, sizes + 3);
    work = malloc(8 * sizes[3] + 8);
    Work done = {0, 0};
    for (int run = 0; run < 3 || seconds() - begun < 0.3; run++) {
        const double start = seconds();
        for (int i = 0; i < N; i++) y[i] = atof(words[3 + i]);
        done = march(N, field, NULL, work, y, end, rtol, rtol / 100.0, room);
        const double took = seconds() - start;
        if (took < fastest) fastest = took;
    }
    tell(fastest, done, y[0], y[1], 0.0);
    return count < 0;
}
"""
"""The march of the limit around CasADi's C."""


def in_c(p: Problem, folder: Path, start: np.ndarray) -> list[Tried]:
    """DOP853 in C around the code of CasADi: the least it can cost, and no outputs are written."""
    (folder / "driver.c").write_text(DRIVER, encoding="utf-8")
    here = Path(__file__).parent.with_name("limit")
    (folder / "sizes.h").write_text(f"#define N {len(start)}\n", encoding="utf-8")
    command = ["cc", "-O3", "-march=native", "-fno-math-errno", "-std=gnu11", f"-I{here}", f"-I{folder}"]
    command += ["-include", str(folder / "sizes.h"), "-o", str(folder / "driver"), str(folder / "driver.c"), "-lm"]
    subprocess.run(command, check=True, capture_output=True)
    found = []
    for rtol in (1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12):
        words = [str(folder / "driver"), repr(float(p.times[-1])), repr(rtol), *map(repr, start.tolist())]
        reported = json.loads(subprocess.run(words, capture_output=True, check=True, text=True).stdout)
        found.append(Tried(f"rtol {rtol:.0e}", reported["seconds"], p.error(reported["angle"]), IN_C))
    return found


def tried(p: Problem) -> list[Tried]:
    x, rate = equations(p)
    start = np.concatenate([p.angles, p.rates])
    found = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        f = compiled(ca.Function("f", [x], [rate]), folder, "f")
        state = ca.MX.sym("x", x.numel())
        ode = {"x": state, "ode": f(state)}
        for tolerance in (1e-6, 1e-8, 1e-10, 1e-12) if x.numel() <= DERIVED else ():
            options = {"abstol": tolerance / 100, "reltol": tolerance, "linear_multistep_method": "adams"}
            options |= {"nonlinear_solver_iteration": "functional", "max_num_steps": 1_000_000}
            run = ca.integrator("run", "cvodes", ode, 0.0, p.times[1:], options)
            try:
                seconds, end = timed(partial(run, x0=start))
            except RuntimeError:
                continue
            found.append(Tried(f"CVODES (Adams) {tolerance:.0e}", seconds, p.error(float(end["xf"][0, -1]))))
        between = float(p.times[1] - p.times[0])
        for steps in (5, 10, 20, 40, 80, 100, 160) if x.numel() <= DERIVED else ():
            whole = compiled(classical(x, rate, between / steps, steps, len(p.times) - 1), folder, f"whole{steps}")
            seconds, end = timed(partial(whole, start))
            found.append(Tried(f"RK4, {steps} steps to an output", seconds, p.error(float(end[0, -1]))))
        found += in_c(p, folder, start)
    return found


if __name__ == "__main__":
    report(tried(Problem.read(sys.argv[1])), f"CasADi {ca.__version__}, compiled C")
