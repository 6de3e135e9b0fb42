//! Small constrained user-defined systems.
#![allow(dead_code, reason = "each test file uses the part it needs")]

use partita_system::equations::{Equations, ExplicitClosing, UserSystem};
use partita_system::record::Sample;
use partita_system::SystemError;

pub const GRAVITY: f64 = 9.81;

type Done = Result<(), SystemError>;

/// A point on a rod of length 1, pivot at (X(t), 0), X = a sin(ω t): `½((x − X)² + y² − 1) = 0`.
#[derive(Clone, Copy)]
pub struct Pendulum {
    pub amplitude: f64,
    pub frequency: f64,
    pub mass: f64,
}

impl Pendulum {
    pub const RESTING_PIVOT: Self = Self { amplitude: 0.0, frequency: 0.0, mass: 2.0 };

    /// Pivot, its velocity and acceleration.
    pub fn pivot(&self, t: f64) -> [f64; 3] {
        let (w, (s, c)) = (self.frequency, (self.frequency * t).sin_cos());
        [self.amplitude * s, self.amplitude * w * c, -self.amplitude * w * w * s]
    }

    pub fn energy(&self, s: &Sample) -> f64 {
        self.mass * (0.5 * (s.v[0].powi(2) + s.v[1].powi(2)) + GRAVITY * s.q[1])
    }
}

impl Equations for Pendulum {
    fn n(&self) -> usize {
        2
    }
    fn rows(&self) -> usize {
        1
    }
    fn holonomic(&self) -> usize {
        1
    }
    fn name(&self, i: usize) -> String {
        ["x", "y"][i].into()
    }
    fn rheonomic(&self) -> bool {
        self.amplitude != 0.0
    }
    fn mass(&self, _: f64, _: &[f64], out: &mut [f64]) -> Done {
        out.copy_from_slice(&[self.mass, 0.0, 0.0, self.mass]);
        Ok(())
    }
    fn forces(&self, _: f64, _: &[f64], _: &[f64], out: &mut [f64]) -> Done {
        out.copy_from_slice(&[0.0, -self.mass * GRAVITY]);
        Ok(())
    }
    fn constraints(&self, t: f64, q: &[f64], out: &mut [f64]) -> Done {
        let x = q[0] - self.pivot(t)[0];
        out[0] = 0.5 * (x * x + q[1] * q[1] - 1.0);
        Ok(())
    }
    fn jacobian(&self, t: f64, q: &[f64], out: &mut [f64]) -> Done {
        out.copy_from_slice(&[q[0] - self.pivot(t)[0], q[1]]);
        Ok(())
    }
    fn rate(&self, t: f64, q: &[f64], out: &mut [f64]) -> Done {
        let [p, u, _] = self.pivot(t);
        out[0] = -(q[0] - p) * u;
        Ok(())
    }
    fn bias(&self, t: f64, q: &[f64], v: &[f64], out: &mut [f64]) -> Done {
        let [p, u, a] = self.pivot(t);
        out[0] = (v[0] - u).powi(2) + v[1].powi(2) - (q[0] - p) * a;
        Ok(())
    }
    fn explicit_closing(&self) -> Option<&dyn ExplicitClosing> {
        Some(self)
    }
}

impl ExplicitClosing for Pendulum {
    fn dependent(&self) -> &[usize] {
        &[1]
    }
    /// y from x, on the side where it was.
    fn close(&self, t: f64, q: &mut [f64]) -> Done {
        let x = q[0] - self.pivot(t)[0];
        if x.abs() > 1.0 {
            return Err(SystemError::Limit { block: "rod".into(), t, shortfall: x.abs() - 1.0 });
        }
        q[1] = (1.0 - x * x).sqrt().copysign(q[1]);
        Ok(())
    }
}

/// Lengths of crank, coupler and rocker, and the distance of the ground pins; rods of 1 kg/m.
pub const LENGTHS: [f64; 3] = [1.0, 2.5, 2.0];
pub const GROUND: f64 = 2.2;

/// The four-bar as three free rods (x, y, θ of each) and four pins.
#[derive(Clone, Copy)]
pub struct FourBar;

