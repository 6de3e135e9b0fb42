//! Checks the derivatives of a user-defined system against its constraints, by differences at one state.
//!
//! ```text
//! C_ij = dPhi_i/dq_j,   a_i = dPhi_i/dt (holonomic rows),   b = d/dt (C v + a) along q' = v
//! ```
//!
//! b is tested with velocities that satisfy S4, and C off the constraints no further than a difference goes:
//! expressions simplified by means of the constraints are accepted.

use super::Equations;
use crate::system::SystemError;
use partita_math::dense::{self, Matrix};
use partita_math::factor;
use partita_math::tolerance;

/// Steps of the differences, from the finest on. Unit: characteristic length. Reason: a factor of eight between them,
/// from rounding to curvature.
const DIFFERENCE_STEPS: [f64; 6] = [3e-6, 2.4e-5, 2e-4, 1.6e-3, 1.3e-2, 0.1];
/// Central differences at offsets 1 to 3. Unit: factors of the differences. Reason: exact to order six.
const CENTRAL_SIX: [f64; 3] = [3.0 / 4.0, -3.0 / 20.0, 1.0 / 60.0];
/// Central differences at offsets 1 and 2. Unit: factors of the differences. Reason: exact to order four, to estimate
/// the error.
const CENTRAL_FOUR: [f64; 3] = [2.0 / 3.0, -1.0 / 12.0, 0.0];
/// Derivatives with a larger error belong to another function. Scale: fraction of the derivative. Reason: finite
/// differences are nearer.
const OTHER_DERIVATIVE: f64 = 1e-4;
/// Velocities tested beside the given ones: irregular, so that nothing cancels.
const TRIED: usize = 2;

/// The best difference so far, from fine steps to coarse ones.
///
/// A coarser one is taken for its smaller error, but only if it lies within the error of the finer one: a fast
/// oscillation sampled coarsely looks like a slow one, perfectly smooth.
#[derive(Clone, Copy)]
struct Best {
    value: f64,
    error: f64,
    closed: bool,
}

impl Best {
    const NONE: Self = Self { value: 0.0, error: f64::INFINITY, closed: false };

    fn offer(&mut self, value: f64, error: f64) {
        let first = self.error.is_infinite();
        self.closed |= !first && (value - self.value).abs() > tolerance::CLEARLY * (self.error + error);
        if !self.closed && (first || error < self.error) {
            (self.value, self.error) = (value, error);
        }
    }
}

/// Slopes of `f(x, out)` at x = 0 for steps in units of `unit`, where f can be evaluated; `size` is that of the terms
/// of f.
fn slopes(
    count: usize,
    unit: f64,
    size: f64,
    mut f: impl FnMut(f64, &mut [f64]) -> Result<(), SystemError>,
) -> Vec<Best> {
    let mut best = vec![Best::NONE; count];
    let (mut ahead, mut behind) = (vec![0.0; count], vec![0.0; count]);
    'steps: for step in DIFFERENCE_STEPS {
        let h = step * unit;
        let (mut high, mut low, mut largest) = (vec![0.0; count], vec![0.0; count], vec![size; count]);
        for i in 0..3 {
            let x = (i + 1) as f64 * h;
            // a function may be undefined near the state; then other steps, or none, are used
            if f(x, &mut ahead).is_err() || f(-x, &mut behind).is_err() {
                continue 'steps;
            }
            for j in 0..count {
                let odd = (ahead[j] - behind[j]) / h;
                high[j] += CENTRAL_SIX[i] * odd;
                low[j] += CENTRAL_FOUR[i] * odd;
                largest[j] = largest[j].max(ahead[j].abs()).max(behind[j].abs());
            }
        }
        for j in 0..count {
            let noise = 8.0 * f64::EPSILON * largest[j] / h;
            let error = (high[j] - low[j]).abs() + noise;
            if error.is_finite() {
                best[j].offer(high[j], error);
            }
        }
    }
    best
}

