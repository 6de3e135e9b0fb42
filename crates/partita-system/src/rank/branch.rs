//! Finite motion of a mechanism from a drawing, at a level of singular values: its kernel and its degrees of freedom.

use super::{Cut, Kernel, Motions};
use crate::manifold::follow::{self, follow, End, Pace};
use crate::manifold::truncated::Along;
use crate::reduction::largest;
use crate::system::{ConstrainedSystem, SystemError};
use partita_math::dense::Matrix;
use partita_math::factor::svd;
use partita_math::tolerance;

/// Shortest step along a path. Unit: fraction of the longest. Reason: positions of one path are
/// compared at one distance.
pub(super) const WHOLE_STEP: f64 = 0.9;
/// Length of a path: a short one does not distinguish order four from a geometric error.
const FAR: usize = 25;
/// Random directions in which paths leave the drawing, for each null direction.
const MORE: usize = 1;
/// Maximum number of paths, for drawings of many degrees of freedom.
const PATHS: usize = 24;
/// Where most ends have a larger kernel, values up to this many levels count as null too. Scale: multiples of the
/// level. Reason: near a lock values are as large as the level.
const TUBE: f64 = 100.0;
/// Half differences of probes above this are motions. Scale: fraction of the longest. Reason: near a lock they are
/// shorter.
const PROBE_MOVES: f64 = 0.25;
/// Probes that deviate from a projection by more are inconclusive. Scale: fraction of the probe. Reason: curvature
/// accounts for a twentieth of a long one.
const PROBE_BENT: f64 = 0.1;
/// Number of sums of probes that are compared with the sum of their parts.
const SUMS: usize = 2;
/// Maximum number of lengths of probes, each half the previous.
const PROBES: usize = 4;
/// Number of positions at which probes must show conclusively what moves.
const TRIED: usize = 4;
/// A path this short (in steps) is inconclusive.
const SHORTEST: usize = 3;

/// A position on a path.
#[derive(Clone, Debug)]
pub struct BranchPoint {
    /// Its path.
    pub path: usize,
    /// Steps from the drawing.
    pub steps: usize,
    /// Coordinates, closed at the level.
    pub q: Vec<f64>,
    /// Null directions there, and those up to the values near a lock.
    pub kernel: (usize, usize),
    /// Relative closure error there.
    pub closure_error: f64,
}

/// The motion of a drawing at a level.
#[derive(Clone, Debug)]
pub struct Branch {
    /// Null directions of C at generic positions of the motion, k_c.
    pub kernel: usize,
    /// Rank of the finite motions there, k_f.
    pub dof: usize,
    /// Positions on the paths.
    pub points: Vec<BranchPoint>,
    /// Whether a path ends before its length, because closing removes the motion or it leaves the null directions.
    pub ends: bool,
}

/// Receives steps from the start, the position, its closure error, and the motions from there; false ends the path.
pub type Visit<'v> = &'v mut dyn FnMut(usize, &[f64], f64, &Motions) -> bool;

/// Small irregular numbers, always the same.
fn irregular(seed: &mut u64) -> f64 {
    *seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
    (*seed >> 11) as f64 / (1u64 << 52) as f64 - 1.0
}

fn combined(motions: &[Vec<f64>], seed: &mut u64) -> Vec<f64> {
    let weights: Vec<f64> = motions.iter().map(|_| irregular(seed)).collect();
    sum(motions, &weights)
}

fn sum(motions: &[Vec<f64>], weights: &[f64]) -> Vec<f64> {
    let mut y = vec![0.0; motions.first().map_or(0, Vec::len)];
    for (motion, weight) in motions.iter().zip(weights) {
        y.iter_mut().zip(motion).for_each(|(y, x)| *y += weight * x);
    }
    y
}

fn dot(x: &[f64], y: &[f64]) -> f64 {
    x.iter().zip(y).map(|(x, y)| x * y).sum()
}

