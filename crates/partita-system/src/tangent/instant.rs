//! Description of an instant: everything that follows from (t, q, v) and from the choice in use there, computed in one
//! place.
//!
//! Accelerations and multipliers do not depend on the method of integration, so all formulations on a tangent share
//! this; the full equations replace them by their own.

use crate::error::Result;
use crate::partition::criterion::{self, Quality};
use crate::record::{Output, Sample};
use crate::reduction::{largest, velocity_residuals, Reduction};
use crate::singular::consistency::gaps;
use crate::start;
use crate::system::{ConstrainedSystem, SystemError, SystemRef};
use partita_math::dense::{self, Matrix};

/// Describes instants of a system: a reduction of its own, so that the integration is not disturbed. For outputs: it
/// allocates.
pub struct Describer<'s, S: ConstrainedSystem> {
    system: SystemRef<'s, S>,
    rank: usize,
    dense: bool,
    probe: Option<Box<Reduction<'s, S>>>,
}

impl<'s, S: ConstrainedSystem> Describer<'s, S> {
    /// For a system of the given rank; allocates memory at the first use. `dense`: with full D and M_d, for a basis
    /// whose quality is computed from them.
    pub fn new(system: impl Into<SystemRef<'s, S>>, rank: usize, dense: bool) -> Self {
        Self { system: system.into(), rank, dense, probe: None }
    }

    /// All of `out` except turns and work, for these independent velocities; `None` uses the best ones of the moment.
    ///
    /// Returns the reduction there; `None` where the position is singular, and then undetermined quantities are NaN.
    pub fn describe(
        &mut self,
        at: &Output,
        independent: Option<&[usize]>,
        out: &mut Sample,
    ) -> Result<Option<&mut Reduction<'s, S>>> {
        let (system, rank, dense) = (&self.system, self.rank, self.dense);
        let r = &mut **self.probe.get_or_insert_with(|| {
            Box::new(match dense {
                true => Reduction::dense(system.clone(), rank),
                false => Reduction::new(system.clone(), rank),
            })
        });
        let independent = independent.filter(|x| x.len() == r.k());
        Ok(describe(r, at, independent, out)?.then_some(r))
    }
}

/// Describe an instant with the levels of any reduction; false where the position is singular.
pub fn describe<S: ConstrainedSystem>(
    r: &mut Reduction<S>,
    at: &Output,
    independent: Option<&[usize]>,
    out: &mut Sample,
) -> Result<bool> {
    let (t, q, v) = (at.t, &at.q[..], &at.v[..]);
    out.t = t;
    out.q.clone_from(&at.q);
    out.v.clone_from(&at.v);
    out.note = None;
    let why = match at.singular {
        true => "the mechanism is at a singular position".into(),
        false => match choose(r, t, q, independent).and_then(|()| levels(r, t, q, v, out)) {
            Ok(()) => return Ok(true),
            Err(e @ (SystemError::Singular { .. } | SystemError::Choice { .. })) => e.to_string(),
            Err(e) => return Err(e),
        },
    };
    r.position(t, q)?;
    closures(r, v, out);
    out.independent = independent.map_or_else(Vec::new, <[usize]>::to_vec);
    undetermined(r.size().nv, r.size().rows, &why, out);
    Ok(false)
}

/// The choice at (t, q), with the position level there; the one in use is kept, of redundant rows others where they
/// weaken.
fn choose<S: ConstrainedSystem>(r: &mut Reduction<S>, t: f64, q: &[f64], independent: Option<&[usize]>) -> Result<()> {
    match independent {
        None => {
            start::choose_partition(r, t, q, None, None)?;
            r.position(t, q)
        }
        Some(now) if r.counts.plans > 0 && r.planned.partition.independent == now => {
            r.position(t, q)?;
            serving_rows(r, t)
        }
        Some(new) => {
            r.position(t, q)?;
            r.refresh_scales(t, q)?;
            r.set_partition(t, new)?;
            serving_rows(r, t)
        }
    }
}

/// Replace redundant rows by others that have become better.
fn serving_rows<S: ConstrainedSystem>(r: &mut Reduction<S>, t: f64) -> Result<()> {
    if r.rank() < r.size().rows && (r.factor(t).is_err() || r.rows_fade()) {
        r.renew_rows(t)?;
    }
    Ok(())
}

fn closures<S: ConstrainedSystem>(r: &mut Reduction<S>, v: &[f64], out: &mut Sample) {
    out.closure = r.closure();
    r.at.v.copy_from_slice(v);
    out.gaps = gaps(out.t, r);
    out.fastest = r.fastest();
    out.velocity_closure = largest(velocity_residuals(r.system.pattern(), &r.at.c, v, &r.at.a));
}