/// The equations at one (t, q).
struct EquationsAt {
    phi: Vec<f64>,
    c: Vec<f64>,
    a: Vec<f64>,
}

impl EquationsAt {
    fn new<E: Equations>(e: &E) -> Self {
        let rows = e.rows();
        Self { phi: vec![0.0; e.holonomic()], c: vec![0.0; rows * e.n()], a: vec![0.0; rows] }
    }

    fn at<E: Equations>(&mut self, e: &E, t: f64, q: &[f64]) -> Result<(), SystemError> {
        e.constraints(t, q, &mut self.phi)?;
        e.jacobian(t, q, &mut self.c)?;
        self.a.fill(0.0);
        if e.rheonomic() {
            e.rate(t, q, &mut self.a)?;
        }
        Ok(())
    }

    /// C v + a.
    fn closure_error_rate(&self, v: &[f64], out: &mut [f64]) {
        for (i, x) in out.iter_mut().enumerate() {
            *x = dense::dot(&self.c[i * v.len()..(i + 1) * v.len()], v) + self.a[i];
        }
    }
}

/// Compare jacobian, constraint rate and bias with differences of the constraints at (t, q, v).
///
/// `lengths` (n): displacement of each coordinate in a large motion. Costs 36 n evaluations of the constraints, and as
/// many of the others together.
///
/// # Errors
/// `Derivative` with the entry of the largest error relative to the allowed one; or an error of the functions
/// themselves at (t, q, v).
pub fn check<E: Equations>(e: &E, t: f64, q: &[f64], v: &[f64], lengths: &[f64]) -> Result<(), SystemError> {
    if e.rows() == 0 {
        return Ok(());
    }
    let mut given = EquationsAt::new(e);
    given.at(e, t, q)?;
    let rows = row_sizes(e, &given, lengths);
    check_jacobian(e, t, q, lengths, &given, &rows)?;
    let time = time_scale(v, lengths);
    check_rate(e, t, q, time, &given, &rows)?;
    check_bias(e, t, q, v, v, time, lengths, &rows)?;
    for tried in 0..TRIED {
        let w = admissible(&given, lengths, time, tried);
        check_bias(e, t, q, v, &w, time, lengths, &rows)?;
    }
    Ok(())
}

/// Upper bound of the closure error of each row when all coordinates move by their lengths.
fn row_sizes<E: Equations>(e: &E, given: &EquationsAt, lengths: &[f64]) -> Vec<f64> {
    let row = |i: usize| &given.c[i * e.n()..(i + 1) * e.n()];
    (0..e.rows()).map(|i| row(i).iter().zip(lengths).fold(0.0, |m: f64, (c, l)| m.max(c.abs() * l))).collect()
}

/// The time in which the velocities move the coordinates by their lengths; one second at rest.
fn time_scale(v: &[f64], lengths: &[f64]) -> f64 {
    let fastest = v.iter().zip(lengths).fold(0.0, |m: f64, (v, l)| m.max(v.abs() / l));
    if fastest > 0.0 {
        1.0 / fastest
    } else {
        1.0
    }
}

/// The difference of given and computed values, relative to the allowed one, if it is larger.
fn off(given: f64, found: Best, nothing: f64) -> Option<f64> {
    if found.error.is_infinite() {
        return None;
    }
    let allowed = OTHER_DERIVATIVE * given.abs().max(found.value.abs()) + tolerance::CLEARLY * found.error + nothing;
    let miss = (given - found.value).abs();
    (miss > allowed).then(|| miss / allowed.max(f64::MIN_POSITIVE))
}

/// The worst error found.
#[derive(Default)]
struct Worst {
    by: f64,
    failure: Option<SystemError>,
}

impl Worst {
    fn hear(&mut self, by: Option<f64>, say: impl FnOnce() -> SystemError) {
        if let Some(by) = by.filter(|&by| by > self.by) {
            (self.by, self.failure) = (by, Some(say()));
        }
    }
    fn result(self) -> Result<(), SystemError> {
        self.failure.map_or(Ok(()), Err)
    }
}

