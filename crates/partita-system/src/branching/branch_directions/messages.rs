//! Messages on the branch that rates select, and on why they select none.

use super::{largest, BranchDirections, RequestedRate, BESIDE_DEAD_CENTRE};
use crate::branching::WRITTEN;
use crate::system::ConstrainedSystem;
use partita_math::factor::symmetric_eigen;
use partita_math::formatted;
use partita_math::tolerance;

impl<S: ConstrainedSystem> BranchDirections<'_, S> {
    pub(super) fn asked_rates(&self, asked: &[RequestedRate]) -> String {
        let all: Vec<String> =
            asked.iter().take(WRITTEN).map(|x| format!("{} = {}", x.name, formatted(x.rate))).collect();
        let more = if asked.len() > WRITTEN { ", ..." } else { "" };
        format!("{}{more}", all.join(", "))
    }

    /// Rates of the moving coordinates, as requested.
    pub(super) fn written(&self, w: &[f64]) -> String {
        let v = self.natural(w);
        let top = largest(w);
        let moving: Vec<usize> = (0..v.len()).filter(|&i| w[i].abs() > tolerance::TAKES_PART * top).collect();
        if moving.is_empty() || moving.len() > WRITTEN {
            return "see the report for its rates".into();
        }
        let all: Vec<String> = moving
            .iter()
            .map(|&i| format!("\"{}\": {}", self.system.structure().velocities[i].name, formatted(v[i])))
            .collect();
        format!("assemble(rates={{{}}})", all.join(", "))
    }

    /// The rates do not select a branch.
    pub(super) fn which(&self, asked: &[RequestedRate]) -> String {
        if self.k == 1 {
            let branch_directions: Vec<String> = self
                .planes
                .iter()
                .flatten()
                .filter_map(|plane| self.on_plane(plane))
                .map(|(base, _)| self.written(&base))
                .collect();
            return format!(
                "two branches agree with the drives; select one of them: {}",
                branch_directions.join(" or ")
            );
        }
        match asked.is_empty() {
            true => REST.into(),
            false => format!(
                "the rates {} belong to more than one branch; give the rate of one more joint to select a branch",
                self.asked_rates(asked)
            ),
        }
    }

    pub(super) fn none(&self, asked: &[RequestedRate], nearest: &[f64]) -> String {
        let of: Vec<String> =
            asked.iter().take(WRITTEN).map(|x| format!("{} = {}", x.name, formatted(self.read(x, nearest)))).collect();
        format!(
            "the rates {} belong to no branch; on the nearest one {}: {}",
            self.asked_rates(asked),
            of.join(", "),
            self.written(nearest)
        )
    }

    /// As `none`, for velocities of a state.
    pub(super) fn nearest(&self, w: &[f64], asked: &[RequestedRate]) -> String {
        let fits = self.planes.iter().flatten().filter_map(|plane| self.on_plane(plane));
        let fits = fits.filter_map(|(base, basis)| self.fit(&base, &basis, w, &[]));
        let off = |v: &[f64]| v.iter().zip(w).fold(0.0, |m: f64, (a, b)| m.max((a - b).abs()));
        let best = fits.map(|fit| fit.v).min_by(|a, b| off(a).total_cmp(&off(b)));
        self.none(asked, &best.unwrap_or_else(|| self.projected(w)))
    }

    /// The branch along `v`, for the report.
    pub fn described(&self, v: &[f64]) -> String {
        let w: Vec<f64> = v.iter().zip(&self.displacement).map(|(v, r)| v / r).collect();
        let top = largest(&w);
        let moving: Vec<usize> = (0..v.len()).filter(|&i| w[i].abs() > tolerance::TAKES_PART * top).collect();
        let all: Vec<String> = moving
            .iter()
            .take(WRITTEN)
            .map(|&i| format!("\"{}\": {}", self.system.structure().velocities[i].name, formatted(v[i])))
            .collect();
        format!("{{{}{}}}", all.join(", "), if moving.len() > WRITTEN { ", ..." } else { "" })
    }

    /// Why no velocity is allowed at all, as the end of a sentence.
    pub(super) fn impossible(&self) -> Option<String> {
        let (off, row, _) = self.forbidden;
        let fastest = self.unit.max(largest(&self.particular));
        if self.driven && off.abs() > BESIDE_DEAD_CENTRE * fastest {
            let (what, speed) = (&self.system.structure().rows[row].owner, self.drive_speed(row));
            return Some(format!(
                "{what} prescribes {speed} at t = {}, which is impossible at a dead centre: there the rate must be \
                 0 and the acceleration must point inwards",
                self.t
            ));
        }
        if !self.driven {
            return None;
        }
        let (values, _) = symmetric_eigen(&self.form).ok()?;
        let top = largest(&values);
        let significant: Vec<f64> = values.into_iter().filter(|x| x.abs() > tolerance::TAKES_PART * top).collect();
        let (rest, whose) = (self.form[(self.k, self.k)].abs(), &self.system.structure().rows[row].owner);
        if significant.len() < 2 && rest <= tolerance::TAKES_PART * top {
            return Some(
                "to second order the drives stand still here, so the branch depends on higher orders, which are not \
                 evaluated; let the prescribed motion begin with an acceleration inwards"
                    .to_owned(),
            );
        }
        let one_sign = significant.iter().all(|x| x * significant[0] > 0.0);
        one_sign.then(|| {
            format!(
                "at t = {} the drives prescribe an acceleration outwards ({whose}), which the joints cannot follow; \
                 let it point inwards",
                self.t
            )
        })
    }

    pub(super) fn drive_speed(&self, row: usize) -> String {
        let unit = if self.system.structure().rows[row].is_angle { "rad/s" } else { "m/s" };
        format!("{} {unit}", formatted(self.forbidden.2))
    }
}

pub(super) const REST: &str =
    "at rest the branch is undetermined; give rates that belong to one branch only, as in assemble(rates=...)";
pub(super) const TOUCH: &str = "at these rates branches touch, so the motion is not unique to second order";
