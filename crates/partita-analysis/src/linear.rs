//! Linearised equations of motion about a state, and their modes.
//!
//! ```text
//! x = (z, p, u, p')     x' = f0 + A (x − x0) + B w     z, u: independent positions and velocities, p: of drives      (V5)
//! ```

use crate::error::AnalysisError;
use partita_math::dense::{self, Matrix};
use partita_math::factor::{self, Eigen, FactorError};
use partita_math::sorting::sort_by;
use partita_math::tolerance;
use partita_model::{time_domain, Model};
use partita_system::prelude::*;
pub use partita_system::variation::Driven;

use partita_system::variation::{Derivatives, FirstOrder, Solved, StateError, Varied};
use partita_system::{ConstrainedSystem, SystemRef};

/// Later times at which a steady state is looked at again. Unit: natural time of the linearisation, and s. Reason: a
/// load changes visibly within a tenth of the time in which the mechanism moves, and no wave has its period in all.
const LATER: [f64; 2] = [0.1, 0.0703];

/// The linearised equations.
pub struct Linearized {
    /// A, B, f0 and their parts.
    pub first_order: FirstOrder,
    /// v'.
    pub vdot: Vec<f64>,
    /// λ.
    pub multipliers: Vec<f64>,
    /// Whether f0 stays as it is while the motion goes on: rest, or a motion on which nothing depends. Only then are
    /// eigenvalues of A the same for all coordinates.
    pub steady: bool,
    /// Whether an independent velocity accelerates.
    pub accelerates: bool,
    /// Whether it is at rest without dissipation and without drives as inputs: stiffness and mass are symmetric and
    /// nothing else acts.
    pub conservative: bool,
    /// Modes, where it is steady.
    pub modes: Option<Modes>,
}

/// Eigenvalues and motions of a linearisation.
pub struct Modes {
    /// Eigenvalues of A: real and imaginary parts, in conjugate pairs, the slowest first.
    pub values: Vec<(f64, f64)>,
    /// Changes of all displacements (nv) for each eigenvalue, real and imaginary parts in turn.
    pub shapes: Vec<(Vec<f64>, Vec<f64>)>,
    /// Size of an eigenvalue that counts as zero.
    pub zero: f64,
}

/// States beside a linearised one, from which outputs that are known as numbers alone are differentiated: one ahead and
/// one behind along each state and each input. Central differences of them cancel what is missing to the second order,
/// so the loops need not be closed again.
pub struct Probes {
    /// Steps of states and inputs.
    pub steps: Vec<f64>,
    /// Coordinates, one row each: ahead and behind in turn.
    pub q: Vec<f64>,
    /// Velocities.
    pub v: Vec<f64>,
    /// Accelerations.
    pub vdot: Vec<f64>,
    /// λ.
    pub multipliers: Vec<f64>,
}

impl Linearized {
    /// States beside (q, v).
    pub fn probes(&self, system: &Model, q: &[f64], v: &[f64]) -> Probes {
        let found = &self.first_order;
        let (kz, states, count) = (found.displacements.cols(), found.f0.len(), found.accelerations.cols());
        // where the errors of a central difference meet: h² of the third derivative, ε/h of round-off
        let h = f64::EPSILON.cbrt();
        let inputs = (states..count).map(|j| h * self.size_of(system, j));
        let steps = sizes(system, found).into_iter().map(|s| h * s).chain(inputs);
        let mut made =
            Probes { steps: steps.collect(), q: Vec::new(), v: Vec::new(), vdot: Vec::new(), multipliers: Vec::new() };
        let column = |m: &Matrix, j: usize, by: f64| (0..m.rows()).map(move |i| by * m[(i, j)]).collect::<Vec<_>>();
        let moved = |x: &[f64], m: &Matrix, j: usize, by: f64| -> Vec<f64> {
            x.iter().zip(column(m, j, by)).map(|(x, d)| x + d).collect()
        };
        for j in 0..count {
            for by in [made.steps[j], -made.steps[j]] {
                let mut at = q.to_vec();
                if j < kz {
                    system.step(&mut at, &column(&found.displacements, j, by));
                }
                made.q.extend(at);
                made.v.extend(if j < states { moved(v, &found.rates, j, by) } else { v.to_vec() });
                made.vdot.extend(moved(&self.vdot, &found.accelerations, j, by));
                made.multipliers.extend(moved(&self.multipliers, &found.multipliers, j, by));
            }
        }
        made
    }

