//! Possible motions of a mechanism from a singular position, to second order, each tested by a finite displacement.
//!
//! Rates u in the kernel of C are motions to first order alone. Each self-stress n, `C^T n = 0`, requires to second
//! order that `Q_n(u) = n^T b(D^T u)` vanish (C2): forms that vanish belong to redundant rows, a definite one leaves no
//! motion at all, the others leave a cone of directions. Along each direction of it the mechanism is moved a few
//! degrees and closed there with all its rows: a direction that does not close is not a motion, and the rank there is
//! that of the branch.

pub mod branch_directions;

use crate::manifold::scaled;
use crate::manifold::truncated::{Along, Cut, Truncated};
use crate::manifold::{leap, End, Visit};
use crate::system::{ConstrainedSystem, SystemError};
use partita_math::dense::Matrix;
use partita_math::factor::{least_squares_min_norm, svd, svd_full, symmetric_eigen};
use partita_math::formatted;
use partita_math::tolerance;

/// Number of velocities above which no analysis is made: dense decompositions would take minutes.
const LARGEST: usize = 200;
/// Singular values of C below this are null where branches meet: sines whose squares are [`tolerance::REDUNDANT`].
fn null_sine() -> f64 {
    tolerance::REDUNDANT.sqrt()
}
/// Move along a branch by which it is verified. Unit: characteristic displacement of the fastest velocity. Reason: some
/// three degrees; rows lost here are open by the square of it elsewhere, and a lost rank has come back far above
/// [`null_sine`].
const BRANCH_MOVE: f64 = 0.05;
/// Rates that differ by less are those of one branch. Scale: fraction of the fastest. Reason: numbers as refusals print
/// them are off by half of it, and branches are farther apart.
const SAME_RATES: f64 = 2e-3;
/// Starts of the search for directions, and the most lines they may find: more are taken for a continuum.
const STARTS: usize = 48;
const LINES: usize = 8;

/// One branch, in both senses where it has two.
#[derive(Clone, Debug)]
pub struct Branch {
    /// Velocities along it, the fastest of them 1 in its characteristic displacement.
    pub rates: Vec<f64>,
    /// A closed position a few degrees along it.
    pub beside: Vec<f64>,
    /// Degrees of freedom there.
    pub mobility: usize,
}

/// A singular position.
#[derive(Clone, Debug)]
pub struct Branching {
    /// Degrees of freedom here, those of an instant.
    pub here: usize,
    /// Branches on which a few degrees were moved. Empty: none was found.
    pub branches: Vec<Branch>,
    /// More directions than can be listed: these branches are samples.
    pub many: bool,
    /// Rates of one instant that a form of one sign forbids to second order: they only seem mobile. Certain.
    pub seeming: usize,
}

impl Branching {
    /// Degrees of freedom next to the position; 0 where nothing moves.
    pub fn beside(&self) -> usize {
        self.branches.iter().map(|b| b.mobility).max().unwrap_or(0)
    }
}

impl Branching {
    /// A structure, mobile for an instant only: certain.
    pub fn structure(&self) -> bool {
        self.seeming == self.here
    }
}

/// Rows over their sizes, velocities over their characteristic displacements.
struct Scaled<'s, S: ConstrainedSystem> {
    system: &'s S,
    /// The rows under consideration.
    rows: Vec<usize>,
    scratch: S::Scratch,
    phi: Vec<f64>,
    c: Vec<f64>,
    a: Vec<f64>,
    sizes: Vec<f64>,
    displacement: Vec<f64>,
}

/// Rank by singular values; none where they leave no gap.
fn rank_of(s: &[f64]) -> Option<usize> {
    let rank = s.iter().filter(|&&x| x > null_sine()).count();
    let kept = if rank > 0 { s[rank - 1] } else { 1.0 };
    s.get(rank).is_none_or(|x| x * x * tolerance::RANK_GAP < kept * kept).then_some(rank)
}