impl FourBar {
    /// Crank at 0.8 rad turning with 1.5 rad/s.
    pub fn start() -> (Vec<f64>, Vec<f64>) {
        let ([a, b], d) = (Angles::close(0.8), 0.8f64);
        let (angles, rates) = ([d, a, b], Angles::rates([d, a, b], 1.5));
        let (mut q, mut v, mut p, mut u) = (vec![], vec![], [0.0, 0.0], [0.0, 0.0]);
        for ((l, f), w) in LENGTHS.iter().zip(angles).zip(rates) {
            let half = 0.5 * l;
            q.extend([p[0] + half * f.cos(), p[1] + half * f.sin(), f]);
            v.extend([u[0] - half * f.sin() * w, u[1] + half * f.cos() * w, w]);
            p = [p[0] + l * f.cos(), p[1] + l * f.sin()];
            u = [u[0] - l * f.sin() * w, u[1] + l * f.cos() * w];
        }
        (q, v)
    }

    pub fn energy(s: &Sample) -> f64 {
        (0..3).fold(0.0, |e, i| {
            let (m, v, half) = (LENGTHS[i], &s.v[3 * i..3 * i + 3], 0.5 * LENGTHS[i]);
            let inertia = m * half * half / 3.0;
            e + 0.5 * (m * (v[0] * v[0] + v[1] * v[1]) + inertia * v[2] * v[2]) + m * GRAVITY * s.q[3 * i + 1]
        })
    }

    /// Rod (its number, place along it) at each side of each pin; the ground has no rod.
    fn pins() -> [[Option<(usize, f64)>; 2]; 4] {
        let end = |i: usize, side: f64| Some((i, side * 0.5 * LENGTHS[i]));
        [[end(0, -1.0), None], [end(0, 1.0), end(1, -1.0)], [end(1, 1.0), end(2, -1.0)], [end(2, 1.0), None]]
    }
}

impl Equations for FourBar {
    fn n(&self) -> usize {
        9
    }
    fn rows(&self) -> usize {
        8
    }
    fn holonomic(&self) -> usize {
        8
    }
    fn name(&self, i: usize) -> String {
        format!("{}{}", ["x", "y", "angle"][i % 3], i / 3 + 1)
    }
    fn rheonomic(&self) -> bool {
        false
    }
    fn mass(&self, _: f64, _: &[f64], out: &mut [f64]) -> Done {
        out.fill(0.0);
        for i in 0..9 {
            let l = LENGTHS[i / 3];
            out[10 * i] = if i % 3 == 2 { l.powi(3) / 12.0 } else { l };
        }
        Ok(())
    }
    fn forces(&self, _: f64, _: &[f64], _: &[f64], out: &mut [f64]) -> Done {
        out.fill(0.0);
        (0..3).for_each(|i| out[3 * i + 1] = -LENGTHS[i] * GRAVITY);
        Ok(())
    }
    fn constraints(&self, _: f64, q: &[f64], out: &mut [f64]) -> Done {
        for (k, sides) in Self::pins().iter().enumerate() {
            let mut gap = [if k == 3 { -GROUND } else { 0.0 }, 0.0];
            for (side, sign) in sides.iter().zip([1.0, -1.0]) {
                if let Some((i, e)) = *side {
                    gap[0] += sign * (q[3 * i] + e * q[3 * i + 2].cos());
                    gap[1] += sign * (q[3 * i + 1] + e * q[3 * i + 2].sin());
                }
            }
            out[2 * k..2 * k + 2].copy_from_slice(&gap);
        }
        Ok(())
    }
    fn jacobian(&self, _: f64, q: &[f64], out: &mut [f64]) -> Done {
        out.fill(0.0);
        for (k, sides) in Self::pins().iter().enumerate() {
            for (side, sign) in sides.iter().zip([1.0, -1.0]) {
                if let Some((i, e)) = *side {
                    let f = q[3 * i + 2];
                    let (first, second) = (2 * k * 9 + 3 * i, (2 * k + 1) * 9 + 3 * i);
                    (out[first], out[first + 2]) = (sign, -sign * e * f.sin());
                    (out[second + 1], out[second + 2]) = (sign, sign * e * f.cos());
                }
            }
        }
        Ok(())
    }
    fn rate(&self, _: f64, _: &[f64], out: &mut [f64]) -> Done {
        out.fill(0.0);
        Ok(())
    }
    fn bias(&self, _: f64, q: &[f64], v: &[f64], out: &mut [f64]) -> Done {
        out.fill(0.0);
        for (k, sides) in Self::pins().iter().enumerate() {
            for (side, sign) in sides.iter().zip([1.0, -1.0]) {
                if let Some((i, e)) = *side {
                    let (f, w2) = (q[3 * i + 2], v[3 * i + 2].powi(2));
                    out[2 * k] -= sign * e * f.cos() * w2;
                    out[2 * k + 1] -= sign * e * f.sin() * w2;
                }
            }
        }
        Ok(())
    }
    fn explicit_closing(&self) -> Option<&dyn ExplicitClosing> {
        Some(self)
    }
}

