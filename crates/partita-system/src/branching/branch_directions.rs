//! Velocities that a singular position allows to second order, and which of them given rates select.
//!
//! Where C loses one rank, drives included, one combination n of its rows does not restrict velocities, and to second
//! order
//!
//! ```text
//! C v + a = 0,   F(v) = nᵀ b(t, q, v) = 0,   v = v₀ + K u
//! ```
//!
//! is one quadratic equation for the k rates u. It falls into two planes (two branches) or is a cone; a smooth motion
//! leaves along a velocity that satisfies it where its gradient does not vanish. With drives it is not homogeneous: of
//! a slider driven inwards out of its dead centre the two planes are the two signs of the crank's rate.

mod messages;

use super::{rank_of, Scaled, LARGEST, SAME_RATES};
use crate::system::{ConstrainedSystem, SystemError};
use messages::{REST, TOUCH};
use partita_math::dense::{self, Matrix};
use partita_math::factor::{least_squares_min_norm, svd, svd_full, symmetric_eigen};
use partita_math::tolerance;

/// Where drives leave no degree of freedom, a given rate selects the branch whose rate is between this fraction of it
/// and as many times it. Scale: ratio. Reason: the drives set the value, the rate selects the sign.
pub const SIGN_ONLY: f64 = 0.5;
/// Gradients of the quadratic form below this belong to velocities in which branches touch. Scale: fraction of the
/// gradient elsewhere. Reason: branches apart have gradients of the size of the form.
const BRANCHES_TOUCH: f64 = 1e-3;
/// Drives that require this rate in a dead centre are treated as being beside it. Scale: fraction of the fastest rate.
/// Reason: their error may be that of rows lost within [`null_sine`](super::null_sine).
const BESIDE_DEAD_CENTRE: f64 = 1e-4;
/// Displacements over which third orders are differences. Unit: characteristic displacement. Reason: third powers
/// exceed rounding, fourth powers are a hundredth of them.
const THIRD_ORDER_MOVE: f64 = 0.03;

/// The rate of a measurement of the mechanism: `row · v` must be `rate`.
#[derive(Clone, Debug)]
pub struct Asked {
    /// Its name.
    pub name: String,
    /// Its gradient (nv).
    pub row: Vec<f64>,
    /// Its change in a large displacement.
    pub displacement: f64,
    /// The requested rates.
    pub rate: f64,
}

/// The velocities that a singular position allows to second order.
pub struct BranchDirections<'s, S: ConstrainedSystem> {
    system: &'s S,
    t: f64,
    /// Rank of C next to the position.
    pub rank: usize,
    /// Free rates in the position.
    k: usize,
    /// Characteristic displacements of velocities; all that follows is in them.
    displacement: Vec<f64>,
    /// v₀ (n).
    particular: Vec<f64>,
    /// K (n x k), its columns orthonormal.
    kernel: Matrix,
    /// Rates that count as one [1/s].
    unit: f64,
    /// F over the square of the unit as a form in (u over the unit, 1).
    form: Matrix,
    /// Branches: F is the product of two of these, linear in (u over the unit, 1).
    planes: Option<[Vec<f64>; 2]>,
    /// M in characteristic displacements.
    mass: Matrix,
    /// Whether drives prescribe motion here.
    driven: bool,
    /// The rows under consideration, with their sizes.
    rows: Vec<(usize, f64)>,
    /// n over these rows.
    lost: Vec<f64>,
    /// C over sizes and reaches by its singular values: left vector, value, right vector.
    range: Vec<(Vec<f64>, f64, Vec<f64>)>,
    /// nᵀ a: the first-order condition of the drives that cannot be satisfied, the row with the largest share and its
    /// value.
    forbidden: (f64, usize, f64),
}

/// A velocity that was looked for.
struct Fit {
    v: Vec<f64>,
    /// The largest rate missed by, in characteristic displacements.
    miss: f64,
    /// Velocities that the rates leave free.
    open: Vec<Vec<f64>>,
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    dense::dot(a, b)
}

