//! Positions that cover a range: from each one steps in all directions, until no place is left without a neighbour.

use super::slice::{alike, newton, Evaluation, Slice};
use crate::error::AnalysisError;
use crate::outputs::Watch;
use partita_math::dense;
use partita_math::tolerance;
use partita_system::manifold::Rule;
use partita_system::prelude::*;
use partita_system::SystemError;
use std::collections::HashMap;
use std::f64::consts::TAU;

/// Distance between neighbouring samples. Scale: characteristic displacements of the body that moves most. Reason: a
/// sheet or a closed curve of singular positions that is a quarter of a radian wide is met.
pub(super) const SAMPLE_SPACING: f64 = 0.2;
/// A position nearer than this to a sample is covered by it. Scale: fraction of [`SAMPLE_SPACING`]. Reason: hexagons of samples
/// one spacing apart leave no gap.
const COVERED: f64 = 0.7;
/// A step is not taken if it leads nearer than this to a sample, before its loops are closed. Scale: fraction of
/// [`SAMPLE_SPACING`]. Reason: closing a step of one moves it by a twentieth of itself, at most by a tenth.
const FORESEEN: f64 = 0.6;
/// Samples up to this distance beyond the range have neighbours. Scale: fraction of [`SAMPLE_SPACING`]. Reason: a part of
/// a sheet in a corner of the range, which may be connected with the rest beyond it alone, is smaller than that.
const SAMPLED_BEYOND: f64 = 0.5;
/// Directions of the steps from a sample in two dimensions. Reason: one and a half times those of a hexagon.
const DIRECTIONS: usize = 9;
/// Maximum number of samples. Reason: some seconds, and a surface of fifty square turns.
const SAMPLES: usize = 60_000;
/// Samples between two checks for an interrupt by the user.
const PATIENCE: usize = 256;
/// Singular positions are sought up to this distance from a sample, along the slope of the measure. Scale: multiples of
/// [`SAMPLE_SPACING`]. Reason: each is within one of a sample; the slope may err by half.
const SOUGHT: f64 = 1.5;

/// Closing a step: one that is corrected by more than half of it leads elsewhere.
const NEAR: Rule = Rule::new(12, f64::EPSILON, tolerance::FITS)
    .contracting(tolerance::HALF_LOST * SAMPLE_SPACING, tolerance::HALF_LOST);

/// A position of the cover.
pub(super) struct Sample {
    pub q: Vec<f64>,
    /// Values of all goals.
    pub y: Vec<f64>,
    signature: Vec<f64>,
    /// The singular position that the slope of the measure points to, if it is near.
    pub towards: Option<Vec<f64>>,
    /// Whether it is within the range, or little beyond it.
    inside: bool,
    /// The sign that turns the basis of its slice into that of its branch, where the goals are oriented positively.
    pub sign: f64,
    pub place: Evaluation,
}

/// All of them.
pub(super) struct Cover {
    pub samples: Vec<Sample>,
    pub complete: bool,
}

/// Largest difference of two signatures.
pub(super) fn distance(one: &[f64], two: &[f64]) -> f64 {
    one.iter().zip(two).fold(0.0, |m: f64, (x, y)| m.max((x - y).abs()))
}

/// Samples by the cell of their free goals.
#[derive(Default)]
struct Cells(HashMap<Vec<i64>, Vec<usize>>);

impl Cells {
    fn cell(goals: &[f64]) -> Vec<i64> {
        goals.iter().map(|x| (x / (2.0 * SAMPLE_SPACING)).floor() as i64).collect()
    }

    /// Whether a sample covers this position.
    fn covers(&self, samples: &[Sample], goals: &[f64], signature: &[f64], within: f64) -> bool {
        let cell = Self::cell(goals);
        (0..3_usize.pow(cell.len() as u32)).any(|number| {
            let near: Vec<i64> =
                cell.iter().enumerate().map(|(i, x)| x + (number / 3_usize.pow(i as u32) % 3) as i64 - 1).collect();
            let own = self.0.get(&near).map_or(&[][..], Vec::as_slice);
            own.iter().any(|&i| distance(&samples[i].signature, signature) < within * SAMPLE_SPACING)
        })
    }
}

/// Samples over all that is connected with the seeds.
pub(super) fn cover(slice: &mut Slice, seeds: &[f64], watch: Watch) -> Result<Cover, AnalysisError> {
    let nq = slice.field.model.size().nq;
    let (mut samples, mut cells, mut next) = (Vec::new(), Cells::default(), 0);
    for seed in seeds.chunks_exact(nq) {
        slice.field.look(seed);
        add(slice, seed.to_vec(), None, &mut samples, &mut cells)?;
        while next < samples.len() {
            if next % PATIENCE == 0 {
                watch()?;
            }
            if samples.len() > SAMPLES {
                return Ok(Cover { samples, complete: false });
            }
            around(slice, next, &mut samples, &mut cells)?;
            next += 1;
        }
    }
    Ok(Cover { samples, complete: true })
}

