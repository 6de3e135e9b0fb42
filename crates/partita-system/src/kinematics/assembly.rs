//! Closing the loops. A far start and a near start are different jobs: `close` goes from a rough drawing to the
//! nearest closed position, `move_to` walks a closed mechanism along its own motion to given coordinates.

use crate::formulation::reduction::Reduction;
use crate::kinematics::projection::dense_rows;
use crate::start;
use crate::system::{ConstrainedSystem, SystemError};
use partita_math::dense::Matrix;
use partita_math::factor;

/// Above this number of coordinates the sparse elimination replaces the least-norm step (a dense SVD).
const DENSE_LIMIT: usize = 500;
/// Largest move in one iteration, in reaches (radians for turns).
const LARGEST_MOVE: f64 = 0.3;
/// Largest step towards a target, in reaches.
const TARGET_STEP: f64 = 0.1;

/// What the assembly did.
#[derive(Clone, Copy, Debug, Default)]
pub struct Assembly {
    /// Newton iterations in all.
    pub iterations: usize,
    /// Largest |Φ| at the end.
    pub residual: f64,
    /// Steps taken towards targets.
    pub target_steps: usize,
}

struct Closer<'s, S: ConstrainedSystem> {
    system: &'s S,
    probe: Reduction<'s, S>,
    reach: Vec<f64>,
}

impl<'s, S: ConstrainedSystem> Closer<'s, S> {
    fn new(system: &'s S) -> Self {
        let reach = (0..system.size().nv).map(|i| system.reach(i)).collect();
        Self { system, probe: Reduction::new(system, 0), reach }
    }

    fn residual(&mut self, t: f64, q: &[f64]) -> Result<f64, SystemError> {
        self.probe.position(t, q)?;
        Ok(self.probe.closure())
    }

    fn square(&self) -> f64 {
        self.probe.phi.iter().map(|x| x * x).sum()
    }

    /// Least-norm move (in reaches) with `C Δ = −Φ` and `Δ_i = δ_i` for the targets; locked velocities rest.
    fn least_move(&mut self, targets: &[(usize, f64)], locked: &[usize]) -> Result<Vec<f64>, SystemError> {
        let h = self.probe.phi.len();
        let rows: Vec<usize> = (0..h).collect();
        let c = dense_rows(self.system, &self.probe.c, &rows);
        let n = self.reach.len();
        let mut j = Matrix::new(h + targets.len(), n);
        let mut x = vec![0.0; h + targets.len()];
        for i in 0..h {
            x[i] = -self.probe.phi[i];
            for (k, r) in self.reach.iter().enumerate() {
                j[(i, k)] = if locked.contains(&k) { 0.0 } else { c[(i, k)] * r };
            }
        }
        for (i, &(k, d)) in targets.iter().enumerate() {
            j[(h + i, k)] = self.reach[k];
            x[h + i] = d;
        }
        let (y, _) = factor::least_squares_min_norm(&j, &x, 1e-9)
            .map_err(|_| SystemError::NotFinite { what: "a closing condition".into(), t: f64::NAN })?;
        Ok(y)
    }

    /// Newton with least-norm steps, damped so that no coordinate runs away; `locked` targets keep their value.
    fn close(&mut self, t: f64, q: &mut [f64], tolerance: f64, locked: &[usize]) -> Result<Assembly, SystemError> {
        let mut report = Assembly { residual: self.residual(t, q)?, ..Assembly::default() };
        let mut trial = q.to_vec();
        let mut stalled = 0;
        while report.residual > tolerance * 1e-3 && report.iterations < 100 {
            let before = self.square();
            let y = self.least_move(&[], locked)?;
            let largest = y.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
            let mut scale = (LARGEST_MOVE / largest.max(1e-300)).min(1.0);
            report.iterations += 1;
            let mut better = false;
            for _ in 0..10 {
                trial.copy_from_slice(q);
                let step: Vec<f64> = y.iter().zip(&self.reach).map(|(y, r)| y * r * scale).collect();
                self.system.step(&mut trial, &step);
                self.system.normalise(&mut trial);
                let residual = self.residual(t, &trial)?;
                if self.square() < before {
                    better = true;
                    // below the tolerance only a real gain is worth another iteration
                    let gain = residual < 0.5 * report.residual;
                    q.copy_from_slice(&trial);
                    report.residual = residual;
                    stalled = if gain { 0 } else { stalled + 1 };
                    break;
                }
                scale *= 0.5;
            }
            if !better || (stalled >= 3 && report.residual <= tolerance) || stalled >= 30 {
                break;
            }
        }
        report.residual = self.residual(t, q)?;
        Ok(report)
    }