fn largest(x: &[f64]) -> f64 {
    x.iter().fold(0.0, |m: f64, x| m.max(x.abs()))
}

fn columns(m: &Matrix) -> Vec<Vec<f64>> {
    let t = m.transpose();
    (0..t.rows()).map(|i| t.row(i).to_vec()).collect()
}

fn combined(base: &[f64], basis: &[Vec<f64>], z: &[f64]) -> Vec<f64> {
    let mut v = base.to_vec();
    for (z, b) in z.iter().zip(basis) {
        v.iter_mut().zip(b).for_each(|(v, b)| *v += z * b);
    }
    v
}

/// Classification of a position.
pub enum Found<'s, S: ConstrainedSystem> {
    /// Not singular, or second orders are inconclusive.
    Nothing,
    /// Several ranks are lost at once.
    Several(usize),
    /// One rank is lost.
    BranchDirections(Box<BranchDirections<'s, S>>),
}

/// Velocities with rates in the position that was refused as `singular`: those on the branch which the rates single
/// out, otherwise as near to `near` as can be in the mass metric.
///
/// # Errors
/// `singular`, and why no branch is singled out; where the system cannot be evaluated.
pub fn singled_out<S: ConstrainedSystem>(
    system: &S,
    (t, q, near): (f64, &[f64], &[f64]),
    asked: &[Asked],
    singular: SystemError,
) -> Result<Vec<f64>, SystemError> {
    of_start(system, t, q, singular, |branch_directions| branch_directions.with_rates(near, asked))
}

/// The branch directions at a position refused as `singular`, if `v` is a velocity along which one motion leaves.
///
/// # Errors
/// `singular`, and why `v` is none; where the system cannot be evaluated.
pub fn along<'s, S: ConstrainedSystem>(
    system: &'s S,
    (t, q, v): (f64, &[f64], &[f64]),
    singular: SystemError,
) -> Result<Box<BranchDirections<'s, S>>, SystemError> {
    let mut held = None;
    of_start(system, t, q, singular, |branch_directions| {
        branch_directions.admits(v)?;
        held = Some(branch_directions);
        Ok(())
    })?;
    held.ok_or_else(|| SystemError::SingularStart { t, message: TOUCH.into() })
}

fn of_start<'s, S: ConstrainedSystem, T>(
    system: &'s S,
    t: f64,
    q: &[f64],
    singular: SystemError,
    ask: impl FnOnce(Box<BranchDirections<'s, S>>) -> Result<T, String>,
) -> Result<T, SystemError> {
    let SystemError::SingularStart { message, .. } = &singular else { return Err(singular) };
    let why = match look(system, t, q)? {
        Found::Nothing => return Err(singular),
        Found::Several(lost) => {
            format!("the rank drops by {lost} here; rates select a branch only where it drops by one")
        }
        Found::BranchDirections(branch_directions) => match ask(branch_directions) {
            Ok(found) => return Ok(found),
            Err(why) => why,
        },
    };
    Err(SystemError::SingularStart { t, message: format!("{message}; {why}") })
}

