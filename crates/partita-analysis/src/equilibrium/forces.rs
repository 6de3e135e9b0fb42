//! Reduced forces and stiffness at rest, at one closed position.

use crate::error::AnalysisError;
use partita_math::dense::{self, Matrix};
use partita_math::factor;
use partita_math::tolerance;
use partita_system::reduction::Reduction;
use partita_system::start;
use partita_system::system::{At, Changes, Directions, Varied};
use partita_system::{ConstrainedSystem, SystemError, SystemRef};

/// Forces and stiffness at a position.
pub(super) struct Here {
    /// h_d (k).
    pub force: Vec<f64>,
    /// Sums of the absolute forces that add up to `force`.
    pub pull: Vec<f64>,
    /// K_d (k x k).
    pub stiffness: Matrix,
    /// Factor of Dᵀ weighed by characteristic displacements: the natural metric (k x k).
    factor: Vec<f64>,
    /// Size of the force in this metric.
    pub size: f64,
    /// λ of rest.
    pub multipliers: Vec<f64>,
    /// Independent velocities.
    pub independent: Vec<usize>,
    /// Dᵀ (n x k).
    pub dt: Vec<f64>,
    /// M v' − h (n) at rest.
    residual: Vec<f64>,
}

/// Eigenvalues of K_d in the natural metric, ascending, with their vectors.
pub(super) struct Curvatures {
    /// K_d in the natural metric.
    pub natural: Matrix,
    /// Eigenvalues: of the symmetric part.
    pub values: Vec<f64>,
    /// Eigenvectors, one in each column.
    pub vectors: Matrix,
    /// Whether K_d is symmetric.
    pub symmetric: bool,
    /// Largest entry of K_d in the natural metric.
    pub largest: f64,
}

/// How everything changes with a number on which the equations depend.
pub(super) struct ByNumber {
    /// Displacement of all velocities that keeps the loops closed while the independent ones stay (n).
    pub displacement: Vec<f64>,
    /// Change of −h_d (k).
    pub force: Vec<f64>,
}

/// The equations at rest at one time.
pub(super) struct Rest<'s, S: ConstrainedSystem + Varied> {
    /// The reduction.
    pub reduction: Reduction<'s, S>,
    /// Time.
    pub t: f64,
    /// Characteristic displacement of each velocity.
    pub displacement: Vec<f64>,
}

/// Natural size of a vector z: its largest displacement.
pub(super) fn travel(dt: &[f64], displacement: &[f64], z: &[f64]) -> f64 {
    let k = z.len();
    displacement.iter().enumerate().fold(0.0, |m: f64, (l, d)| m.max(dense::dot(&dt[l * k..(l + 1) * k], z).abs() / d))
}

impl Here {
    /// The forces of single loads cancel up to rounding.
    pub fn rests(&self) -> bool {
        self.force.iter().zip(&self.pull).all(|(f, p)| f.abs() <= tolerance::ROUNDING * p)
    }

    /// Forces along a direction of the natural metric that rounding explains: of single loads that cancel, and of
    /// coordinates along the stiffest direction.
    pub fn noise(&self, found: &Curvatures) -> f64 {
        let mut pull = self.pull.clone();
        self.forward(&mut pull);
        tolerance::SOLUTION_ROUNDING.sqrt() * dense::dot(&pull, &pull).sqrt()
            + tolerance::SOLUTION_ROUNDING * found.largest
    }

    /// The independent velocity with the largest effort that is left.
    pub fn most(&self, displacement: &[f64]) -> Option<(usize, f64)> {
        let work = |i: usize| (self.force[i] * displacement[self.independent[i]]).abs();
        (0..self.force.len()).max_by(|&a, &b| work(a).total_cmp(&work(b))).map(|i| (self.independent[i], self.force[i]))
    }

    /// Forces x in the natural metric.
    pub fn forward(&self, x: &mut [f64]) {
        dense::cholesky_forward(&self.factor, self.force.len(), x);
    }

    /// Displacements of the natural metric in independent ones.
    pub fn backward(&self, x: &mut [f64]) {
        dense::cholesky_backward(&self.factor, self.force.len(), x);
    }

