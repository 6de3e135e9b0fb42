//! Levels of singular values: how a drawing fits along finite motions, and which of its conditions count.      (T1)

use super::change::{largest, Change, OWN};
use super::{coarsest, Drawing, Wanted, LARGEST_CHANGE, WEAK_CONDITION};
use crate::model::Model;
use crate::spec::Joint;
use partita_math::sorting::sort_by;
use partita_math::tolerance;
use partita_system::prelude::*;
use partita_system::rank::{Branch, Cut, Kernel};
use partita_system::SystemError;

/// Finer levels of singular values. Unit: singular values in natural scales. Reason: two digits apart.
const FINER_LEVELS: [f64; 2] = [1e-5, 1e-7];
/// The drawing of a block may have this closure error for a decision to be meaningful. Scale: lengths of its bodies.
/// Reason: a drawing with a larger error shows another assembly.
const NEARLY_DRAWN: f64 = 0.5;
/// Number of generic positions that are examined for weak conditions.
const ASKED: usize = 5;
/// Steps of the path on which a change is checked: one radian.
const CHECKED: usize = 10;

/// The drawing at one level.
pub(super) struct Fit {
    pub(super) dof: usize,
    pub(super) kernel: usize,
    /// Change of the frames; none where the drawing is exact.
    pub(super) change: Option<Vec<f64>>,
    pub(super) most: f64,
    /// Length of which the displacements of the change are fractions.
    pub(super) length: f64,
    pub(super) joints: Vec<Joint>,
    pub(super) folds: bool,
    /// Whether it is constrained by conditions that are weak at generic positions too.
    pub(super) weak: bool,
    /// It would fit by a change of couplings within the tolerance, which is not sought: the row with the largest
    /// closure error.
    pub(super) ambiguous: Option<usize>,
}

/// Null directions of a drawing at the finest and the coarsest level.
pub(super) struct NullDirections {
    pub(super) fine: usize,
    pub(super) coarse: usize,
    /// Degrees of freedom where all conditions are independent: then the drawing moves without repair.
    pub(super) regular: Option<usize>,
    /// Those of the whole, if it is not attached.
    pub(super) afloat: usize,
}

impl Drawing {
    /// The fits at the levels, coarsest first, and the null directions of the drawing. `None` where it does not close.
    pub(super) fn levels(
        &self,
        own: usize,
        (tolerance, pose): Wanted,
    ) -> Result<Option<(Option<Fit>, NullDirections)>, SystemError> {
        let near = Cut::Level(coarsest(tolerance));
        let mut home = self.model.initial();
        let closed = Kernel::new(&self.model, 0.0).close(&mut home, near)?;
        // a drawing that closes with opposed axes is another mechanism
        let closure_error = closed.filter(|_| self.model.turned_over(&home).is_empty()).map(|x| x.closure_error);
        let there = if closure_error.is_none_or(|x| x > tolerance) { pose() } else { None };
        if let Some(pose) = there {
            // a drawing that no change within the tolerance closes here closes elsewhere: then lengths are those there.
            // Where it does not close either, a slide may have moved far, which would raise the tolerance: none is
            // longer than drawn
            let mut q = self.model.coordinates_in(pose);
            let there = self.model.length_at(&q);
            let closed = Kernel::new(&self.model, 0.0).close(&mut q.clone(), Cut::Level(tolerance::NULL_VALUE))?;
            let length = match closed.is_some_and(|x| x.closure_error <= tolerance::CLOSED_IN_RUN) {
                true => there,
                false => there.map(|x| x.min(self.length)),
            };
            let there = Self::new((*self.model.spec).clone(), self.model.functions(), length, self.model.is_planar());
            if let Some(there) = there.filter(|x| x.model.is_planar() == self.model.is_planar()) {
                let closed = Kernel::new(&there.model, 0.0).close(&mut q, near)?;
                let fits = there.model.turned_over(&q).is_empty();
                if fits
                    && closed.is_some_and(|x| closure_error.is_none_or(|closure_error| x.closure_error < closure_error))
                {
                    return there.levels_at(q, own, tolerance);
                }
            }
        }
        if closure_error.is_none_or(|closure_error| closure_error > NEARLY_DRAWN) {
            return Ok(None);
        }
        self.levels_at(home, own, tolerance)
    }