fn check_jacobian<E: Equations>(
    e: &E,
    t: f64,
    q: &[f64],
    lengths: &[f64],
    given: &EquationsAt,
    rows: &[f64],
) -> Result<(), SystemError> {
    let (n, p) = (e.n(), e.holonomic());
    let far = q.iter().zip(lengths).fold(0.0, |m: f64, (q, l)| m.max(q.abs() / l));
    let mut x = q.to_vec();
    let mut found = Vec::with_capacity(n);
    for j in 0..n {
        let size = rows.iter().fold(0.0, |m: f64, r| m.max(*r)) * far;
        found.push(slopes(p, lengths[j], size, |h, out| {
            x[j] = q[j] + h;
            e.constraints(t, &x, out)
        }));
        x[j] = q[j];
    }
    let mut worst = Worst::default();
    for i in 0..p {
        let seen = (0..n).fold(rows[i], |m: f64, j| m.max(found[j][i].value.abs() * lengths[j]));
        for j in 0..n {
            let (c, d) = (given.c[i * n + j], found[j][i]);
            worst.hear(off(c, d, tolerance::DIFFERENCE_ROUNDING * seen / lengths[j]), || SystemError::Derivative {
                function: "jacobian",
                row: i,
                column: Some(j),
                given: c,
                found: d.value,
                t,
                of: format!("the slope of constraints[{i}] along {}", e.name(j)),
            });
        }
    }
    worst.result()
}

fn check_rate<E: Equations>(
    e: &E,
    t: f64,
    q: &[f64],
    time: f64,
    given: &EquationsAt,
    rows: &[f64],
) -> Result<(), SystemError> {
    let size = rows.iter().fold(0.0, |m: f64, r| m.max(*r));
    let found = slopes(e.holonomic(), time, size, |h, out| e.constraints(t + h, q, out));
    let mut worst = Worst::default();
    for (i, &d) in found.iter().enumerate() {
        let a = given.a[i];
        worst.hear(off(a, d, tolerance::DIFFERENCE_ROUNDING * rows[i] / time), || SystemError::Derivative {
            function: "constraint_rate",
            row: i,
            column: None,
            given: a,
            found: d.value,
            t,
            of: format!("the slope of constraints[{i}] in time"),
        });
    }
    worst.result()
}

/// b for the velocities w, compared with the change of C w + a along them.
fn check_bias<E: Equations>(
    e: &E,
    t: f64,
    q: &[f64],
    v: &[f64],
    w: &[f64],
    time: f64,
    lengths: &[f64],
    rows: &[f64],
) -> Result<(), SystemError> {
    let mut b = vec![0.0; e.rows()];
    if e.bias(t, q, w, &mut b).is_err() {
        // a function may be undefined for these velocities; the run's own must be accepted
        return if v == w { e.bias(t, q, w, &mut b) } else { Ok(()) };
    }
    let fastest = w.iter().zip(lengths).fold(0.0, |m: f64, (w, l)| m.max(w.abs() / l));
    let unit = if fastest > 0.0 { (1.0 / fastest).min(time) } else { time };
    let far = q.iter().zip(lengths).fold(1.0, |m: f64, (q, l)| m.max(q.abs() / l));
    let size = rows.iter().fold(0.0, |m: f64, r| m.max(*r)) / unit * far;
    let (mut x, mut there) = (q.to_vec(), EquationsAt::new(e));
    let found = slopes(e.rows(), unit, size, |h, out| {
        x.iter_mut().zip(q).zip(w).for_each(|((x, q), w)| *x = q + h * w);
        there.at(e, t + h, &x)?;
        there.closure_error_rate(w, out);
        Ok(())
    });
    let mut worst = Worst::default();
    for (i, &d) in found.iter().enumerate() {
        worst.hear(off(b[i], d, tolerance::DIFFERENCE_ROUNDING * rows[i] / (unit * unit)), || {
            SystemError::Derivative {
                function: "bias",
                row: i,
                column: None,
                given: b[i],
                found: d.value,
                t,
                of: format!("the change of (C v + a)[{i}] along the motion, at v = {}", listed(w)),
            }
        });
    }
    worst.result()
}

