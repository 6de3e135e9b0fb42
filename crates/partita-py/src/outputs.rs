//! Tables with a row for each output, as arrays.

use crate::arrays::{array, shaped};
use crate::ending::{entered, released};
use crate::failure;
use partita_analysis::error::AnalysisError;
use partita_analysis::outputs::Watch;
use partita_analysis::run::{Assessed, Described};
use partita_system::Size;
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// Compute while other Python threads run; Ctrl-C is checked between the rows.
pub fn watched<T: Send>(py: Python<'_>, f: impl FnOnce(Watch) -> Result<T, AnalysisError> + Send) -> PyResult<T> {
    let mut asked = Ok(());
    let found = released(py, || {
        f(&mut || {
            asked = entered(|py| py.check_signals());
            asked.as_ref().map_or(Err(AnalysisError::Stopped), |_| Ok(()))
        })
    });
    asked?;
    found.map_err(|e| failure::analysis(py, e))
}

/// Quantities at nt outputs of a system, by name.
pub fn described(py: Python<'_>, nt: usize, size: Size, x: Described) -> PyResult<Bound<'_, PyDict>> {
    let tables = [x.vdot, x.multipliers, x.closure, x.velocity_closure];
    let shapes: [(&str, &[usize]); 4] =
        [("vdot", &[size.nv]), ("multipliers", &[size.rows]), ("closure", &[]), ("velocity_closure", &[])];
    let d = named(py, nt, tables, &shapes)?;
    // -1: nothing was chosen in a singular position
    let chosen = x.independent.iter().map(|i| if i.is_nan() { -1 } else { *i as i64 }).collect();
    d.set_item("independent", shaped(py, &[nt, x.k], chosen))?;
    d.set_item("notes", x.notes)?;
    Ok(d)
}

/// Measures, qualities and, where they are others than velocities of the system, tangent velocities at nt outputs, by
/// name.
pub fn assessed(py: Python<'_>, nt: usize, size: Size, x: Assessed) -> PyResult<Bound<'_, PyDict>> {
    let shapes: [(&str, &[usize]); 3] = [("measure", &[size.nv]), ("sigma", &[]), ("sqrt_mu", &[])];
    let d = named(py, nt, [x.measure, x.sigma, x.sqrt_mu], &shapes)?;
    if !x.selector.is_empty() {
        let k = x.selector.len() / (nt * size.nv);
        d.set_item("selector", array(py, &[nt, k, size.nv], x.selector))?;
    }
    Ok(d)
}

/// Name and array of each table; `shape` gives its axes after time.
pub fn named<'py>(
    py: Python<'py>,
    nt: usize,
    tables: impl IntoIterator<Item = Vec<f64>>,
    shapes: &[(&str, &[usize])],
) -> PyResult<Bound<'py, PyDict>> {
    let d = PyDict::new(py);
    for (data, (name, shape)) in tables.into_iter().zip(shapes) {
        d.set_item(name, array(py, &[&[nt], *shape].concat(), data))?;
    }
    Ok(d)
}
<<<<<<< HEAD

/// Poses and twists of the bodies `which`.
pub fn bodies<'py>(py: Python<'py>, m: &Model, x: &Motion, which: &[usize]) -> PyResult<Bound<'py, PyDict>> {
    known(py, which, m.spec.bodies.len(), "body")?;
    let (states, nb) = (x.states(), which.len());
    let found = tables(py, |watch| outputs::bodies(m, &states, which, watch))?;
    let shapes: [(&str, &[usize]); 4] = [
        ("body_position", &[nb, 3]),
        ("body_rotation", &[nb, 3, 3]),
        ("body_velocity", &[nb, 3]),
        ("body_angular_velocity", &[nb, 3]),
    ];
    named(py, states.len(), found, &shapes)
}