    /// Decide at a position that is closed as far as possible.
    fn levels_at(
        &self,
        home: Vec<f64>,
        afloat: usize,
        tolerance: f64,
    ) -> Result<Option<(Option<Fit>, NullDirections)>, SystemError> {
        let coarsest = coarsest(tolerance);
        let mut kernel = Kernel::new(&self.model, 0.0);
        let n = self.model.size().nv;
        let values = kernel.values(&home)?;
        let null = |level: f64| n - Cut::Level(level).count(&values);
        let counted = n.saturating_sub(kernel.rows.len());
        let fine = null(tolerance::NULL_VALUE);
        let seen =
            NullDirections { fine, coarse: null(coarsest), regular: (fine == counted).then_some(counted), afloat };
        if seen.coarse == 0 || seen.coarse == counted {
            let fit = Fit {
                dof: seen.coarse,
                kernel: seen.coarse,
                change: None,
                most: 0.0,
                length: self.length,
                joints: self.model.spec.joints.clone(),
                folds: false,
                weak: false,
                ambiguous: None,
            };
            return Ok(Some(((seen.coarse > 0).then_some(fit), seen)));
        }
        let mut levels = vec![coarsest];
        levels.extend(FINER_LEVELS);
        levels.retain(|x| *x <= coarsest);
        if seen.fine == seen.coarse {
            let finest = levels.pop().unwrap_or(coarsest);
            let fit = self.at_level(&home, finest, (tolerance, &seen))?;
            if let Some(fit) = fit.filter(|x| x.change.is_none() && x.dof == seen.coarse) {
                return Ok(Some((Some(fit), seen)));
            }
            levels.push(finest);
        }
        // this level alone returns a lock of order four to where closure errors are rounding
        levels.push(tolerance::NULL_VALUE);
        let mut fits: Vec<Fit> = Vec::new();
        for (i, &level) in levels.iter().enumerate() {
            let next = levels.get(i + 1).map_or(seen.fine, |x| null(*x));
            let Some(fit) = self.at_level(&home, level, (tolerance, &seen))? else { continue };
            let as_drawn = fit.change.is_none() && fit.ambiguous.is_none();
            let ends = fit.dof >= next && (as_drawn || seen.fine < fit.dof);
            fits.push(fit);
            if ends {
                break;
            }
        }
        Ok(Some((chosen(fits), seen)))
    }

