//! Whether two positions at rest belong to one continuum of them.
//!
//! Along directions that change no force the position moves towards the other one and is brought to rest again across
//! them. A single such direction is followed both ways, since it may bend away first.

use super::deflation::displacement_between;
use super::forces::{travel, Curvatures, Here, Rest};
use crate::error::AnalysisError;
use partita_math::dense;
use partita_math::tolerance;
use partita_model::Model;
use partita_system::manifold::kept_rows::close_kept;
use partita_system::start;
use partita_system::{SystemError, SystemRef};

/// Length of a step along a continuum. Unit: characteristic displacement. Reason: as in a search.
const STRIDE_ALONG: f64 = 0.2;
/// Positions nearer than this are one step apart, and corrections of a step are shorter. Scale: characteristic
/// displacement. Reason: the length of a step.
const ONE_STEP_AWAY: f64 = 0.2;
/// A closed continuum is back at its beginning within this. Scale: characteristic displacement. Reason: half a step.
const BACK: f64 = 0.1;
/// Steps along a continuum before it is left: four turns.
const MOST_STEPS: usize = 120;
/// Halvings of a step before the continuum ends there.
const HALVINGS: usize = 6;
/// Corrections of one position. Reason: Newton's method needs five.
const CORRECTIONS: usize = 8;
/// A direction across that to the other position leads no nearer to it. Scale: cosine. Reason: a hundred steps would be
/// needed.
const ACROSS: f64 = 1e-2;
/// Positions of a continuum nearer than this are one. Scale: characteristic displacement. Reason: searches end six
/// digits nearer.
const SAME: f64 = tolerance::DEPENDENT;

/// Whether the position `to` lies on the continuum of positions at rest through `from`, as far as it was followed.
///
/// # Errors
/// Where nothing can be evaluated.
pub fn is_connected(model: &Model, t: f64, from: &[f64], to: &[f64]) -> Result<bool, AnalysisError> {
    let system = SystemRef::from(model);
    let rank = start::analyse(&*system, t, from)?.rank;
    let mut path = Path { rest: Rest::new(system, rank, t), to };
    for sign in [1.0, -1.0] {
        match path.follow(from, sign) {
            Ok(Some(arrived)) => return Ok(arrived),
            Ok(None) | Err(AnalysisError::System(SystemError::Singular { .. })) => {}
            Err(e) => return Err(e),
        }
    }
    Ok(false)
}

struct Path<'a, 's> {
    rest: Rest<'s, Model>,
    to: &'a [f64],
}

impl Path<'_, '_> {
    /// Whether it arrives, beginning this way where there is one direction alone; none where it ends before.
    fn follow(&mut self, from: &[f64], sign: f64) -> Result<Option<bool>, AnalysisError> {
        let mut q = from.to_vec();
        let mut ahead: Option<Vec<f64>> = None;
        for step in 0..MOST_STEPS {
            let here = self.rest.look(&q)?;
            let found = here.curvatures()?;
            let directions = self.free(&here, &found);
            let left = displacement_between(&*self.rest.reduction.system, &q, self.to);
            let far = largest(&left);
            if far <= SAME {
                return Ok(Some(true));
            }
            let along: Vec<f64> = directions.iter().map(|x| dense::dot(&x.displacement, &left)).collect();
            let parts = match (&along[..], &mut ahead) {
                ([], _) => return Ok(Some(false)),
                ([one], ahead) => {
                    let displacement = &directions[0].displacement;
                    let same = ahead.as_ref().map_or(sign * one, |before| dense::dot(before, displacement));
                    let side = if same < 0.0 { -1.0 } else { 1.0 };
                    *ahead = Some(displacement.iter().map(|x| side * x).collect());
                    // what is left of it, unless it only passes by
                    let near = far < ONE_STEP_AWAY && one.abs() > tolerance::HALF_LOST * far;
                    vec![if near { *one } else { side * STRIDE_ALONG }]
                }
                _ => {
                    let size = along.iter().map(|x| x * x).sum::<f64>().sqrt();
                    if size < ACROSS * far {
                        return Ok(Some(false));
                    }
                    along.iter().map(|x| x * (STRIDE_ALONG / size).min(1.0)).collect()
                }
            };
            let mut z = vec![0.0; here.force.len()];
            for (part, x) in parts.iter().zip(&directions) {
                z.iter_mut().zip(&x.independent).for_each(|(z, x)| *z += part * x);
            }
            let Some(next) = self.beside(&q, &here, &mut z)? else { return Ok(None) };
            q = next;
            // around a closed curve, past its beginning
            let back = displacement_between(&*self.rest.reduction.system, &q, from);
            if step > 2 && along.len() == 1 && largest(&back) < BACK {
                let near = displacement_between(&*self.rest.reduction.system, &q, self.to);
                if largest(&near) > ONE_STEP_AWAY {
                    return Ok(Some(false));
                }
            }
        }
        Ok(None)
    }