    /// Size of an input: what it adds to accelerations or forces is then as large as these.
    fn size_of<S: ConstrainedSystem>(&self, system: &S, j: usize) -> f64 {
        let FirstOrder { accelerations, multipliers, .. } = &self.first_order;
        let gained = self.vdot.iter().enumerate().fold(0.0, |m: f64, (l, x)| {
            m.max(accelerations[(l, j)].abs() / x.abs().max(system.structure().displacement(l)))
        });
        let load = self.multipliers.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
        let added = (0..self.multipliers.len()).fold(0.0, |m: f64, i| m.max(multipliers[(i, j)].abs()));
        let share = gained.max(if load > 0.0 { added / load } else { 0.0 });
        if share > 0.0 {
            1.0 / share
        } else {
            1.0
        }
    }
}

/// Linearise about (t, q, v); `efforts` are columns of E (nv numbers each), one after the other, and the accelerations of
/// the drives are inputs behind them.
///
/// # Errors
/// Singular positions, velocities that violate constraints, a choice that does not serve.
pub fn linearize(
    model: &Model,
    (t, q, v): (f64, &[f64], &[f64]),
    independent: Option<&[usize]>,
    efforts: &[f64],
    driven: &[Driven],
) -> Result<Linearized, AnalysisError> {
    let system = SystemRef::from(model);
    if let Some(corner) = model.one_sided(t, q, v)?.into_iter().next() {
        let message = format!(
            "the equations have no derivative at t = {t} s: {corner}; linearise beside it, where it slides or acts or \
             does not, or remove it"
        );
        return Err(AnalysisError::Argument { argument: "at", message });
    }
    let solved = Solved::new(system.clone(), (t, q, v), independent).map_err(|e| state_error(&*system, e))?;
    let found = solved.first_order(efforts, driven)?;
    let still = system.travel(v) == 0.0;
    let lasting =
        if still || !system.structure().rheonomic { stays(&*system, &found) } else { persists(&solved, (t, q, v))? };
    let accelerates = accelerates(&*system, &solved, &found);
    let steady = lasting
        && !accelerates
        && (still || unchanging(&solved, (t, q, v), &found, driven)?)
        && lasts(model, &solved, (t, q, v), &found, driven)?;
    let conservative = steady && still && driven.is_empty() && !system.structure().rheonomic && is_conservative(&found);
    let mut made = Linearized {
        first_order: found,
        vdot: solved.vdot.clone(),
        multipliers: solved.multipliers.clone(),
        steady,
        accelerates,
        conservative,
        modes: None,
    };
    if steady {
        let modes = if conservative { real_modes(&made.first_order) } else { modes(&*system, &made.first_order) };
        made.modes = Some(modes.map_err(|e| failed(&e))?);
    }
    Ok(made)
}

fn failed(error: &FactorError) -> AnalysisError {
    AnalysisError::Argument { argument: "at", message: format!("the eigenvalues could not be computed: {error}") }
}

/// An error of a state, with the row in words.
pub(crate) fn state_error<S: ConstrainedSystem>(system: &S, error: StateError) -> AnalysisError {
    match error {
        StateError::System(error) => AnalysisError::System(error),
        StateError::Inconsistent { row, rate } => AnalysisError::Argument {
            argument: "at",
            message: format!(
                "the velocities violate constraints, the most {} (by {rate:.3e} per second); make the state with \
                 assemble(rates=...)",
                system.structure().rows[row].description
            ),
        },
    }
}

/// Natural sizes of the states: characteristic displacements, and the same per second.
fn sizes<S: ConstrainedSystem>(system: &S, found: &FirstOrder) -> Vec<f64> {
    let of = |velocities: &[usize], drives: &[usize]| {
        let drives = drives.iter().map(|&i| system.structure().rows[i].size());
        velocities.iter().map(|&i| system.structure().displacement(i)).chain(drives).collect::<Vec<_>>()
    };
    [of(&found.positions, &found.driven_positions), of(&found.velocities, &found.driven_rates)].concat()
}