impl ExplicitClosing for FourBar {
    fn dependent(&self) -> &[usize] {
        &[0, 1, 3, 4, 5, 6, 7, 8]
    }
    fn close(&self, _: f64, q: &mut [f64]) -> Done {
        let [a, b] = Angles::close(q[2]);
        (q[5], q[8]) = (nearest_turn(a, q[5]), nearest_turn(b, q[8]));
        let mut p = [0.0, 0.0];
        for i in 0..3 {
            let (l, (s, c)) = (LENGTHS[i], q[3 * i + 2].sin_cos());
            (q[3 * i], q[3 * i + 1]) = (p[0] + 0.5 * l * c, p[1] + 0.5 * l * s);
            p = [p[0] + l * c, p[1] + l * s];
        }
        Ok(())
    }
}

/// The same four-bar in the angles of its rods, cut at the rocker's ground pin.
#[derive(Clone, Copy)]
pub struct Angles;

impl Angles {
    /// Coupler and rocker angle for a crank angle.
    pub fn close(crank: f64) -> [f64; 2] {
        let [l1, l2, l3] = LENGTHS;
        let (x, y) = (GROUND - l1 * crank.cos(), -l1 * crank.sin());
        let r = x.hypot(y);
        let coupler = y.atan2(x) + ((l2 * l2 + r * r - l3 * l3) / (2.0 * l2 * r)).acos();
        [coupler, (y - l2 * coupler.sin()).atan2(x - l2 * coupler.cos())]
    }

    /// All rates for a crank rate: along the tangent t_i = l_j l_k sin(φ_k − φ_j).
    pub fn rates(f: [f64; 3], crank: f64) -> [f64; 3] {
        let t = [0, 1, 2].map(|i| {
            let (j, k) = ((i + 1) % 3, (i + 2) % 3);
            LENGTHS[j] * LENGTHS[k] * (f[k] - f[j]).sin()
        });
        t.map(|x| x / t[0] * crank)
    }

    pub fn start() -> (Vec<f64>, Vec<f64>) {
        let [a, b] = Self::close(0.8);
        (vec![0.8, a, b], Self::rates([0.8, a, b], 1.5).to_vec())
    }

    pub fn energy(s: &Sample) -> f64 {
        let (a, g) = Self::coefficients();
        let (q, v) = (&s.q, &s.v);
        let kinetic: f64 =
            (0..9).map(|e| (e / 3, e % 3)).map(|(i, j)| a[i][j] * (q[i] - q[j]).cos() * v[i] * v[j]).sum();
        0.5 * kinetic + (0..3).map(|i| GRAVITY * g[i] * q[i].sin()).sum::<f64>()
    }

    /// a_ij of the mass matrix M_ij = a_ij cos(φ_i − φ_j), and the gravity moments.
    fn coefficients() -> ([[f64; 3]; 3], [f64; 3]) {
        let (mut a, mut g) = ([[0.0; 3]; 3], [0.0; 3]);
        for i in 0..3 {
            let outer: f64 = LENGTHS[i + 1..].iter().sum();
            let l = LENGTHS[i];
            a[i][i] = l.powi(3) / 3.0 + outer * l * l;
            g[i] = l * 0.5 * l + outer * l;
            for j in 0..i {
                a[i][j] = (l * 0.5 * l + outer * l) * LENGTHS[j];
                a[j][i] = a[i][j];
            }
        }
        (a, g)
    }
}