impl<S: ConstrainedSystem> Kernel<'_, S> {
    /// A direction scaled to fastest coordinate 1; `None` where there is none.
    fn unit(&self, y: &[f64]) -> Option<Vec<f64>> {
        let length = self.travel(y);
        (length.is_finite() && length > 0.0).then(|| y.iter().map(|y| y / length).collect())
    }

    /// Follow the motion from `home` along a null direction; `visit` receives each position and may end the path. True
    /// where the motion itself ends: closing removes it, or its direction leaves the null directions.
    ///
    /// # Errors
    /// Where nothing can be evaluated.
    pub fn path(
        &mut self,
        home: &[f64],
        direction: &[f64],
        cut: Cut,
        steps: usize,
        visit: Visit,
    ) -> Result<bool, SystemError> {
        let Some(direction) = self.unit(direction) else { return Ok(false) };
        let (mut q, mut taken) = (home.to_vec(), 0);
        let pace = Pace { longest: tolerance::RANK_MOVE, shortest: WHOLE_STEP * tolerance::RANK_MOVE, steps };
        self.closings.cut = cut;
        let mut curve = Along::new(&mut self.closings, f64::INFINITY);
        let length = steps as f64 * tolerance::RANK_MOVE;
        let followed = follow(&mut curve, &mut q, &direction, length, &pace, &mut |curve, at| {
            taken += 1;
            let closure_error = largest(curve.rows.scaled.phi.iter().copied());
            let goes_on = curve.free.as_ref().is_some_and(|free| visit(taken, at.q, closure_error, free));
            Ok(if goes_on { follow::Visit::On } else { follow::Visit::Stop })
        })?;
        Ok(matches!(followed.end, End::ThrownBack | End::Limit))
    }

    /// The motion of the drawing closed at `home`, by the accepted singular values. `None` where no path leads away.
    ///
    /// # Errors
    /// Where nothing can be evaluated.
    pub fn branch(&mut self, home: &[f64], cut: Cut) -> Result<Option<Branch>, SystemError> {
        let motions = self.motions(home, cut)?.motions;
        let mut seed = 1;
        let mut directions: Vec<Vec<f64>> = Vec::new();
        for motion in &motions {
            directions.push(motion.clone());
            directions.push(motion.iter().map(|x| -x).collect());
        }
        (0..MORE * motions.len()).for_each(|_| directions.push(combined(&motions, &mut seed)));
        if directions.len() > PATHS {
            directions = (0..PATHS).map(|_| combined(&motions, &mut seed)).collect();
        }
        let tube = match cut {
            Cut::Level(level) => Cut::Level(TUBE * level),
            Cut::Rank(_) => cut,
        };
        let n = self.velocities();
        let mut points: Vec<BranchPoint> = Vec::new();
        let (mut ends, mut is_end): (Vec<usize>, bool) = (Vec::new(), false);
        for (path, direction) in directions.iter().enumerate() {
            let before = points.len();
            is_end |= self.path(home, direction, cut, FAR, &mut |steps, q, closure_error, nulls| {
                // rank does not fall from a position to generic ones
                let null = (n - cut.count(&nulls.pivots)).min(motions.len());
                let kernel = (null, n - tube.count(&nulls.pivots));
                points.push(BranchPoint { path, steps, q: q.to_vec(), kernel, closure_error });
                true
            })?;
            if points.len() >= before + SHORTEST {
                ends.push(points.len() - 1);
            }
        }
        let Some(kernel) = agreed(&ends.iter().map(|&i| points[i].kernel).collect::<Vec<_>>()) else { return Ok(None) };
        let agrees = |point: &BranchPoint| point.kernel.0 <= kernel && kernel <= point.kernel.1;
        points.retain(agrees);
        let mut dof = DofCount::default();
        for point in tried(&points) {
            dof.add(self.probed(&point.q, cut)?);
            if dof.clear >= TRIED {
                break;
            }
        }
        let dof = dof.most;
        Ok((dof > 0).then_some(Branch { kernel, dof, points, ends: is_end }))
    }

    /// Number of null directions at q that are tangents of motions, and whether probes show it conclusively.
    ///
    /// On one branch probes are projected onto its tangents. Where branches cross within a probe, it is projected from
    /// one onto another: then shorter ones are tried, and a direction that is removed at any length is not a motion. A
    /// crossing that is nearer than the shortest probe is inconclusive. `None` where probes do not close.
    fn probed(&mut self, q: &[f64], cut: Cut) -> Result<Option<(usize, bool)>, SystemError> {
        let directions = mixed(&self.motions(q, cut)?.motions);
        let (mut found, mut length) = (None, tolerance::RANK_MOVE);
        for probe in 1..=PROBES {
            if let Some(kept) = self.kept(q, cut, (&directions, &directions), length)? {
                let Ok(f) = svd(&kept) else { return Ok(None) };
                let longest = f.s.first().copied().unwrap_or(0.0).max(PROBE_MOVES);
                let moves = f.s.iter().filter(|s| **s > PROBE_MOVES * longest).count();
                let dof = found.map_or(moves, |before: usize| before.min(moves));
                if is_projection(&kept) || probe == PROBES && self.is_linear(q, cut, (&directions, &kept), length)? {
                    return Ok(Some((dof, true)));
                }
                found = Some(dof);
            }
            length *= 0.5;
        }
        Ok(found.map(|dof| (dof, false)))
    }

    /// Whether the sums of probes are preserved. On one branch this is the case even where weak rows prevent it from
    /// being a projection.
    fn is_linear(
        &mut self,
        q: &[f64],
        cut: Cut,
        (directions, kept): (&[Vec<f64>], &Matrix),
        length: f64,
    ) -> Result<bool, SystemError> {
        let k = directions.len();
        let (mut seed, mut weights) = (2, Matrix::new(SUMS, k));
        for i in 0..SUMS {
            let row = weights.row_mut(i);
            row.iter_mut().for_each(|x| *x = irregular(&mut seed));
            let size = dot(row, row).sqrt();
            row.iter_mut().for_each(|x| *x /= size);
        }
        let sums: Vec<Vec<f64>> = (0..SUMS).map(|i| sum(directions, weights.row(i))).collect();
        let Some(of_sums) = self.kept(q, cut, (&sums, directions), length)? else { return Ok(false) };
        let expected = weights.matmul(kept);
        Ok(of_sums.data().iter().zip(expected.data()).all(|(x, y)| (x - y).abs() <= PROBE_BENT))
    }

    /// Half the differences of probes to both sides along unit directions, relative to the probes and by their
    /// components in an orthonormal frame: the even part of a probe is curvature. `None` where one does not close.
    fn kept(
        &mut self,
        q: &[f64],
        cut: Cut,
        (directions, frame): (&[Vec<f64>], &[Vec<f64>]),
        length: f64,
    ) -> Result<Option<Matrix>, SystemError> {
        let mut kept = Matrix::new(directions.len(), frame.len());
        for (i, direction) in directions.iter().enumerate() {
            let Some(along) = self.unit(direction) else { return Ok(None) };
            let scale = 0.5 / (length * dot(&along, &along).sqrt());
            for sign in [1.0, -1.0] {
                let by: Vec<f64> = along.iter().map(|x| sign * length * x).collect();
                let mut there = q.to_vec();
                self.step(&mut there, &by);
                let Some(closed) = self.close(&mut there, cut)? else { return Ok(None) };
                let total: Vec<f64> = by.iter().zip(&closed.moved).map(|(x, y)| sign * scale * (x + y)).collect();
                kept.row_mut(i).iter_mut().zip(frame).for_each(|(x, other)| *x += dot(&total, other));
            }
        }
        Ok(Some(kept))
    }
}

