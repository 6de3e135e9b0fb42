//! First-order changes of a motion and of its forces (V1-V4): what is solved is differentiated, never the solver.
//!
//! ```text
//! r = M v' − h − Cᵀ λ     s = C v' + b     (v', λ as solved, constant while r and s are differentiated)
//!
//! (V1)  dq  = D_hᵀ dz − G_h Φ_p dp
//! (V2)  dv  = Dᵀ du − G d(C v + a)
//! (V3)  dv' = Dᵀ du' − G ds       M_d du' = −D (dr − M G ds)
//! (V4)  C_Dᵀ dλ = (M dv' + dr)_D
//! ```
//!
//! G x = [0 on I; C_D⁻¹ x on D]; D_h and G_h belong to the rows that constrain positions. A system gives the changes of
//! Φ, C v + a, s and r along given directions ([`Varied`]); they know no partition.
//!
//! In independent positions z and velocities u = v_I:
//!
//! ```text
//! x = (z, p, u, p')      x' = f0 + A dx + B dw      w: efforts along columns of E, and accelerations p'' of drives
//! ```
//!
//! The rows of a drive are Φ − p, C v − p' and C v' + b − p'': its motion enters by G alone.

use crate::reduction::Reduction;
use crate::start::{self, Start};
use crate::system::{At, Changes, Directions};
use crate::system::{ConstrainedSystem, SystemError, SystemRef};
pub use crate::system::{Derivatives, Varied};
use partita_math::dense::{self, Matrix};
use partita_math::tolerance;

/// Why a state has no linearisation.
#[derive(Debug)]
pub enum StateError {
    /// The equations cannot be solved there.
    System(SystemError),
    /// The velocities violate a constraint: the row, and by how much in its own unit per second.
    Inconsistent {
        /// Row of C.
        row: usize,
        /// C v + a.
        rate: f64,
    },
}

impl From<SystemError> for StateError {
    fn from(error: SystemError) -> Self {
        Self::System(error)
    }
}

/// A drive whose acceleration is an input.
#[derive(Clone, Copy, Debug)]
pub struct Driven {
    /// Its row.
    pub row: usize,
    /// Rate that it prescribes at the state.
    pub rate: f64,
    /// Acceleration, likewise.
    pub acceleration: f64,
}

/// A state whose reduced equations are solved, with everything that its first-order changes need.
pub struct Solved<'s, S: ConstrainedSystem + Varied> {
    /// The reduction there: choice, factors, D.
    pub reduction: Reduction<'s, S>,
    /// Elimination of the rows that constrain positions, where there are others.
    positions: Option<Reduction<'s, S>>,
    t: f64,
    q: Vec<f64>,
    /// v'.
    pub vdot: Vec<f64>,
    /// λ.
    pub multipliers: Vec<f64>,
    /// h.
    pub forces: Vec<f64>,
}

/// Changes of first order: A and what it is made of.
pub struct FirstOrder {
    /// Velocities whose displacements are the states z.
    pub positions: Vec<usize>,
    /// Rows of the drives whose positions are the states p.
    pub driven_positions: Vec<usize>,
    /// Independent velocities, the states u.
    pub velocities: Vec<usize>,
    /// Rows of the drives whose rates are the states p'.
    pub driven_rates: Vec<usize>,
    /// Displacements with z and p (nv columns each).                                                     (V1)
    pub displacements: Matrix,
    /// Changes of all velocities with the states (nv x states).                                          (V2)
    pub rates: Matrix,
    /// Changes of all accelerations with states and inputs (nv x (states + inputs)).                     (V3)
    pub accelerations: Matrix,
    /// Changes of λ with states and inputs (rows x (states + inputs)), zero on redundant rows.           (V4)
    pub multipliers: Matrix,
    /// A.
    pub a: Matrix,
    /// B.
    pub b: Matrix,
    /// f0.
    pub f0: Vec<f64>,
    /// M_d (ku x ku).
    pub mass: Matrix,
    /// D dr by displacements (ku x kz): at rest the stiffness.
    pub stiffness: Matrix,
    /// D dr by velocities (ku x ku): at rest the damping.
    pub damping: Matrix,
    /// How it was computed.
    pub derivatives: Derivatives,
}