impl<'s, S: ConstrainedSystem> Scaled<'s, S> {
    fn new(system: &'s S, t: f64, q: &[f64], drives: bool) -> Result<Self, SystemError> {
        let (size, nnz) = (system.size(), system.pattern().nnz());
        let mut x = Self {
            system,
            rows: (0..size.rows).filter(|&i| drives || !system.structure().rows[i].is_drive).collect(),
            scratch: system.scratch(),
            phi: vec![0.0; size.holonomic],
            c: vec![0.0; nnz],
            a: vec![0.0; size.rows],
            sizes: vec![1.0; size.rows],
            displacement: system.structure().displacements().collect(),
        };
        x.position(t, q)?;
        let pattern = system.pattern();
        for i in 0..size.rows {
            let norm =
                pattern.row(i).map(|e| (x.c[e] * x.displacement[pattern.col_idx[e]]).powi(2)).sum::<f64>().sqrt();
            let known = system.structure().rows[i].displacement.filter(|r| *r > 0.0);
            x.sizes[i] = known.unwrap_or(if norm > 0.0 { norm } else { 1.0 });
        }
        Ok(x)
    }

    fn position(&mut self, t: f64, q: &[f64]) -> Result<(), SystemError> {
        self.system.position(t, q, &mut self.scratch, &mut self.phi, &mut self.c, &mut self.a)
    }

    /// C at the position last evaluated.
    fn jacobian(&self) -> Matrix {
        let pattern = self.system.pattern();
        let mut m = Matrix::new(self.rows.len(), pattern.cols);
        for (n, &i) in self.rows.iter().enumerate() {
            for e in pattern.row(i) {
                let j = pattern.col_idx[e];
                m[(n, j)] = self.c[e] * self.displacement[j] / self.sizes[i];
            }
        }
        m
    }

    /// The residual there.
    fn violation(&self) -> Vec<f64> {
        self.rows.iter().map(|&i| self.phi[i] / self.sizes[i]).collect()
    }

    /// The part of b that is quadratic in the velocities `w` (in characteristic displacements).
    fn bend(&mut self, t: f64, q: &[f64], w: &[f64]) -> Result<Vec<f64>, SystemError> {
        let mut sum = vec![0.0; self.sizes.len()];
        let mut b = sum.clone();
        for (sign, weight) in [(1.0, 0.5), (-1.0, 0.5), (0.0, -1.0)] {
            let v: Vec<f64> = w.iter().zip(&self.displacement).map(|(w, r)| sign * w * r).collect();
            self.system.velocity(t, q, &v, &mut self.scratch, &mut b)?;
            sum.iter_mut().zip(&b).for_each(|(s, b)| *s += weight * b);
        }
        Ok(self.rows.iter().map(|&i| sum[i] / self.sizes[i]).collect())
    }
}

/// The position [`BRANCH_MOVE`] along `w`, closed by all rows under consideration; none where it does not close near
/// there.
fn moved<S: ConstrainedSystem>(x: &Scaled<S>, t: f64, q: &[f64], w: &[f64]) -> Result<Option<Vec<f64>>, SystemError> {
    let scaled = scaled::Scaled::new(x.system, t, q, &[])?;
    let mut rows = Truncated::new(scaled, t, Cut::Level(null_sine()));
    rows.scaled.idle.iter_mut().enumerate().for_each(|(i, idle)| *idle = !x.rows.contains(&i));
    let mut there = q.to_vec();
    let end = leap(
        &mut Along::new(&mut rows, tolerance::CLOSED),
        &mut there,
        w,
        (0.0, BRANCH_MOVE),
        BRANCH_MOVE,
        &mut |_, _| Ok(Visit::On),
    )?;
    Ok((end == End::There).then_some(there))
}

/// Quadratic forms on k rates, each k x k and symmetric.
struct Forms(Vec<Matrix>);

impl Forms {
    /// Independent ones among those of all self-stresses: combinations that are not flat.
    fn independent(all: &[Matrix], k: usize) -> Option<Self> {
        let mut rows = Matrix::new(all.len(), k * k);
        for (i, f) in all.iter().enumerate() {
            rows.row_mut(i).copy_from_slice(f.data());
        }
        let f = svd(&rows).ok()?;
        let rank = f.s.iter().filter(|&&s| s > tolerance::DEPENDENT).count();
        let form = |r: usize| {
            let column: Vec<f64> = (0..k * k).map(|e| f.v[(e, r)]).collect();
            let m = Matrix::from_vec(k, k, column);
            let mut even = Matrix::new(k, k);
            (0..k).for_each(|i| (0..k).for_each(|j| even[(i, j)] = 0.5 * (m[(i, j)] + m[(j, i)])));
            even
        };
        Some(Self((0..rank).map(form).collect()))
    }

