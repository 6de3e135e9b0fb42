//! Velocities with given rates: of all that satisfy S4, the ones of least kinetic energy.

use crate::reduction::Reduction;
use crate::system::{ConstrainedSystem, SystemError, Tangent};
use partita_math::dense::{self, Matrix};
use partita_math::factor;
use partita_math::formatted;
use partita_math::tolerance;

/// Precision to which compatible rates are met at the last tangent, as a fraction of the largest velocity.
pub fn met<S: ConstrainedSystem>(r: &mut Reduction<S>) -> f64 {
    if r.rank() == 0 {
        return tolerance::RATES_MET;
    }
    let (distance, _) = r.distance();
    (tolerance::SUM_ROUNDING / (distance * distance)).clamp(tolerance::RATES_MET, tolerance::OPEN_RATE)
}

/// A requested rate and the possible one, with as many digits as it takes to distinguish them.
pub fn possible(want: f64, got: f64) -> String {
    let digits = if format!("{want:.6}") == format!("{got:.6}") { 12 } else { 6 };
    format!("{want} (possible: {got:.digits$})")
}

/// Velocities with `v_i = rate` for the given pairs and least kinetic energy otherwise, at the partition of `r`.
///
/// Needs `r` with a partition; rates that the constraints forbid are refused with the numbers.
pub fn with_rates<S: ConstrainedSystem>(
    r: &mut Reduction<S>,
    t: f64,
    q: &[f64],
    rates: &[(usize, f64)],
) -> Result<Vec<f64>, SystemError> {
    near_with_rates(r, t, q, &vec![0.0; r.size().nv], rates)
}

/// As `with_rates`, but otherwise as near to `near` as the constraints allow, in the mass metric: the difference has least
/// energy.
pub fn near_with_rates<S: ConstrainedSystem>(
    r: &mut Reduction<S>,
    t: f64,
    q: &[f64],
    near: &[f64],
    rates: &[(usize, f64)],
) -> Result<Vec<f64>, SystemError> {
    let momentum = momentum(r, t, q, near)?;
    pushed_with_rates(r, t, q, &momentum, rates)
}

/// As `near_with_rates`, for the velocities of this momentum, `M v` with the loops open.
pub fn pushed_with_rates<S: ConstrainedSystem>(
    r: &mut Reduction<S>,
    t: f64,
    q: &[f64],
    momentum: &[f64],
    rates: &[(usize, f64)],
) -> Result<Vec<f64>, SystemError> {
    r.position(t, q)?;
    let k = r.k();
    r.tangent(t)?;
    let zero = vec![0.0; k];
    r.spread(&zero);
    let gamma = r.at.v.clone(); // [0; η]
    let (system, met) = (r.system.clone(), met(r));
    let failed = |got: &[f64]| {
        let words: Vec<String> = rates
            .iter()
            .zip(got)
            .map(|(&(i, want), &got)| format!("{} = {}", system.structure().velocities[i].name, possible(want, got)))
            .collect();
        SystemError::argument(
            "rates",
            format!(
                "the rates {} are incompatible: with the loops closed, the number of independent rates here is {k}",
                words.join(", ")
            ),
        )
    };
    let displacement = |i: usize| system.structure().displacement(i);
    let asked = rates.iter().fold(0.0, |m: f64, &(i, w)| m.max(w.abs() / displacement(i)));
    let fastest = gamma.iter().enumerate().fold(asked, |m: f64, (i, g)| m.max(g.abs() / displacement(i)));
    if k == 0 {
        let got: Vec<f64> = rates.iter().map(|&(i, _)| gamma[i]).collect();
        let off = rates.iter().zip(&got).any(|(&(i, w), g)| (w - g).abs() > met * fastest * displacement(i));
        return if off { Err(failed(&got)) } else { Ok(gamma) };
    }
    if r.by_clusters() {
        let (v, got) = r.least_energy(momentum, rates)?;
        let off = rates.iter().zip(&got).any(|(&(_, w), g)| (w - g).abs() > met * (1.0 + w.abs()));
        return if off { Err(failed(&got)) } else { unlocked(&*r.system, t, &named(&*r.system, rates), fastest, v) };
    }
    r.system.velocity(t, q, &gamma, &mut r.scratch, &mut r.at.b)?;
    let n = gamma.len();
    let (mut md, mut with, mut without) = (vec![0.0; k * k], vec![0.0; k], vec![0.0; k]);
    let none = vec![0.0; n];
    let tangent = Tangent { k, dt: &r.at.dt, delta: &none };
    r.system.project(t, q, &gamma, &tangent, &mut r.scratch, &mut md, &mut without)?;
    let tangent = Tangent { k, dt: &r.at.dt, delta: &gamma };
    r.system.project(t, q, &gamma, &tangent, &mut r.scratch, &mut md, &mut with)?;
    // D M [0; η] - D M near
    let mut g: Vec<f64> = without.iter().zip(&with).map(|(a, b)| a - b).collect();
    for (i, p) in momentum.iter().enumerate() {
        g.iter_mut().zip(&r.at.dt[i * k..(i + 1) * k]).for_each(|(g, d)| *g -= d * p);
    }
    dense::cholesky(&mut md, k).map_err(|e| SystemError::Mass {
        name: r.system.structure().velocity_name(r.planned.partition.independent[e.index]),
        pivot: e.pivot,
    })?;
    // with v_I = L⁻ᵀ y the energy is ½|y + L⁻¹g|² + const: least norm of y' = y + L⁻¹ g under T L⁻ᵀ y' = w
    dense::cholesky_forward(&md, k, &mut g);
    let mut y = vec![0.0; k];
    if !rates.is_empty() {
        let mut rows = Matrix::new(rates.len(), k);
        let (mut want, mut length) = (vec![0.0; rates.len()], vec![1.0; rates.len()]);
        for (i, &(vi, rate)) in rates.iter().enumerate() {
            let row = rows.row_mut(i);
            row.copy_from_slice(&r.at.dt[vi * k..(vi + 1) * k]);
            dense::cholesky_forward(&md, k, row); // row of T L⁻ᵀ
            want[i] = rate - gamma[vi] + dense::dot(row, &g);
            length[i] = dense::dot(row, row).sqrt();
        }
        // the motion that the loops do not allow is round-off compared with the motion they do: it gets no row, and its
        // rate is checked below
        let freest = rates.iter().zip(&length).fold(0.0, |m: f64, (r, l)| m.max(l / displacement(r.0)));
        for (i, &(vi, _)) in rates.iter().enumerate() {
            // rates of rotations and translations are compared in the mass metric
            if length[i] > tolerance::NULL_VALUE * freest * displacement(vi) {
                want[i] /= length[i];
                rows.row_mut(i).iter_mut().for_each(|x| *x /= length[i]);
            } else {
                rows.row_mut(i).fill(0.0);
                length[i] = 1.0;
            }
        }
        let (solution, _) = factor::least_squares_min_norm(&rows, &want, tolerance::NULL_VALUE)
            .map_err(|_| SystemError::NotFinite { what: "a rate".into(), t })?;
        let got = rows.matvec(&solution);
        let miss: Vec<f64> = got.iter().zip(&want).zip(&length).map(|((g, w), s)| (g - w) * s).collect();
        if rates.iter().zip(&miss).any(|(r, miss)| miss.abs() > met * fastest * displacement(r.0)) {
            let got: Vec<f64> = rates.iter().zip(&miss).map(|(r, miss)| r.1 + miss).collect();
            return Err(failed(&got));
        }
        y = solution;
    }
    for (y, g) in y.iter_mut().zip(&g) {
        *y -= g;
    }
    dense::cholesky_backward(&md, k, &mut y);
    r.spread(&y);
    unlocked(&*r.system, t, &named(&*r.system, rates), fastest, r.at.v.clone())
}