impl<'s, S: ConstrainedSystem + Varied> Solved<'s, S> {
    /// At (t, q, v), with the choice that a run would begin with, or these independent velocities.
    ///
    /// # Errors
    /// Singular positions, velocities that violate constraints, a choice that does not serve.
    pub fn new(
        system: impl Into<SystemRef<'s, S>>,
        (t, q, v): (f64, &[f64], &[f64]),
        independent: Option<&[usize]>,
    ) -> Result<Self, StateError> {
        let system = system.into();
        let found = start::analyse(&*system, t, q)?;
        let mut r = Reduction::dense(system.clone(), found.rank);
        start::choose_partition(&mut r, t, q, None, independent)?;
        let u: Vec<f64> = r.planned.partition.independent.iter().map(|&i| v[i]).collect();
        r.evaluate(t, q, &u)?;
        // D holds the given velocities to what the constraints say
        let slowest = |i: usize| system.structure().displacement(i);
        let fastest = (0..v.len()).fold(1.0, |m: f64, i| m.max(v[i].abs() / slowest(i)));
        if (0..v.len()).any(|i| (r.at.v[i] - v[i]).abs() > tolerance::OPEN * fastest * slowest(i)) {
            let pattern = system.pattern();
            let rate = |i: usize| r.at.a[i] + pattern.row(i).map(|e| r.at.c[e] * v[pattern.col_idx[e]]).sum::<f64>();
            let of = |i: usize| (rate(i) / system.structure().rows[i].size()).abs();
            let worst = (0..pattern.rows).max_by(|&a, &b| of(a).total_cmp(&of(b))).unwrap_or(0);
            return Err(StateError::Inconsistent { row: worst, rate: rate(worst) });
        }
        let size = system.size();
        let (mut vdot, mut multipliers) = (vec![0.0; size.nv], vec![0.0; size.rows]);
        r.full_acceleration(&mut vdot);
        r.multipliers(t, q, &vdot, &mut multipliers)?;
        let mut forces = vec![0.0; size.nv];
        system.inverse_dynamics(t, q, &r.at.v, &vec![0.0; size.nv], &mut r.scratch, &mut forces)?;
        forces.iter_mut().for_each(|x| *x = -*x);
        let positions = Self::positions(&r, &found, t, q)?;
        Ok(Self { reduction: r, positions, t, q: q.to_vec(), vdot, multipliers, forces })
    }