/// Whether the projected part of probes satisfies A = A², as on one branch.
fn is_projection(kept: &Matrix) -> bool {
    let mut off = kept.matmul(kept);
    off.data_mut().iter_mut().zip(kept.data()).for_each(|(x, a)| *x -= a);
    svd(&off).is_ok_and(|f| f.s.iter().all(|s| *s <= PROBE_BENT))
}

/// Number of finite motions: that of the positions with a clear rank, and the largest over several branches.
#[derive(Default)]
struct DofCount {
    most: usize,
    clear: usize,
}

impl DofCount {
    fn add(&mut self, probed: Option<(usize, bool)>) {
        let Some((dof, is_clear)) = probed else { return };
        self.most = match (is_clear, self.clear) {
            (false, 0) if self.most > 0 => self.most.min(dof),
            (false, 1..) => self.most,
            (true, 1..) => self.most.max(dof),
            _ => dof,
        };
        self.clear += usize::from(is_clear);
    }
}

/// Positions at which probes are tried: the ends of the paths, then points half-way.
fn tried(points: &[BranchPoint]) -> impl Iterator<Item = &BranchPoint> {
    let is_last = |i: usize| points.get(i + 1).is_none_or(|next| next.path != points[i].path);
    let ends = (0..points.len()).filter(move |&i| is_last(i) && points[i].steps >= SHORTEST);
    let halfway = points.iter().filter(|x| x.steps == FAR / 2);
    ends.map(|i| &points[i]).chain(halfway)
}

/// The same space spanned by directions that each mix all of it: along the axes of branches that cross, each would
/// appear movable.
fn mixed(motions: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let mut seed = 1;
    let weights: Vec<f64> = motions.iter().map(|_| irregular(&mut seed)).collect();
    let twice: Vec<f64> = weights.iter().map(|x| 2.0 * x / dot(&weights, &weights)).collect();
    let sum = sum(motions, &twice);
    let reflected =
        |(weight, motion): (&f64, &Vec<f64>)| motion.iter().zip(&sum).map(|(x, y)| x - weight * y).collect();
    weights.iter().zip(motions).map(reflected).collect()
}

/// The kernel on which most ends agree; of two the larger.
fn agreed(ends: &[(usize, usize)]) -> Option<usize> {
    let of = |k: usize| ends.iter().filter(|x| x.0 <= k && k <= x.1).count();
    let mut kernels: Vec<usize> = ends.iter().map(|x| x.0).collect();
    kernels.sort_unstable();
    kernels.into_iter().max_by_key(|&k| (of(k), k))
}