/// Whether an independent velocity accelerates.
fn accelerates<S: ConstrainedSystem + Varied>(system: &S, solved: &Solved<S>, found: &FirstOrder) -> bool {
    let (kz, n, r) = (found.displacements.cols(), found.f0.len(), &solved.reduction);
    let sizes = sizes(system, found);
    // accelerations that an ordinary displacement would cause, or single forces
    let mut single: Vec<f64> = (0..r.k())
        .map(|j| (0..solved.forces.len()).map(|l| (r.at.dt[l * r.k() + j] * solved.forces[l]).abs()).sum())
        .collect();
    dense::cholesky_solve(&r.at.md_factor, r.k(), &mut single);
    let ordinary = (kz..n).fold(0.0, |m: f64, i| {
        let single = single.get(i - kz).map_or(0.0, |x| x.abs() / sizes[i]);
        (0..kz).fold(m.max(single), |m: f64, j| m.max((found.a[(i, j)] * sizes[j] / sizes[i]).abs()))
    });
    (kz..n).any(|i| found.f0[i].abs() / sizes[i] > tolerance::CLOSED_IN_RUN * ordinary)
}

/// Whether f0, without accelerations, does not change along itself: A f0 = 0.
fn stays<S: ConstrainedSystem>(system: &S, found: &FirstOrder) -> bool {
    let (kz, n, sizes) = (found.displacements.cols(), found.f0.len(), sizes(system, found));
    let scaled = |i: usize, j: usize| found.a[(i, j)] * sizes[j] / sizes[i];
    let rate = |j: usize| found.f0[j] / sizes[j];
    let fastest = (0..kz).fold(0.0, |m: f64, j| m.max(rate(j).abs()));
    let largest =
        (0..n).flat_map(|i| (0..kz).map(move |j| (i, j))).fold(0.0, |m: f64, (i, j)| m.max(scaled(i, j).abs()));
    (0..n).all(|i| {
        (0..kz).map(|j| scaled(i, j) * rate(j)).sum::<f64>().abs() <= tolerance::CLOSED_IN_RUN * largest * fastest
    })
}

/// Whether the independent velocities go on as they are while drives move: by their accelerations a moment ahead and
/// behind, on the motion.
fn persists<S: ConstrainedSystem + Varied>(
    solved: &Solved<S>,
    (t, q, v): (f64, &[f64], &[f64]),
) -> Result<bool, AnalysisError> {
    let system = &solved.reduction.system;
    let fastest = system.travel(v);
    let h = f64::EPSILON.cbrt() / fastest;
    let (ahead, behind) = (beside(solved, (t, q, v), h)?, beside(solved, (t, q, v), -h)?);
    // the fastest motion, and what forces and the drives accelerate by themselves
    let size = |i: usize| system.structure().displacement(i);
    let strongest = (0..v.len()).fold(fastest * fastest, |m: f64, i| m.max(solved.vdot[i].abs() / size(i)));
    Ok(solved.reduction.planned.partition.independent.iter().all(|&i| {
        let grown = (ahead.vdot[i] - behind.vdot[i]).abs() / (2.0 * h);
        grown <= tolerance::OPEN * size(i) * strongest * fastest
    }))
}