impl Equations for Angles {
    fn n(&self) -> usize {
        3
    }
    fn rows(&self) -> usize {
        2
    }
    fn holonomic(&self) -> usize {
        2
    }
    fn name(&self, i: usize) -> String {
        ["crank", "coupler", "rocker"][i].into()
    }
    fn rheonomic(&self) -> bool {
        false
    }
    fn mass(&self, _: f64, q: &[f64], out: &mut [f64]) -> Done {
        let (a, _) = Self::coefficients();
        (0..9).for_each(|e| out[e] = a[e / 3][e % 3] * (q[e / 3] - q[e % 3]).cos());
        Ok(())
    }
    fn forces(&self, _: f64, q: &[f64], v: &[f64], out: &mut [f64]) -> Done {
        let (a, g) = Self::coefficients();
        for i in 0..3 {
            let turning: f64 = (0..3).map(|j| a[i][j] * (q[i] - q[j]).sin() * v[j] * v[j]).sum();
            out[i] = -turning - GRAVITY * g[i] * q[i].cos();
        }
        Ok(())
    }
    fn constraints(&self, _: f64, q: &[f64], out: &mut [f64]) -> Done {
        out[0] = (0..3).map(|i| LENGTHS[i] * q[i].cos()).sum::<f64>() - GROUND;
        out[1] = (0..3).map(|i| LENGTHS[i] * q[i].sin()).sum();
        Ok(())
    }
    fn jacobian(&self, _: f64, q: &[f64], out: &mut [f64]) -> Done {
        for i in 0..3 {
            out[i] = -LENGTHS[i] * q[i].sin();
            out[3 + i] = LENGTHS[i] * q[i].cos();
        }
        Ok(())
    }
    fn rate(&self, _: f64, _: &[f64], out: &mut [f64]) -> Done {
        out.fill(0.0);
        Ok(())
    }
    fn bias(&self, _: f64, q: &[f64], v: &[f64], out: &mut [f64]) -> Done {
        out[0] = -(0..3).map(|i| LENGTHS[i] * q[i].cos() * v[i] * v[i]).sum::<f64>();
        out[1] = -(0..3).map(|i| LENGTHS[i] * q[i].sin() * v[i] * v[i]).sum::<f64>();
        Ok(())
    }
    fn explicit_closing(&self) -> Option<&dyn ExplicitClosing> {
        Some(self)
    }
}

impl ExplicitClosing for Angles {
    fn dependent(&self) -> &[usize] {
        &[1, 2]
    }
    fn close(&self, _: f64, q: &mut [f64]) -> Done {
        let [a, b] = Self::close(q[0]);
        (q[1], q[2]) = (nearest_turn(a, q[1]), nearest_turn(b, q[2]));
        Ok(())
    }
}

/// The angle `x` plus the whole turns that bring it closest to `last`.
pub fn nearest_turn(x: f64, last: f64) -> f64 {
    let turn = std::f64::consts::TAU;
    x + turn * ((last - x) / turn).round()
}

/// A body on a pin at the origin, its centre of mass at distance 0.7, in x, y and the angle: k = 1, C_D = 1 for the
/// angle.
#[derive(Clone, Copy)]
pub struct Plate;

impl Plate {
    const ARM: f64 = 0.7;
    const MASS: f64 = 1.3;
    const INERTIA: f64 = 0.2;

    pub fn start() -> (Vec<f64>, Vec<f64>) {
        let (w, (s, c)) = (1.7, 0.4f64.sin_cos());
        (vec![Self::ARM * c, Self::ARM * s, 0.4], vec![-Self::ARM * s * w, Self::ARM * c * w, w])
    }

    pub fn energy(s: &Sample) -> f64 {
        0.5 * Self::MASS * (s.v[0].powi(2) + s.v[1].powi(2))
            + 0.5 * Self::INERTIA * s.v[2].powi(2)
            + Self::MASS * GRAVITY * s.q[1]
    }
}

