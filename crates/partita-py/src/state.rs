//! Quantities of any system at one state.

use crate::arrays::{array, dense, indices};
use crate::failure;
use numpy::PyArrayDyn;
use partita_analysis::instant;
use partita_system::branching::branch_directions::{selection, RequestedRate};
use partita_system::kinematics::{assembly, velocity};
use partita_system::reduction::Reduction;
use partita_system::{start, ConstrainedSystem, SystemError};
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// An array for Python.
pub type Array<'py> = Bound<'py, PyArrayDyn<f64>>;

/// The reduction with the best partition at (t, q).
fn chosen<'s, S: ConstrainedSystem>(system: &'s S, t: f64, q: &[f64]) -> Result<Reduction<'s, S>, SystemError> {
    let found = start::analyse(system, t, q)?;
    let mut r = Reduction::new(system, found.rank);
    start::choose_partition(&mut r, t, q, None, None)?;
    Ok(r)
}

/// (q, v) with the loops closed, the targets reached and the rates; also the JSON report.
pub fn assemble<S: ConstrainedSystem>(
    system: &S,
    t: f64,
    (mut q, near): (Vec<f64>, &[f64]),
    targets: &[(usize, f64)],
    rates: &[(usize, f64)],
    tolerance: f64,
) -> Result<(Vec<f64>, Vec<f64>, String), SystemError> {
    let closed = assembly::close(system, t, &mut q, tolerance, &[])?;
    let mut steps = 0;
    let (mut iterations, mut residual) = (closed.iterations, closed.residual);
    if !targets.is_empty() {
        let moved = assembly::move_to(system, t, &mut q, targets, tolerance)?;
        iterations += moved.iterations;
        residual = moved.residual;
        steps = moved.target_steps;
    }
    let v = if rates.is_empty() && !system.structure().rheonomic && near.iter().all(|v| *v == 0.0) {
        vec![0.0; system.size().nv]
    } else {
        match chosen(system, t, &q) {
            Err(e @ SystemError::SingularStart { .. }) => {
                let n = system.size().nv;
                let asked = |&(i, rate): &(usize, f64)| {
                    let row = (0..n).map(|j| f64::from(u8::from(i == j))).collect();
                    RequestedRate {
                        name: system.structure().velocity_name(i),
                        row,
                        displacement: system.structure().displacement(i),
                        rate,
                    }
                };
                let asked: Vec<RequestedRate> = rates.iter().map(asked).collect();
                selection::singled_out(system, (t, &q, near), &asked, e)?
            }
            found => velocity::near_with_rates(&mut found?, t, &q, near, rates)?,
        }
    };
    let report = serde_json::json!({
        "iterations": iterations, "residual": residual, "target_steps": steps, "explicit": false
    });
    Ok((q, v, report.to_string()))
}

/// v' and λ, by a partition chosen there.
pub fn acceleration<'py, S: ConstrainedSystem>(
    py: Python<'py>,
    system: &S,
    t: f64,
    q: &[f64],
    v: &[f64],
) -> PyResult<(Array<'py>, Array<'py>)> {
    let compute = || -> Result<_, SystemError> {
        let mut r = chosen(system, t, q)?;
        let speeds: Vec<f64> = r.planned.partition.independent.iter().map(|&i| v[i]).collect();
        r.evaluate(t, q, &speeds)?;
        let size = system.size();
        let (mut vdot, mut lambda) = (vec![0.0; size.nv], vec![0.0; size.rows]);
        r.full_acceleration(&mut vdot);
        r.multipliers(t, q, &vdot, &mut lambda)?;
        Ok((vdot, lambda))
    };
    let (vdot, lambda) = compute().map_err(|e| failure::system(py, e))?;
    Ok((array(py, &[vdot.len()], vdot), array(py, &[lambda.len()], lambda)))
}

/// Everything of S1-S5 and P1-P4 at one instant, by name.
pub fn at<'py, S: ConstrainedSystem>(
    py: Python<'py>,
    system: &S,
    t: f64,
    q: &[f64],
    v: Option<&[f64]>,
) -> PyResult<Bound<'py, PyDict>> {
    reported(py, instant::at(system, t, q, v).map_err(|e| failure::system(py, e))?)
}

/// An instant by name.
pub fn reported(py: Python<'_>, i: instant::Instant) -> PyResult<Bound<'_, PyDict>> {
    let d = PyDict::new(py);
    let s = i.split;
    for (name, x) in [("M", i.mass), ("C", i.c), ("A", s.a), ("D", s.d), ("M_d", i.md)] {
        d.set_item(name, dense(py, x))?;
    }
    let vectors = [
        ("v", i.v),
        ("h", i.h),
        ("a", i.a),
        ("b", i.b),
        ("eta", i.eta),
        ("xi", i.xi),
        ("h_d", i.hd),
        ("vdot", i.vdot),
        ("multipliers", i.multipliers),
        ("rho", i.rho),
    ];
    for (name, x) in vectors {
        d.set_item(name, array(py, &[x.len()], x))?;
    }
    for (name, x) in [("independent", s.independent), ("dependent", s.dependent), ("rows", s.rows)] {
        d.set_item(name, indices(py, &x))?;
    }
    d.set_item("sigma", i.sigma)?;
    d.set_item("sqrt_mu", i.sqrt_mu)?;
    Ok(d)
}

/// ρ at a position.
pub fn measure<'py, S: ConstrainedSystem>(py: Python<'py>, system: &S, t: f64, q: &[f64]) -> PyResult<Array<'py>> {
    let compute = || -> Result<_, SystemError> {
        let mut r = chosen(system, t, q)?;
        r.evaluate(t, q, &vec![0.0; r.k()])?;
        let mut rho = vec![0.0; system.size().nv];
        r.measure(t, q, &mut rho)?;
        Ok(rho)
    };
    let rho = compute().map_err(|e| failure::system(py, e))?;
    Ok(array(py, &[rho.len()], rho))
}