fn listed(v: &[f64]) -> String {
    let first: Vec<String> = v.iter().take(6).map(|x| format!("{x:.4}")).collect();
    format!("({}{})", first.join(", "), if v.len() > 6 { ", ..." } else { "" })
}

/// Velocities with `C w + a = 0` next to irregular ones that cover one length in `time`.
fn admissible(given: &EquationsAt, lengths: &[f64], time: f64, tried: usize) -> Vec<f64> {
    let n = lengths.len();
    let irregular = |j: usize| (1.3 + 2.7 * j as f64 + 1.9 * tried as f64).sin();
    let mut w: Vec<f64> = (0..n).map(|j| irregular(j) * lengths[j] / time).collect();
    let m = given.a.len();
    let mut violation = vec![0.0; m];
    given.closure_error_rate(&w, &mut violation);
    let mut c = Matrix::new(m, n);
    for i in 0..m {
        let row = c.row_mut(i);
        row.iter_mut().zip(&given.c[i * n..(i + 1) * n]).zip(lengths).for_each(|((x, c), l)| *x = c * l);
        let length = dense::dot(row, row).sqrt();
        if length > 0.0 {
            row.iter_mut().for_each(|x| *x /= length);
            violation[i] /= length;
        }
    }
    if let Ok((z, _)) = factor::least_squares_min_norm(&c, &violation, tolerance::DIFFERENCE_ROUNDING) {
        w.iter_mut().zip(&z).zip(lengths).for_each(|((w, z), l)| *w -= z * l);
    }
    w
}

/// Displacement of each coordinate in a large motion, according to the equations at (t, q): over such a distance the
/// directions of the rows that depend on it rotate by about a radian. A power of ten; 1 where nothing rotates.
pub fn lengths<E: Equations>(e: &E, t: f64, q: &[f64]) -> Result<Vec<f64>, SystemError> {
    let (n, m) = (e.n(), e.rows());
    if m == 0 {
        return Ok(vec![1.0; n]);
    }
    let mut mass = vec![0.0; n * n];
    e.mass(t, q, &mut mass)?;
    let s: Vec<f64> = (0..n).map(|j| mass[j * n + j]).map(|x| if x > 0.0 { 1.0 / x.sqrt() } else { 1.0 }).collect();
    let mut c = vec![0.0; m * n];
    e.jacobian(t, q, &mut c)?;
    // where q is large, steps in fractions of it; the mass metric makes rotations and translations comparable
    let farthest = q.iter().zip(&s).fold(0.0, |f: f64, (q, s)| f.max(q.abs() / s));
    let size = |x: &[f64]| x.iter().zip(&s).map(|(x, s)| (x * s).powi(2)).sum::<f64>();
    let mut found = Vec::with_capacity(n);
    let mut x = q.to_vec();
    for j in 0..n {
        let unit = if farthest > 0.0 { farthest * s[j] } else { 1.0 };
        let scale = c.iter().fold(0.0, |f: f64, c| f.max(c.abs()));
        let slope = slopes(m * n, unit, scale, |h, out| {
            x[j] = q[j] + h;
            e.jacobian(t, &x, out)
        });
        x[j] = q[j];
        let slope: Vec<f64> =
            slope.iter().map(|d| if d.value.abs() > tolerance::CLEARLY * d.error { d.value } else { 0.0 }).collect();
        let (mut turning, mut count) = (0.0, 0.0);
        for i in 0..m {
            let (row, turn) = (size(&c[i * n..(i + 1) * n]), size(&slope[i * n..(i + 1) * n]));
            if row > 0.0 && turn > 0.0 {
                turning += turn / row;
                count += 1.0;
            }
        }
        let length: f64 = if turning > 0.0 { (count / turning).sqrt() } else { 1.0 };
        found.push(10f64.powf(length.log10().round()));
    }
    Ok(found)
}