/// Coordinates, velocities and points of the joints `which`.
pub fn joints<'py>(py: Python<'py>, m: &Model, x: &Motion, which: &[usize]) -> PyResult<Bound<'py, PyDict>> {
    known(py, which, m.spec.joints.len(), "joint")?;
    let (states, nj) = (x.states(), which.len());
    let found = tables(py, |watch| outputs::joints(m, &states, which, watch))?;
    let shape = |j: &usize| m.shape(*j);
    let nq = which.iter().flat_map(|j| &shape(j).motions).map(partita_model::joint::Motion::coordinates).sum();
    let nv = which.iter().map(|j| shape(j).dof()).sum();
    let shapes: [(&str, &[usize]); 3] =
        [("joint_position", &[nq]), ("joint_velocity", &[nv]), ("joint_point", &[nj, 3])];
    named(py, states.len(), found, &shapes)
}

/// Accelerations along the degrees of freedom of the joints `which` (nt, degrees of freedom).
pub fn joint_accelerations<'py>(
    py: Python<'py>,
    m: &Model,
    x: &Motion,
    vdot: &PyReadonlyArray2<'py, f64>,
    which: &[usize],
) -> PyResult<Array<'py>> {
    known(py, which, m.spec.joints.len(), "joint")?;
    let states = x.states();
    let vdot = rows_of(vdot, states.len(), m.size().nv, "vdot")?;
    let mut found = tables(py, |watch| outputs::joint_accelerations(m, &states, &vdot, which, watch))?;
    let nv = which.iter().map(|&j| m.shape(j).dof()).sum();
    Ok(array(py, &[states.len(), nv], found.next().unwrap_or_default()))
}

/// Accelerations of the origins of the bodies `which`, and angular accelerations.
pub fn body_accelerations<'py>(
    py: Python<'py>,
    m: &Model,
    x: &Motion,
    vdot: &PyReadonlyArray2<'py, f64>,
    which: &[usize],
) -> PyResult<Bound<'py, PyDict>> {
    known(py, which, m.spec.bodies.len(), "body")?;
    let (states, nb) = (x.states(), which.len());
    let vdot = rows_of(vdot, states.len(), m.size().nv, "vdot")?;
    let found = tables(py, |watch| outputs::body_accelerations(m, &states, &vdot, which, watch))?;
    let shapes: [(&str, &[usize]); 2] = [("body_acceleration", &[nb, 3]), ("body_angular_acceleration", &[nb, 3])];
    named(py, states.len(), found, &shapes)
}

/// Effect of applied force `number`.
pub fn load<'py>(py: Python<'py>, m: &Model, x: &Motion, number: usize) -> PyResult<Bound<'py, PyDict>> {
    let states = x.states();
    let (found, n) = watched(py, |watch| outputs::load(m, &states, number, watch))?;
    let shapes: [(&str, &[usize]); 6] = [
        ("power", &[]),
        ("potential", &[]),
        ("effort", &[]),
        ("point", &[n, 3]),
        ("force", &[n, 3]),
        ("moment", &[n, 3]),
    ];
    named(py, states.len(), found.into_iter(), &shapes)
}

/// Kinetic and potential energy.
pub fn energies<'py>(py: Python<'py>, m: &Model, x: &Motion) -> PyResult<Bound<'py, PyDict>> {
    let states = x.states();
    let found = tables(py, |watch| outputs::energies(m, &states, watch))?;
    named(py, states.len(), found, &[("kinetic", &[]), ("potential", &[])])
}

/// Wrench of one joint, effort of its drives and its axes.
pub fn reaction<'py>(
    py: Python<'py>,
    m: &Model,
    x: &Motion,
    acting: &Acting,
    joint: usize,
) -> PyResult<Bound<'py, PyDict>> {
    known(py, &[joint], m.spec.joints.len(), "joint")?;
    let (states, forces) = (x.states(), acting.forces());
    let found = tables(py, |watch| outputs::reaction(m, &states, &forces, joint, watch))?;
    let nv = m.shape(joint).dof();
    let shapes: [(&str, &[usize]); 4] =
        [("force", &[3]), ("moment", &[3]), ("drive", &[nv]), ("joint_rotation", &[3, 3])];
    named(py, states.len(), found, &shapes)
}

