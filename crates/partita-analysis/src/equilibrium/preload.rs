//! Numbers of the loads with which a given position is one of rest.
//!
//! ```text
//! h_d(z*, p) = 0      (h_d)_p dp = −h_d   with the least |dp / scale|               (E3)
//! ```
//!
//! Where h_d is linear in p (free lengths, constant torques and forces, stiffnesses) the first step is the last.

use super::forces::{failed, Here, Rest};
use crate::error::AnalysisError;
use partita_math::dense::Matrix;
use partita_math::factor;
use partita_math::tolerance;
use partita_model::Model;
use partita_system::prelude::*;
use partita_system::start;

/// Steps before the search for numbers ends. Reason: linear loads need one, and Newton's method doubles digits.
const MOST_STEPS: usize = 30;

/// Unknown numbers under one name.
#[derive(Clone, Debug)]
pub struct Unknown {
    /// Name of the parameter.
    pub name: String,
    /// Powers of a length and of an energy that are the natural size of its numbers: (1, 0) for a length, (-1, 1) for a
    /// force.
    pub powers: (i32, i32),
}

/// The position whose loads are changed.
struct Held<'a> {
    model: &'a Model,
    t: f64,
    q: &'a [f64],
    unknown: &'a [Unknown],
}

impl Held<'_> {
    /// The model with these numbers.
    fn with(&self, values: &[Vec<f64>]) -> Result<Model, AnalysisError> {
        let changes: Vec<(&str, &[f64])> =
            self.unknown.iter().zip(values).map(|(u, x)| (u.name.as_str(), x.as_slice())).collect();
        Ok(self.model.with_parameters(&changes)?)
    }

    /// Change of h_d to the loads of another model, which must leave the loops closed.
    fn change(&self, rest: &Rest<Model>, here: &Here, other: &Model, name: &str) -> Result<Vec<f64>, AnalysisError> {
        let (phi, forces) = rest.change_to(other, self.q, here)?;
        if phi.iter().any(|x| x.abs() > tolerance::ROUNDING) {
            let message = format!(
                "parameter {name:?} moves joints, so that the loops do not close at this position; name numbers of \
                 loads: free lengths, angles, constant torques and forces, stiffnesses"
            );
            return Err(AnalysisError::Argument { argument: "parameters", message });
        }
        let k = here.force.len();
        Ok((0..k).map(|i| -forces.iter().enumerate().map(|(l, f)| here.dt[l * k + i] * f).sum::<f64>()).collect())
    }
}

/// Numbers of the unknown parameters with which the closed position q is one of rest, those with the least change in
/// natural sizes.
///
/// # Errors
/// Where these numbers cannot hold the position, where they move joints, singular positions.
pub fn preload(model: &Model, t: f64, q: &[f64], unknown: &[Unknown]) -> Result<Vec<Vec<f64>>, AnalysisError> {
    let held = Held { model, t, q, unknown };
    let known = model.parameters();
    let mut values = Vec::with_capacity(unknown.len());
    for u in unknown {
        let Some((_, x)) = known.iter().find(|x| x.0 == u.name) else {
            let message = format!("there is no parameter {:?}", u.name);
            return Err(AnalysisError::Argument { argument: "parameters", message });
        };
        values.push(x.clone());
    }
    let rank = start::analyse(model, t, q)?.rank;
    let numbers: Vec<(usize, usize)> =
        values.iter().enumerate().flat_map(|(i, x)| (0..x.len()).map(move |j| (i, j))).collect();
    let length = model.length();
    let mut scales = Vec::new();
    let (mut energy, mut first) = (1.0, 0.0);
    let (mut before, mut moved, mut step) = (f64::INFINITY, f64::INFINITY, 0);
    loop {
        let present = held.with(&values)?;
        let mut rest = Rest::new((&present).into(), rank, held.t);
        let here = rest.look(held.q)?;
        let left = here.size;
        if step == 0 {
            // sizes are those of the position as it was given: a stiffness is an energy over a displacement's square
            energy = Some(here.curvatures()?.largest).filter(|x| *x > 0.0).unwrap_or(energy);
            scales.extend(unknown.iter().map(|u| length.powi(u.powers.0) * energy.powi(u.powers.1)));
            first = left;
        }
        if left <= tolerance::SUM_ROUNDING * energy {
            return Ok(values);
        }
        // what is left is rounding, of the numbers themselves as well
        let settled = step > 1 && tolerance::DOUBLED * left > before;
        if settled && (left <= tolerance::CLOSED_IN_RUN * first || moved <= tolerance::CLOSED) {
            return Ok(values);
        }
        if step == MOST_STEPS || settled {
            return Err(not_held(&rest, &here, unknown, None));
        }
        before = left;
        let k = here.force.len();
        let mut by = Matrix::new(k, numbers.len());
        for (c, &(i, j)) in numbers.iter().enumerate() {
            let mut beside = values.clone();
            beside[i][j] += scales[i];
            let mut column = held.change(&rest, &here, &held.with(&beside)?, &unknown[i].name)?;
            here.forward(&mut column);
            (0..k).for_each(|l| by[(l, c)] = column[l]);
        }
        let mut wanted: Vec<f64> = here.force.iter().map(|x| -x).collect();
        here.forward(&mut wanted);
        let (x, found) = factor::least_squares_min_norm(&by, &wanted, tolerance::NULL_VALUE).map_err(|e| failed(&e))?;
        let short: Vec<f64> =
            (0..k).map(|l| wanted[l] - (0..numbers.len()).map(|c| by[(l, c)] * x[c]).sum::<f64>()).collect();
        let size = |x: &[f64]| x.iter().map(|x| x * x).sum::<f64>().sqrt();
        if size(&short) > tolerance::CLOSED_IN_RUN * size(&wanted) {
            if step > 0 && left <= tolerance::CLOSED_IN_RUN * first {
                return Ok(values);
            }
            return Err(not_held(&rest, &here, unknown, Some(found)));
        }
        moved = x.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
        for (x, &(i, j)) in x.iter().zip(&numbers) {
            values[i][j] += x * scales[i];
        }
        step += 1;
    }
}

/// The refusal of numbers that cannot hold the position.
fn not_held(rest: &Rest<Model>, here: &Here, unknown: &[Unknown], rank: Option<usize>) -> AnalysisError {
    let names: Vec<&str> = unknown.iter().map(|u| u.name.as_str()).collect();
    let k = here.force.len();
    let (i, effort) = here.most(&rest.displacement).unwrap_or((0, 0.0));
    let along = &rest.reduction.system.structure().velocities[i].name;
    let why = match rank {
        Some(rank) if rank < k => {
            let s = if k == 1 { "" } else { "s" };
            format!("they change {rank} of the efforts along {k} degree{s} of freedom; name others as well")
        }
        Some(_) => "what they do is not enough; name others as well".to_string(),
        None => "the steps towards it do not converge; name others".to_string(),
    };
    let message = format!(
        "{} cannot hold the mechanism in this position, in which the effort {effort:.3e} along {along} is to be \
         balanced: {why}",
        names.join(", ")
    );
    AnalysisError::Argument { argument: "parameters", message }
}
