//! Velocities with given rates, of coordinates of any joint.

use super::goal::Target;
use partita_math::dense;
use partita_math::dense::Matrix;
use partita_math::factor::least_squares_min_norm;
use partita_math::tolerance;
use partita_model::model::ModelScratch;
use partita_model::Model;
use partita_system::branching::branch_directions::{selection, RequestedRate};
use partita_system::kinematics::velocity::{met, momentum, near_with_rates, possible, pushed_with_rates, unlocked};
use partita_system::prelude::*;
use partita_system::reduction::Reduction;
use partita_system::{start, SystemError};

/// How the rate of a goal follows from velocities (n).
fn gradient(model: &Model, q: &[f64], x: &Target, memory: &mut [f64], s: &mut ModelScratch) -> Vec<f64> {
    let mut g = vec![0.0; model.size().nv];
    let mut at = x.velocities.iter();
    x.rates(model, q, memory, s, |value| {
        if let Some(&i) = at.next() {
            g[i] = value;
        }
    });
    g
}

/// All rates as readings of velocities.
fn asked(model: &Model, q: &[f64], own: &[(usize, f64)], others: &[(Target, f64)]) -> Vec<RequestedRate> {
    let n = model.size().nv;
    let (mut s, mut memory) = (model.scratch(), vec![0.0; n]);
    let of_own = own.iter().map(|&(i, rate)| {
        let mut row = vec![0.0; n];
        row[i] = 1.0;
        RequestedRate {
            name: model.structure().velocity_name(i),
            row,
            displacement: model.structure().displacement(i),
            rate,
        }
    });
    let mut all: Vec<RequestedRate> = of_own.collect();
    for (x, rate) in others {
        let row = gradient(model, q, x, &mut memory, &mut s);
        all.push(RequestedRate { name: x.name.clone(), row, displacement: x.displacement, rate: *rate });
    }
    all
}

/// Velocities that satisfy S4 with `v_i = rate` for the pairs `own` and these rates of goals, otherwise as near to
/// `near` as possible in the mass metric.
///
/// # Errors
/// `Argument` where the rates are incompatible.
pub fn with_rates(
    model: &Model,
    t: f64,
    q: &[f64],
    near: &[f64],
    own: &[(usize, f64)],
    others: &[(Target, f64)],
) -> Result<Vec<f64>, SystemError> {
    let found = match start::analyse(model, t, q) {
        Err(e @ SystemError::SingularStart { .. }) => {
            return selection::singled_out(model, (t, q, near), &asked(model, q, own, others), e);
        }
        found => found?,
    };
    let mut r = Reduction::new(model, found.rank);
    start::choose_partition(&mut r, t, q, None, None)?;
    let mut own = own.to_vec();
    let mut rows: Vec<(&Target, f64)> = Vec::new();
    for (x, rate) in others {
        match x.own() {
            Some((_, v)) => own.push((v, *rate)),
            None => rows.push((x, *rate)),
        }
    }
    let mut v = near_with_rates(&mut r, t, q, near, &own)?;
    if rows.is_empty() {
        return Ok(v);
    }
    let largest =
        |v: &[f64]| v.iter().enumerate().fold(0.0, |m: f64, (i, v)| m.max(v.abs() / model.structure().displacement(i)));
    let given = largest(&v);
    let (n, mut s, mut memory) = (v.len(), model.scratch(), vec![0.0; v.len()]);
    let gradients: Vec<Vec<f64>> = rows.iter().map(|(x, _)| gradient(model, q, x, &mut memory, &mut s)).collect();
    // the response to an impulse along each of them: the projection of M^-1 g
    let mut moves: Vec<Vec<f64>> = Vec::with_capacity(rows.len());
    for ((x, _), g) in rows.iter().zip(&gradients) {
        if model.structure().lacks_mass {
            // what takes no momentum to move can still be pushed
            let mut push = momentum(&mut r, t, q, near)?;
            push.iter_mut().zip(g).for_each(|(p, g)| *p += g);
            let moved = pushed_with_rates(&mut r, t, q, &push, &own)?;
            moves.push(moved.iter().zip(&v).map(|(a, b)| a - b).collect());
            continue;
        }
        let (mut phi, mut c, mut a) =
            (vec![0.0; model.size().holonomic], vec![0.0; model.pattern().nnz()], vec![0.0; model.size().rows]);
        model.position(t, q, &mut s, &mut phi, &mut c, &mut a)?;
        let which = &x.velocities;
        let mut columns = vec![0.0; n * which.len()];
        model.inverse_mass_columns(t, q, which, &mut s, &mut columns)?;
        let kick: Vec<f64> = (0..n)
            .map(|i| near[i] + which.iter().enumerate().map(|(j, &w)| columns[i * which.len() + j] * g[w]).sum::<f64>())
            .collect();
        let moved = near_with_rates(&mut r, t, q, &kick, &own)?;
        moves.push(moved.iter().zip(&v).map(|(a, b)| a - b).collect());
    }
    let p = rows.len();
    let mut system = Matrix::new(p, p);
    let mut want = vec![0.0; p];
    for i in 0..p {
        let scale = dense::dot(&gradients[i], &moves[i]).sqrt();
        let scale = if scale > 0.0 { scale } else { 1.0 };
        for j in 0..p {
            let other = dense::dot(&gradients[j], &moves[j]).sqrt();
            system[(i, j)] = dense::dot(&gradients[i], &moves[j]) / scale / if other > 0.0 { other } else { 1.0 };
        }
        want[i] = (rows[i].1 - dense::dot(&gradients[i], &v)) / scale;
    }
    let (mut parts, _) = least_squares_min_norm(&system, &want, tolerance::NULL_VALUE)
        .map_err(|_| SystemError::NotFinite { what: "a rate".into(), t })?;
    for (part, (g, m)) in parts.iter_mut().zip(gradients.iter().zip(&moves)) {
        let scale = dense::dot(g, m).sqrt();
        *part = if scale > 0.0 { *part / scale } else { 0.0 };
    }
    for (part, m) in parts.iter().zip(&moves) {
        v.iter_mut().zip(m).for_each(|(v, m)| *v += part * m);
    }
    let speed = |x: &Target, rate: f64| rate.abs() / x.displacement;
    let asked = rows.iter().fold(0.0, |m: f64, (x, rate)| m.max(speed(x, *rate)));
    let fastest = asked.max(largest(&v));
    let miss = |i: usize| dense::dot(&gradients[i], &v) - rows[i].1;
    let met = met(&mut r);
    if (0..p).any(|i| speed(rows[i].0, miss(i)) > met * fastest) {
        let words: Vec<String> = (0..p)
            .map(|i| format!("{} = {}", rows[i].0.name, possible(rows[i].1, dense::dot(&gradients[i], &v))))
            .chain(own.iter().map(|&(i, rate)| format!("{} = {rate}", model.structure().velocities[i].name)))
            .collect();
        let message = format!(
            "the rates {} are incompatible: with the loops closed, the number of independent rates here is {}",
            words.join(", "),
            r.k()
        );
        return Err(SystemError::argument("rates", message));
    }
    let of_rows = rows.iter().map(|(x, rate)| (x.name.clone(), *rate));
    let named: Vec<(String, f64)> =
        of_rows.chain(own.iter().map(|&(i, rate)| (model.structure().velocity_name(i), rate))).collect();
    unlocked(model, t, &named, asked.max(given), v)
}
