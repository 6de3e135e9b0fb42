//! The branch that given rates select, and the velocities on it.

use super::messages::TOUCH;
use super::{columns, combined, dot, largest, of_start, BranchDirections, RequestedRate};
use crate::branching::SAME_RATES;
use crate::system::{ConstrainedSystem, SystemError};
use partita_math::dense::{self, Matrix};
use partita_math::factor::{least_squares_min_norm, svd_full};
use partita_math::sorting::sort_by;
use partita_math::tolerance;

/// Where drives leave no degree of freedom, a given rate selects the branch whose rate is between this fraction of it
/// and as many times it. Scale: ratio. Reason: the drives set the value, the rate selects the sign.
pub const SIGN_ONLY: f64 = 0.5;

/// A velocity that was looked for.
pub(super) struct Fit {
    pub(super) v: Vec<f64>,
    /// The largest rate missed by, in characteristic displacements.
    miss: f64,
    /// Velocities that the rates leave free.
    open: Vec<Vec<f64>>,
}

/// Velocities with rates in the position that was refused as `singular`: those on the branch which the rates single
/// out, otherwise as near to `near` as can be in the mass metric.
///
/// # Errors
/// `singular`, and why no branch is singled out; where the system cannot be evaluated.
pub fn singled_out<S: ConstrainedSystem>(
    system: &S,
    (t, q, near): (f64, &[f64], &[f64]),
    asked: &[RequestedRate],
    singular: SystemError,
) -> Result<Vec<f64>, SystemError> {
    of_start(system, t, q, singular, |branch_directions| branch_directions.with_rates(near, asked))
}