    /// A direction of the cone near `u` by Gauss-Newton steps on the unit sphere.
    fn zero_near(&self, mut u: Vec<f64>) -> Option<Vec<f64>> {
        let k = u.len();
        for _ in 0..60 {
            let length = u.iter().map(|x| x * x).sum::<f64>().sqrt();
            if length.is_nan() || length < tolerance::NEGLIGIBLE {
                return None;
            }
            u.iter_mut().for_each(|x| *x /= length);
            let (mut slopes, mut values) = (Matrix::new(self.0.len(), k), Vec::new());
            for (i, f) in self.0.iter().enumerate() {
                let fu = f.matvec(&u);
                values.push(fu.iter().zip(&u).map(|(a, b)| a * b).sum::<f64>());
                slopes.row_mut(i).iter_mut().zip(&fu).for_each(|(s, x)| *s = 2.0 * x);
            }
            if values.iter().all(|x| x.abs() < tolerance::SUM_ROUNDING) {
                return Some(u);
            }
            let (back, _) = least_squares_min_norm(&slopes, &values, tolerance::NULL_VALUE).ok()?;
            // far off a step may be no longer than the direction itself
            let long = back.iter().map(|x| x * x).sum::<f64>().sqrt();
            let part = (0.5 / long).min(1.0);
            u.iter_mut().zip(&back).for_each(|(x, y)| *x -= part * y);
        }
        // double lines are approached by halves
        let vanishes = |f: &Matrix| {
            f.matvec(&u).iter().zip(&u).map(|(a, b)| a * b).sum::<f64>().abs() < tolerance::SINGULAR_ROUNDING
        };
        self.0.iter().all(vanishes).then_some(u)
    }

    /// Lines of the cone that irregular starts lead to, up to one more than can be listed.
    fn lines(&self, k: usize) -> Vec<Vec<f64>> {
        let mut found: Vec<Vec<f64>> = Vec::new();
        for n in 0..STARTS {
            let start =
                (0..k).map(|j| (1.0 + 1.7 * n as f64 + 2.3 * j as f64 * (1.0 + n as f64).sqrt()).sin()).collect();
            let Some(u) = self.zero_near(start) else { continue };
            // 1 - cos = ½ |difference|² of unit vectors
            let apart = |x: &Vec<f64>| 2.0 * (1.0 - x.iter().zip(&u).map(|(a, b)| a * b).sum::<f64>().abs());
            let same = |x: &Vec<f64>| apart(x) < SAME_RATES * SAME_RATES;
            if !found.iter().any(same) {
                found.push(u);
            }
            if found.len() > LINES {
                break;
            }
        }
        found
    }
}

