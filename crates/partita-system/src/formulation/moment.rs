//! The measure at one moment, for formulations that keep no partition of their own.

use super::reduction::Reduction;
use super::Sample;
use crate::start;
use crate::system::{ConstrainedSystem, SystemError};

/// P4, σ, √μ and the choice P5 at `(t, q, v)`, written into `out`.
///
/// They belong to the mechanism, not to the way it is integrated: the partition is chosen afresh at each moment, so
/// consecutive samples may name different coordinates. `probe` is any reduction of the system; it is left at `(t, q)` with
/// the partition of the moment. For outputs: it allocates.
pub fn measure<S: ConstrainedSystem>(
    probe: &mut Reduction<S>,
    t: f64,
    q: &[f64],
    v: &[f64],
    out: &mut Sample,
) -> Result<(), SystemError> {
    start::choose_partition(probe, t, q, None, None)?;
    let speeds: Vec<f64> = probe.partition.independent.iter().map(|&i| v[i]).collect();
    probe.evaluate(t, q, &speeds)?;
    out.measure.resize(v.len(), 0.0);
    probe.measure(t, q, &mut out.measure)?;
    let quality = probe.quality(t, q)?;
    (out.sigma, out.sqrt_mu) = (quality.sigma, quality.sqrt_mu);
    out.independent.clear();
    out.independent.extend_from_slice(&probe.partition.independent);
    Ok(())
}