/// M v.
///
/// # Errors
/// Where the system cannot be evaluated.
pub fn momentum<S: ConstrainedSystem>(
    r: &mut Reduction<S>,
    t: f64,
    q: &[f64],
    v: &[f64],
) -> Result<Vec<f64>, SystemError> {
    let none = vec![0.0; v.len()];
    let (mut with, mut without) = (none.clone(), none.clone());
    if v.iter().all(|v| *v == 0.0) {
        return Ok(none);
    }
    r.position(t, q)?;
    r.system.velocity(t, q, &none, &mut r.scratch, &mut r.at.b)?;
    r.system.inverse_dynamics(t, q, &none, v, &mut r.scratch, &mut with)?;
    r.system.inverse_dynamics(t, q, &none, &none, &mut r.scratch, &mut without)?;
    with.iter_mut().zip(&without).for_each(|(x, y)| *x -= y);
    Ok(with)
}

/// Rates of velocities with their names.
fn named<S: ConstrainedSystem>(system: &S, rates: &[(usize, f64)]) -> Vec<(String, f64)> {
    rates.iter().map(|&(i, rate)| (system.structure().velocity_name(i), rate)).collect()
}

/// `v`, unless a requested rate needs velocities that cannot be distinguished from infinite ones; `fastest` is the
/// largest of the rates that are requested or prescribed, in characteristic displacements.
///
/// # Errors
/// `Argument`, with the rates.
pub fn unlocked<S: ConstrainedSystem>(
    system: &S,
    t: f64,
    rates: &[(String, f64)],
    fastest: f64,
    v: Vec<f64>,
) -> Result<Vec<f64>, SystemError> {
    let speed = |i: usize| v[i].abs() / system.structure().displacement(i);
    let Some(top) = (0..v.len()).max_by(|&i, &j| speed(i).total_cmp(&speed(j))) else { return Ok(v) };
    if fastest == 0.0 || tolerance::SINGULAR_PIVOT * speed(top) <= fastest {
        return Ok(v);
    }
    let asked: Vec<String> = rates.iter().map(|(name, rate)| format!("{name} = {rate}")).collect();
    Err(SystemError::argument(
        "rates",
        format!(
            "the rates {} are impossible at t = {t}: {} would need the rate {}, {:.1e} times as fast, because the \
         requested coordinate is locked here except for round-off (a dead point or a singular position); give the \
         rate of {} instead, or start a little away from here",
            asked.join(", "),
            system.structure().velocities[top].name,
            formatted(v[top]),
            speed(top) / fastest,
            system.structure().velocities[top].name,
        ),
    ))
}
