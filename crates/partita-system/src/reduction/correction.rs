//! One linear step of the dependent coordinates towards closed positions.                                     (34)

use super::Reduction;
use crate::system::ConstrainedSystem;
use partita_math::tolerance;

/// A larger residual is not rounding even next to a singular position: the loop is open. Scale: multiples of the
/// rounding of the row. Reason: two digits are lost where rank is doubtful.
const UNDECIDED_ROUNDINGS: f64 = 1e2;

/// A step of the dependent coordinates, stored in the reduction.
#[derive(Clone, Copy, Debug)]
pub struct DependentStep {
    /// Its largest displacement: in characteristic displacements, or in natural scales where the system has no sizes of
    /// rows.
    pub length: f64,
    /// Whether it would change only round-off: a short one, but a large multiple of a residual of some roundings, as
    /// next to a singular position, where round-off is amplified without bounds.
    pub is_round_off: bool,
}

impl<S: ConstrainedSystem> Reduction<'_, S> {
    /// `-C_D⁻¹ Φ` with the current factors, for [`move_dependent`](Self::move_dependent).               (34)
    ///
    /// Needs `position` and `factor` at q, and all rows holonomic.
    pub fn dependent_step(&mut self) -> DependentStep {
        let x = &mut self.at.work[..self.planned.rank];
        for (x, &row) in x.iter_mut().zip(&self.planned.partition.rows) {
            *x = -self.at.phi[row];
        }
        if let Some(plan) = &self.planned.plan {
            plan.solve(&self.at.factors, x, 1);
        }
        // both in characteristic displacements where the system has them; elsewhere both in natural scales, so that
        // units cancel
        let known = self.system.structure().rows.iter().all(|x| x.displacement.is_some());
        let part = |i: usize| match known {
            true if self.scale.noise[i] > 0.0 => tolerance::ROUNDING / self.scale.noise[i],
            true => 0.0,
            false => self.scale.row_scale[i],
        };
        let rows = self.at.phi.iter().enumerate().filter(|(i, _)| !self.planned.left_out[*i]);
        let residual = rows.fold(0.0, |m: f64, (i, x)| m.max(x.abs() * part(i)));
        let scale = if known { &self.scale.displacement } else { &self.scale.s };
        let length =
            x.iter().zip(&self.planned.partition.dependent).fold(0.0, |m: f64, (x, &i)| m.max(x.abs() / scale[i]));
        let amplifies = length < tolerance::OPEN && length > super::LARGEST_AMPLIFICATION * residual;
        let undecided = || self.closure_error_of_rows().all(|x| x.abs() <= UNDECIDED_ROUNDINGS);
        DependentStep { length, is_round_off: amplifies && undecided() }
    }

    /// As `dependent_step`, written into `dv` (nv); false where it would change only round-off.
    pub fn dependent_correction(&mut self, dv: &mut [f64]) -> bool {
        let closes = !self.dependent_step().is_round_off;
        dv.fill(0.0);
        self.at.work.iter().zip(&self.planned.partition.dependent).for_each(|(x, &i)| dv[i] = *x);
        closes
    }

    /// Shorten the step last found.
    pub fn scale_dependent_step(&mut self, by: f64) {
        self.at.work[..self.planned.rank].iter_mut().for_each(|x| *x *= by);
    }

    /// Φ of the rows to be closed, in units of their own round-off as in [`closure_error`](Self::closure_error).
    pub fn closure_error_of_rows(&self) -> impl Iterator<Item = f64> + '_ {
        let rows = self.at.phi.iter().zip(&self.scale.noise).enumerate().filter(|(i, _)| !self.planned.left_out[*i]);
        rows.map(|(i, (x, n))| {
            let least = self.system.structure().rows[i]
                .displacement
                .map_or(f64::MIN_POSITIVE, |displacement| tolerance::ROUNDING * displacement);
            x / n.max(least)
        })
    }
}
