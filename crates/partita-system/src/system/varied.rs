//! Derivatives of the equations of a system along directions.

use super::{Manifold, SystemError};
use partita_math::elimination::Pattern;

/// How derivatives were computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Derivatives {
    /// Exactly, except for rounding.
    Exact,
    /// By central differences, which leave about 1e-9 of the largest values: of all equations, or of functions of the
    /// user's inside them.
    Differences,
}

/// A point with everything that the equations determine there.
#[derive(Clone, Copy, Debug)]
pub struct At<'a> {
    /// Time.
    pub t: f64,
    /// Coordinates (nq).
    pub q: &'a [f64],
    /// Velocities (nv).
    pub v: &'a [f64],
    /// Accelerations (nv).
    pub vdot: &'a [f64],
    /// λ (rows), zero on redundant rows.
    pub multipliers: &'a [f64],
}

/// Directions, one after the other: displacements, changes of velocities and of accelerations, nv numbers each.
#[derive(Clone, Copy, Debug)]
pub struct Directions<'a> {
    /// Their number.
    pub count: usize,
    /// Velocity-like displacements of q.
    pub q: &'a [f64],
    /// Changes of v.
    pub v: &'a [f64],
    /// Changes of v'.
    pub vdot: &'a [f64],
}

/// Changes of the equations, one direction after the other.
#[derive(Clone, Debug, Default)]
pub struct Changes {
    /// Of C v + a (rows).
    pub rates: Vec<f64>,
    /// Of s = C v' + b (rows).
    pub accelerations: Vec<f64>,
    /// Of r = M v' − h − Cᵀ λ (nv).
    pub forces: Vec<f64>,
}

impl Changes {
    /// For a system of this size and so many directions.
    pub fn new(rows: usize, nv: usize, count: usize) -> Self {
        let zeros = |n: usize| vec![0.0; n * count];
        Self { rates: zeros(rows), accelerations: zeros(rows), forces: zeros(nv) }
    }
}

/// A system that differentiates its equations.
pub trait Varied: Manifold {
    /// Where the derivatives of the equations are not zero, by way of results that lie between; none where that is not known.
    ///
    /// Rows: these results, C v + a, s (rows each) and r (nv). Columns: displacements, v, v' (nv each), λ (rows), and these
    /// results again.
    fn expanded(&self) -> Option<&Pattern> {
        None
    }
    /// Multiplications of [`expand`](Self::expand).
    fn expansion_cost(&self) -> usize {
        0
    }
    /// These derivatives, entry by entry of the pattern; exact ones. Nothing is written without one.
    fn expand(&self, _at: &At, _out: &mut [f64]) {}
    /// Changes of the equations along directions; by differences unless the system can do better.
    ///
    /// # Errors
    /// Where the system cannot be evaluated.
    fn vary(&self, at: &At, along: &Directions, out: &mut Changes) -> Result<Derivatives, SystemError> {
        by_differences(self, at, along, out)
    }
}

/// The equations at one point of a direction.
struct Sides<'s, S: Varied + ?Sized> {
    system: &'s S,
    scratch: S::Scratch,
    phi: Vec<f64>,
    c: Vec<f64>,
    a: Vec<f64>,
    b: Vec<f64>,
    values: Changes,
}

impl<S: Varied + ?Sized> Sides<'_, S> {
    /// C v + a, s and r at t, with λ as given.
    fn at(&mut self, t: f64, (q, v, vdot): (&[f64], &[f64], &[f64]), multipliers: &[f64]) -> Result<(), SystemError> {
        let s = &mut self.scratch;
        self.system.position(t, q, s, &mut self.phi, &mut self.c, &mut self.a)?;
        self.system.velocity(t, q, v, s, &mut self.b)?;
        self.system.inverse_dynamics(t, q, v, vdot, s, &mut self.values.forces)?;
        let pattern = self.system.pattern();
        for i in 0..pattern.rows {
            let (mut rate, mut acceleration) = (self.a[i], self.b[i]);
            for e in pattern.row(i) {
                let (c, col) = (self.c[e], pattern.col_idx[e]);
                rate += c * v[col];
                acceleration += c * vdot[col];
                self.values.forces[col] -= c * multipliers[i];
            }
            self.values.rates[i] = rate;
            self.values.accelerations[i] = acceleration;
        }
        Ok(())
    }
}

/// [`Varied::vary`] by central differences of the equations.
///
/// # Errors
/// Where the system cannot be evaluated.
pub fn by_differences<S: Varied + ?Sized>(
    system: &S,
    at: &At,
    along: &Directions,
    out: &mut Changes,
) -> Result<Derivatives, SystemError> {
    let (size, n) = (system.size(), system.size().nv);
    let mut sides = Sides {
        system,
        scratch: system.scratch(),
        phi: vec![0.0; size.holonomic],
        c: vec![0.0; system.pattern().nnz()],
        a: vec![0.0; size.rows],
        b: vec![0.0; size.rows],
        values: Changes::new(size.rows, n, 1),
    };
    let mut by = vec![0.0; n];
    for j in 0..along.count {
        let part = j * n..(j + 1) * n;
        let (dq, dv, dvdot) = (&along.q[part.clone()], &along.v[part.clone()], &along.vdot[part.clone()]);
        // forces are linear in accelerations: their size does not matter to the length of the difference
        let fastest = (0..n).fold(0.0, |m: f64, i| {
            let displacement = system.structure().displacement(i);
            m.max(dq[i].abs() / displacement)
                .max(dv[i].abs() / displacement.max(at.v[i].abs()))
                .max(dvdot[i].abs() / displacement.max(at.vdot[i].abs()))
        });
        let rows = j * size.rows..(j + 1) * size.rows;
        let outs = [&mut out.rates[rows.clone()], &mut out.accelerations[rows], &mut out.forces[part]];
        if fastest == 0.0 {
            outs.into_iter().for_each(|x| x.fill(0.0));
            continue;
        }
        // where the errors of a central difference meet: h² of the third derivative, ε/h of round-off
        let h = f64::EPSILON.cbrt() / fastest;
        let mut side = |h: f64| -> Result<Changes, SystemError> {
            let mut q = at.q.to_vec();
            by.iter_mut().zip(dq).for_each(|(x, d)| *x = h * d);
            system.step(&mut q, &by);
            let moved = |x: &[f64], d: &[f64]| x.iter().zip(d).map(|(x, d)| x + h * d).collect::<Vec<_>>();
            sides.at(at.t, (&q, &moved(at.v, dv), &moved(at.vdot, dvdot)), at.multipliers)?;
            Ok(sides.values.clone())
        };
        let (ahead, behind) = (side(h)?, side(-h)?);
        let pairs =
            [(ahead.rates, behind.rates), (ahead.accelerations, behind.accelerations), (ahead.forces, behind.forces)];
        for (out, (ahead, behind)) in outs.into_iter().zip(pairs) {
            for (x, (a, b)) in out.iter_mut().zip(ahead.iter().zip(&behind)) {
                *x = (a - b) / (2.0 * h);
            }
        }
    }
    Ok(Derivatives::Differences)
}