    /// Where rows constrain velocities alone, the others determine more positions than velocities: the independent ones,
    /// and some of those that are dependent.
    fn positions(
        r: &Reduction<'s, S>,
        found: &Start,
        t: f64,
        q: &[f64],
    ) -> Result<Option<Reduction<'s, S>>, SystemError> {
        let holonomic = r.size().holonomic;
        if r.planned.partition.rows.iter().all(|&i| i < holonomic) {
            return Ok(None);
        }
        let rows: Vec<usize> = (0..holonomic).filter(|i| !found.dropped.contains(i)).collect();
        let mut own = Reduction::dense(r.system.clone(), rows.len()).keeping(&rows);
        own.position(t, q)?;
        own.refresh_scales(t, q)?;
        own.plan_dependent(t, &r.planned.partition.dependent)?;
        own.tangent(t)?;
        Ok(Some(own))
    }

    /// The reduction whose D gives displacements.
    fn displacing(&self) -> &Reduction<'s, S> {
        self.positions.as_ref().unwrap_or(&self.reduction)
    }

    /// G x for rows x of all constraints.
    fn lift(r: &Reduction<'s, S>, x: &[f64], out: &mut [f64]) {
        let mut kept: Vec<f64> = r.planned.partition.rows.iter().map(|&i| x[i]).collect();
        r.solve(&mut kept, 1);
        out.fill(0.0);
        for (x, &i) in kept.iter().zip(&r.planned.partition.dependent) {
            out[i] = *x;
        }
    }

    /// A, B and f0 with their parts; `efforts` are the columns of E (nv numbers each), one after the other, and the
    /// accelerations of the drives are inputs behind them.
    ///
    /// # Errors
    /// Where the system cannot be evaluated; `Argument` for a drive whose row repeats others.
    pub fn first_order(&self, efforts: &[f64], driven: &[Driven]) -> Result<FirstOrder, SystemError> {
        let (r, system) = (&self.reduction, &*self.reduction.system);
        let (n, rows, ku) = (r.size().nv, r.size().rows, r.k());
        let displacing = self.displacing();
        let (kz, positions) = (displacing.k(), &displacing.planned.partition.independent);
        if let Some(d) = driven.iter().find(|d| !r.planned.partition.rows.contains(&d.row)) {
            let message = format!(
                "{} repeats other conditions here, so that it moves nothing alone",
                system.structure().rows[d.row].description
            );
            return Err(SystemError::argument("inputs", message));
        }
        // a drive of rates alone leaves its position among z
        let held: Vec<usize> = driven.iter().map(|d| d.row).filter(|&i| i < r.size().holonomic).collect();
        let (kp, kr) = (held.len(), driven.len());
        let (first_rate, states) = (kz + kp, kz + kp + ku + kr);
        let first_drive = states + efforts.len() / n.max(1);
        let count = first_drive + kr;
        let at = At { t: self.t, q: &self.q, v: &r.at.v, vdot: &self.vdot, multipliers: &self.multipliers };
        let (mut dq, mut dv, mut dvdot) = (vec![0.0; count * n], vec![0.0; count * n], vec![0.0; count * n]);
        let mut changes = Changes::new(rows, n, count);
        for i in 0..n {
            (0..kz).for_each(|j| dq[j * n + i] = displacing.at.dt[i * kz + j]);
            (0..ku).for_each(|j| dv[(first_rate + j) * n + i] = r.at.dt[i * ku + j]);
        }
        let mut unit = vec![0.0; rows];
        let mut moved = |r: &Reduction<'s, S>, row: usize, out: &mut [f64]| {
            unit[row] = 1.0;
            Self::lift(r, &unit, out);
            unit[row] = 0.0;
        };
        for (j, &row) in held.iter().enumerate() {
            moved(displacing, row, &mut dq[(kz + j) * n..(kz + j + 1) * n]); // (V1)
        }
        for (j, d) in driven.iter().enumerate() {
            let (rate, input) = (first_rate + ku + j, first_drive + j);
            moved(r, d.row, &mut dv[rate * n..(rate + 1) * n]);
            moved(r, d.row, &mut dvdot[input * n..(input + 1) * n]);
        }
        let mut lifted = vec![0.0; n];
        let along = |dq: &[f64], dv: &[f64], dvdot: &[f64], changes: &mut Changes| {
            let derivatives = system.vary(&at, &Directions { count, q: dq, v: dv, vdot: dvdot }, changes)?;
            changes.forces[states * n..first_drive * n].iter_mut().zip(efforts).for_each(|(r, e)| *r -= e);
            Ok::<_, SystemError>(derivatives)
        };
        // each level needs the changes of the one before
        along(&dq, &dv, &dvdot, &mut changes)?;
        for j in 0..first_rate {
            Self::lift(r, &changes.rates[j * rows..(j + 1) * rows], &mut lifted); // (V2)
            dv[j * n..(j + 1) * n].iter_mut().zip(&lifted).for_each(|(x, g)| *x -= g);
        }
        along(&dq, &dv, &dvdot, &mut changes)?;
        for j in 0..states {
            Self::lift(r, &changes.accelerations[j * rows..(j + 1) * rows], &mut lifted); // (V3)
            dvdot[j * n..(j + 1) * n].iter_mut().zip(&lifted).for_each(|(x, g)| *x -= g);
        }
        // with it M times −G ds is part of the change of r
        along(&dq, &dv, &dvdot, &mut changes)?;
        let mut force = Matrix::new(ku, count);
        let (mut a, mut b) = (Matrix::new(states, states), Matrix::new(states, count - states));
        let mut du = vec![0.0; ku];
        for j in 0..count {
            let change = &changes.forces[j * n..(j + 1) * n];
            for i in 0..ku {
                force[(i, j)] = (0..n).map(|l| r.at.dt[l * ku + i] * change[l]).sum::<f64>();
                du[i] = -force[(i, j)];
            }
            dense::cholesky_solve(&r.at.md_factor, ku, &mut du);
            let (to, column) = if j < states { (&mut a, j) } else { (&mut b, j - states) };
            du.iter().enumerate().for_each(|(i, x)| to[(first_rate + i, column)] = *x);
            for l in 0..n {
                dvdot[j * n + l] += (0..ku).map(|i| r.at.dt[l * ku + i] * du[i]).sum::<f64>();
            }
        }
        for j in 0..states {
            let rate = self.rate_of(&dq[j * n..(j + 1) * n], &dv[j * n..(j + 1) * n]);
            positions.iter().enumerate().for_each(|(i, &p)| a[(i, j)] = rate[p]);
        }
        for (j, d) in driven.iter().enumerate() {
            if let Some(i) = held.iter().position(|row| *row == d.row) {
                a[(kz + i, first_rate + ku + j)] = 1.0;
            }
            b[(first_rate + ku + j, first_drive - states + j)] = 1.0;
        }
        let derivatives = along(&dq, &dv, &dvdot, &mut changes)?;
        let (mut work, mut lambda) = (vec![0.0; r.rank()], vec![0.0; rows]);
        let mut multipliers = Matrix::new(rows, count);
        for j in 0..count {
            r.multipliers_of(&changes.forces[j * n..(j + 1) * n], &mut work, &mut lambda); // (V4)
            lambda.iter().enumerate().for_each(|(i, x)| multipliers[(i, j)] = *x);
        }
        let by_columns = |x: &[f64], columns: usize| {
            let mut m = Matrix::new(n, columns);
            (0..columns).for_each(|j| (0..n).for_each(|i| m[(i, j)] = x[j * n + i]));
            m
        };
        let part = |from: usize, columns: usize| {
            let mut m = Matrix::new(ku, columns);
            (0..ku).for_each(|i| (0..columns).for_each(|j| m[(i, j)] = force[(i, from + j)]));
            m
        };
        let rate = |row: &usize| driven.iter().find(|d| d.row == *row).map_or(0.0, |d| d.rate);
        let f0 = (positions.iter().map(|&i| r.at.v[i]))
            .chain(held.iter().map(rate))
            .chain(r.at.vdot_independent.iter().copied())
            .chain(driven.iter().map(|d| d.acceleration))
            .collect();
        Ok(FirstOrder {
            positions: positions.clone(),
            velocities: r.planned.partition.independent.clone(),
            displacements: by_columns(&dq, first_rate),
            rates: by_columns(&dv, states),
            accelerations: by_columns(&dvdot, count),
            multipliers,
            a,
            b,
            f0,
            mass: Matrix::from_vec(ku, ku, r.at.md.clone()),
            stiffness: part(0, kz),
            damping: part(first_rate, ku),
            driven_positions: held,
            driven_rates: driven.iter().map(|d| d.row).collect(),
            derivatives,
        })
    }

    /// Rate of a displacement dq that changes by dv: turns in space are measured in axes of the body, which turn.
    ///
    /// `ζ' = dω − ω × ζ`
    fn rate_of(&self, dq: &[f64], dv: &[f64]) -> Vec<f64> {
        let (system, v) = (&*self.reduction.system, &self.reduction.at.v);
        let mut out = dv.to_vec();
        let mut i = 0;
        while i < out.len() {
            let own = system.structure().coordinates_of(i);
            if own.len() == 1 {
                i += 1;
                continue;
            }
            let (w, z) = (&v[i..i + 3], &dq[i..i + 3]);
            for (j, (a, b)) in [(1, 2), (2, 0), (0, 1)].into_iter().enumerate() {
                out[i + j] -= w[a] * z[b] - w[b] * z[a];
            }
            i += 3;
        }
        out
    }
}
