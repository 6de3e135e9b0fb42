"""An independent program: free bodies, six velocities each (of the centre of mass, angular; world axes), every closing
kept. Phi, its Jacobian C and the bias b of C v' + b = 0 by formulas; null directions by singular values.

The number k of null directions on the branch is handed in by who knows the mechanism. It is a truth of theory, never
taken from a gap.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import DOP853, solve_ivp
from scipy.spatial.transform import Rotation

from .drawing import Drawing, across

Array = NDArray[np.float64]


def skew(r: Array) -> Array:
    """(n, 3) to (n, 3, 3): `skew(r) x = r x x`."""
    out = np.zeros((*r.shape, 3))
    out[..., 0, 1], out[..., 0, 2], out[..., 1, 2] = -r[..., 2], r[..., 1], -r[..., 0]
    return out - np.swapaxes(out, -1, -2)


class Program:
    """The equations of one drawing. Poses are (x (n, 3), R (n, 3, 3)); the ground is the last body, and rests."""

    def __init__(self, drawing: Drawing) -> None:
        self.drawing, self.n = drawing, len(drawing.bodies)
        names = [body.name for body in drawing.bodies]
        where = {name: i for i, name in enumerate(names)} | {"ground": self.n}
        self.where = where
        self.mass = np.array([body.mass for body in drawing.bodies])
        self.inertia = np.array([body.inertia for body in drawing.bodies])
        positions = np.array([body.position for body in drawing.bodies] + [np.zeros(3)])
        self.x0, self.r0 = positions[:-1], np.tile(np.eye(3), (self.n, 1, 1))
        points: list[Any] = []
        dots: list[Any] = []
        alongs: list[Any] = []
        bars: list[Any] = []
        self.rolls: list[Any] = []
        self.slides: list[Any] = []
        for j in drawing.joints:
            a, b = where[j.parent], where[j.child]
            if j.kind == "sliding":
                self.slides.append((b, j.point - positions[b], j.length))
                continue
            if j.kind == "rolling":
                self.rolls.append((b, j.point - positions[b], j.axis, j.length))
                continue
            p, s = j.point - positions[a], j.point_on_child() - positions[b]
            if j.kind == "distance":
                s = j.end - positions[b]
                bars.append((a, p, b, s, j.length))
                continue
            if j.kind in ("revolute", "spherical", "universal"):
                points.append((a, p, b, s))
            if j.kind == "universal":
                dots.append((a, j.axis, b, j.axis2, float(j.axis @ j.axis2)))
            if j.kind in ("revolute", "cylindrical", "prismatic"):
                u, w = across(j.axis)
                dots += [(a, u, b, j.axis_on_child(), 0.0), (a, w, b, j.axis_on_child(), 0.0)]
                if j.kind != "revolute":
                    alongs += [(a, p, u, b, s), (a, p, w, b, s)]
                if j.kind == "prismatic":
                    dots.append((a, u, b, w, 0.0))
            if j.kind == "lock":
                e = np.eye(3)
                dots += [(a, e[i], b, e[k], 0.0) for i, k in ((0, 1), (1, 2), (2, 0))]
        self.points, self.dots = self._table(points), self._table(dots)
        self.alongs, self.bars = self._table(alongs), self._table(bars)
        self.positions = 3 * len(points) + len(dots) + len(alongs) + len(bars) + len(self.slides) + len(self.rolls)

    @staticmethod
    def _table(rows: list[Any]) -> list[Array]:
        return [np.array(column) for column in zip(*rows, strict=True)] if rows else []

    def _with_ground(self, x: Array, r: Array, v: Array | None) -> tuple[Array, Array, Array, Array]:
        x, r = np.vstack([x, np.zeros(3)]), np.concatenate([r, np.eye(3)[None]])
        v = np.zeros(6 * self.n) if v is None else v
        twist = np.vstack([v.reshape(self.n, 6), np.zeros(6)])
        return x, r, twist[:, :3], twist[:, 3:]

    def closing(self, x: Array, r: Array, v: Array | None = None) -> tuple[Array, Array, Array]:
        """Phi of what closes positions; C and b of the same rows and of what rolls behind them."""
        x, r, lin, om = self._with_ground(x, r, v)
        n = self.n + 1
        phi: list[Array] = []
        rows: list[Array] = []
        bias: list[Array] = []

        def turned(i: Array, s: Array) -> Array:
            return np.einsum("nij,nj->ni", r[i], s)

        def put(count: int, parts: list[tuple[Array, int, Array]]) -> None:
            c = np.zeros((count, n, 6))
            for body, start, block in parts:
                c[np.arange(count), body, start : start + 3] += block
            rows.append(c)

        def centripetal(i: Array, s: Array) -> Array:
            return np.cross(om[i], np.cross(om[i], s))

        if self.points:
            a, p, b, s = self.points
            ra, rb = turned(a, p), turned(b, s)
            phi.append((x[b] + rb - x[a] - ra).ravel())
            eye, sa, sb = np.eye(3), skew(ra), skew(rb)
            count = len(a)
            c = np.zeros((count, 3, n, 6))
            for k in range(3):
                at = np.arange(count)
                c[at, k, b, :3] += eye[k]
                c[at, k, b, 3:] -= sb[:, k]
                c[at, k, a, :3] -= eye[k]
                c[at, k, a, 3:] += sa[:, k]
            rows.append(c.reshape(3 * count, n, 6))
            bias.append((centripetal(b, rb) - centripetal(a, ra)).ravel())
        if self.dots:
            a, u, b, w, value = self.dots
            u, w = turned(a, u), turned(b, w)
            phi.append(np.sum(u * w, axis=1) - value)
            cross = np.cross(u, w)
            put(len(a), [(a, 3, cross), (b, 3, -cross)])
            rate = np.cross(np.cross(om[a], u), w) + np.cross(u, np.cross(om[b], w))
            bias.append(np.sum((om[a] - om[b]) * rate, axis=1))
        if self.alongs:
            a, p, u, b, s = self.alongs
            ra, rb, u = turned(a, p), turned(b, s), turned(a, u)
            d = x[b] + rb - x[a] - ra
            phi.append(np.sum(u * d, axis=1))
            put(len(a), [(a, 0, -u), (a, 3, np.cross(u, d) - np.cross(ra, u)), (b, 0, u), (b, 3, np.cross(rb, u))])
            rate = lin[b] + np.cross(om[b], rb) - lin[a] - np.cross(om[a], ra)
            more = np.sum(centripetal(a, u) * d + 2.0 * np.cross(om[a], u) * rate, axis=1)
            bias.append(more + np.sum(u * (centripetal(b, rb) - centripetal(a, ra)), axis=1))
        if self.bars:
            a, p, b, s, length = self.bars
            ra, rb = turned(a, p), turned(b, s)
            d = x[b] + rb - x[a] - ra
            phi.append((np.sum(d * d, axis=1) - length**2) / (2.0 * length))
            e = d / length[:, None]
            put(len(a), [(a, 0, -e), (a, 3, -np.cross(ra, e)), (b, 0, e), (b, 3, np.cross(rb, e))])
            rate = lin[b] + np.cross(om[b], rb) - lin[a] - np.cross(om[a], ra)
            bias.append(
                np.sum(rate * rate, axis=1) / length + np.sum(e * (centripetal(b, rb) - centripetal(a, ra)), axis=1)
            )
        for body, s, radius in self.slides:
            arm, up = r[body] @ s, np.array([0.0, 0.0, 1.0])
            phi.append(np.array([x[body, 2] + arm[2] - radius]))
            put(1, [(np.array([body]), 0, up[None]), (np.array([body]), 3, np.cross(arm, up)[None])])
            bias.append(np.cross(om[body], np.cross(om[body], arm))[2:])
        touch, gap, slide = self._rolling(x, r)
        if self.rolls:
            phi.append(gap)
            rows.append(touch)
            rows.append(slide)
            bias.append(self._rolling_bias(x, r, lin, om))
        c = np.concatenate(rows)[:, :-1].reshape(-1, 6 * self.n)
        return np.concatenate(phi), c, np.concatenate(bias)

    def _rolling(self, x: Array, r: Array) -> tuple[Array, Array, Array]:
        """Discs on the plane z = 0: gaps, rows of touching, two rows each of not slipping."""
        count = len(self.rolls)
        touch, slide, gap = np.zeros((count, len(x), 6)), np.zeros((2 * count, len(x), 6)), np.zeros(count)
        up = np.array([0.0, 0.0, 1.0])
        for i, (b, s, axis, radius) in enumerate(self.rolls):
            arm, w = r[b] @ s, r[b] @ axis
            e = up - (up @ w) * w
            e /= np.linalg.norm(e)
            arm = arm - radius * e
            gap[i] = x[b, 2] + arm[2]
            for row, u in ((touch[i], up), (slide[2 * i], np.eye(3)[0]), (slide[2 * i + 1], np.eye(3)[1])):
                row[b, :3], row[b, 3:] = u, np.cross(arm, u)
        return touch, gap, slide

    def _rolling_bias(self, x: Array, r: Array, lin: Array, om: Array) -> Array:
        """d/dt of the rows at the velocities at hand, by a central difference along them."""
        step, ends = 1e-5, []
        for sign in (1.0, -1.0):
            turn = Rotation.from_rotvec(sign * step * om).as_matrix()
            touch, _, slide = self._rolling(x + sign * step * lin, turn @ r)
            ends.append(np.concatenate([touch, slide]))
        twist = np.hstack([lin, om])
        return np.einsum("rni,ni->r", (ends[0] - ends[1]) / (2.0 * step), twist)

    def moved(self, x: Array, r: Array, d: Array) -> tuple[Array, Array]:
        d = d.reshape(self.n, 6)
        return x + d[:, :3], Rotation.from_rotvec(d[:, 3:]).as_matrix() @ r

    def closed(self, x: Array, r: Array, k: int) -> tuple[Array, Array]:
        """The nearest closed position, by Gauss-Newton with all rows and the 6 n - k largest singular values."""
        for _ in range(30):
            phi, c, _ = self.closing(x, r)
            c = c[: self.positions]
            if np.abs(phi).max() < 1e-14:
                break
            u, s, vt = np.linalg.svd(c, full_matrices=False)
            rank = min(6 * self.n - k, int((s > 1e-9 * s[0]).sum())) if self.rolls else min(6 * self.n - k, s.size)
            x, r = self.moved(x, r, -vt[:rank].T @ ((u[:, :rank].T @ phi) / s[:rank]))
        return x, r

    def mass_matrix(self, r: Array) -> Array:
        m = np.zeros((self.n, 6, self.n, 6))
        for i in range(self.n):
            m[i, :3, i, :3] = self.mass[i] * np.eye(3)
            m[i, 3:, i, 3:] = r[i] @ np.diag(self.inertia[i]) @ r[i].T
        return m.reshape(6 * self.n, 6 * self.n)

    def acceleration(self, x: Array, r: Array, v: Array, k: int) -> Array:
        """v' of M v' + C^T lambda = h, C v' + b = 0, with k degrees of freedom."""
        _, c, b = self.closing(x, r, v)
        u, s, vt = np.linalg.svd(c)
        rank = 6 * self.n - k
        part = -vt[:rank].T @ ((u[:, :rank].T @ b) / s[:rank])
        d = vt[rank:].T
        m, om = self.mass_matrix(r), v.reshape(self.n, 6)[:, 3:]
        h = np.zeros((self.n, 6))
        h[:, :3] = self.mass[:, None] * self.drawing.gravity
        for i in range(self.n):
            h[i, 3:] = -np.cross(om[i], r[i] @ (self.inertia[i] * (r[i].T @ om[i])))
        for name, force, point in self.drawing.forces:
            i = self.where[name]
            h[i, :3] += force
            h[i, 3:] += np.cross(r[i] @ point, force)
        return part + d @ np.linalg.solve(d.T @ m @ d, d.T @ (h.ravel() - m @ part))

    def energy(self, x: Array, r: Array, v: Array) -> float:
        """Kinetic and potential; forces are constant."""
        potential = -sum(
            force @ (x[self.where[name]] + r[self.where[name]] @ point) for name, force, point in self.drawing.forces
        )
        return float(0.5 * v @ self.mass_matrix(r) @ v - self.mass @ (x @ self.drawing.gravity) + potential)

    def rates(self, x: Array, r: Array, wanted: dict[str, float]) -> Array:
        """Velocities closed with all rows in which the hinges named turn so fast; at rest where none is."""
        _, c, _ = self.closing(x, r)
        rows, values = [], []
        _, turned, _, _ = self._with_ground(x, r, None)
        for j in self.drawing.joints:
            if j.name in wanted:
                row = np.zeros((self.n + 1, 6))
                axis = turned[self.where[j.parent]] @ j.axis
                row[self.where[j.child], 3:] += axis
                row[self.where[j.parent], 3:] -= axis
                rows.append(row[:-1].ravel())
                values.append(wanted[j.name])
        if not rows:
            return np.zeros(6 * self.n)
        a = np.vstack([c, *rows])
        return np.linalg.lstsq(a, np.concatenate([np.zeros(len(c)), values]), rcond=1e-10)[0]

    def motion(self, times: Array, k: int, wanted: dict[str, float], rtol: float = 1e-9) -> tuple[Array, Array, Array]:
        """x (nt, n, 3), R (nt, n, 3, 3), v (nt, 6 n) from the drawing closed."""
        x, r = self.closed(self.x0, self.r0, k)
        v = self.rates(x, r, wanted)
        y = np.concatenate([x.ravel(), Rotation.from_matrix(r).as_quat().ravel(), v])
        run = solve_ivp(
            self._slope(k), (0.0, float(times[-1])), y, method="DOP853", t_eval=times, rtol=rtol, atol=1e-11
        )
        return self._unpacked(run.y.T)

    def clear(self, span: float, k: int, wanted: dict[str, float]) -> float:
        """How long a motion keeps clear of singular positions: until the least singular value that is a condition comes
        to 0.3 of what it was at the start, or the span."""
        x, r = self.closed(self.x0, self.r0, k)
        y = np.concatenate([x.ravel(), Rotation.from_matrix(r).as_quat().ravel(), self.rates(x, r, wanted)])
        rank = 6 * self.n - k

        def least(y: Array) -> float:
            x, r, _ = self._unpacked(y[None])
            return float(np.linalg.svd(self.closing(x[0], r[0])[1], compute_uv=False)[rank - 1])

        solver, lowest = DOP853(self._slope(k), 0.0, y, span, rtol=1e-6, atol=1e-8), 0.3 * least(y)
        while solver.status == "running" and solver.nfev < 2000:
            solver.step()
            if least(solver.y) < lowest:
                return float(solver.t_old)
        return float(solver.t) if solver.status == "finished" else 0.5 * float(solver.t)

    def _unpacked(self, y: Array) -> tuple[Array, Array, Array]:
        n = self.n
        r = Rotation.from_quat(y[:, 3 * n : 7 * n].reshape(-1, 4)).as_matrix().reshape(-1, n, 3, 3)
        return y[:, : 3 * n].reshape(-1, n, 3), r, y[:, 7 * n :]

    def _slope(self, k: int) -> Callable[[float, Array], Array]:
        n = self.n

        def slope(_t: float, y: Array) -> Array:
            (x,), (r,), (v,) = self._unpacked(y[None])
            q, twist = y[3 * n : 7 * n].reshape(n, 4), v.reshape(n, 6)
            w = twist[:, 3:]
            rate = np.empty((n, 4))
            rate[:, :3] = 0.5 * (q[:, 3:] * w + np.cross(w, q[:, :3]))
            rate[:, 3] = -0.5 * np.sum(w * q[:, :3], axis=1)
            return np.concatenate([twist[:, :3].ravel(), rate.ravel(), self.acceleration(x, r, v, k)])

        return slope

    def singular_values(self) -> Array:
        """Of C as drawn, largest first, one for each velocity."""
        s = np.linalg.svd(self.closing(self.x0, self.r0)[1], compute_uv=False)
        return np.concatenate([s, np.zeros(6 * self.n)])[: 6 * self.n]