/// The branch directions at (t, q), with the drives at rest.
///
/// Cost: dense decompositions of C and of M.
///
/// # Errors
/// Where the system cannot be evaluated here.
pub fn look<'s, S: ConstrainedSystem>(system: &'s S, t: f64, q: &[f64]) -> Result<Found<'s, S>, SystemError> {
    let size = system.size();
    if size.nv > LARGEST || size.rows > 5 * LARGEST || size.rows != size.holonomic || size.rows == 0 {
        return Ok(Found::Nothing);
    }
    let mut x = Scaled::new(system, t, q, true)?;
    let rows = x.rows.len();
    if x.violation().iter().any(|x| x.abs() > tolerance::OPEN) {
        return Ok(Found::Nothing);
    }
    let Ok(f) = svd_full(&x.jacobian()) else { return Ok(Found::Nothing) };
    let Some(rank) = rank_of(&f.s) else { return Ok(Found::Nothing) };
    let (n, k) = (size.nv, size.nv - rank);
    if k == 0 || rank == rows {
        return Ok(Found::Nothing);
    }
    let (u, v) = (columns(&f.u), columns(&f.v));
    let (stresses, kernel) = (&u[rank..], &v[rank..]);
    // v₀: C v₀ = -a as far as it can be
    let a: Vec<f64> = x.rows.iter().map(|&i| x.a[i] / x.sizes[i]).collect();
    let mut particular = vec![0.0; n];
    for i in 0..rank {
        let part = -dot(&u[i], &a) / f.s[i];
        particular.iter_mut().zip(&v[i]).for_each(|(p, v)| *p += part * v);
    }
    // the one combination of self-stresses whose second rates do not vanish
    let mut forms = Matrix::new(stresses.len(), k * k);
    let mut second = |w: &[f64]| x.bend(t, q, w);
    let squares: Vec<Vec<f64>> = kernel.iter().map(|w| second(w)).collect::<Result<_, _>>()?;
    for i in 0..k {
        for j in 0..=i {
            let both = match i == j {
                true => squares[i].clone(),
                false => {
                    let sum: Vec<f64> = kernel[i].iter().zip(&kernel[j]).map(|(a, b)| a + b).collect();
                    let sum = second(&sum)?;
                    sum.iter().zip(&squares[i]).zip(&squares[j]).map(|((s, a), b)| 0.5 * (s - a - b)).collect()
                }
            };
            for (r, stress) in stresses.iter().enumerate() {
                let value = dot(stress, &both);
                (forms.row_mut(r)[i * k + j], forms.row_mut(r)[j * k + i]) = (value, value);
            }
        }
    }
    let Ok(found) = svd(&forms) else { return Ok(Found::Nothing) };
    match found.s.iter().filter(|s| **s > tolerance::DEPENDENT).count() {
        0 => return Ok(Found::Nothing),
        1 => {}
        lost => return Ok(Found::Several(lost)),
    }
    let combined_by = |weights: &[f64]| -> Vec<f64> {
        (0..rows).map(|i| stresses.iter().zip(weights).map(|(s, w)| w * s[i]).sum()).collect()
    };
    let of_stress = columns(&found.u);
    let lost = combined_by(&of_stress[0]);
    let mut bend_of = |w: &[f64]| -> Result<f64, SystemError> {
        let v: Vec<f64> = w.iter().zip(&x.displacement).map(|(w, r)| w * r).collect();
        let mut b = vec![0.0; size.rows];
        x.system.velocity(t, q, &v, &mut x.scratch, &mut b)?;
        Ok(x.rows.iter().zip(&lost).map(|(&i, n)| n * b[i] / x.sizes[i]).sum())
    };
    let rest = bend_of(&particular)?;
    let unit = match largest(&particular).max((rest.abs() / found.s[0]).sqrt()) {
        at_all if at_all > 0.0 => at_all,
        _ => 1.0,
    };
    let mut form = Matrix::new(k + 1, k + 1);
    let quadratic: Vec<f64> =
        (0..k * k).map(|e| (0..stresses.len()).map(|r| of_stress[0][r] * forms.row(r)[e]).sum()).collect();
    for i in 0..k {
        form.row_mut(i)[..k].copy_from_slice(&quadratic[i * k..(i + 1) * k]);
        if system.rheonomic() {
            let ahead = combined(&particular, &kernel[i..=i], &[unit]);
            let back = combined(&particular, &kernel[i..=i], &[-unit]);
            let linear = 0.5 * (bend_of(&ahead)? - bend_of(&back)?) / (unit * unit);
            (form[(i, k)], form[(k, i)]) = (0.5 * linear, 0.5 * linear);
        }
    }
    form[(k, k)] = rest / (unit * unit);
    let planes = planes(&form);
    let asks: Vec<f64> = (0..rows).map(|i| lost[i] * a[i]).collect();
    let most = (0..rows).max_by(|&i, &j| asks[i].abs().total_cmp(&asks[j].abs())).unwrap_or(0);
    let forbidden = (asks.iter().sum(), x.rows[most], -x.a[x.rows[most]]);
    let (mut mass, mut h) = (vec![0.0; n * n], vec![0.0; n]);
    let zero = vec![0.0; n];
    let mut b = vec![0.0; size.rows];
    system.velocity(t, q, &zero, &mut x.scratch, &mut b)?;
    system.dynamics(t, q, &zero, &mut x.scratch, &mut mass, &mut h)?;
    let mut mass = Matrix::from_vec(n, n, mass);
    (0..n).for_each(|i| (0..n).for_each(|j| mass[(i, j)] *= x.displacement[i] * x.displacement[j]));
    let of_rows = x.rows.iter().map(|&i| (i, x.sizes[i])).collect();
    let range = (0..rank).map(|i| (u[i].clone(), f.s[i], v[i].clone())).collect();
    let displacement = x.displacement;
    let driven = system.rheonomic();
    let mut of_kernel = Matrix::new(n, k);
    (0..n).for_each(|i| (0..k).for_each(|j| of_kernel[(i, j)] = kernel[j][i]));
    let kernel = of_kernel;
    Ok(Found::BranchDirections(Box::new(BranchDirections {
        system,
        t,
        rank: rank + 1,
        k,
        displacement,
        particular,
        kernel,
        unit,
        form,
        planes,
        mass,
        driven,
        forbidden,
        rows: of_rows,
        lost,
        range,
    })))
}