    /// K_d in the natural metric, decomposed.
    pub fn curvatures(&self) -> Result<Curvatures, AnalysisError> {
        let k = self.force.len();
        let columns = |x: &Matrix| {
            let mut out = Matrix::new(k, k);
            for j in 0..k {
                let mut column: Vec<f64> = (0..k).map(|i| x[(i, j)]).collect();
                self.forward(&mut column);
                (0..k).for_each(|i| out[(i, j)] = column[i]);
            }
            out
        };
        let natural = columns(&columns(&self.stiffness).transpose()).transpose();
        let largest = natural.data().iter().fold(0.0, |m: f64, x| m.max(x.abs()));
        let skew = (0..k * k).fold(0.0, |m: f64, e| m.max((natural[(e / k, e % k)] - natural[(e % k, e / k)]).abs()));
        let mean = Matrix::from_vec(
            k,
            k,
            (0..k * k).map(|e| 0.5 * (natural[(e / k, e % k)] + natural[(e % k, e / k)])).collect::<Vec<f64>>(),
        );
        let (values, vectors) = factor::symmetric_eigen(&mean).map_err(|e| failed(&e))?;
        let symmetric = skew <= tolerance::CLOSED_IN_RUN * largest;
        Ok(Curvatures { natural, values, vectors, symmetric, largest })
    }
}

/// An equation that has no solution.
pub(super) fn failed(e: &factor::FactorError) -> AnalysisError {
    AnalysisError::Argument { argument: "near", message: e.to_string() }
}

impl<'s, S: ConstrainedSystem + Varied> Rest<'s, S> {
    /// For a system with constraints of this rank.
    pub fn new(system: SystemRef<'s, S>, rank: usize, t: f64) -> Self {
        let displacement = (0..system.size().nv).map(|l| system.structure().displacement(l)).collect();
        Self { reduction: Reduction::dense(system, rank), t, displacement }
    }

    /// Evaluate at q, with the best choice of coordinates there.
    pub fn look(&mut self, q: &[f64]) -> Result<Here, AnalysisError> {
        start::choose_partition(&mut self.reduction, self.t, q, None, None)?;
        let r = &mut self.reduction;
        let size = r.size();
        let (n, k) = (size.nv, r.k());
        let (rest, mut residual) = (vec![0.0; n], vec![0.0; n]);
        r.at.v.fill(0.0);
        r.velocity(self.t, q)?;
        let system = r.system.clone();
        system.inverse_dynamics(self.t, q, &rest, &rest, &mut r.scratch, &mut residual)?;
        let (mut work, mut multipliers) = (vec![0.0; r.rank()], vec![0.0; size.rows]);
        r.multipliers_of(&residual, &mut work, &mut multipliers); // C_Dᵀ λ = (−h)_D
        let mut dq = vec![0.0; n * k];
        (0..n).for_each(|i| (0..k).for_each(|j| dq[j * n + i] = r.at.dt[i * k + j]));
        let none = vec![0.0; n * k];
        let mut changes = Changes::new(size.rows, n, k);
        let at = At { t: self.t, q, v: &rest, vdot: &rest, multipliers: &multipliers };
        r.system.vary(&at, &Directions { count: k, q: &dq, v: &none, vdot: &none }, &mut changes)?;
        let (mut stiffness, mut metric) = (Matrix::new(k, k), vec![0.0; k * k]);
        for i in 0..k {
            for j in 0..k {
                let of = |l: usize| r.at.dt[l * k + i];
                stiffness[(i, j)] = (0..n).map(|l| of(l) * changes.forces[j * n + l]).sum();
                metric[i * k + j] = (0..n).map(|l| of(l) * r.at.dt[l * k + j] / self.displacement[l].powi(2)).sum();
            }
        }
        let sum = |f: &dyn Fn(f64) -> f64, i: usize| (0..n).map(|l| f(-r.at.dt[l * k + i] * residual[l])).sum::<f64>();
        dense::cholesky(&mut metric, k).map_err(|e| SystemError::Mass {
            name: r.system.structure().velocity_name(r.planned.partition.independent[e.index]),
            pivot: e.pivot,
        })?;
        let mut here = Here {
            force: (0..k).map(|i| sum(&|x| x, i)).collect(),
            pull: (0..k).map(|i| sum(&f64::abs, i)).collect(),
            size: 0.0,
            factor: metric,
            stiffness,
            multipliers,
            independent: r.planned.partition.independent.clone(),
            dt: r.at.dt.clone(),
            residual,
        };
        let mut along = here.force.clone();
        here.forward(&mut along);
        here.size = dense::dot(&along, &along).sqrt();
        Ok(here)
    }