    /// The drawing at this level: a motion, and the change by which it fits. None where there is none.
    fn at_level(
        &self,
        home: &[f64],
        level: f64,
        (tolerance, seen): (f64, &NullDirections),
    ) -> Result<Option<Fit>, SystemError> {
        if self.is_abandoned() {
            return Ok(None);
        }
        let cut = Cut::Level(level);
        let mut there = home.to_vec();
        let mut kernel = Kernel::new(&self.model, 0.0);
        if kernel.close(&mut there, cut)?.is_none() {
            return Ok(None);
        }
        let Some(branch) = kernel.branch(&there, cut)? else { return Ok(None) };
        let (weak, exact) = self.conditions_along(&mut kernel, &branch)?;
        let fit = |change: Option<Vec<f64>>, joints: &[Joint]| Fit {
            weak,
            dof: branch.dof,
            kernel: branch.kernel,
            most: change.as_deref().map_or(0.0, largest),
            length: self.length,
            folds: change.as_deref().is_some_and(|x| self.folds(x)),
            change,
            joints: joints.to_vec(),
            ambiguous: None,
        };
        let closure_error = branch.points.iter().fold(0.0, |m: f64, x| m.max(x.closure_error));
        let unlike = self.alike_too(&vec![0.0; OWN * self.model.spec.joints.len()], &there, tolerance);
        // a motion of the drawing itself needs no change, however similar its axes are; the closure error of an exact
        // drawing is rounding, and a smaller geometric error shows in its null directions
        let exact = exact && closure_error <= tolerance::SUM_ROUNDING;
        let moves_as_drawn = exact || seen.regular.is_some_and(|k| branch.dof <= k);
        if closure_error < tolerance::FITS && (unlike.is_none() || moves_as_drawn) {
            return Ok(Some(fit(None, &self.model.spec.joints)));
        }
        if !self.model.spec.couplings.is_empty() || branch.dof < branch.kernel {
            // conditions have no frames that could be moved, and no slope removes a lock of higher order
            let found = || fit(None, &self.model.spec.joints);
            if closure_error < tolerance::FITS {
                return Ok(Some(found()));
            }
            // a closure error within the limits of a whole run is judged there
            let row = match closure_error > tolerance::CLOSED_IN_RUN {
                true => self.left_open(&mut kernel, (&branch, closure_error), tolerance, seen)?,
                false => None,
            };
            return Ok(row.map(|row| Fit { most: closure_error, ambiguous: Some(row), ..found() }));
        }
        let nothing = vec![0.0; OWN * self.model.spec.joints.len()];
        let plain = match closure_error < tolerance::FITS {
            true => None,
            false => self.change(&branch.points, branch.kernel, (&nothing, &[]), tolerance)?,
        };
        let begun = plain.as_ref().map_or(nothing.as_slice(), |x| &x.numbers);
        let alike = self.alike_too(begun, &there, tolerance);
        let small =
            |x: &Change| largest(&x.numbers) <= LARGEST_CHANGE * tolerance && !self.folds_all(&x.numbers, tolerance);
        let with = match &alike {
            // the closure error had a double root, or none was found
            Some((numbers, kept, off)) if plain.as_ref().is_none_or(|x| x.is_double(*off)) => {
                self.change(&branch.points, branch.kernel, (numbers, kept), tolerance)?.filter(small)
            }
            _ => None,
        };
        let beyond = |x: &Change| largest(&x.numbers) > LARGEST_CHANGE * tolerance;
        let needs_more = plain.as_ref().is_some_and(beyond);
        for change in [with, plain.filter(small)].into_iter().flatten() {
            let Some(changed) = self.changed(&change.numbers) else { continue };
            if changed.goes(&there, &branch)? {
                return Ok(Some(fit(Some(change.numbers), &changed.model.spec.joints)));
            }
        }
        if closure_error < tolerance::FITS {
            return Ok(Some(fit(None, &self.model.spec.joints)));
        }
        // a motion that opens by less than the tolerance, and no change by which it closes: not what was intended as
        // drawn, and not repaired
        let row = match needs_more {
            true => None,
            false => self.left_open(&mut kernel, (&branch, closure_error), tolerance, seen)?,
        };
        let joints = &self.model.spec.joints;
        Ok(row.map(|row| Fit { most: closure_error, ambiguous: Some(row), ..fit(None, joints) }))
    }

    /// The row with the largest closure error along a motion that opens the drawing by less than the tolerance; none
    /// where it opens it by more, or the drawing as it is decides.
    fn left_open(
        &self,
        kernel: &mut Kernel<Model>,
        (branch, closure_error): (&Branch, f64),
        tolerance: f64,
        seen: &NullDirections,
    ) -> Result<Option<usize>, SystemError> {
        let within = closure_error <= LARGEST_CHANGE * tolerance;
        // independent conditions that leave a motion are accepted, however weak
        // and a motion that ends on the way is no finite one: the conditions oppose it as drawn
        let undecided = within && !branch.ends && seen.regular.is_none_or(|k| k <= seen.afloat);
        let far = branch.points.iter().filter(|x| x.steps >= CHECKED);
        let far = far.max_by(|a, b| a.closure_error.total_cmp(&b.closure_error));
        match far.filter(|_| undecided && branch.dof == branch.kernel) {
            Some(point) => self.most_open(kernel, &point.q).map(Some),
            None => Ok(None),
        }
    }

    /// The coupling whose row has the largest closure error at q; where there are none, the joint.
    fn most_open(&self, kernel: &mut Kernel<Model>, q: &[f64]) -> Result<usize, SystemError> {
        kernel.closure_error(q)?;
        let closure_error = |k: usize| kernel.raw_phi()[kernel.rows[k]].abs() / kernel.sizes[k];
        let is_coupling = |k: usize| self.model.joint_of_row(kernel.rows[k]).is_none();
        let most = (0..kernel.rows.len())
            .max_by(|&a, &b| is_coupling(a).cmp(&is_coupling(b)).then(closure_error(a).total_cmp(&closure_error(b))));
        Ok(most.map_or(0, |k| kernel.rows[k]))
    }