/// Motions from a closed position that may be singular; none where it is not, where rows have no positions to close,
/// where the rank is not clear or the mechanism too large to look at.
///
/// `drives`: those hold still, too; else they are released. Cost: dense decompositions of C, some twenty for each
/// branch.
///
/// # Errors
/// Where the system cannot be evaluated here.
pub fn look<S: ConstrainedSystem>(
    system: &S,
    t: f64,
    q: &[f64],
    drives: bool,
) -> Result<Option<Branching>, SystemError> {
    let size = system.size();
    if size.nv > LARGEST || size.rows > 5 * LARGEST || size.rows != size.holonomic || size.rows == 0 {
        return Ok(None);
    }
    let mut x = Scaled::new(system, t, q, drives)?;
    let rows = x.rows.len();
    if x.violation().iter().any(|x| x.abs() > tolerance::OPEN) {
        return Ok(None);
    }
    let Ok(f) = svd_full(&x.jacobian()) else { return Ok(None) };
    let Some(rank) = rank_of(&f.s) else { return Ok(None) };
    let (n, k) = (size.nv, size.nv - rank);
    if k == 0 || rank == rows {
        return Ok(None);
    }
    let column = |m: &Matrix, j: usize| -> Vec<f64> { (0..m.rows()).map(|i| m[(i, j)]).collect() };
    let kernel: Vec<Vec<f64>> = (rank..n).map(|j| column(&f.v, j)).collect();
    let stresses: Vec<Vec<f64>> = (rank..rows).map(|j| column(&f.u, j)).collect();
    let mut forms = vec![Matrix::new(k, k); stresses.len()];
    let mut squares: Vec<Vec<f64>> = Vec::with_capacity(k);
    for i in 0..k {
        for j in 0..=i {
            let w: Vec<f64> = match i == j {
                true => kernel[i].clone(),
                false => kernel[i].iter().zip(&kernel[j]).map(|(a, b)| a + b).collect(),
            };
            squares.push(x.bend(t, q, &w)?);
        }
    }
    let entry = |i: usize, j: usize| i * (i + 1) / 2 + j;
    for (form, stress) in forms.iter_mut().zip(&stresses) {
        let of = |b: &[f64]| stress.iter().zip(b).map(|(n, b)| n * b).sum::<f64>();
        for i in 0..k {
            for j in 0..=i {
                let both = of(&squares[entry(i, j)]);
                let value = match i == j {
                    true => both,
                    false => 0.5 * (both - of(&squares[entry(i, i)]) - of(&squares[entry(j, j)])),
                };
                (form[(i, j)], form[(j, i)]) = (value, value);
            }
        }
    }
    let Some(forms) = Forms::independent(&forms, k) else { return Ok(None) };
    if forms.0.is_empty() {
        return Ok(None);
    }
    let mut found = Branching { here: k, branches: Vec::new(), many: false, seeming: 0 };
    let mut one_sign = None;
    if let [form] = forms.0.as_slice() {
        let Ok((values, vectors)) = symmetric_eigen(form) else { return Ok(None) };
        let largest = values.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
        let significant = |x: f64| x.abs() > tolerance::TAKES_PART * largest;
        let mut signs = values.iter().filter(|x| significant(**x)).map(|x| x.signum());
        let first = signs.next();
        if signs.all(|sign| Some(sign) == first) {
            let free: Vec<Vec<f64>> =
                (0..k).filter(|&j| !significant(values[j])).map(|j| column(&vectors, j)).collect();
            found.seeming = k - free.len();
            one_sign = Some(free);
        }
    }
    let all_free = one_sign.as_ref().map(Vec::len);
    let lines = one_sign.unwrap_or_else(|| forms.lines(k));
    found.many = all_free.is_none() && lines.len() > LINES;
    for u in lines.iter().take(LINES) {
        let mut w = vec![0.0; n];
        for (u, d) in u.iter().zip(&kernel) {
            w.iter_mut().zip(d).for_each(|(w, d)| *w += u * d);
        }
        let (fastest, ahead) = w.iter().fold((0.0, 1.0), |m: (f64, f64), x| {
            // of several equally fast ones the first moves forward
            if x.abs() > m.0 * (1.0 + tolerance::TIE) {
                (x.abs(), x.signum())
            } else {
                m
            }
        });
        w.iter_mut().for_each(|x| *x *= ahead / fastest);
        let there = match moved(&x, t, q, &w) {
            Ok(Some(there)) => Some(there),
            _ => {
                w.iter_mut().for_each(|x| *x = -*x);
                moved(&x, t, q, &w).unwrap_or(None)
            }
        };
        let Some(beside) = there else { continue };
        x.position(t, &beside)?;
        let Ok(f) = svd(&x.jacobian()) else { continue };
        let Some(rank) = rank_of(&f.s) else { continue };
        let rates = w
            .iter()
            .zip(&x.displacement)
            .map(|(w, r)| if w.abs() < tolerance::NEGLIGIBLE { 0.0 } else { w * r })
            .collect();
        found.branches.push(Branch { rates, beside, mobility: all_free.unwrap_or(n - rank) });
    }
    if all_free.is_some_and(|free| found.branches.len() < free.min(LINES)) {
        found.branches.clear(); // what higher orders forbid is not known by its number
    }
    Ok(Some(found))
}

/// Values of the moving coordinates a few degrees along a branch: a guess for an assembly on it.
pub fn guess<S: ConstrainedSystem>(system: &S, q: &[f64], branch: &Branch) -> Vec<(String, f64)> {
    let at = |v: usize| (0..q.len()).find(|&c| system.structure().coordinates[c].velocity == Some(v));
    let moved = |(v, c): (usize, usize)| {
        let (from, to) = (q[c], branch.beside[c]);
        ((to - from).abs() > tolerance::TAKES_PART * system.structure().displacement(v))
            .then(|| (system.structure().velocity_name(v), to))
    };
    (0..system.size().nv).filter_map(|v| at(v).map(|c| (v, c))).filter_map(moved).collect()
}