/// Whether time itself changes nothing: loads and drives a little later, at the same positions and velocities. Where
/// drives move the mechanism, they change it along the motion alone.
fn lasts(
    model: &Model,
    solved: &Solved<Model>,
    (t, q, v): (f64, &[f64], &[f64]),
    found: &FirstOrder,
    driven: &[Driven],
) -> Result<bool, AnalysisError> {
    let still = model.travel(v) == 0.0;
    let changes = model.structure().rheonomic || time_domain::changes(&model.spec);
    if !changes || (model.structure().rheonomic && !still) {
        return Ok(true);
    }
    let (kz, n, sizes) = (found.displacements.cols(), found.f0.len(), sizes(model, found));
    let scaled = |a: &Matrix, i: usize, j: usize| a[(i, j)] * sizes[j] / sizes[i];
    let all = || (kz..n).flat_map(|i| (0..n).map(move |j| (i, j)));
    let largest = all().fold(0.0, |m: f64, (i, j)| m.max(scaled(&found.a, i, j).abs()));
    let natural = if largest > 1.0 { 1.0 / largest.sqrt() } else { 1.0 };
    let strongest = (0..v.len()).fold(0.0, |m: f64, i| m.max(solved.vdot[i].abs() / model.structure().displacement(i)));
    let exact = found.derivatives == Derivatives::Exact;
    let bound = largest.max(strongest) * if exact { tolerance::CLOSED_IN_RUN } else { tolerance::OPEN };
    let independent = Some(&*solved.reduction.planned.partition.independent);
    for later in LATER.iter().flat_map(|x| [x * natural, *x]) {
        let there = match Solved::new(solved.reduction.system.clone(), (t + later, q, v), independent) {
            Ok(there) => there,
            Err(StateError::Inconsistent { .. }) => return Ok(false),
            // a table has ended, or a function is not defined there: nothing is known of that time
            Err(StateError::System(_)) => continue,
        };
        let by = |i: usize| (there.vdot[i] - solved.vdot[i]).abs() / model.structure().displacement(i);
        let first = there.first_order(&[], driven)?;
        let grown = |(i, j): (usize, usize)| (scaled(&first.a, i, j) - scaled(&found.a, i, j)).abs();
        if (0..v.len()).any(|i| by(i) > bound) || first.positions != found.positions || all().any(|e| grown(e) > bound)
        {
            return Ok(false);
        }
    }
    Ok(true)
}

/// Whether A does not change along the motion: axes that turn with a body, and unequal inertias that turn, change it and
/// accelerate nothing. By A a moment ahead and behind; rates are measured in the time of the fastest motion.
fn unchanging<S: ConstrainedSystem + Varied>(
    solved: &Solved<S>,
    at: (f64, &[f64], &[f64]),
    found: &FirstOrder,
    driven: &[Driven],
) -> Result<bool, AnalysisError> {
    let system = &solved.reduction.system;
    let fastest = system.travel(at.2);
    let h = f64::EPSILON.cbrt() / fastest;
    let (ahead, behind) =
        (beside(solved, at, h)?.first_order(&[], driven)?, beside(solved, at, -h)?.first_order(&[], driven)?);
    if ahead.positions != behind.positions {
        return Ok(false);
    }
    let (kz, n) = (found.displacements.cols(), found.f0.len());
    let sizes: Vec<f64> =
        sizes(&**system, &ahead).iter().enumerate().map(|(i, s)| if i < kz { *s } else { s * fastest }).collect();
    let row = |i: usize| (0..n).fold(0.0, |m: f64, j| m.max((ahead.a[(i, j)] * sizes[j] / sizes[i]).abs()));
    let largest = (0..n).fold(0.0, |m: f64, i| m.max(row(i)));
    let exact = found.derivatives == Derivatives::Exact;
    Ok((0..n).all(|i| {
        let noise = tolerance::OPEN_RATE * largest;
        let bound = if exact { tolerance::OPEN * row(i).max(noise) } else { noise };
        let grown = |j: usize| (ahead.a[(i, j)] - behind.a[(i, j)]) / (2.0 * h) * sizes[j] / sizes[i];
        (0..n).all(|j| grown(j).abs() <= bound * fastest)
    }))
}

/// The motion a time h later, with the same independent velocities.
fn beside<'s, S: ConstrainedSystem + Varied>(
    solved: &Solved<'s, S>,
    (t, q, v): (f64, &[f64], &[f64]),
    h: f64,
) -> Result<Solved<'s, S>, AnalysisError> {
    let system = &solved.reduction.system;
    let (mut q, along) = (q.to_vec(), v.iter().map(|v| h * v).collect::<Vec<_>>());
    system.step(&mut q, &along);
    let v: Vec<f64> = v.iter().zip(&solved.vdot).map(|(v, a)| v + h * a).collect();
    let independent = Some(&*solved.reduction.planned.partition.independent);
    Solved::new(system.clone(), (t + h, &q, &v), independent).map_err(|e| state_error(&**system, e))
}