    /// Whether further values besides the null ones are small at most of some generic positions, and whether the null
    /// ones vanish to round-off at all of them, as in an exact drawing.
    fn conditions_along(&self, kernel: &mut Kernel<Model>, branch: &Branch) -> Result<(bool, bool), SystemError> {
        let n = self.model.size().nv;
        let (mut weak, mut exact, mut asked) = (0, 0, 0);
        for point in branch.points.iter().step_by((branch.points.len() / ASKED).max(1)).take(ASKED) {
            let values = kernel.values(&point.q)?;
            let small = |level: f64| n - Cut::Level(level).count(&values);
            weak += usize::from(small(WEAK_CONDITION) > branch.kernel);
            exact += usize::from(small(tolerance::NULL_VALUE) >= branch.kernel);
            asked += 1;
        }
        Ok((2 * weak > asked, exact == asked))
    }

    /// Whether this drawing, with its loop closures as given, follows all its motions with the kernel of the branch.
    fn goes(&self, home: &[f64], branch: &Branch) -> Result<bool, SystemError> {
        let cut = Cut::Rank(self.model.size().nv - branch.kernel);
        let mut kernel = Kernel::new(&self.model, 0.0);
        let mut there = home.to_vec();
        let Some(point) = branch.points.get(branch.points.len() / 2) else { return Ok(false) };
        if kernel.close(&mut there, cut)?.is_none_or(|x| x.closure_error > tolerance::FITS) {
            there.clone_from(&point.q);
            if kernel.close(&mut there, cut)?.is_none_or(|x| x.closure_error > tolerance::FITS) {
                return Ok(false);
            }
        }
        let (mut closure_error, mut count) = (0.0f64, 0);
        for motion in kernel.motions(&there, cut)?.motions {
            for sign in [1.0, -1.0] {
                let along: Vec<f64> = motion.iter().map(|x| sign * x).collect();
                kernel.path(&there, &along, cut, CHECKED, &mut |_, _, off, _| {
                    closure_error = closure_error.max(off);
                    count += 1;
                    closure_error <= tolerance::FITS
                })?;
            }
        }
        Ok(count >= CHECKED && closure_error <= tolerance::FITS)
    }

    /// Whether a change reduces a length of a body to zero.
    fn folds(&self, numbers: &[f64]) -> bool {
        let Some(changed) = self.changed(numbers) else { return false };
        let (before, after) = (self.lengths(), changed.lengths());
        before.iter().zip(&after).any(|(d, now)| *d > tolerance::EQUAL * self.length && *now < tolerance::HALF_LOST * d)
    }

    /// Whether it removes a length that is too large for a geometric error.
    fn folds_all(&self, numbers: &[f64], tolerance: f64) -> bool {
        let Some(changed) = self.changed(numbers) else { return true };
        let (before, after) = (self.lengths(), changed.lengths());
        let longest = before.iter().fold(0.0, |m: f64, x| m.max(*x));
        before
            .iter()
            .zip(&after)
            .any(|(d, now)| *d > LARGEST_CHANGE * tolerance * longest && *now < tolerance::HALF_LOST * d)
    }
}

/// The fit with the most degrees of freedom; of equal ones that with the least change, unless it folds a length that a
/// finer level keeps.
fn chosen(fits: Vec<Fit>) -> Option<Fit> {
    let most = fits.iter().map(|x| x.dof).max()?;
    let open = |x: &Fit| x.ambiguous.is_some();
    let better = |a: &Fit, b: &Fit| b.dof.cmp(&a.dof).then(open(a).cmp(&open(b))).then(a.most.total_cmp(&b.most));
    let (mut first, mut others): (Vec<Fit>, Vec<Fit>) = fits.into_iter().partition(|x| x.dof == most);
    sort_by(&mut first, better);
    let kept = first.into_iter().next()?;
    if kept.folds {
        others.retain(|x| !x.folds && tolerance::CLEARLY * x.most <= kept.most);
        sort_by(&mut others, better);
        if let Some(other) = others.into_iter().next() {
            return Some(other);
        }
    }
    Some(kept)
}
