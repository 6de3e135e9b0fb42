//! What a mechanism shows along sampled states: bodies, joints, energies, reactions.

use crate::arrays::{any_vector, array, matrix};
use crate::failure::{self, raise};
use crate::state::{Array, Levels};
use numpy::{PyReadonlyArray1, PyReadonlyArray2};
use partita_model::observe::TurnCounter;
use partita_model::Model;
use partita_system::ConstrainedSystem;
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// States at some times, row by row; what was not asked for is empty.
pub struct States {
    t: Vec<f64>,
    q: Vec<f64>,
    v: Vec<f64>,
    vdot: Vec<f64>,
    multipliers: Vec<f64>,
}

/// Entries of a matrix with one row a time.
fn rows(x: &PyReadonlyArray2<'_, f64>, nt: usize, width: usize, what: &str) -> PyResult<Vec<f64>> {
    let (height, columns, data) = matrix(x);
    if (height, columns) != (nt, width) {
        let message = format!("{what} is {height} x {columns}; it must be {nt} x {width}, a row for each time");
        return Err(raise(x.py(), "ArgumentError", &message, &[("argument", what.into())]));
    }
    Ok(data)
}

impl States {
    /// t, q and v, their shapes checked.
    pub fn read(
        m: &Model,
        t: &PyReadonlyArray1<'_, f64>,
        q: &PyReadonlyArray2<'_, f64>,
        v: &PyReadonlyArray2<'_, f64>,
    ) -> PyResult<Self> {
        let (t, size) = (any_vector(t), m.size());
        let (q, v) = (rows(q, t.len(), size.nq, "q")?, rows(v, t.len(), size.nv, "v")?);
        Ok(Self { t, q, v, vdot: Vec::new(), multipliers: Vec::new() })
    }

    /// Accelerations and multipliers besides.
    pub fn with_forces(
        mut self,
        m: &Model,
        vdot: &PyReadonlyArray2<'_, f64>,
        multipliers: &PyReadonlyArray2<'_, f64>,
    ) -> PyResult<Self> {
        let (nt, size) = (self.t.len(), m.size());
        self.vdot = rows(vdot, nt, size.nv, "vdot")?;
        self.multipliers = rows(multipliers, nt, size.rows, "multipliers")?;
        Ok(self)
    }

    fn row<'x>(&self, x: &'x [f64], i: usize) -> &'x [f64] {
        let width = x.len() / self.t.len();
        &x[i * width..(i + 1) * width]
    }

    /// t, q and v of sample i.
    fn at(&self, i: usize) -> (f64, &[f64], &[f64]) {
        (self.t[i], self.row(&self.q, i), self.row(&self.v, i))
    }

    /// v' and λ of sample i.
    fn forces_at(&self, i: usize) -> (&[f64], &[f64]) {
        (self.row(&self.vdot, i), self.row(&self.multipliers, i))
    }
}

/// Poses and velocities of bodies and joints, and the energies.
pub fn observe<'py>(py: Python<'py>, m: &Model, states: &States) -> PyResult<Bound<'py, PyDict>> {
    let (nt, nb, nj) = (states.t.len(), m.spec.bodies.len(), m.spec.joints.len());
    let mut levels = Levels::new(m);
    let (mut position, mut rotation, mut velocity, mut spin) = (vec![], vec![], vec![], vec![]);
    let (mut jq, mut jv, mut point) = (vec![], vec![], vec![]);
    let (mut kinetic, mut potential) = (vec![], vec![]);
    let mut tracker = TurnCounter::new(m);
    for i in 0..nt {
        let (t, q, v) = states.at(i);
        levels.velocity(t, q, v).map_err(|e| failure::system(py, e))?;
        let s = &mut levels.scratch;
        let (k, p) = m.energy(t, q, v, s).map_err(|e| failure::system(py, e))?;
        kinetic.push(k);
        potential.push(p);
        m.look(q, v, s);
        for body in 0..nb {
            let x = m.body_state(body, s);
            position.extend(x.position.0);
            rotation.extend(x.rotation.0.concat());
            velocity.extend(x.velocity.0);
            spin.extend(x.angular_velocity.0);
        }
        for j in 0..nj {
            let mut x = m.joint_state(j, q, v, s);
            tracker.unwrap(j, t, &mut x);
            jq.extend(x.position);
            jv.extend(x.velocity);
            point.extend(x.point);
        }
    }
    let width = |x: &Vec<f64>| x.len().checked_div(nt).unwrap_or(0);
    let d = PyDict::new(py);
    d.set_item("body_position", array(py, &[nt, nb, 3], position))?;
    d.set_item("body_rotation", array(py, &[nt, nb, 3, 3], rotation))?;
    d.set_item("body_velocity", array(py, &[nt, nb, 3], velocity))?;
    d.set_item("body_angular_velocity", array(py, &[nt, nb, 3], spin))?;
    d.set_item("joint_position", array(py, &[nt, width(&jq)], jq))?;
    d.set_item("joint_velocity", array(py, &[nt, width(&jv)], jv))?;
    d.set_item("joint_point", array(py, &[nt, nj, 3], point))?;
    d.set_item("kinetic", array(py, &[nt], kinetic))?;
    d.set_item("potential", array(py, &[nt], potential))?;
    Ok(d)
}

/// Wrenches of all joints and efforts of the drives, by the recursion along the tree.
pub fn reactions<'py>(py: Python<'py>, m: &Model, states: &States) -> PyResult<Bound<'py, PyDict>> {
    let (nt, nj) = (states.t.len(), m.spec.joints.len());
    let mut s = m.scratch();
    let (mut force, mut moment, mut drive, mut frame, mut residual) = (vec![], vec![], vec![], vec![], vec![]);
    for i in 0..nt {
        let ((t, q, v), (vdot, lambda)) = (states.at(i), states.forces_at(i));
        let r = m.reactions(t, q, v, vdot, lambda, &mut s).map_err(|e| failure::system(py, e))?;
        for (j, w) in r.joints.iter().enumerate() {
            force.extend(w.force.0);
            moment.extend(w.moment.0);
            frame.extend(m.joint_frame(j, &s).0.concat());
        }
        drive.extend(r.drives.concat());
        residual.push(r.residual);
    }
    let width = drive.len().checked_div(nt).unwrap_or(0);
    let d = PyDict::new(py);
    d.set_item("force", array(py, &[nt, nj, 3], force))?;
    d.set_item("moment", array(py, &[nt, nj, 3], moment))?;
    d.set_item("drive", array(py, &[nt, width], drive))?;
    d.set_item("joint_rotation", array(py, &[nt, nj, 3, 3], frame))?;
    d.set_item("residual", array(py, &[nt], residual))?;
    Ok(d)
}

/// Forces and moments of all joints, by augmented joint coordinates.
pub fn augmented_reactions<'py>(py: Python<'py>, m: &Model, states: &States) -> PyResult<(Array<'py>, Array<'py>)> {
    let (nt, nj) = (states.t.len(), m.spec.joints.len());
    let mut s = m.scratch();
    let (mut force, mut moment) = (Vec::with_capacity(3 * nt * nj), Vec::with_capacity(3 * nt * nj));
    for i in 0..nt {
        let ((t, q, v), (vdot, lambda)) = (states.at(i), states.forces_at(i));
        let found = m.augmented_reactions(t, q, v, vdot, lambda, &mut s);
        for w in found.map_err(|e| failure::system(py, e))? {
            force.extend(w.force.0);
            moment.extend(w.moment.0);
        }
    }
    Ok((array(py, &[nt, nj, 3], force), array(py, &[nt, nj, 3], moment)))
}