/// Wrenches of all joints and efforts of the drives, by the recursion along the tree.
pub fn reactions<'py>(py: Python<'py>, m: &Model, x: &Motion, acting: &Acting) -> PyResult<Bound<'py, PyDict>> {
    let (states, forces, nj) = (x.states(), acting.forces(), m.spec.joints.len());
    let found = tables(py, |watch| outputs::reactions(m, &states, &forces, watch))?;
    let nv = m.zero_position().joints.iter().map(|p| p.shape.dof()).sum();
    let shapes: [(&str, &[usize]); 7] = [
        ("force", &[nj, 3]),
        ("moment", &[nj, 3]),
        ("drive", &[nv]),
        ("joint_rotation", &[nj, 3, 3]),
        ("residual", &[]),
        ("residuals", &[m.spec.bodies.len()]),
        ("effort", &[m.size().rows - m.closing_rows]),
    ];
    named(py, states.len(), found, &shapes)
}

/// Forces and moments of all joints, by augmented joint coordinates.
pub fn augmented_reactions<'py>(
    py: Python<'py>,
    m: &Model,
    x: &Motion,
    acting: &Acting,
) -> PyResult<(Array<'py>, Array<'py>)> {
    let (states, forces, nj) = (x.states(), acting.forces(), m.spec.joints.len());
    let mut found = tables(py, |watch| outputs::augmented(m, &states, &forces, watch))?;
    let mut next = || array(py, &[states.len(), nj, 3], found.next().unwrap_or_default());
    Ok((next(), next()))
}

/// Whether self-stresses make reactions of this motion indeterminate.
pub fn shares(py: Python<'_>, m: &Model, x: &Motion, acting: &Acting) -> PyResult<bool> {
    watched(py, |_| outputs::shares(m, &x.states(), &acting.forces()))
}

/// Acceleration closure with its row, worst row of the closure, rank and margin.
pub fn checks<'py>(py: Python<'py>, m: &Model, x: &Motion, acting: &Acting) -> PyResult<Bound<'py, PyDict>> {
    let (states, forces) = (x.states(), acting.forces());
    let found = tables(py, |watch| outputs::checks(m, &states, &forces, watch))?;
    let shapes: [(&str, &[usize]); 5] = [
        ("acceleration_closure", &[]),
        ("acceleration_row", &[]),
        ("closure_row", &[]),
        ("rank", &[]),
        ("margin", &[]),
    ];
    named(py, states.len(), found, &shapes)
}

/// Boolean values.
pub type Flags<'py> = Bound<'py, PyArrayDyn<bool>>;

/// Flags of all joints in world axes and in joint axes (nt, nj, 6), of the efforts along their degrees of freedom (nt,
/// degrees of freedom), and of the multipliers of couplings, drives and joints' own conditions (nt, conditions).
pub fn determined<'py>(py: Python<'py>, m: &Model, x: &Motion) -> PyResult<[Flags<'py>; 4]> {
    let (states, nj) = (x.states(), m.spec.joints.len());
    let dof = m.zero_position().joints.iter().map(|p| p.shape.dof()).sum();
    let mut found = tables(py, |watch| determined::flags(m, &states, watch))?;
    let mut next = |shape: &[usize]| {
        let flags = found.next().unwrap_or_default().into_iter().map(|x| x != 0.0).collect();
        shaped(py, shape, flags)
    };
    let wrench = [states.len(), nj, 6];
    let conditions = m.size().rows - m.closing_rows;
    Ok([next(&wrench), next(&wrench), next(&[states.len(), dof]), next(&[states.len(), conditions])])
}

/// Directions in which self-stresses load a joint: (nt, 2, 3, 3) for force and moment, in units of the level that
/// counts as zero.
pub fn self_stresses<'py>(py: Python<'py>, m: &Model, x: &Motion, joint: usize) -> PyResult<Array<'py>> {
    known(py, &[joint], m.spec.joints.len(), "joint")?;
    let states = x.states();
    let found = watched(py, |watch| determined::directions(m, &states, joint, watch))?;
    assert_eq!(found.len(), DIRECTIONS * states.len());
    Ok(array(py, &[states.len(), 2, 3, 3], found))
}
=======
>>>>>>> tables