/// Close q, and make a sample of it where none is near.
fn add(
    slice: &mut Slice,
    mut q: Vec<f64>,
    from: Option<(f64, &Evaluation)>,
    samples: &mut Vec<Sample>,
    cells: &mut Cells,
) -> Result<(), SystemError> {
    match slice.field.close_hard(&mut q, &NEAR) {
        Ok(closed) if closed.is_closed() => {}
        Ok(_) | Err(SystemError::NotFinite { .. }) => return Ok(()),
        Err(e) => return Err(e),
    }
    // parts in a corner of the range may be connected beyond it alone
    if !slice.is_within((1.0 + SAMPLED_BEYOND) * SAMPLE_SPACING) {
        return Ok(());
    }
    let (inside, goals, y) =
        (slice.is_within(SAMPLED_BEYOND * SAMPLE_SPACING), slice.free_goals(), slice.field.y.clone());
    let signature = slice.signature(&q);
    if cells.covers(samples, &goals, &signature, COVERED) {
        return Ok(());
    }
    let place = slice.look(&q)?;
    let orientation = slice.orientation(&place);
    let sign = from.map_or(orientation.signum(), |(sign, before)| sign * alike(&place.slice, &before.slice));
    if slice.one_branch && sign * orientation < 0.0 {
        return Ok(());
    }
    cells.0.entry(Cells::cell(&goals)).or_default().push(samples.len());
    samples.push(Sample { q, y, signature, towards: None, inside, sign, place });
    Ok(())
}

/// Steps from a sample in all directions, and where the measure is zero.
fn around(slice: &mut Slice, i: usize, samples: &mut Vec<Sample>, cells: &mut Cells) -> Result<(), SystemError> {
    let (q, y, place) = (samples[i].q.clone(), samples[i].y.clone(), samples[i].place.clone());
    let sign = samples[i].sign;
    let rates: Vec<Vec<f64>> = place.slice.iter().map(|x| slice.signature_rate(&q, x)).collect();
    slice.field.y.copy_from_slice(&y);
    slice.field.evaluate(&q)?;
    let (home, goal_rates) = (slice.free_goals(), slice.free_goal_rates(&place.slice));
    let slopes = slice.slopes(&q, &place, &place.slice)?;
    let mut change = vec![0.0; samples[i].signature.len()];
    let square = dense::dot(&slopes, &slopes);
    rates.iter().zip(&slopes).for_each(|(x, slope)| dense::axpy(-place.measure * slope / square, x, &mut change));
    if square > 0.0 && distance(&change, &vec![0.0; change.len()]) <= SOUGHT * SAMPLE_SPACING {
        samples[i].towards = Some(newton(&place.slice, place.measure, &slopes));
    }
    if !samples[i].inside {
        return Ok(());
    }
    for by in directions(&rates) {
        let (mut direction, mut change) = (vec![0.0; place.slice[0].len()], vec![0.0; change.len()]);
        for ((part, x), rate) in by.iter().zip(&place.slice).zip(&rates) {
            dense::axpy(*part, x, &mut direction);
            dense::axpy(*part, rate, &mut change);
        }
        let speed = distance(&change, &vec![0.0; change.len()]);
        if speed <= 0.0 {
            continue;
        }
        let step = SAMPLE_SPACING / speed;
        let goals: Vec<f64> =
            home.iter().zip(&goal_rates).map(|(x, rates)| x + step * dense::dot(&by, rates)).collect();
        let signature: Vec<f64> = samples[i].signature.iter().zip(&change).map(|(x, c)| x + step * c).collect();
        if cells.covers(samples, &goals, &signature, FORESEEN) {
            continue;
        }
        let mut there = q.clone();
        slice.field.y.copy_from_slice(&y);
        slice.moved(&mut there, &direction, step);
        add(slice, there, Some((sign, &place)), samples, cells)?;
    }
    Ok(())
}

/// Combinations of the motions in directions that are evenly spaced for the bodies.
fn directions(rates: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let [x, y] = rates else { return vec![vec![1.0], vec![-1.0]] };
    // Gram-Schmidt: x over |x|, and what y has across it
    let length = dense::dot(x, x).sqrt().max(f64::MIN_POSITIVE);
    let along = dense::dot(x, y) / length;
    let across = (dense::dot(y, y) - along * along).max(0.0).sqrt().max(tolerance::NULL_VALUE * length);
    let of = |i: usize| {
        let (sin, cos) = (TAU * i as f64 / DIRECTIONS as f64).sin_cos();
        vec![(cos - sin * along / across) / length, sin / across]
    };
    (0..DIRECTIONS).map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Steps in all directions move the bodies evenly, however oblique the motions are.
    #[test]
    fn directions_are_even_for_the_bodies() {
        let rates = [vec![2.0, 0.0, 0.0], vec![1.9, 0.1, 0.2]];
        let moves: Vec<Vec<f64>> = directions(&rates)
            .iter()
            .map(|by| (0..3).map(|i| by[0] * rates[0][i] + by[1] * rates[1][i]).collect())
            .collect();
        assert_eq!(moves.len(), DIRECTIONS);
        for (x, next) in moves.iter().zip(moves.iter().cycle().skip(1)) {
            assert!((dense::dot(x, x) - 1.0).abs() < 1e-12);
            assert!((dense::dot(x, next) - (TAU / DIRECTIONS as f64).cos()).abs() < 1e-12);
        }
        assert_eq!(directions(&rates[..1]), [[1.0], [-1.0]]);
    }
}