impl Equations for Plate {
    fn n(&self) -> usize {
        3
    }
    fn rows(&self) -> usize {
        2
    }
    fn holonomic(&self) -> usize {
        2
    }
    fn name(&self, i: usize) -> String {
        ["x", "y", "angle"][i].into()
    }
    fn rheonomic(&self) -> bool {
        false
    }
    fn mass(&self, _: f64, _: &[f64], out: &mut [f64]) -> Done {
        out.fill(0.0);
        (out[0], out[4], out[8]) = (Self::MASS, Self::MASS, Self::INERTIA);
        Ok(())
    }
    fn forces(&self, _: f64, _: &[f64], _: &[f64], out: &mut [f64]) -> Done {
        out.copy_from_slice(&[0.0, -Self::MASS * GRAVITY, 0.0]);
        Ok(())
    }
    fn constraints(&self, _: f64, q: &[f64], out: &mut [f64]) -> Done {
        out.copy_from_slice(&[q[0] - Self::ARM * q[2].cos(), q[1] - Self::ARM * q[2].sin()]);
        Ok(())
    }
    fn jacobian(&self, _: f64, q: &[f64], out: &mut [f64]) -> Done {
        out.copy_from_slice(&[1.0, 0.0, Self::ARM * q[2].sin(), 0.0, 1.0, -Self::ARM * q[2].cos()]);
        Ok(())
    }
    fn rate(&self, _: f64, _: &[f64], out: &mut [f64]) -> Done {
        out.fill(0.0);
        Ok(())
    }
    fn bias(&self, _: f64, q: &[f64], v: &[f64], out: &mut [f64]) -> Done {
        let w2 = v[2] * v[2];
        out.copy_from_slice(&[Self::ARM * q[2].cos() * w2, Self::ARM * q[2].sin() * w2]);
        Ok(())
    }
    fn explicit_closing(&self) -> Option<&dyn ExplicitClosing> {
        Some(self)
    }
}

impl ExplicitClosing for Plate {
    fn dependent(&self) -> &[usize] {
        &[0, 1]
    }
    fn close(&self, _: f64, q: &mut [f64]) -> Done {
        (q[0], q[1]) = (Self::ARM * q[2].cos(), Self::ARM * q[2].sin());
        Ok(())
    }
}

/// Sizes and names of a system that wraps another one: those of the other.
macro_rules! as_within {
    () => {
        fn n(&self) -> usize {
            self.0.n()
        }
        fn rows(&self) -> usize {
            self.0.rows()
        }
        fn holonomic(&self) -> usize {
            self.0.holonomic()
        }
        fn name(&self, i: usize) -> String {
            self.0.name(i)
        }
        fn rheonomic(&self) -> bool {
            self.0.rheonomic()
        }
    };
}

/// Another system with two rows more: the sum of all rows, and the first one twice as large.
pub struct Redundant<E>(pub E);

impl<E: Equations> Redundant<E> {
    /// Extend a column of the rows of C (or Φ, a, b), `width` numbers a row.
    fn extend(out: &mut [f64], rows: usize, width: usize) {
        for j in 0..width {
            out[rows * width + j] = (0..rows).map(|i| out[i * width + j]).sum();
            out[(rows + 1) * width + j] = 2.0 * out[j];
        }
    }
}

