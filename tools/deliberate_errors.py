"""Deliberate errors, put into the core and the package one at a time: do the tests see each of them?

python tools/deliberate_errors.py               all of them
python tools/deliberate_errors.py NAME ...      these alone
python tools/deliberate_errors.py --list        what they spoil

An error is an exact piece of text that stands once in its file, and what takes its place. The files that git knows are
copied to a folder of their own with their own builds, so the working tree stays as it is. Unspoilt, the tests named
beside the errors must pass. Then each error is made, and the tests that should see it run, the narrowest first, until
one fails: it is caught. Where none does, all that `make test` runs is asked. An error that does not compile, or with
which the tests come to no end, is not caught. The exit code is 1 if one was not.
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
SCRATCH = ROOT / "target" / "errors"
"""Tree and builds stay here, so that the next error costs one incremental build."""
LONGEST = 1200.0
"""Seconds for one command: `make test` as a whole takes less."""
LIST_TEST = "test_deliberate_errors.py"


@dataclass(frozen=True)
class Error:
    """One error: what it spoils, where, and which tests of `make test` should see it."""

    name: str
    spoils: str
    file: str
    old: str
    new: str
    seen_by: tuple[str, ...]
    """In the order to try: "motion heavy_top" is a test binary of a crate and a filter, "lib spatial" the unit
    tests, "python test_x.py" a file of tests/python, "docstrings x.py" a file of the package."""


MATH, SYSTEM, INTEGRATE, MODEL, ANALYSIS = (
    f"crates/partita-{crate}/src" for crate in ("math", "system", "integrate", "model", "analysis")
)
PACKAGE = "python/partita"

ERRORS = (
    # numbers and space
    Error(
        "dual-atan2",
        "sign in the derivative of atan2",
        f"{MATH}/scalar/dual.rs",
        "(x.re * self.eps - self.re * x.eps) / square",
        "(x.re * self.eps + self.re * x.eps) / square",
        ("lib scalar",),
    ),
    Error(
        "quaternion-rate",
        "the half in q' = N(q) v of a ball (S2)",
        f"{MATH}/spatial/rotation.rs",
        "let h = S::from_f64(0.5);",
        "let h = S::one();",
        ("lib spatial",),
    ),
    Error(
        "lock-bias",
        "sign of a term in the bias b of a locked turn (S5)",
        f"{MATH}/spatial/three.rs",
        "wb.cross(w).cross(u) + w.cross(wa.cross(u))",
        "wb.cross(w).cross(u) - w.cross(wa.cross(u))",
        ("motion model_identities",),
    ),
    Error(
        "lock-axis",
        "gradient of a locked turn points the other way (S4)",
        f"{MATH}/spatial/three.rs",
        "b.apply(l.w).cross(a.apply(l.u))",
        "a.apply(l.u).cross(b.apply(l.w))",
        ("motion model_identities",),
    ),
    Error(
        "product-of-inertia",
        "sign of the products of inertia of bodies that are welded together",
        f"{MATH}/spatial/rotation.rs",
        "s.0[i][j] = -mass * r.0[i] * r.0[j];",
        "s.0[i][j] = if i == j { -mass } else { mass } * r.0[i] * r.0[j];",
        ("motion reactions", "python test_oracle.py"),
    ),
    Error(
        "determinant-side",
        "sign of det C_D, by which a crossed singular position is noticed, not kept up to date",
        f"{MATH}/elimination/plan.rs",
        "all ^= negative;",
        "all ^= false;",
        ("lib elimination", "motion passages"),
    ),
    # the mechanism
    Error(
        "coriolis-of-a-slide",
        "half of the Coriolis acceleration of a slide",
        f"{MODEL}/tree.rs",
        "+ coriolis + coriolis",
        "+ coriolis",
        ("motion model_identities",),
    ),
    Error(
        "coriolis-of-a-turn",
        "the angular acceleration that two turns make together",
        f"{MODEL}/tree.rs",
        "x.alpha = alpha_p + G::cross_ang(w_p, turn);",
        "x.alpha = alpha_p;",
        ("motion model_identities",),
    ),
    Error(
        "gyroscopic-projected",
        "sign of the gyroscopic moment in the projected equations (P3)",
        f"{MODEL}/dynamics.rs",
        "G::spin(&x.inertia, alpha) - G::cross_ang(x.w, spin)",
        "G::spin(&x.inertia, alpha) + G::cross_ang(x.w, spin)",
        ("motion model_identities",),
    ),
    Error(
        "gyroscopic-inverse",
        "sign of the gyroscopic moment in inverse dynamics",
        f"{MODEL}/dynamics.rs",
        "G::spin(&x.inertia, alpha) + G::cross_ang(x.w, spin) - x.moment",
        "G::spin(&x.inertia, alpha) - G::cross_ang(x.w, spin) - x.moment",
        ("motion model_identities",),
    ),
    Error(
        "gyroscopic-recursion",
        "sign of the gyroscopic moment in the recursion over clusters (48)",
        f"{MODEL}/clusters/sweep.rs",
        "G::spin(&l.inertia, l.alpha) + G::cross_ang(l.w, spin)",
        "G::spin(&l.inertia, l.alpha) - G::cross_ang(l.w, spin)",
        ("motion many_freedoms",),
    ),
    Error(
        "recursion-outward",
        "the base of a cluster takes its freedoms along the wrong way (48)",
        f"{MODEL}/clusters/few.rs",
        "x.few.own[f.small + j] -= carried;",
        "x.few.own[f.small + j] += carried;",
        ("motion many_freedoms",),
    ),
    Error(
        "recursion-bias",
        "the rows in the recursion over clusters start without b (48)",
        f"{MODEL}/clusters/sweep.rs",
        "*left = given.tangents.b[row as usize];",
        "*left = G::S::zero();",
        ("motion many_freedoms",),
    ),
    Error(
        "bias-of-a-cut-slide",
        "half of the Coriolis term in the bias b of a cut joint that slides (S5)",
        f"{MODEL}/closing.rs",
        "+ twice + twice +",
        "+ twice +",
        ("motion model_identities",),
    ),
    Error(
        "cut-slide-arm",
        "the row of a cut slide turns about the point of A instead of that of B (S4)",
        f"{MODEL}/closing.rs",
        "let point = if p.on_b { pb } else { pb + k.offset };",
        "let point = if p.on_b { pb } else { pa };",
        ("motion model_identities",),
    ),
    Error(
        "universal-second-axis",
        "axes of a cut universal joint ride on the wrong bodies",
        f"{MODEL}/joint/universal.rs",
        "locks: vec![(a, b)],",
        "locks: vec![(b, a)],",
        ("motion reactions", "python test_oracle.py"),
    ),
    Error(
        "order-of-turns",
        "angles of a cut joint with two turns are read in the wrong order",
        f"{MODEL}/joint/coordinates.rs",
        "rest = Mat3::about(a, (-angle).sin(), angle.cos()).mul(&rest);",
        "rest = rest.mul(&Mat3::about(a, (-angle).sin(), angle.cos()));",
        ("motion reactions", "python test_oracle.py"),
    ),
    Error(
        "rate-of-the-second-turn",
        "rates of a cut universal joint about the second axis as drawn, not as it stands",
        f"{MODEL}/joint/coordinates.rs",
        "axes.push(so_far.apply(*a));",
        "axes.push(*a);",
        ("motion reactions", "python test_oracle.py"),
    ),
    Error(
        "turns-of-cut-joints",
        "whole turns of a cut joint foretold with twice the speed",
        f"{MODEL}/observe.rs",
        "0.5 * (last.velocity[i] + state.velocity[i])",
        "(last.velocity[i] + state.velocity[i])",
        ("python test_results.py",),
    ),
    Error(
        "damper-power",
        "sign of the power of a damper",
        f"{MODEL}/force/spring.rs",
        "power: -(self.damping * speed * speed)",
        "power: self.damping * speed * speed",
        ("motion model_identities",),
    ),
    Error(
        "torsion-damper-power",
        "sign of the power of a damper in a joint",
        f"{MODEL}/force/torsion.rs",
        "power: -(self.damping * speed * speed)",
        "power: self.damping * speed * speed",
        ("motion model_identities",),
    ),
    Error(
        "spring-energy",
        "the half in the energy of a spring",
        f"{MODEL}/force/mod.rs",
        "(stiffness * stretch * stretch).scale(0.5)",
        "stiffness * stretch * stretch",
        ("motion model_identities",),
    ),
    Error(
        "spring-between-branches",
        "a spring between two branches forgets how far apart they are held",
        f"{MODEL}/force/spring.rs",
        "- xa.centre - ra + self.offset;",
        "- xa.centre - ra;",
        ("motion every_formulation", "python test_oracle.py"),
    ),
    Error(
        "force-axes",
        "a force that turns with its body stays in world axes, and the other way round",
        f"{MODEL}/force/point_force.rs",
        "if self.turns { G::rot_to(&state.rot)",
        "if !self.turns { G::rot_to(&state.rot)",
        ("motion model_identities", "motion reactions", "python test_oracle.py"),
    ),
    Error(
        "universal-effort",
        "a torque in a cut universal joint acts about the other axis",
        f"{MODEL}/force/build.rs",
        "{ (own, other) } else { (other, own) }",
        "{ (other, own) } else { (own, other) }",
        ("motion reactions", "python test_oracle.py"),
    ),
    Error(
        "cut-effort-point",
        "the force on the parent in a cut slide acts at another point than that on the child",
        f"{MODEL}/force/cut_effort.rs",
        "let back = at.tree.place(child, at.s) + arm - at.tree.place(parent, at.s);",
        "let back = at.tree.place(child, at.s) - at.tree.place(parent, at.s);",
        ("motion model_identities", "motion reactions", "python test_oracle.py"),
    ),
    Error(
        "gravity-axes",
        "gravity stays in world axes where the mechanism has axes of its own",
        f"{MODEL}/numbers.rs",
        "gravity: lift(placed.basis.apply(Vec3(spec.gravity))),",
        "gravity: lift(Vec3(spec.gravity)),",
        ("motion parameters", "motion model_identities", "python test_oracle.py"),
    ),
    Error(
        "gravity-energy",
        "sign of the potential of gravity",
        f"{MODEL}/dynamics.rs",
        "potential -= link.mass * G::dot(self.gravity",
        "potential += link.mass * G::dot(self.gravity",
        ("motion model_identities",),
    ),
    Error(
        "inertia-axes",
        "inertia is turned from body axes the wrong way",
        f"{MODEL}/place.rs",
        "inertia: rot.mul(&Mat3(b.inertia)).mul(&rot.transpose()),",
        "inertia: rot.transpose().mul(&Mat3(b.inertia)).mul(&rot),",
        ("motion parameters", "motion reactions", "python test_oracle.py"),
    ),
    Error(
        "inertia-as-parameter",
        "the same where inertia is changed without compiling anew",
        f"{MODEL}/numbers.rs",
        "inertia: rot.mul(&b.inertia).mul(&rot.transpose()),",
        "inertia: rot.transpose().mul(&b.inertia).mul(&rot),",
        ("motion parameters",),
    ),
    Error(
        "drive-rate",
        "sign of a, how fast a drive moves its row (S4)",
        f"{MODEL}/evaluator.rs",
        "a[d.row] = -u;",
        "a[d.row] = u;",
        ("motion model_identities",),
    ),
    Error(
        "drive-acceleration",
        "the bias b of a drive is half of what it should be (S5)",
        f"{MODEL}/evaluator.rs",
        "b[d.row] = -value::motion_at(&d.motion, &self.callers, t, &d.name, &mut s.room)?[2];",
        "b[d.row] = value::motion_at(&d.motion, &self.callers, t, &d.name, &mut s.room)?[2].scale(-0.5);",
        ("motion model_identities",),
    ),
    Error(
        "table-slope",
        "slope of a cubic in a table",
        f"{MODEL}/value.rs",
        "(a.scale(3.0) * x + b.scale(2.0)) * x + c, a",
        "(a.scale(3.0) * x + b) * x + c, a",
        ("motion scalars",),
    ),
    Error(
        "reaction-point",
        "a tree joint's moment is reduced to the wrong point (R3)",
        f"{MODEL}/reaction/mod.rs",
        ".about(self.com_now(s, outer) - self.joint_point_now(s, j))",
        ".about(self.joint_point_now(s, j) - self.com_now(s, outer))",
        ("motion reactions",),
    ),
    Error(
        "reaction-on-the-parent",
        "a cut joint's wrench is not given back to the parent (R3)",
        f"{MODEL}/reaction/mod.rs",
        "self.put(s, needed, p.parent, &w, point);",
        "self.put(s, needed, p.parent, &w.opposite(), point);",
        ("motion reactions",),
    ),
    Error(
        "augmented-arm",
        "arm of a prohibited turn in the augmented joint coordinates (45)",
        f"{MODEL}/reaction/augmented.rs",
        "z.axis.cross(self.com_now(s, node - 1) - point)",
        "z.axis.cross(point - self.com_now(s, node - 1))",
        ("motion reactions",),
    ),
    Error(
        "dyad-branch",
        "explicit closing: a triangle of links is closed on one side whatever the assembly",
        f"{MODEL}/loop_closure/planar.rs",
        "let h = twice_area.scale(sign) / r;",
        "let h = twice_area.scale(sign.abs()) / r;",
        ("closing loop_closure_plane",),
    ),
    Error(
        "slider-branch",
        "explicit closing: a slide is closed on one side whatever the assembly",
        f"{MODEL}/loop_closure/planar.rs",
        "* (l + off.abs())).sqrt().scale(sign);",
        "* (l + off.abs())).sqrt().scale(sign.abs());",
        ("closing loop_closure_plane",),
    ),
    # reduced equations
    Error(
        "xi-sign",
        "sign of xi, what the loops add to the dependent accelerations (P1)",
        f"{SYSTEM}/reduction/arithmetic.rs",
        "*x = -b[row];",
        "*x = b[row];",
        ("reducing identities",),
    ),
    Error(
        "eta-left-out",
        "eta, what drives give to the dependent velocities (P2)",
        f"{SYSTEM}/reduction/arithmetic.rs",
        "gamma[i] = row[k];",
        "gamma[i] = T::zero();",
        ("reducing identities", "motion driven"),
    ),
    Error(
        "measure-scale",
        "the scale left out of the projective measure (P4)",
        f"{SYSTEM}/partition/criterion.rs",
        "*r = (dense::dot(y, y) / s2[i]).sqrt().min(1.0);",
        "*r = dense::dot(y, y).sqrt().min(1.0);",
        ("reducing identities", "reducing invariance"),
    ),
    Error(
        "exchange-index",
        "what enters is taken for what leaves in the scales of an exchange (P6)",
        f"{SYSTEM}/partition/exchange.rs",
        "* s[c] / s[i];",
        "* s[i] / s[c];",
        ("reducing", "python test_units.py"),
    ),
    Error(
        "volume-sign",
        "rows swapped in a determinant do not change its sign (persistence)",
        f"{SYSTEM}/partition/volume.rs",
        "let swapped = if pivots[i] == i { 1.0 } else { -1.0 };",
        "let swapped = 1.0;",
        ("reducing selection",),
    ),
    Error(
        "row-scale",
        "characteristic length left out of how open a condition is",
        f"{SYSTEM}/reduction/openness.rs",
        "worst(self.phi.iter().zip(&self.row_size).map(|(x, size)| x / size).enumerate())",
        "worst(self.phi.iter().zip(&self.row_size).map(|(x, _)| *x).enumerate())",
        ("python test_scales.py",),
    ),
    Error(
        "reach-of-a-slide",
        "the characteristic length is no measure of slides any more",
        f"{MODEL}/model.rs",
        "new.reach[l.v] = placed.length;",
        "new.reach[l.v] = 1.0;",
        ("closing scales",),
    ),
    Error(
        "closing-once",
        "outputs are closed by one iteration of Newton's method alone",
        f"{SYSTEM}/positions/all.rs",
        "for _ in 0..8 {",
        "for _ in 0..1 {",
        ("motion many_turns",),
    ),
    Error(
        "closing-newton",
        "dependent coordinates are taken for closed after one iteration (34)",
        f"{SYSTEM}/positions/newton.rs",
        "if r.is_closed() || (open <= ROUND_OFF && open > 0.5 * last) {",
        "if r.is_closed() || last.is_finite() {",
        ("marching every_formulation",),
    ),
    Error(
        "assembly-polish",
        "a drawing is closed to the tolerance, not to round-off",
        f"{SYSTEM}/kinematics/assembly/descent.rs",
        "const LAST: usize = 8;",
        "const LAST: usize = 0;",
        ("closing assembly",),
    ),
    Error(
        "orthogonal-correction",
        "sign of the correction in the mass metric (33)",
        f"{SYSTEM}/kinematics/projection.rs",
        ".map(|d| -d).collect()",
        ".copied().collect()",
        ("marching constrained_order",),
    ),
    Error(
        "least-energy",
        "given rates with drives: the remaining speeds are not those of least energy",
        f"{SYSTEM}/kinematics/velocity.rs",
        "want[i] = rate - gamma[vi] + dense::dot(row, &g);",
        "want[i] = rate - gamma[vi];",
        ("motion driven",),
    ),
    Error(
        "baumgarte-damping",
        "the two in 2 alpha of Baumgarte's stabilisation",
        f"{SYSTEM}/equations/full/baumgarte.rs",
        "x.b[i] + 2.0 * self.alpha * x.opening(i)",
        "x.b[i] + self.alpha * x.opening(i)",
        ("reducing every_formulation",),
    ),
    Error(
        "proximal-once",
        "the proximal iteration stops after one",
        f"{SYSTEM}/equations/full/proximal.rs",
        "const MOST: u64 = 80;",
        "const MOST: u64 = 1;",
        ("reducing every_formulation", "closing redundant_proximal"),
    ),
    Error(
        "chart-turn",
        "the second term of how a chart of turns moves (46)",
        f"{SYSTEM}/positions/chart.rs",
        "0.5 * once[i] + c * twice[i]",
        "0.5 * once[i] - c * twice[i]",
        ("motion heavy_top",),
    ),
    Error(
        "whole-turns",
        "whole turns taken off an angle are counted backwards",
        f"{SYSTEM}/positions/turns.rs",
        "*turns = turns.saturating_add(n as i32);",
        "*turns = turns.saturating_sub(n as i32);",
        ("motion many_turns",),
    ),
    Error(
        "rest-of-a-turn",
        "the digits of 2 pi beyond those of a double when whole turns are taken off",
        f"{SYSTEM}/positions/turns.rs",
        "*angle = (*angle - n * TAU) - n * TAU_REST;",
        "*angle = (*angle - n * TAU) + n * TAU_REST;",
        ("motion many_turns",),
    ),
    Error(
        "work-of-drives",
        "sign of the work of drives",
        f"{SYSTEM}/tangent/base.rs",
        "Ok(dense::dot(&self.residual, &r.gamma))",
        "Ok(-dense::dot(&self.residual, &r.gamma))",
        ("motion driven",),
    ),
    Error(
        "work-of-drives-in-full",
        "sign of the work of drives where the equations are solved in all velocities",
        f"{SYSTEM}/tangent/all.rs",
        "Ok(-dense::dot(&self.lambda, &self.base.r.a))",
        "Ok(dense::dot(&self.lambda, &self.base.r.a))",
        ("motion driven", "marching driven", "python test_verdict.py"),
    ),
    Error(
        "redundant",
        "the threshold below which a row counts as redundant",
        f"{SYSTEM}/reduction/rows.rs",
        "pub const REDUNDANT: f64 = 1e-9;",
        "pub const REDUNDANT: f64 = 1e-30;",
        ("lib mobility determined", "closing"),
    ),
    Error(
        "choice-of-an-output",
        "an output is described with the first choice of the run, not with the one in use",
        f"{SYSTEM}/formulation/motion.rs",
        "out.choice = self.tangent.base().events().len().saturating_sub(1);",
        "out.choice = 0;",
        ("marching tangent_methods",),
    ),
    Error(
        "time-of-a-passage",
        "a singular position that was crossed is dated from the wrong end of its step",
        f"{SYSTEM}/formulation/motion/passing.rs",
        "from + h * one / (one + two)",
        "from + h * two / (one + two)",
        ("motion passages",),
    ),
    Error(
        "branch-kept",
        "a crossing is believed whatever the velocities do in it",
        f"{SYSTEM}/singular/crossing.rs",
        "norm(&missed) <= Self::MISSED * speed && !(0..s.len()).any(jumps)",
        "norm(&missed) <= Self::MISSED * speed || !(0..s.len()).any(jumps)",
        ("lib singular",),
    ),
    Error(
        "dead-point-of-the-choice",
        "a dead point of the choice is taken for a singular position of the mechanism",
        f"{SYSTEM}/singular/dead_point.rs",
        "r.choices() == choice && !one.differ(&two)",
        "r.choices() == choice && one.differ(&two)",
        ("python test_trust.py",),
    ),
    Error(
        "near-velocities",
        "velocities keep away from those they should stay near to",
        f"{SYSTEM}/kinematics/velocity.rs",
        "*g -= d * p",
        "*g += d * p",
        ("python test_assemblies.py",),
    ),
    # marching
    Error(
        "corners-passed",
        "steps pass the corners of tables",
        f"{INTEGRATE}/explicit_rk.rs",
        "self.next_corner().unwrap_or(self.t_end)",
        "self.next_corner().map_or(self.t_end, |_| self.t_end)",
        ("marching stepping",),
    ),
    Error(
        "output-in-a-singular-position",
        "a weight of the polynomial through outputs beside it",
        f"{INTEGRATE}/simulate.rs",
        "[1.0, -6.0, 15.0, 15.0, -6.0, 1.0]",
        "[1.0, -6.0, 15.0, 15.0, -6.0, 1.001]",
        ("python test_trust.py",),
    ),
    Error(
        "dense-output-dop853",
        "the seventh digit of a coefficient of dense output (dop853)",
        f"{INTEGRATE}/tableau/dop853.rs",
        "-374.5467547226902",
        "-374.5468547226902",
        ("marching order_conditions", "marching convergence"),
    ),
    Error(
        "dense-output-tsit5",
        "the sixth digit of a coefficient of dense output (tsit5)",
        f"{INTEGRATE}/tableau/tsit5.rs",
        "47.37952196281928",
        "47.37962196281928",
        ("marching order_conditions", "marching convergence"),
    ),
    Error(
        "extra-stage",
        "a stage for dense output alone is evaluated at the wrong time (dop853)",
        f"{INTEGRATE}/tableau/dop853.rs",
        "nodes: &[0.1, 0.2, 7.0 / 9.0],",
        "nodes: &[0.1, 0.2, 7.0 / 9.1],",
        ("marching order_conditions",),
    ),
    Error(
        "error-weights",
        "the sixth digit of an error weight (dopri5)",
        f"{INTEGRATE}/tableau/dopri5.rs",
        "-17253.0 / 339_200.0",
        "-17253.0 / 339_201.0",
        ("marching order_conditions",),
    ),
    Error(
        "stage-time",
        "stages are evaluated at the time at which their step begins",
        f"{INTEGRATE}/explicit_rk.rs",
        "let t = if c[i] == 1.0 { t_new } else { self.t_old + c[i] * h };",
        "let t = if c[i] == 1.0 { t_new } else { self.t_old };",
        ("marching convergence",),
    ),
    Error(
        "error-norm",
        "of the errors of a step the last one counts, not the largest",
        f"{INTEGRATE}/step_size.rs",
        "squares[lane] = if e2 <= squares[lane] { squares[lane] } else { e2 };",
        "squares[lane] = e2;",
        ("marching stepping",),
    ),
    Error(
        "tolerances-of-others",
        "from the ninth component on errors are held against the tolerances of the first ones",
        f"{INTEGRATE}/step_size.rs",
        "let tolerance = self.tolerance_tile(at, y_old, y_new);",
        "let tolerance = self.tolerance_tile(0, y_old, y_new);",
        ("marching stepping",),
    ),
    Error(
        "atol-ignored",
        "tolerances given for each component are not looked at",
        f"{INTEGRATE}/step_size.rs",
        "AbsoluteTolerance::Each(values) => atol[..controlled].copy_from_slice(values),",
        "AbsoluteTolerance::Each(values) => atol[..controlled].fill(values[0]),",
        ("marching stepping",),
    ),
    Error(
        "atol-scale",
        "natural sizes left out of the absolute tolerances",
        f"{INTEGRATE}/step_size.rs",
        "self.atol[i] = self.asked[i] * size;",
        "self.atol[i] = self.asked[i];",
        ("marching stepping", "closing scales"),
    ),
    Error(
        "change-of-coordinates",
        "after an exchange of coordinates the step goes on with the old slope",
        f"{INTEGRATE}/explicit_rk.rs",
        "self.stages[..self.dim].copy_from_slice(dy);",
        "let _ = dy;",
        ("marching constrained_order", "marching stepping"),
    ),
    # questions to a run
    Error(
        "determined",
        "the flag of one component of the reactions is the opposite of what it should be (R2)",
        f"{ANALYSIS}/determined.rs",
        "if i < 3 { along(&self.force, i) }",
        "if i == 1 { !along(&self.force, i) } else if i < 3 { along(&self.force, i) }",
        ("lib determined",),
    ),
    Error(
        "verdict-of-rates",
        "rates that stand open are not held against a run",
        f"{ANALYSIS}/run/verdict.rs",
        'look(gaps.velocity, self.velocity, "the rate", "the fastest");',
        'look(gaps.velocity, (f64::INFINITY, f64::INFINITY), "the rate", "the fastest");',
        ("lib verdict", "python test_verdict.py"),
    ),
    Error(
        "verdict-of-steps",
        "steps beyond the tolerance are never held against a run",
        f"{ANALYSIS}/run/verdict.rs",
        "if lenient > explained {",
        "if lenient == u64::MAX {",
        ("lib verdict", "python test_verdict.py"),
    ),
    Error(
        "self-stress-point",
        "moment of a self-stress is collected about the wrong point (R2)",
        f"{ANALYSIS}/stress.rs",
        "let moment = moment + (self.points[k.joint] - origin).cross(force);",
        "let moment = moment - (self.points[k.joint] - origin).cross(force);",
        ("lib stress",),
    ),
    Error(
        "body-velocity",
        "velocity of a body's origin is that of its reference point",
        f"{MODEL}/observe.rs",
        "velocity: out.apply(x.u + x.w.cross(arm)),",
        "velocity: out.apply(x.u),",
        ("python test_results.py",),
    ),
    # the package
    Error(
        "unit-of-speed",
        "a revolution per minute is half of one",
        f"{PACKAGE}/units.py",
        "rpm = 2.0 * math.pi / 60.0",
        "rpm = math.pi / 60.0",
        ("docstrings units.py",),
    ),
    Error(
        "unit-of-force",
        "the sixth digit of a pound-force",
        f"{PACKAGE}/units.py",
        "4.4482216152605",
        "4.4482316152605",
        ("python test_units.py",),
    ),
    Error(
        "stored-steps",
        "what was open at the ends of steps is read back as something else",
        f"{PACKAGE}/results/record.py",
        'told["steps_open"], told["gaps"] = _pair(account.get("steps_open")), _pair(account.get("gaps"))',
        'told["steps_open"], told["gaps"] = _pair(account.get("gaps")), _pair(account.get("steps_open"))',
        ("python test_results.py", "python test_verdict.py", "python test_files.py"),
    ),
    Error(
        "stored-findings",
        "a stored result forgets what stands against it",
        f"{PACKAGE}/results/record.py",
        'told["findings"] = findings_of(account.get("findings", ()))',
        'told["findings"] = findings_of(())',
        ("python test_verdict.py",),
    ),
)


@dataclass(frozen=True)
class Outcome:
    """How a command ended: tests that failed, or why there is nothing to say."""

    failed: tuple[str, ...] = ()
    trouble: str = ""

    @property
    def passed(self) -> bool:
        """Nothing failed, and nothing stood in the way."""
        return not self.failed and not self.trouble


class Workshop:
    """The copied tree and its builds."""

    def __init__(self, scratch: Path) -> None:
        self.tree = scratch / "tree"
        self.builds = scratch / "build"
        self.log = scratch / "last.txt"
        self.all_pass = False
        self.environment = os.environ | {
            "CARGO_TARGET_DIR": str(self.builds),
            "PYO3_PYTHON": sys.executable,
            "PYO3_BUILD_EXTENSION_MODULE": "1",
            "PYTHONPATH": str(self.tree / "python"),
            "PYTHONDONTWRITEBYTECODE": "1",  # a source changed twice in a second keeps its old bytecode
            "MPLBACKEND": "Agg",
        }

    def copy(self) -> None:
        """Bring the tree to the state of the files that git knows; what has not changed keeps its date and build."""
        listed = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, check=True, capture_output=True).stdout
        names = {name for name in listed.decode().split("\0") if name and (ROOT / name).is_file()}
        if self.tree.exists():
            for path in (self.tree / top for top in ("crates", "python", "tests")):
                for there in [p for p in path.rglob("*") if p.is_file()]:
                    if str(there.relative_to(self.tree)) not in names:
                        there.unlink()
        for name in sorted(names):
            source, there = ROOT / name, self.tree / name
            if not there.exists() or there.read_bytes() != source.read_bytes():
                there.parent.mkdir(parents=True, exist_ok=True)
                there.write_bytes(source.read_bytes())

    @contextmanager
    def spoilt(self, error: Error) -> Iterator[None]:
        """The tree with this error in it."""
        path = self.tree / error.file
        right = path.read_text("utf-8")
        path.write_text(spoil(error, right), "utf-8")
        try:
            yield
        finally:
            path.write_text(right, "utf-8")

    def run(self, command: Sequence[str]) -> tuple[int | None, str]:
        """Exit code (none if there was no end) and what was said."""
        with subprocess.Popen(
            command,
            cwd=self.tree,
            env=self.environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            errors="replace",
            start_new_session=True,
        ) as process:
            try:
                said, _ = process.communicate(timeout=LONGEST)
                code: int | None = process.returncode
            except subprocess.TimeoutExpired:
                self.cut_short(process)
                said, code = process.communicate()[0], None
            except BaseException:
                self.cut_short(process)
                raise
        self.log.write_text(f"{' '.join(command)}\n{said}", "utf-8")
        return code, said

    def cut_short(self, process: subprocess.Popen[str]) -> None:
        """End a command with all that it started. A compiler cut short may leave pieces of spoilt code in its cache."""
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()
        shutil.rmtree(self.builds / "debug" / "incremental", ignore_errors=True)

    def tests(self, tests: str) -> Outcome:
        """Run some of the tests, see `Error.seen_by`."""
        kind, *rest = tests.split()
        if kind in ("python", "docstrings"):
            folder = "tests/python" if kind == "python" else PACKAGE
            return self.python([f"{folder}/{name}" for name in rest])
        # of the whole workspace always: a crate by itself has other features of its dependencies, and other builds
        return self.rust(["--lib"] if kind == "lib" else ["--test", kind], rest)

    def check_all_tests(self) -> None:
        """Unspoilt they pass; asked when that is first needed."""
        if not self.all_pass:
            outcome = self.all_tests()
            if not outcome.passed:
                raise SystemExit(f"unspoilt, make test fails: {outcome.trouble or ' '.join(outcome.failed)}")
            self.all_pass = True

    def all_tests(self) -> Outcome:
        """What `make test` runs."""
        outcome = self.rust([], [])
        # the list of errors knows the right text: that a spoilt one differs from it proves nothing
        return self.python([f"--ignore=tests/python/{LIST_TEST}"]) if outcome.passed else outcome

    def rust(self, which: Sequence[str], names: Sequence[str]) -> Outcome:
        """`cargo test`, built first: what does not compile is no failure of a test."""
        command = ["cargo", "test", "--workspace", "--locked", *which]
        code, said = self.run([*command, "--no-run"])
        if code != 0:
            return Outcome(trouble=f"it does not compile:\n{tail(said)}")
        code, said = self.run([*command, "--", *names])
        if code is None:
            return Outcome(trouble=f"the tests did not end within {LONGEST:.0f} s")
        if code != 0:
            failed = re.findall(r"^test (\S+)(?: - should panic)? \.\.\. FAILED", said, re.M)
            return Outcome(tuple(failed) or ("aborted",))
        ran = sum(int(n) for n in re.findall(r"^running (\d+) tests?$", said, re.M))
        return Outcome() if ran > 0 else Outcome(trouble=f"{' '.join(command)} has no tests named {' '.join(names)}")

    def python(self, files: Sequence[str]) -> Outcome:
        """`pytest` on these files, or on all, with the native module of the tree."""
        code, said = self.run(["cargo", "build", "--workspace", "--locked"])
        if code != 0:
            return Outcome(trouble=f"it does not compile:\n{tail(said)}")
        built = next(
            path
            for path in (self.builds / "debug").glob(
                "lib_core.*",
            )
            if path.suffix in (".so", ".dylib")
        )
        module = self.tree / PACKAGE / "_core.abi3.so"
        if not module.exists() or module.read_bytes() != built.read_bytes():
            module.unlink(missing_ok=True)
            shutil.copyfile(built, module)
        code, said = self.run([sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", *files])
        if code is None:
            return Outcome(trouble=f"the tests did not end within {LONGEST:.0f} s")
        if code == 0:
            return Outcome()
        if code == 1 or code < 0:
            return Outcome(tuple(re.findall(r"^(?:FAILED|ERROR) (\S+)", said, re.M)) or ("aborted",))
        return Outcome(trouble=f"pytest could not run the tests (exit code {code}):\n{tail(said)}")


def spoil(error: Error, text: str) -> str:
    """`text` with the error in it; the text to replace must stand there once."""
    if (count := text.count(error.old)) != 1:
        raise SystemExit(f"{error.name}: {error.old!r} stands {count} times in {error.file}; it must be once")
    return text.replace(error.old, error.new)


def tail(said: str) -> str:
    """The last lines of what a command said."""
    return "\n".join(said.splitlines()[-15:])


def named(names: Sequence[str]) -> list[Error]:
    """The errors called so, all if none is."""
    known = {error.name: error for error in ERRORS}
    if unknown := [name for name in names if name not in known]:
        raise SystemExit(f"no error is called {', '.join(unknown)}; there are {', '.join(known)}")
    return [known[name] for name in names] if names else list(ERRORS)


def main() -> int:
    """Make the errors that the arguments name; 1 if one was not caught."""
    parser = argparse.ArgumentParser(description="Deliberate errors: do the tests see each of them?")
    parser.add_argument("names", nargs="*", metavar="NAME", help="errors to make; all if none is named")
    parser.add_argument("--list", action="store_true", help="say what each spoils")
    parser.add_argument("--narrow", action="store_true", help="do not ask all of make test where the named tests pass")
    arguments = parser.parse_args()
    errors = named(arguments.names)
    if arguments.list:
        print("\n".join(f"{error.name:24} {error.spoils}" for error in errors))
        return 0
    workshop = Workshop(SCRATCH)
    workshop.copy()
    for error in errors:
        spoil(error, (workshop.tree / error.file).read_text("utf-8"))
    missed: list[str] = []
    caught = 0
    try:
        check_unspoilt(workshop, errors)
        for number, error in enumerate(errors, 1):
            print(f"[{number}/{len(errors)}] {error.name}: {error.spoils}", flush=True)
            began = time.monotonic()
            by = hunt(workshop, error, arguments.narrow)
            took = f"({time.monotonic() - began:.0f} s)"
            if by is None:
                missed.append(error.name)
                print(f"    NOT CAUGHT {took}", flush=True)
            else:
                caught += 1
                print(f"    caught by {by} {took}", flush=True)
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        return 130
    finally:
        left = f"; not caught: {', '.join(missed)}" if missed else ""
        print(f"{caught} of {len(errors)} errors were caught{left}")
    return 1 if missed else 0


def check_unspoilt(workshop: Workshop, errors: Sequence[Error]) -> None:
    """Without an error the named tests pass: otherwise they would prove nothing."""
    for tests in dict.fromkeys(tests for error in errors for tests in error.seen_by):
        began = time.monotonic()
        outcome = workshop.tests(tests)
        if not outcome.passed:
            raise SystemExit(f"unspoilt, {tests}: {outcome.trouble or ' '.join(outcome.failed)}; see {workshop.log}")
        print(f"unspoilt, {tests}: passes ({time.monotonic() - began:.0f} s)", flush=True)


def hunt(workshop: Workshop, error: Error, narrow: bool) -> str | None:
    """The first test that sees the error."""
    with workshop.spoilt(error):
        for tests in error.seen_by:
            outcome = workshop.tests(tests)
            if outcome.failed:
                return f"{tests}: {outcome.failed[0]}" + more(outcome)
            if outcome.trouble:
                print(f"    {outcome.trouble}", flush=True)
                return None
    if narrow:
        return None
    print("    the named tests pass; asking all of make test", flush=True)
    workshop.check_all_tests()
    with workshop.spoilt(error):
        outcome = workshop.all_tests()
    if outcome.trouble:
        print(f"    {outcome.trouble}", flush=True)
    return f"make test: {outcome.failed[0]}" + more(outcome) if outcome.failed else None


def more(outcome: Outcome) -> str:
    """How many other tests failed with the first."""
    return f" and {len(outcome.failed) - 1} more" if len(outcome.failed) > 1 else ""


if __name__ == "__main__":
    sys.exit(main())