/// The rates along one branch of all coordinates that move on any branch: a rate of zero distinguishes branches as
/// well.
pub fn rates<S: ConstrainedSystem>(system: &S, branch: &Branch, all: &[Branch]) -> Vec<(String, f64)> {
    let goes = |i: usize| all.iter().chain([branch]).any(|b| b.rates[i] != 0.0);
    let moving = branch.rates.iter().enumerate().filter(|x| goes(x.0));
    moving.map(|(i, &rate)| (system.structure().velocity_name(i), rate)).collect()
}

/// Number of coordinates written out; beyond it the message refers to the report.
const WRITTEN: usize = 6;

/// The possible motions from here, as the end of a sentence; none where they are unknown.
///
/// # Errors
/// Where the system cannot be evaluated here.
pub fn words<S: ConstrainedSystem>(system: &S, t: f64, q: &[f64]) -> Result<Option<String>, SystemError> {
    if let Some(found) = look(system, t, q, false)? {
        return Ok(Some(of_joints(system, q, &found)));
    }
    let rows = system.size().rows;
    let drives: Vec<usize> = (0..rows).filter(|&i| system.structure().rows[i].is_drive).collect();
    if drives.is_empty() {
        return Ok(None);
    }
    Ok(look(system, t, q, true)?.filter(Branching::structure).map(|_| {
        let names: Vec<String> =
            drives.iter().take(WRITTEN).map(|&i| system.structure().rows[i].owner.to_string()).collect();
        format!(
            "a dead centre: {} does not determine here in which direction the joints continue, although the joints \
             alone could move; start a little away from it, with a joint bent by a few degrees and the drive \
             starting there, or drive a joint that is not at its dead centre",
            names.join(" and ")
        )
    }))
}

fn degrees(k: usize) -> String {
    format!("{k} degree{} of freedom", if k == 1 { "" } else { "s" })
}

/// The possible motions of the joints alone, drives released, from here.
pub fn of_joints<S: ConstrainedSystem>(system: &S, q: &[f64], found: &Branching) -> String {
    let here = degrees(found.here);
    if found.structure() {
        return format!(
            "it appears to have {here} here, but the mobility is instantaneous: to second order its joints lock it, \
             so it is a structure that amplifies play; change a length or a joint"
        );
    }
    if found.branches.is_empty() {
        return format!(
            "it appears to have {here} here, but no branch was found on which it moves by a few degrees: its \
             mobility may be instantaneous; change a length or a joint, or start a little away from this position"
        );
    }
    if found.seeming > 0 {
        return format!(
            "it appears to have {here} here, {} of them instantaneous: to second order its joints lock that part, \
             which is a structure that amplifies play; change a length or a joint",
            found.seeming
        );
    }
    let line = |(n, b): (usize, &Branch)| {
        let list = |x: &[(String, f64)]| -> String {
            x.iter().map(|(name, x)| format!("\"{name}\": {}", formatted(*x))).collect::<Vec<_>>().join(", ")
        };
        let (rates, guess) = (rates(system, b, &found.branches), guess(system, q, b));
        match rates.len().max(guess.len()) <= WRITTEN {
            true => format!("rates {{{}}}, reached by assemble(guess={{{}}})", list(&rates), list(&guess)),
            false => format!("rates and guess in report().to_dict()[\"singular\"][\"branches\"][{n}]"),
        }
    };
    let branches: Vec<String> = found.branches.iter().enumerate().take(BRANCHES_LISTED).map(line).collect();
    let meet = match (found.many, found.branches.len()) {
        (true, _) => "more branches meet than can be listed, such as".into(),
        (false, 1) => "one branch continues".into(),
        (false, n) if n > BRANCHES_LISTED => format!("{n} branches meet, such as"),
        (false, n) => format!("{n} branches meet"),
    };
    format!(
        "the mechanism has {here} here and {} next to it, where {meet}: {}; start a little away from it, with the joints bent \
         by a few degrees onto the branch you want",
        found.beside(),
        branches.join("; or ")
    )
}

/// Branches written out.
const BRANCHES_LISTED: usize = 4;