    fn failure(&mut self, report: Assembly, tolerance: f64, advice: &str) -> SystemError {
        let mut open: Vec<(usize, f64)> =
            self.probe.phi.iter().enumerate().map(|(i, x)| (i, x.abs())).filter(|x| x.1 > tolerance).collect();
        open.sort_by(|a, b| b.1.total_cmp(&a.1));
        let loops: Vec<String> =
            open.iter().take(6).map(|&(i, x)| format!("{} by {x:.3e}", self.system.row_words(i))).collect();
        SystemError::Assembly {
            iterations: report.iterations,
            residual: report.residual,
            tolerance,
            loops: loops.join(", "),
            advice: advice.into(),
        }
    }
}

/// Close a rough drawing: the nearest position with Φ(q, t) = 0 that damped least-norm Newton steps reach.      (S3)
///
/// Redundant rows are harmless. `locked` velocities keep their coordinate. Fails with the residual of each open row
/// when the lengths cannot close.
pub fn close<S: ConstrainedSystem>(
    system: &S,
    t: f64,
    q: &mut [f64],
    tolerance: f64,
    locked: &[usize],
) -> Result<Assembly, SystemError> {
    let mut closer = Closer::new(system);
    let residual = closer.residual(t, q)?;
    if residual.is_infinite() {
        return Err(SystemError::NotFinite { what: "a closing condition".into(), t });
    }
    if residual <= tolerance * 1e-3 {
        return Ok(Assembly { residual, ..Assembly::default() });
    }
    if system.size().nv > DENSE_LIMIT {
        return close_sparse(system, &mut closer, t, q, tolerance);
    }
    let report = closer.close(t, q, tolerance, locked)?;
    if report.residual > tolerance {
        let advice =
            if report.iterations >= 100 { "start closer" } else { "check the lengths: this is the closest they come" };
        return Err(closer.failure(report, tolerance, advice));
    }
    Ok(report)
}

fn close_sparse<S: ConstrainedSystem>(
    system: &S,
    closer: &mut Closer<S>,
    t: f64,
    q: &mut [f64],
    tolerance: f64,
) -> Result<Assembly, SystemError> {
    let found = start::analyse(system, t, q)?;
    let mut r = Reduction::new(system, found.rank);
    start::choose_partition(&mut r, t, q, None, None)?;
    let mut report = Assembly { residual: r.closure(), ..Assembly::default() };
    while report.iterations < 50 {
        r.position(t, q)?;
        r.factor(t)?;
        let residual = r.closure();
        if report.iterations > 0 && residual > 0.5 * report.residual && residual <= tolerance {
            report.residual = residual;
            break;
        }
        report.residual = residual;
        r.correct_dependent(q);
        report.iterations += 1;
    }
    report.residual = closer.residual(t, q)?;
    if report.residual > tolerance {
        return Err(closer.failure(report, tolerance, "start closer or check the lengths"));
    }
    Ok(report)
}