    /// The dependent velocity that drives accelerate most where all rest, with its acceleration, after `look`.   (P2)
    pub fn accelerated(&self) -> Option<(usize, f64)> {
        let r = &self.reduction;
        if !r.system.structure().rheonomic {
            return None;
        }
        let mut growth: Vec<f64> = r.planned.partition.rows.iter().map(|&i| -r.at.b[i]).collect();
        r.solve(&mut growth, 1);
        let size = |(i, x): &(usize, f64)| (x / self.displacement[*i]).abs();
        let each = r.planned.partition.dependent.iter().copied().zip(growth).filter(|(_, x)| *x != 0.0);
        each.max_by(|a, b| size(a).total_cmp(&size(b)))
    }

    /// Change of Φ (kept rows in their order) and of r = M v' − h − Cᵀ λ (n) from these equations to others at the same q
    /// and λ, after `look`.
    pub fn change_to(&self, other: &S, q: &[f64], here: &Here) -> Result<(Vec<f64>, Vec<f64>), SystemError> {
        let (r, size, pattern) = (&self.reduction, other.size(), other.pattern());
        let (rest, mut forces) = (vec![0.0; size.nv], vec![0.0; size.nv]);
        let (mut phi, mut c, mut a) = (vec![0.0; size.holonomic], vec![0.0; pattern.nnz()], vec![0.0; size.rows]);
        let mut s = other.scratch();
        other.position(self.t, q, &mut s, &mut phi, &mut c, &mut a)?;
        other.velocity(self.t, q, &rest, &mut s, &mut a)?;
        other.inverse_dynamics(self.t, q, &rest, &rest, &mut s, &mut forces)?;
        forces.iter_mut().zip(&here.residual).for_each(|(x, y)| *x -= y);
        for (i, lambda) in here.multipliers.iter().enumerate() {
            for e in pattern.row(i) {
                forces[pattern.col_idx[e]] -= (c[e] - r.at.c[e]) * lambda;
            }
        }
        let closing = |i: &usize| if *i < size.holonomic { phi[*i] - r.at.phi[*i] } else { 0.0 };
        Ok((r.planned.partition.rows.iter().map(closing).collect(), forces))
    }

    /// Changes per unit of a number, by central differences between the equations a `step` ahead and behind, after
    /// `look`.
    ///
    /// `dq = −G Φ_p,  −dh_d = D (r_p + r_q dq)`                                                          (V1)
    pub fn by_number(
        &self,
        q: &[f64],
        here: &Here,
        (ahead, behind): (&S, &S),
        step: f64,
    ) -> Result<ByNumber, SystemError> {
        let (size, r) = (self.reduction.size(), &self.reduction);
        let (n, k) = (size.nv, r.k());
        let (phi, force) = self.change_to(ahead, q, here)?;
        let (phi2, force2) = self.change_to(behind, q, here)?;
        let central = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| 0.5 * (a - b) / step).collect::<Vec<f64>>();
        let (mut closing, mut forces) = (central(&phi, &phi2), central(&force, &force2));
        let mut displacement = vec![0.0; n];
        if closing.iter().any(|x| *x != 0.0) {
            r.solve(&mut closing, 1);
            closing.iter().zip(&r.planned.partition.dependent).for_each(|(x, &i)| displacement[i] = -x);
            let none = vec![0.0; n];
            let mut changes = Changes::new(size.rows, n, 1);
            let at = At { t: self.t, q, v: &none, vdot: &none, multipliers: &here.multipliers };
            r.system.vary(&at, &Directions { count: 1, q: &displacement, v: &none, vdot: &none }, &mut changes)?;
            forces.iter_mut().zip(&changes.forces).for_each(|(x, y)| *x += y);
        }
        let force = (0..k).map(|i| (0..n).map(|l| r.at.dt[l * k + i] * forces[l]).sum()).collect();
        Ok(ByNumber { displacement, force })
    }
}