impl<E: Equations> Equations for Redundant<E> {
    fn n(&self) -> usize {
        self.0.n()
    }
    fn rows(&self) -> usize {
        self.0.rows() + 2
    }
    fn holonomic(&self) -> usize {
        self.0.holonomic() + 2
    }
    fn name(&self, i: usize) -> String {
        self.0.name(i)
    }
    fn rheonomic(&self) -> bool {
        self.0.rheonomic()
    }
    fn mass(&self, t: f64, q: &[f64], out: &mut [f64]) -> Done {
        self.0.mass(t, q, out)
    }
    fn forces(&self, t: f64, q: &[f64], v: &[f64], out: &mut [f64]) -> Done {
        self.0.forces(t, q, v, out)
    }
    fn constraints(&self, t: f64, q: &[f64], out: &mut [f64]) -> Done {
        let m = self.0.rows();
        self.0.constraints(t, q, &mut out[..m])?;
        Self::extend(out, m, 1);
        Ok(())
    }
    fn jacobian(&self, t: f64, q: &[f64], out: &mut [f64]) -> Done {
        let (m, n) = (self.0.rows(), self.0.n());
        self.0.jacobian(t, q, &mut out[..m * n])?;
        Self::extend(out, m, n);
        Ok(())
    }
    fn rate(&self, t: f64, q: &[f64], out: &mut [f64]) -> Done {
        let m = self.0.rows();
        self.0.rate(t, q, &mut out[..m])?;
        Self::extend(out, m, 1);
        Ok(())
    }
    fn bias(&self, t: f64, q: &[f64], v: &[f64], out: &mut [f64]) -> Done {
        let m = self.0.rows();
        self.0.bias(t, q, v, &mut out[..m])?;
        Self::extend(out, m, 1);
        Ok(())
    }
    fn explicit_closing(&self) -> Option<&dyn ExplicitClosing> {
        self.0.explicit_closing()
    }
}

/// q' = S q of another system.
pub struct InUnits<E>(pub E, pub Vec<f64>);

impl<E: Equations> InUnits<E> {
    fn back(&self, x: &[f64]) -> Vec<f64> {
        x.iter().zip(&self.1).map(|(x, s)| x / s).collect()
    }
}

impl<E: Equations> Equations for InUnits<E> {
    as_within!();
    fn mass(&self, t: f64, q: &[f64], out: &mut [f64]) -> Done {
        self.0.mass(t, &self.back(q), out)?;
        let n = self.1.len();
        out.iter_mut().enumerate().for_each(|(e, x)| *x /= self.1[e / n] * self.1[e % n]);
        Ok(())
    }
    fn forces(&self, t: f64, q: &[f64], v: &[f64], out: &mut [f64]) -> Done {
        self.0.forces(t, &self.back(q), &self.back(v), out)?;
        out.iter_mut().zip(&self.1).for_each(|(x, s)| *x /= s);
        Ok(())
    }
    fn constraints(&self, t: f64, q: &[f64], out: &mut [f64]) -> Done {
        self.0.constraints(t, &self.back(q), out)
    }
    fn jacobian(&self, t: f64, q: &[f64], out: &mut [f64]) -> Done {
        self.0.jacobian(t, &self.back(q), out)?;
        let n = self.1.len();
        out.iter_mut().enumerate().for_each(|(e, x)| *x /= self.1[e % n]);
        Ok(())
    }
    fn rate(&self, t: f64, q: &[f64], out: &mut [f64]) -> Done {
        self.0.rate(t, &self.back(q), out)
    }
    fn bias(&self, t: f64, q: &[f64], v: &[f64], out: &mut [f64]) -> Done {
        self.0.bias(t, &self.back(q), &self.back(v), out)
    }
}

/// Any equations behind one type, so that what marches and reduces them is compiled once and not for each.
pub struct Any(Box<dyn Equations>);

/// A system of these equations, of the one type of all.
pub fn any(equations: impl Equations + 'static) -> UserSystem<Any> {
    UserSystem::new(Any(Box::new(equations)))
}

impl Equations for Any {
    as_within!();
    fn mass(&self, t: f64, q: &[f64], out: &mut [f64]) -> Done {
        self.0.mass(t, q, out)
    }
    fn forces(&self, t: f64, q: &[f64], v: &[f64], out: &mut [f64]) -> Done {
        self.0.forces(t, q, v, out)
    }
    fn constraints(&self, t: f64, q: &[f64], out: &mut [f64]) -> Done {
        self.0.constraints(t, q, out)
    }
    fn jacobian(&self, t: f64, q: &[f64], out: &mut [f64]) -> Done {
        self.0.jacobian(t, q, out)
    }
    fn rate(&self, t: f64, q: &[f64], out: &mut [f64]) -> Done {
        self.0.rate(t, q, out)
    }
    fn bias(&self, t: f64, q: &[f64], v: &[f64], out: &mut [f64]) -> Done {
        self.0.bias(t, q, v, out)
    }
    fn explicit_closing(&self) -> Option<&dyn ExplicitClosing> {
        self.0.explicit_closing()
    }
}