/// Walk a closed mechanism to given coordinates `(coordinate, value)` along its own motion, branch kept.
///
/// Steps of at most a tenth of a radian (or reach), each closed again before the next; halved where the loops resist.
/// Fails with the value reached when the mechanism cannot go there.
pub fn move_to<S: ConstrainedSystem>(
    system: &S,
    t: f64,
    q: &mut [f64],
    targets: &[(usize, f64)],
    tolerance: f64,
) -> Result<Assembly, SystemError> {
    let mut closer = Closer::new(system);
    let mut pairs = Vec::with_capacity(targets.len());
    for &(i, value) in targets {
        let Some(v) = system.velocity_of_coordinate(i) else {
            return Err(SystemError::Request(format!(
                "coordinate {i} of a turn in space cannot be a target by itself"
            )));
        };
        if !value.is_finite() {
            return Err(SystemError::Request(format!("the target of {} is {value}", system.velocity_name(v))));
        }
        pairs.push((i, v, value));
    }
    let locked: Vec<usize> = pairs.iter().map(|p| p.1).collect();
    let mut report = Assembly::default();
    let mut fraction = 1.0f64;
    let mut here = q.to_vec();
    loop {
        let rest: Vec<f64> = pairs.iter().map(|&(i, _, value)| value - q[i]).collect();
        let far = pairs.iter().zip(&rest).fold(0.0, |m: f64, (p, d)| m.max(d.abs() / closer.reach[p.1]));
        if far == 0.0 {
            break;
        }
        let part = (TARGET_STEP * fraction / far).min(1.0);
        let wanted: Vec<(usize, f64)> = pairs.iter().zip(&rest).map(|(p, d)| (p.1, d * part)).collect();
        here.copy_from_slice(q);
        let stepped = step_towards(system, &mut closer, t, q, &wanted, &locked, tolerance, &mut report);
        let moved_far = |closer: &Closer<S>, q: &[f64], here: &[f64]| {
            (0..here.len()).any(|i| {
                system
                    .velocity_of_coordinate(i)
                    .is_some_and(|v| (q[i] - here[i]).abs() > 5.0 * closer.reach[v] * TARGET_STEP)
            })
        };
        match stepped {
            Ok(()) if !moved_far(&closer, q, &here) => {
                report.target_steps += 1;
                fraction = (2.0 * fraction).min(1.0);
                if part == 1.0 {
                    for &(i, _, value) in &pairs {
                        q[i] = value; // exactly what was asked for, round-off of the steps removed
                    }
                    break;
                }
            }
            _ => {
                q.copy_from_slice(&here);
                fraction *= 0.5;
                if fraction < 1e-4 {
                    let reached: Vec<String> = pairs
                        .iter()
                        .map(|&(i, v, value)| format!("{} reached {:.6} of {value:.6}", system.velocity_name(v), q[i]))
                        .collect();
                    // how far the loops are from closing at the target itself: the shortfall
                    for &(i, _, value) in &pairs {
                        here[i] = value;
                    }
                    let there = closer.close(t, &mut here, tolerance, &locked)?;
                    report.residual = there.residual;
                    let advice = format!("{}: the loops do not let it go further; ask for less", reached.join(", "));
                    return Err(closer.failure(report, tolerance, &advice));
                }
            }
        }
        if report.target_steps > 100_000 {
            return Err(closer.failure(report, tolerance, "the target is too many turns away"));
        }
    }
    let last = close(system, t, q, tolerance, &locked)?;
    report.iterations += last.iterations;
    report.residual = last.residual;
    Ok(report)
}

fn step_towards<S: ConstrainedSystem>(
    system: &S,
    closer: &mut Closer<S>,
    t: f64,
    q: &mut [f64],
    wanted: &[(usize, f64)],
    locked: &[usize],
    tolerance: f64,
    report: &mut Assembly,
) -> Result<(), SystemError> {
    if system.size().nv > DENSE_LIMIT {
        let found = start::analyse(system, t, q)?;
        let mut r = Reduction::new(system, found.rank);
        let mut weights = vec![1.0; system.size().nv];
        for &(v, _) in wanted {
            weights[v] = 1e6; // wanted coordinates become independent wherever they can
        }
        start::choose_partition(&mut r, t, q, Some(&weights), None)?;
        let mut moves = vec![0.0; r.k()];
        for &(v, d) in wanted {
            match r.partition.independent.iter().position(|&i| i == v) {
                Some(j) => moves[j] = d,
                None => {
                    return Err(SystemError::Request(format!(
                        "the target of {} follows from the other targets",
                        system.velocity_name(v)
                    )))
                }
            }
        }
        r.gamma.fill(0.0);
        r.spread(&moves);
        let v = r.v.clone();
        system.step(q, &v);
        for _ in 0..8 {
            r.position(t, q)?;
            r.factor(t)?;
            r.correct_dependent(q);
            report.iterations += 1;
        }
        closer.residual(t, q)?;
    } else {
        closer.residual(t, q)?;
        let y = closer.least_move(wanted, &[])?;
        let step: Vec<f64> = y.iter().zip(&closer.reach).map(|(y, r)| y * r).collect();
        // the linear system answers in the least-squares sense: what it cannot do is a limit of the mechanism
        for &(v, d) in wanted {
            if (step[v] - d).abs() > 1e-6 * closer.reach[v] + 1e-3 * d.abs() {
                return Err(closer.failure(*report, tolerance, "the target is out of reach"));
            }
        }
        system.step(q, &step);
        system.normalise(q);
        let r = closer.close(t, q, tolerance, locked)?;
        report.iterations += r.iterations;
    }
    if closer.probe.closure() > tolerance {
        return Err(closer.failure(*report, tolerance, "the loops do not close"));
    }
    Ok(())
}
