//! What is the same for every tangent that an evaluation left in a [`Reduction`], wherever it came from.

use super::reduction::Reduction;
use crate::partition::Partition;
use crate::start;
use crate::system::{ConstrainedSystem, SystemError, Tangent};
use partita_math::dense;

/// `M_d u' = D (h − M δ)` for any tangent left in r (`dt`, `delta`, `v`); u' in `r.vdot_independent`.
pub fn reduced_acceleration<S: ConstrainedSystem>(
    r: &mut Reduction<S>,
    t: f64,
    q: &[f64],
    hd: &mut [f64],
) -> Result<(), SystemError> {
    let k = r.k();
    let tangent = Tangent { k, dt: &r.dt, delta: &r.delta };
    r.system.project(t, q, &r.v, &tangent, &mut r.scratch, &mut r.md, hd)?;
    r.md_factor.copy_from_slice(&r.md);
    r.vdot_independent.copy_from_slice(hd);
    if let Err(e) = dense::cholesky(&mut r.md_factor, k) {
        if !r.md.iter().all(|x| x.is_finite()) {
            return Err(SystemError::NotFinite { what: "the reduced mass matrix".into(), t });
        }
        // the velocity with the largest share in the tangent velocity that has no inertia
        let share = |i: &usize| r.dt[i * k + e.index].abs();
        let most = (0..r.size().nv).max_by(|a, b| share(a).total_cmp(&share(b))).unwrap_or(0);
        return Err(SystemError::Mass { name: r.system.velocity_name(most), pivot: e.pivot });
    }
    dense::cholesky_solve(&r.md_factor, k, &mut r.vdot_independent);
    Ok(())
}

/// dE/dt that is not the work of conservative forces: applied power and, for driven constraints, −λᵀa.
///
/// For any tangent: −λᵀ a = λᵀ C v = (M v' − h)ᵀ γ, because the reaction does no work along the rows of D.
pub fn power<S: ConstrainedSystem>(
    r: &mut Reduction<S>,
    t: f64,
    q: &[f64],
    vdot: &mut [f64],
    residual: &mut [f64],
) -> Result<f64, SystemError> {
    let mut p = r.system.power(t, q, &r.v, &mut r.scratch)?;
    if r.system.rheonomic() {
        r.full_acceleration(vdot);
        r.system.inverse_dynamics(t, q, &r.v, vdot, &mut r.scratch, residual)?;
        p += dense::dot(residual, &r.gamma);
    }
    Ok(p)
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