/// Stiffness symmetric, and no force depends on velocities.
fn is_conservative(found: &FirstOrder) -> bool {
    let (k, stiffness, damping) = (found.velocities.len(), &found.stiffness, &found.damping);
    if found.positions != found.velocities {
        return false;
    }
    let size = |m: &Matrix, i: usize, j: usize| m[(i, j)] / (found.mass[(i, i)] * found.mass[(j, j)]).sqrt();
    let all = || (0..k).flat_map(|i| (0..k).map(move |j| (i, j)));
    let largest = all().fold(0.0, |m: f64, (i, j)| m.max(size(stiffness, i, j).abs()));
    let skew = all().fold(0.0, |m: f64, (i, j)| m.max((size(stiffness, i, j) - size(stiffness, j, i)).abs()));
    let damped = all().fold(0.0, |m: f64, (i, j)| m.max(size(damping, i, j).abs()));
    skew <= tolerance::CLOSED_IN_RUN * largest && damped <= tolerance::CLOSED_IN_RUN * largest.sqrt()
}

/// Modes of M_d u' + K z = 0 by a symmetric matrix: ω² real, none lost to rounding.
fn real_modes(found: &FirstOrder) -> Result<Modes, FactorError> {
    let (k, n) = (found.velocities.len(), found.displacements.rows());
    let mut factor = found.mass.data().to_vec();
    factor::cholesky_large(&mut factor, k)?;
    // L⁻¹ K L⁻ᵀ
    let symmetric = Matrix::from_vec(
        k,
        k,
        (0..k * k)
            .map(|e| 0.5 * (found.stiffness[(e / k, e % k)] + found.stiffness[(e % k, e / k)]))
            .collect::<Vec<f64>>(),
    );
    let half = forward_columns(&factor, k, &symmetric).transpose();
    let reduced = forward_columns(&factor, k, &half);
    let (squares, vectors) = factor::symmetric_eigen(&reduced)?;
    let largest = squares.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
    let zero = tolerance::SOLUTION_ROUNDING.sqrt() * largest.sqrt();
    let mut modes = Modes { values: Vec::new(), shapes: Vec::new(), zero };
    for (j, square) in squares.iter().enumerate() {
        let mut y: Vec<f64> = (0..k).map(|i| vectors[(i, j)]).collect();
        dense::cholesky_backward(&factor, k, &mut y);
        let shape: Vec<f64> = (0..n).map(|l| (0..k).map(|i| found.displacements[(l, i)] * y[i]).sum::<f64>()).collect();
        let root = if square.abs() <= zero * zero { 0.0 } else { square.abs().sqrt() };
        let pair = if *square < 0.0 { [(-root, 0.0), (root, 0.0)] } else { [(0.0, root), (0.0, -root)] };
        for value in pair {
            modes.values.push(value);
            modes.shapes.push((shape.clone(), vec![0.0; n]));
        }
    }
    Ok(modes)
}

/// L⁻¹ X.
fn forward_columns(factor: &[f64], k: usize, x: &Matrix) -> Matrix {
    let mut out = Matrix::new(k, k);
    let mut column = vec![0.0; k];
    for j in 0..k {
        (0..k).for_each(|i| column[i] = x[(i, j)]);
        dense::cholesky_forward(factor, k, &mut column);
        (0..k).for_each(|i| out[(i, j)] = column[i]);
    }
    out
}

