//! Velocities that a singular position allows to second order.
//!
//! Where C loses one rank, drives included, one combination n of its rows does not restrict velocities, and to second
//! order
//!
//! ```text
//! C v + a = 0,   F(v) = nᵀ b(t, q, v) = 0,   v = v₀ + K u                                     (X2)
//! ```
//!
//! is one quadratic equation for the k rates u. It falls into two planes (two branches) or is a cone; a smooth motion
//! leaves along a velocity that satisfies it where its gradient does not vanish. With drives it is not homogeneous: of
//! a slider driven inwards out of its dead centre the two planes are the two signs of the crank's rate.

mod acceleration;
mod messages;
pub mod selection;

use super::{rank_of, Scaled, LARGEST};
use crate::system::{ConstrainedSystem, SystemError};
use messages::{REST, TOUCH};
use partita_math::dense::{self, Matrix};
use partita_math::factor::{svd, svd_full, symmetric_eigen};
use partita_math::tolerance;

/// Gradients of the quadratic form below this belong to velocities in which branches touch. Scale: fraction of the
/// gradient elsewhere. Reason: branches apart have gradients of the size of the form.
const BRANCHES_TOUCH: f64 = 1e-3;
/// Drives that require this rate in a dead centre are treated as being beside it. Scale: fraction of the fastest rate.
/// Reason: their error may be that of rows lost within [`null_sine`](super::null_sine).
const BESIDE_DEAD_CENTRE: f64 = 1e-4;

/// The rate of a measurement of the mechanism: `row · v` must be `rate`.
#[derive(Clone, Debug)]
pub struct RequestedRate {
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
pub enum PositionClass<'s, S: ConstrainedSystem> {
    /// Not singular, or second orders are inconclusive.
    Nothing,
    /// Several ranks are lost at once.
    Several(usize),
    /// One rank is lost.
    BranchDirections(Box<BranchDirections<'s, S>>),
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
        PositionClass::Nothing => return Err(singular),
        PositionClass::Several(lost) => {
            format!("the rank drops by {lost} here; rates select a branch only where it drops by one")
        }
        PositionClass::BranchDirections(branch_directions) => match ask(branch_directions) {
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
pub fn look<'s, S: ConstrainedSystem>(system: &'s S, t: f64, q: &[f64]) -> Result<PositionClass<'s, S>, SystemError> {
    let size = system.size();
    if size.nv > LARGEST || size.rows > 5 * LARGEST || size.rows != size.holonomic || size.rows == 0 {
        return Ok(PositionClass::Nothing);
    }
    let mut x = Scaled::new(system, t, q, true)?;
    let rows = x.rows.len();
    if x.violation().iter().any(|x| x.abs() > tolerance::OPEN) {
        return Ok(PositionClass::Nothing);
    }
    let Ok(f) = svd_full(&x.jacobian()) else { return Ok(PositionClass::Nothing) };
    let Some(rank) = rank_of(&f.s) else { return Ok(PositionClass::Nothing) };
    let (n, k) = (size.nv, size.nv - rank);
    if k == 0 || rank == rows {
        return Ok(PositionClass::Nothing);
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
    let Ok(found) = svd(&forms) else { return Ok(PositionClass::Nothing) };
    match found.s.iter().filter(|s| **s > tolerance::DEPENDENT).count() {
        0 => return Ok(PositionClass::Nothing),
        1 => {}
        lost => return Ok(PositionClass::Several(lost)),
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
        if system.structure().rheonomic {
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
    let driven = system.structure().rheonomic;
    let mut of_kernel = Matrix::new(n, k);
    (0..n).for_each(|i| (0..k).for_each(|j| of_kernel[(i, j)] = kernel[j][i]));
    let kernel = of_kernel;
    Ok(PositionClass::BranchDirections(Box::new(BranchDirections {
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
        let asked: Vec<RequestedRate> =
            (0..v.len()).filter(|&i| w[i].abs() > tolerance::TAKES_PART * fastest).map(|i| self.own(i, v[i])).collect();
        Err(self.nearest(&w, &asked))
    }

    /// The rate of one velocity.
    pub fn own(&self, i: usize, rate: f64) -> RequestedRate {
        let mut row = vec![0.0; self.displacement.len()];
        row[i] = 1.0;
        RequestedRate { name: self.system.structure().velocity_name(i), row, displacement: self.displacement[i], rate }
    }
}