    /// The position at rest a step away, shorter where it does not close or does not come to rest.
    fn beside(&mut self, q: &[f64], here: &Here, z: &mut [f64]) -> Result<Option<Vec<f64>>, AnalysisError> {
        for _ in 0..HALVINGS {
            let mut next = q.to_vec();
            if self.moved(&mut next, here, z)? && self.at_rest(&mut next)? {
                return Ok(Some(next));
            }
            z.iter_mut().for_each(|x| *x *= 0.5);
            // with the choice of coordinates there again
            self.rest.look(q)?;
        }
        Ok(None)
    }

    /// Directions along which no force changes.
    fn free(&self, here: &Here, found: &Curvatures) -> Vec<Direction> {
        let (k, small) = (here.force.len(), tolerance::DIFFERENCE_ROUNDING * found.largest);
        let of = |j: usize| {
            let mut independent: Vec<f64> = (0..k).map(|i| found.vectors[(i, j)]).collect();
            here.backward(&mut independent);
            let rows = here.dt.chunks_exact(k).zip(&self.rest.displacement);
            let displacement = rows.map(|(row, by)| dense::dot(row, &independent) / by).collect();
            Direction { independent, displacement }
        };
        (0..k).filter(|&j| found.values[j].abs() <= small).map(of).collect()
    }

    /// Move by independent displacements; whether the loops close there.
    fn moved(&mut self, q: &mut [f64], here: &Here, z: &[f64]) -> Result<bool, AnalysisError> {
        let (r, k) = (&mut self.rest.reduction, z.len());
        let dv: Vec<f64> = here.dt.chunks_exact(k).map(|row| dense::dot(row, z)).collect();
        r.system.equations().step(q, &dv);
        match close_kept(r, self.rest.t, q) {
            Ok(closed) => Ok(closed.is_closed()),
            Err(SystemError::Singular { .. }) => Ok(false),
            Err(e) => Err(e.into()),
        }
    }

    /// Bring a position to rest by steps across the directions that change no force; whether it comes to rest.
    fn at_rest(&mut self, q: &mut [f64]) -> Result<bool, AnalysisError> {
        for _ in 0..CORRECTIONS {
            let here = self.rest.look(q)?;
            if here.rests() {
                return Ok(true);
            }
            let (found, k) = (here.curvatures()?, here.force.len());
            let small = tolerance::DIFFERENCE_ROUNDING * found.largest;
            let mut force = here.force.clone();
            here.forward(&mut force);
            let (mut z, mut left) = (vec![0.0; k], 0.0f64);
            for j in 0..k {
                let along: f64 = (0..k).map(|i| found.vectors[(i, j)] * force[i]).sum();
                if found.values[j].abs() <= small {
                    left = left.max(along.abs());
                    continue;
                }
                (0..k).for_each(|i| z[i] += found.vectors[(i, j)] * along / found.values[j]);
            }
            here.backward(&mut z);
            let length = travel(&here.dt, &self.rest.displacement, &z);
            if length > ONE_STEP_AWAY {
                return Ok(false);
            }
            if length <= tolerance::CLOSED_IN_RUN {
                return Ok(left <= here.noise(&found));
            }
            if !self.moved(q, &here, &z)? {
                return Ok(false);
            }
        }
        Ok(false)
    }
}

/// A direction along which no force changes: in independent displacements, and in all, in characteristic displacements.
struct Direction {
    independent: Vec<f64>,
    displacement: Vec<f64>,
}

fn largest(x: &[f64]) -> f64 {
    x.iter().fold(0.0, |m: f64, x| m.max(x.abs()))
}