impl<S: ConstrainedSystem> BranchDirections<'_, S> {
    /// The velocities on the branch that the rates single out, otherwise as near to `near` as can be in the mass
    /// metric.
    ///
    /// Rates are met exactly, or within [`SAME_RATES`] where only one branch is that near; where the drives leave no
    /// degree of freedom they only select the branch, and each must lie between half and twice the rate that the drives
    /// determine.
    ///
    /// # Errors
    /// The reason, as the end of a sentence.
    pub fn with_rates(&self, near: &[f64], asked: &[RequestedRate]) -> Result<Vec<f64>, String> {
        if let Some(why) = self.impossible() {
            return Err(why);
        }
        let near: Vec<f64> = near.iter().zip(&self.displacement).map(|(v, r)| v / r).collect();
        if asked.iter().all(|x| x.rate == 0.0) && !self.driven {
            let v = self.natural(&near);
            return self.admits(&v).map(|()| v);
        }
        let fastest =
            asked.iter().fold(0.0, |m: f64, x| m.max(x.rate.abs() / x.displacement)).max(largest(&self.particular));
        let chosen = match &self.planes {
            Some(planes) => self.of_planes(planes, &near, asked, fastest),
            None => self.of_cone(&near, asked, fastest),
        }?;
        let (u, _) = self.rates_of(&chosen);
        if self.touches(&u) {
            return Err(TOUCH.into());
        }
        Ok(self.natural(&chosen))
    }

    fn of_planes(
        &self,
        planes: &[Vec<f64>; 2],
        near: &[f64],
        asked: &[RequestedRate],
        fastest: f64,
    ) -> Result<Vec<f64>, String> {
        let fits: Vec<Fit> = planes
            .iter()
            .filter_map(|plane| self.on_plane(plane))
            .filter_map(|(base, basis)| self.fit(&base, &basis, near, asked))
            .collect();
        let within =
            |part: f64| -> Vec<usize> { (0..fits.len()).filter(|&i| fits[i].miss <= part * fastest).collect() };
        let exact = within(tolerance::RATES_MET);
        match exact[..] {
            [one] => return Ok(fits[one].v.clone()),
            [_, _] => return Err(self.which(asked)),
            _ => {}
        }
        let mut order: Vec<usize> = (0..fits.len()).collect();
        sort_by(&mut order, |&i, &j| fits[i].miss.total_cmp(&fits[j].miss));
        let Some(&first) = order.first() else { return Err(self.which(asked)) };
        let second = order.get(1).map_or(f64::INFINITY, |&i| fits[i].miss);
        if fits[first].miss <= SAME_RATES * fastest && second > tolerance::CLEARLY * fits[first].miss {
            return Ok(fits[first].v.clone());
        }
        if self.k == 1 {
            let has_sign = |fit: &Fit| {
                asked.iter().any(|x| x.rate != 0.0)
                    && asked.iter().all(|x| {
                        let part = self.read(x, &fit.v) / x.rate;
                        part >= SIGN_ONLY && part * SIGN_ONLY <= 1.0
                    })
            };
            let signed: Vec<&Fit> = fits.iter().filter(|fit| has_sign(fit)).collect();
            if let [one] = signed[..] {
                return Ok(one.v.clone());
            }
        }
        Err(self.none(asked, &fits[first].v))
    }

    fn of_cone(&self, near: &[f64], asked: &[RequestedRate], fastest: f64) -> Result<Vec<f64>, String> {
        let basis: Vec<Vec<f64>> = columns(&self.kernel);
        let Some(fit) = self.fit(&self.particular, &basis, near, asked) else { return Err(self.which(asked)) };
        if fit.miss > SAME_RATES * fastest {
            return Err(self.none(asked, &self.projected(&fit.v)));
        }
        match &fit.open[..] {
            [] => {
                let on = self.projected(&fit.v);
                let off = on.iter().zip(&fit.v).fold(0.0, |m: f64, (a, b)| m.max((a - b).abs()));
                match off <= SAME_RATES * fastest {
                    true => Ok(on),
                    false => Err(self.none(asked, &on)),
                }
            }
            [free] => {
                // F along the line that the rates leave: a quadratic equation
                let (u, _) = self.rates_of(&fit.v);
                let mut d: Vec<f64> = self.kernel.transpose().matvec(free);
                let long = dot(&d, &d).sqrt();
                d.iter_mut().for_each(|d| *d /= long);
                d.push(0.0);
                let along = self.form.matvec(&d);
                let (a, b, c) = (dot(&along, &d), 2.0 * dot(&along, &u), self.bend(&u).0);
                let scale = self.form.max_abs();
                if a.abs() <= tolerance::TAKES_PART * scale {
                    if b.abs() <= tolerance::TAKES_PART * scale * self.length(&u) {
                        return Err(self.which(asked));
                    }
                    return Ok(self.velocity_of(&combined(&u, &[d], &[-c / b])));
                }
                let discriminant = b * b - 4.0 * a * c;
                if discriminant < 0.0 {
                    let nearest = combined(&u, &[d], &[-b / (2.0 * a)]);
                    return Err(self.none(asked, &self.projected(&self.velocity_of(&nearest))));
                }
                Err(self.which(asked))
            }
            _ => Err(self.which(asked)),
        }
    }

    /// Velocities of one plane: a base and a basis, in characteristic displacements.
    pub(super) fn on_plane(&self, plane: &[f64]) -> Option<(Vec<f64>, Vec<Vec<f64>>)> {
        let k = self.k;
        let slope = &plane[..k];
        let square = dot(slope, slope);
        if square <= tolerance::TAKES_PART * tolerance::TAKES_PART * self.form.max_abs() {
            return None;
        }
        let mut u: Vec<f64> = slope.iter().map(|s| -plane[k] / square * s).collect();
        u.push(1.0);
        let mut row = Matrix::new(1, k);
        row.row_mut(0).copy_from_slice(slope);
        let f = svd_full(&row).ok()?;
        let basis = columns(&f.v).iter().skip(1).map(|z| self.kernel.matvec(z)).collect();
        Some((self.velocity_of(&u), basis))
    }

    /// The velocity among base + basis z that meets the rates best and, among those, is nearest to `near` in kinetic
    /// energy.
    pub(super) fn fit(&self, base: &[f64], basis: &[Vec<f64>], near: &[f64], asked: &[RequestedRate]) -> Option<Fit> {
        let d = basis.len();
        let miss_of =
            |v: &[f64]| asked.iter().fold(0.0, |m: f64, x| m.max((self.read(x, v) - x.rate).abs() / x.displacement));
        if d == 0 {
            return Some(Fit { v: base.to_vec(), miss: miss_of(base), open: Vec::new() });
        }
        let moved: Vec<Vec<f64>> = basis.iter().map(|b| self.mass.matvec(b)).collect();
        let mut l: Vec<f64> = (0..d * d).map(|e| dot(&basis[e / d], &moved[e % d])).collect();
        dense::cholesky(&mut l, d).ok()?;
        let off: Vec<f64> = near.iter().zip(base).map(|(n, b)| n - b).collect();
        let mut z0: Vec<f64> = moved.iter().map(|m| dot(m, &off)).collect();
        dense::cholesky_solve(&l, d, &mut z0);
        let start = combined(base, basis, &z0);
        let mut rows = Matrix::new(asked.len(), d);
        let mut want = Vec::with_capacity(asked.len());
        for (i, x) in asked.iter().enumerate() {
            let row = rows.row_mut(i);
            row.iter_mut().zip(basis).for_each(|(r, b)| *r = self.read(x, b) / x.displacement);
            dense::cholesky_forward(&l, d, row);
            want.push((x.rate - self.read(x, &start)) / x.displacement);
        }
        let mut open: Vec<Vec<f64>> = Vec::new();
        let mut y = vec![0.0; d];
        if asked.is_empty() {
            open.extend(basis.iter().cloned());
        } else {
            y = least_squares_min_norm(&rows, &want, tolerance::DIFFERENCE_ROUNDING).ok()?.0;
            let f = svd_full(&rows).ok()?;
            let rank = f.rank(tolerance::DIFFERENCE_ROUNDING);
            for z in columns(&f.v).iter_mut().skip(rank) {
                dense::cholesky_backward(&l, d, z);
                open.push(combined(&vec![0.0; base.len()], basis, z));
            }
        }
        dense::cholesky_backward(&l, d, &mut y);
        let v = combined(&start, basis, &y);
        let miss = miss_of(&v);
        Some(Fit { v, miss, open })
    }

    /// The request, at a velocity in characteristic displacements.
    pub(super) fn read(&self, x: &RequestedRate, w: &[f64]) -> f64 {
        x.row.iter().zip(w).zip(&self.displacement).map(|((r, w), displacement)| r * w * displacement).sum()
    }

    /// The nearest velocity with F = 0, by steps along the gradient.
    pub(super) fn projected(&self, w: &[f64]) -> Vec<f64> {
        let (mut u, _) = self.rates_of(w);
        for _ in 0..50 {
            let (bend, slope) = self.bend(&u);
            let square = dot(&slope, &slope);
            if square == 0.0 || bend == 0.0 {
                break;
            }
            u.iter_mut().zip(&slope).for_each(|(u, s)| *u -= bend / square * s);
        }
        self.velocity_of(&u)
    }
}