/// F as a product, where it is one of two different factors.
fn planes(form: &Matrix) -> Option<[Vec<f64>; 2]> {
    let (values, vectors) = symmetric_eigen(form).ok()?;
    let top = largest(&values);
    let significant: Vec<usize> =
        (0..values.len()).filter(|&i| values[i].abs() > tolerance::TAKES_PART * top).collect();
    let [one, two] = significant[..] else { return None };
    if values[one] * values[two] > 0.0 {
        return None;
    }
    let of = columns(&vectors);
    let (p, m) = (values[one].abs().sqrt(), values[two].abs().sqrt());
    let plane = |sign: f64| -> Vec<f64> { of[one].iter().zip(&of[two]).map(|(a, b)| p * a + sign * m * b).collect() };
    Some([plane(1.0), plane(-1.0)])
}

impl<S: ConstrainedSystem> BranchDirections<'_, S> {
    /// (u over the unit, 1) of a velocity in characteristic displacements, and how far off C v + a = 0 it is.
    fn rates_of(&self, w: &[f64]) -> (Vec<f64>, f64) {
        let off: Vec<f64> = w.iter().zip(&self.particular).map(|(w, p)| w - p).collect();
        let mut u = self.kernel.transpose().matvec(&off);
        let back = self.kernel.matvec(&u);
        let miss = off.iter().zip(&back).fold(0.0, |m: f64, (a, b)| m.max((a - b).abs()));
        u.iter_mut().for_each(|u| *u /= self.unit);
        u.push(1.0);
        (u, miss)
    }

    /// The velocity in characteristic displacements of rates over the unit.
    fn velocity_of(&self, u: &[f64]) -> Vec<f64> {
        let free = self.kernel.matvec(&u[..self.k]);
        self.particular.iter().zip(free).map(|(p, f)| p + self.unit * f).collect()
    }

    /// F and its gradient with respect to u.
    fn bend(&self, u: &[f64]) -> (f64, Vec<f64>) {
        let half = self.form.matvec(u);
        (dot(&half, u), half[..self.k].iter().map(|x| 2.0 * x).collect())
    }

    /// How long (u, 1) is as far as it matters: without drives F is homogeneous in u.
    fn length(&self, u: &[f64]) -> f64 {
        let all = if self.driven { u } else { &u[..self.k] };
        dot(all, all).sqrt()
    }

    /// Whether branches touch in this velocity.
    fn touches(&self, u: &[f64]) -> bool {
        let (_, slope) = self.bend(u);
        dot(&slope, &slope).sqrt() <= BRANCHES_TOUCH * self.form.max_abs() * self.length(u)
    }

    fn natural(&self, w: &[f64]) -> Vec<f64> {
        w.iter().zip(&self.displacement).map(|(w, r)| w * r).collect()
    }

    /// The velocity among base + basis z that meets the rates best and, among those, is nearest to `near` in kinetic
    /// energy.
    fn fit(&self, base: &[f64], basis: &[Vec<f64>], near: &[f64], asked: &[Asked]) -> Option<Fit> {
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
    fn read(&self, x: &Asked, w: &[f64]) -> f64 {
        x.row.iter().zip(w).zip(&self.displacement).map(|((r, w), displacement)| r * w * displacement).sum()
    }

    /// Velocities of one plane: a base and a basis, in characteristic displacements.
    fn on_plane(&self, plane: &[f64]) -> Option<(Vec<f64>, Vec<Vec<f64>>)> {
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

    /// Whether exactly one smooth motion leaves along `v`.
    ///
    /// # Errors
    /// The reason, as the end of a sentence.
    pub fn admits(&self, v: &[f64]) -> Result<(), String> {
        if let Some(why) = self.impossible() {
            return Err(why);
        }
        let w: Vec<f64> = v.iter().zip(&self.displacement).map(|(v, r)| v / r).collect();
        let fastest = largest(&w);
        if fastest == 0.0 && !self.driven {
            return Err(REST.into());
        }
        let (u, miss) = self.rates_of(&w);
        let (bend, slope) = self.bend(&u);
        let steep = dot(&slope, &slope).sqrt();
        if miss <= tolerance::TAKES_PART * fastest && bend.abs() <= tolerance::TAKES_PART * steep * self.length(&u) {
            return if self.touches(&u) { Err(TOUCH.into()) } else { Ok(()) };
        }
        if self.driven && fastest == 0.0 {
            return Err(self.which(&[]));
        }
        // the nearest in all rates
        let asked: Vec<Asked> =
            (0..v.len()).filter(|&i| w[i].abs() > tolerance::TAKES_PART * fastest).map(|i| self.own(i, v[i])).collect();
        Err(self.nearest(&w, &asked))
    }

    /// The rate of one velocity.
    pub fn own(&self, i: usize, rate: f64) -> Asked {
        let mut row = vec![0.0; self.displacement.len()];
        row[i] = 1.0;
        Asked { name: self.system.velocity_name(i), row, displacement: self.displacement[i], rate }
    }

    /// The velocities on the branch that the rates single out, otherwise as near to `near` as can be in the mass
    /// metric.
    ///
    /// Rates are met exactly, or within [`SAME_RATES`] where only one branch is that near; where the drives leave no
    /// degree of freedom they only select the branch, and each must lie between half and twice the rate that the drives
    /// determine.
    ///
    /// # Errors
    /// The reason, as the end of a sentence.
    pub fn with_rates(&self, near: &[f64], asked: &[Asked]) -> Result<Vec<f64>, String> {
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
        asked: &[Asked],
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
        order.sort_by(|&i, &j| fits[i].miss.total_cmp(&fits[j].miss));
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

    fn of_cone(&self, near: &[f64], asked: &[Asked], fastest: f64) -> Result<Vec<f64>, String> {
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

    /// The nearest velocity with F = 0, by steps along the gradient.
    fn projected(&self, w: &[f64]) -> Vec<f64> {
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

    /// The accelerations with which the motion along `v`, one that [`admits`](Self::admits), leaves (t, q): the limit
    /// of those next to it. None where they are not determined.
    ///
    /// To third order nᵀ Φ(q(t)) = 0 is linear in them; it replaces the row that is dependent here. Its coefficient
    /// comes from differences over displacements of a few hundredths of the characteristic ones, exact to some six
    /// digits.
    ///
    /// # Errors
    /// Where the system cannot be evaluated.
    pub fn acceleration(&self, q: &[f64], v: &[f64]) -> Result<Option<Vec<f64>>, SystemError> {
        let (system, t, n) = (self.system, self.t, v.len());
        let size = system.size();
        let mut scratch = system.scratch();
        let (mut phi, mut c, mut a_rows) =
            (vec![0.0; size.holonomic], vec![0.0; system.pattern().nnz()], vec![0.0; size.rows]);
        system.position(t, q, &mut scratch, &mut phi, &mut c, &mut a_rows)?;
        let mut b = vec![0.0; size.rows];
        system.velocity(t, q, v, &mut scratch, &mut b)?;
        let (mut mass, mut h) = (vec![0.0; n * n], vec![0.0; n]);
        system.dynamics(t, q, v, &mut scratch, &mut mass, &mut h)?;
        let b: Vec<f64> = self.rows.iter().map(|&(i, size)| b[i] / size).collect();
        let mut forced = vec![0.0; n];
        for (left, s, right) in &self.range {
            let part = -dot(left, &b) / s;
            forced.iter_mut().zip(right).for_each(|(f, r)| *f += part * r);
        }
        // K^T (h - M a): the remaining load for the free rates
        let moved = self.mass.matvec(&forced);
        let left: Vec<f64> = h.iter().zip(&self.displacement).zip(&moved).map(|((h, r), m)| h * r - m).collect();
        let kernel = columns(&self.kernel);
        let k = self.k;
        let of: Vec<Vec<f64>> = kernel.iter().map(|d| self.mass.matvec(d)).collect();
        let mut l: Vec<f64> = (0..k * k).map(|e| dot(&kernel[e / k], &of[e % k])).collect();
        if dense::cholesky(&mut l, k).is_err() {
            return Ok(None);
        }
        let mut z: Vec<f64> = kernel.iter().map(|d| dot(d, &left)).collect();
        dense::cholesky_solve(&l, k, &mut z);
        let w: Vec<f64> = v.iter().zip(&self.displacement).map(|(v, r)| v / r).collect();
        let (u, _) = self.rates_of(&w);
        let slope: Vec<f64> = self.bend(&u).1.iter().map(|s| s * self.unit).collect();
        // the third order of n^T phi along v t + forced t^2 / 2, by its odd part
        let apart = (THIRD_ORDER_MOVE / largest(&w).max(f64::MIN_POSITIVE))
            .min((THIRD_ORDER_MOVE / largest(&forced).max(f64::MIN_POSITIVE)).sqrt());
        let mut odd = |e: f64| -> Result<f64, SystemError> {
            let mut sum = 0.0;
            for sign in [1.0, -1.0] {
                let by: Vec<f64> =
                    (0..n).map(|i| sign * e * v[i] + 0.5 * e * e * forced[i] * self.displacement[i]).collect();
                let mut there = q.to_vec();
                system.step(&mut there, &by);
                system.position(t + sign * e, &there, &mut scratch, &mut phi, &mut c, &mut a_rows)?;
                let open = self.rows.iter().zip(&self.lost).map(|(&(i, size), n)| n * phi[i] / size);
                sum += 0.5 * sign * open.sum::<f64>();
            }
            Ok(sum / (e * e * e))
        };
        let third = (4.0 * odd(0.5 * apart)? - odd(apart)?) / 3.0;
        // slope . z = -4 third, by the least change of z in the mass metric
        let mut along = slope.clone();
        dense::cholesky_solve(&l, k, &mut along);
        let part = (-4.0 * third - dot(&slope, &z)) / dot(&slope, &along);
        z.iter_mut().zip(&along).for_each(|(z, a)| *z += part * a);
        let found = self.natural(&combined(&forced, &kernel, &z));
        Ok(found.iter().all(|a| a.is_finite()).then_some(found))
    }
}
