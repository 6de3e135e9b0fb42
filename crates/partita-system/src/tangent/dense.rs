//! A tangent given as a matrix: what is the same for every dense D, wherever it came from.

use crate::partition::Partition;
use crate::reduction::Reduction;
use crate::start;
use crate::system::{ConstrainedSystem, SystemError, Tangent};
use partita_math::dense;

/// Dᵀ (n x k), γ, δ and what follows from them.
pub struct DenseTangent {
    /// `Dᵀ`.
    pub dt: Vec<f64>,
    /// γ.
    pub gamma: Vec<f64>,
    /// δ.
    pub delta: Vec<f64>,
    /// M_d, not factored.
    pub md: Vec<f64>,
    md_factor: Vec<f64>,
    /// u'.
    pub du: Vec<f64>,
}

impl DenseTangent {
    /// Room for n velocities, k of them free.
    pub fn new(n: usize, k: usize) -> Self {
        Self {
            dt: vec![0.0; n * k],
            gamma: vec![0.0; n],
            delta: vec![0.0; n],
            md: vec![0.0; k * k],
            md_factor: vec![0.0; k * k],
            du: vec![0.0; k],
        }
    }

    /// `v = Dᵀ u + γ`.                                                                     (P2)
    pub fn spread(&self, u: &[f64], v: &mut [f64]) {
        let k = u.len();
        for (i, (v, g)) in v.iter_mut().zip(&self.gamma).enumerate() {
            *v = g + dense::dot(&self.dt[i * k..(i + 1) * k], u);
        }
    }

    /// `v' = Dᵀ u' + δ`.                                                                   (P2)
    pub fn full_acceleration(&self, out: &mut [f64]) {
        let k = self.du.len();
        for (i, (x, d)) in out.iter_mut().zip(&self.delta).enumerate() {
            *x = d + dense::dot(&self.dt[i * k..(i + 1) * k], &self.du);
        }
    }

    /// `M_d u' = D (h − M δ)` at the velocity level of r.                                  (P3)
    ///
    /// `name` says which velocity is to blame for a pivot of M_d that is not positive, if the tangent knows.
    pub fn accelerate<S: ConstrainedSystem>(
        &mut self,
        r: &mut Reduction<S>,
        t: f64,
        q: &[f64],
        name: impl Fn(usize) -> Option<usize>,
    ) -> Result<(), SystemError> {
        let k = self.du.len();
        let tangent = Tangent { k, dt: &self.dt, delta: &self.delta };
        r.system.project(t, q, &r.v, &tangent, &mut r.scratch, &mut self.md, &mut self.du)?;
        self.md_factor.copy_from_slice(&self.md);
        if let Err(e) = dense::cholesky(&mut self.md_factor, k) {
            if !self.md.iter().all(|x| x.is_finite()) {
                return Err(SystemError::NotFinite { what: "the reduced mass matrix".into(), t });
            }
            // the velocity with the largest share in the tangent velocity that has no inertia
            let share = |i: &usize| self.dt[i * k + e.index].abs();
            let most = || (0..r.size().nv).max_by(|a, b| share(a).total_cmp(&share(b))).unwrap_or(0);
            let name = r.system.velocity_name(name(e.index).unwrap_or_else(most));
            return Err(SystemError::Mass { name, pivot: e.pivot });
        }
        dense::cholesky_solve(&self.md_factor, k, &mut self.du);
        Ok(())
    }
}

/// The best choice of coordinates at `(t, q)` (P5, P6).
pub fn best_partition<S: ConstrainedSystem>(
    system: &S,
    rank: usize,
    t: f64,
    q: &[f64],
) -> Result<Partition, SystemError> {
    let mut probe = Reduction::dense(system, rank);
    start::choose_partition(&mut probe, t, q, None, None)?;
    Ok(probe.partition)
}