fn levels<S: ConstrainedSystem>(r: &mut Reduction<S>, t: f64, q: &[f64], v: &[f64], out: &mut Sample) -> Result<()> {
    let size = r.size();
    closures(r, v, out);
    r.tangent(t)?;
    r.velocity(t, q)?;
    r.acceleration(t, q)?;
    out.vdot.resize(size.nv, 0.0);
    r.full_acceleration(&mut out.vdot);
    out.multipliers.resize(size.rows, 0.0);
    r.multipliers(t, q, &out.vdot, &mut out.multipliers)?;
    out.independent.clone_from(&r.planned.partition.independent);
    out.measure.resize(size.nv, 0.0);
    if out.brief {
        return Ok(());
    }
    r.measure(t, q, &mut out.measure)?;
    let quality = r.quality(t, q)?;
    (out.sigma, out.sqrt_mu) = (quality.sigma, quality.sqrt_mu);
    Ok(())
}

/// At a change point accelerations and multipliers have no value, and none is invented.
fn undetermined(n: usize, rows: usize, why: &str, out: &mut Sample) {
    out.vdot = vec![f64::NAN; n];
    out.multipliers = vec![f64::NAN; rows];
    out.measure = vec![f64::NAN; n];
    (out.sigma, out.sqrt_mu) = (f64::NAN, f64::NAN);
    out.note = Some(format!("accelerations and multipliers are not determined here: {why}"));
}

/// `S M⁻¹ Sᵀ` at the last position of r.
fn block_of_selector<S: ConstrainedSystem>(r: &mut Reduction<S>, t: f64, q: &[f64], s: &Matrix) -> Result<Matrix> {
    let n = r.size().nv;
    let all: Vec<usize> = (0..n).collect();
    let mut inverse = Matrix::new(n, n);
    r.system.inverse_mass_columns(t, q, &all, &mut r.scratch, inverse.data_mut())?;
    Ok(s.matmul(&inverse).matmul(&s.transpose()))
}

/// σ and √μ_S of a constant S (k x n), at the last evaluation of r.
///
/// `D_Sᵀ = Dᵀ (S Dᵀ)⁻¹` for any D, so M_d of S is `(S Dᵀ)⁻ᵀ M_d (S Dᵀ)⁻¹`; √μ_S compares it with `S M⁻¹ Sᵀ`.
pub(super) fn quality_of_selector<S: ConstrainedSystem>(
    r: &mut Reduction<S>,
    t: f64,
    q: &[f64],
    s: &Matrix,
) -> Result<Quality> {
    let (n, k) = (r.size().nv, r.k());
    let block = block_of_selector(r, t, q, s)?;
    let mut sd = s.matmul(&Matrix::from_vec(n, k, r.at.dt.clone())).into_vec();
    let mut pivots = vec![0; k];
    if dense::lu(&mut sd, k, &mut pivots).is_err() {
        return Ok(Quality { sigma: 0.0, sqrt_mu: 0.0 });
    }
    // twice from the left, with M_d symmetric
    let from_left = |m: &Matrix| {
        let mut out = m.transpose();
        for i in 0..k {
            dense::lu_solve_transposed(&sd, k, &pivots, out.row_mut(i));
        }
        out
    };
    let md = from_left(&from_left(&Matrix::from_vec(k, k, r.at.md.clone())));
    let lengths: Vec<f64> = (0..k).map(|j| block[(j, j)]).collect();
    Ok(criterion::quality(md.data(), &lengths, block.data()))
}

/// σ of tangent velocities with the matrix `dt` (n x k), at the last evaluation of r: they span the tangent space
/// exactly.
pub(super) fn quality_of_tangent<S: ConstrainedSystem>(r: &Reduction<S>, dt: &[f64]) -> Quality {
    let k = r.k();
    // the rows of the independent velocities relate the two bases: Dᵀ = D_Iᵀ T
    let t = Matrix::from_vec(
        k,
        k,
        r.planned.partition.independent.iter().flat_map(|&i| &dt[i * k..(i + 1) * k]).copied().collect(),
    );
    let md = t.transpose().matmul(&Matrix::from_vec(k, k, r.at.md.clone())).matmul(&t);
    quality_of_exact(md.data(), k)
}

/// σ of tangent velocities that span the tangent space exactly (so √μ = 1), from their M_d: its conditioning in units
/// of the velocities themselves; 0 where they are dependent.
pub(super) fn quality_of_exact(md: &[f64], k: usize) -> Quality {
    let mut factor = md.to_vec();
    if dense::cholesky(&mut factor, k).is_err() {
        return Quality { sigma: 0.0, sqrt_mu: 1.0 };
    }
    let mut inverse = vec![0.0; k * k];
    dense::inverse_from_cholesky(&factor, k, &mut inverse);
    let lengths: Vec<f64> = (0..k).map(|j| inverse[j * k + j]).collect();
    criterion::quality(md, &lengths, &inverse)
}