/// States x = T y in which A is nearly normal, if it is that of M_d u' + D u + K z = 0: modes of M_d and K without D and
/// what is skew in K, displacements times their frequencies. Masses and stiffnesses of very different sizes then lose
/// nothing.
///
/// `y' = [0  Ω; −Vᵀ L⁻¹ K L⁻ᵀ V Ω⁻¹  −Vᵀ L⁻¹ D L⁻ᵀ V] y,   M_d = L Lᵀ`
fn of_second_order(found: &FirstOrder) -> Option<(Matrix, Matrix)> {
    let k = found.velocities.len();
    if found.positions != found.velocities || found.f0.len() != 2 * k || found.mass.rows() != k {
        return None;
    }
    let (a, m, stiffness, damping) = (&found.a, &found.mass, &found.stiffness, &found.damping);
    let top = |i: usize, j: usize| a[(i, j)] == if j == i + k { 1.0 } else { 0.0 };
    if !(0..k).all(|i| (0..2 * k).all(|j| top(i, j))) {
        return None;
    }
    // forces of A, and those of the parts
    for i in 0..k {
        for j in 0..2 * k {
            let terms: Vec<f64> = (0..k).map(|l| m[(i, l)] * a[(k + l, j)]).collect();
            let part = if j < k { stiffness[(i, j)] } else { damping[(i, j - k)] };
            let size = terms.iter().fold(part.abs(), |s: f64, x| s.max(x.abs()));
            if (terms.iter().sum::<f64>() + part).abs() > tolerance::DIFFERENCE_ROUNDING * size {
                return None;
            }
        }
    }
    let mut factor = m.data().to_vec();
    factor::cholesky_large(&mut factor, k).ok()?;
    let reduced = |x: &Matrix| {
        let half = forward_columns(&factor, k, x).transpose();
        forward_columns(&factor, k, &half).transpose()
    };
    let (stiffness, damping) = (reduced(stiffness), reduced(damping));
    let mean = |e: usize| 0.5 * (stiffness[(e / k, e % k)] + stiffness[(e % k, e / k)]);
    let symmetric = Matrix::from_vec(k, k, (0..k * k).map(mean).collect::<Vec<f64>>());
    let (squares, v) = factor::symmetric_eigen(&symmetric).ok()?;
    let largest = squares.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
    let least = if largest > 0.0 { tolerance::SOLUTION_ROUNDING * largest } else { 1.0 };
    let frequency: Vec<f64> = squares.iter().map(|x| x.abs().max(least).sqrt()).collect();
    let turned = |x: &Matrix| v.transpose().matmul(&x.matmul(&v));
    let (mut stiffness, damping) = (turned(&stiffness), turned(&damping));
    (0..k).for_each(|i| stiffness[(i, i)] = squares[i]);
    let (mut scaled, mut back) = (Matrix::new(2 * k, 2 * k), Matrix::new(2 * k, 2 * k));
    for j in 0..k {
        scaled[(j, j + k)] = frequency[j];
        let mut y: Vec<f64> = (0..k).map(|i| v[(i, j)]).collect();
        dense::cholesky_backward(&factor, k, &mut y);
        for i in 0..k {
            scaled[(k + i, j)] = -stiffness[(i, j)] / frequency[j];
            scaled[(k + i, k + j)] = -damping[(i, j)];
            back[(i, j)] = y[i] / frequency[j];
            back[(k + i, k + j)] = y[i];
        }
    }
    Some((scaled, back))
}

/// Eigenvalues and eigenvectors of A, balanced: by modes, or by the natural sizes of the states.
fn modes<S: ConstrainedSystem>(system: &S, found: &FirstOrder) -> Result<Modes, FactorError> {
    let (count, kz, n) = (found.f0.len(), found.displacements.cols(), found.displacements.rows());
    let (balanced, back) = of_second_order(found).unwrap_or_else(|| {
        let (sizes, mut balanced) = (sizes(system, found), found.a.clone());
        let mut back = Matrix::new(count, count);
        for i in 0..count {
            (0..count).for_each(|j| balanced[(i, j)] *= sizes[j] / sizes[i]);
            back[(i, i)] = sizes[i];
        }
        (balanced, back)
    });
    let Eigen { mut values, re, im } = factor::general_eigen(&balanced)?;
    let largest = values.iter().fold(0.0, |m: f64, x| m.max(x.0.hypot(x.1)));
    let zero = tolerance::SOLUTION_ROUNDING.sqrt() * largest;
    let mut order: Vec<usize> = (0..count).collect();
    sort_by(&mut order, |&a, &b| {
        let size = |x: (f64, f64)| x.0.hypot(x.1);
        size(values[a]).total_cmp(&size(values[b])).then(values[b].1.total_cmp(&values[a].1))
    });
    let shape = |m: &Matrix, j: usize| -> Vec<f64> {
        let state = |i: usize| (0..count).map(|e| back[(i, e)] * m[(e, j)]).sum::<f64>();
        let states: Vec<f64> = (0..kz).map(state).collect();
        (0..n).map(|l| (0..kz).map(|i| found.displacements[(l, i)] * states[i]).sum::<f64>()).collect()
    };
    let shapes = order.iter().map(|&j| (shape(&re, j), shape(&im, j))).collect();
    values = order.iter().map(|&j| values[j]).collect();
    Ok(Modes { values, shapes, zero })
}
