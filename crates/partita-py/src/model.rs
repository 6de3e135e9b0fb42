//! The compiled mechanism for Python.

use crate::arrays::{any_vector, array, shaped, vector};
use crate::failure::{self, guarded, raise};
use crate::functions::Callables;
use crate::hand;
use crate::run::{self, read_options};
use crate::tangent::TangentFunctions;
use numpy::{PyArrayDyn, PyReadonlyArray1, PyReadonlyArray2, PyUntypedArrayMethods};
use partita_analysis as analysis;
use partita_model::place::Coordinates;
use partita_model::spec::Spec;
use partita_system::formulation::Sample;
use partita_system::kinematics::{assembly, projection::dense_rows};
use partita_system::{ConstrainedSystem, SystemError};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use serde_json::json;
use std::sync::{Arc, OnceLock};

/// A compiled mechanism: constant; states are handed in.
#[pyclass(frozen, module = "partita._core")]
pub struct Model {
    inner: partita_model::Model,
    structure: OnceLock<Structure>,
}

/// What the closed drawing tells of the mechanism.
struct Structure {
    mobility: Option<analysis::mobility::Mobility>,
    note: Option<String>,
}

/// Φ, C, a or M, h, b.
type Three = (Vec<f64>, Vec<f64>, Vec<f64>);
/// Coordinates, branches and residual of an assembly.
type Assembled<'py> = (Array<'py>, Vec<i8>, f64);
type Array<'py> = Bound<'py, PyArrayDyn<f64>>;

/// Closing conditions are lengths and angles: round-off of the size of the mechanism.
const CLOSED: f64 = 1e-12;

impl Model {
    fn structure(&self) -> &Structure {
        self.structure.get_or_init(|| {
            let mut q = self.inner.initial();
            let closed = assembly::close(&self.inner, 0.0, &mut q, CLOSED * self.inner.placed.size.max(1.0), &[]);
            if closed.is_err() {
                q = self.inner.initial();
            }
            let note = closed.as_ref().err().map(ToString::to_string);
            match analysis::mobility::mobility(&self.inner, 0.0, &q) {
                Ok(m) => Structure { mobility: Some(m), note },
                Err(e) => Structure { mobility: None, note: Some(note.unwrap_or_else(|| e.to_string())) },
            }
        })
    }

    fn state<'py>(
        &self,
        q: &PyReadonlyArray1<'py, f64>,
        v: &PyReadonlyArray1<'py, f64>,
    ) -> PyResult<(Vec<f64>, Vec<f64>)> {
        let size = self.inner.size();
        Ok((vector(q, size.nq, "q")?, vector(v, size.nv, "v")?))
    }

    /// Φ, C in pattern order, a.
    fn position(&self, t: f64, q: &[f64]) -> Result<Three, SystemError> {
        let size = self.inner.size();
        let mut s = self.inner.scratch();
        let (mut phi, mut a) = (vec![0.0; size.rows], vec![0.0; size.rows]);
        let mut c = vec![0.0; self.inner.pattern().nnz()];
        self.inner.position(t, q, &mut s, &mut phi, &mut c, &mut a)?;
        Ok((phi, c, a))
    }

    fn mass_and_forces(&self, t: f64, q: &[f64], v: &[f64]) -> Result<Three, SystemError> {
        let size = self.inner.size();
        let mut s = self.inner.scratch();
        let (mut phi, mut a) = (vec![0.0; size.rows], vec![0.0; size.rows]);
        let mut c = vec![0.0; self.inner.pattern().nnz()];
        self.inner.position(t, q, &mut s, &mut phi, &mut c, &mut a)?;
        let mut b = vec![0.0; size.rows];
        self.inner.velocity(t, q, v, &mut s, &mut b)?;
        let (mut mass, mut h) = (vec![0.0; size.nv * size.nv], vec![0.0; size.nv]);
        self.inner.dynamics(t, q, v, &mut s, &mut mass, &mut h)?;
        Ok((mass, h, b))
    }

    fn rows_of<'py>(&self, x: &PyReadonlyArray2<'py, f64>, width: usize, what: &str) -> PyResult<Vec<f64>> {
        let (_, columns, data) = crate::arrays::matrix(x);
        if columns != width {
            let message = format!("{what} has {columns} columns, the model has {width}");
            return Err(raise(x.py(), "ArgumentError", &message, &[("argument", what.into())]));
        }
        Ok(data)
    }
}

#[pymethods]
impl Model {
    #[new]
    #[pyo3(signature = (spec, functions, coordinates = "relative"))]
    fn new(py: Python<'_>, spec: &str, functions: Vec<Py<PyAny>>, coordinates: &str) -> PyResult<Self> {
        guarded(py, || {
            let coordinates = match coordinates {
                "relative" => Coordinates::Relative,
                "absolute" => Coordinates::Absolute,
                other => {
                    let message = format!("there are no coordinates \"{other}\"; choose relative or absolute");
                    return Err(raise(py, "ArgumentError", &message, &[("argument", "coordinates".into())]));
                }
            };
            let spec: Spec = serde_json::from_str(spec).map_err(|e| {
                let fields = [("element", "mechanism".into()), ("name", "".into())];
                raise(py, "DescriptionError", &format!("the description cannot be read: {e}"), &fields)
            })?;
            let inner = partita_model::Model::new(spec, Arc::new(Callables(functions)), coordinates)
                .map_err(|e| failure::description(py, &e))?;
            Ok(Self { inner, structure: OnceLock::new() })
        })
    }

    #[getter]
    fn nq(&self) -> usize {
        self.inner.size().nq
    }
    #[getter]
    fn nv(&self) -> usize {
        self.inner.size().nv
    }
    #[getter]
    fn rows(&self) -> usize {
        self.inner.size().rows
    }
    #[getter]
    fn rank(&self, py: Python<'_>) -> PyResult<usize> {
        guarded(py, || Ok(self.nv() - self.mobility(py)?))
    }
    #[getter]
    fn mobility(&self, py: Python<'_>) -> PyResult<usize> {
        guarded(py, || match &self.structure().mobility {
            Some(m) => Ok(m.mobility),
            None => {
                let note = self.structure().note.clone().unwrap_or_default();
                Err(raise(py, "AssemblyError", &note, &[("residual", f64::NAN.into())]))
            }
        })
    }
    #[getter]
    fn planar(&self) -> bool {
        self.inner.is_planar()
    }

    #[getter]
    fn summary(&self, py: Python<'_>) -> PyResult<String> {
        guarded(py, || {
            let m = &self.inner;
            let found = self.structure();
            let (mut oq, mut ov) = (0, 0);
            let joints: Vec<serde_json::Value> = m
                .placed
                .joints
                .iter()
                .zip(&m.spec.joints)
                .map(|(p, j)| {
                    let nq: usize = p.shape.motions.iter().map(|x| x.coordinates()).sum();
                    let nv = p.shape.freedoms();
                    let (q, v) = ([oq, nq], [ov, nv]);
                    oq += nq;
                    ov += nv;
                    // coordinates of a joint lie side by side in the state unless it was walked backwards
                    let first = p.links.as_ref().filter(|l| !(l.is_empty() || p.reversed && nv > 1)).map(|l| l[0]);
                    let state_q = first.map(|l| [m.placed.links[l].q, nq]);
                    let state_v = first.map(|l| [m.placed.links[l].v, nv]);
                    let mut axes: Vec<&str> = Vec::new();
                    for (motion, name) in p.shape.motions.iter().zip(&p.shape.names) {
                        match motion {
                            partita_model::joint::Motion::Ball => axes.extend(["wx", "wy", "wz"]),
                            _ => axes.push(name),
                        }
                    }
                    json!({ "name": j.name, "kind": j.kind, "parent": j.parent, "child": j.child,
                            "tree": p.links.is_some(), "q": q, "v": v, "state_q": state_q, "state_v": state_v, "axes": axes })
                })
                .collect();
            let rows: Vec<String> = (0..m.size().rows).map(|i| m.row_name(i)).collect();
            let bodies: Vec<serde_json::Value> = m.spec.bodies.iter().map(|b| json!({ "name": b.name })).collect();
            let mobility = found.mobility.as_ref();
            let removed: Vec<serde_json::Value> = mobility
                .map(|m| m.redundant.iter().map(|r| json!({ "row": r.row, "why": r.why })).collect())
                .unwrap_or_default();
            let notes: Vec<&String> = found.note.iter().collect();
            Ok(json!({
                "name": m.spec.name, "planar": m.is_planar(), "nq": m.size().nq, "nv": m.size().nv,
                "rows": m.size().rows, "rank": mobility.map(|x| m.size().nv - x.mobility),
                "mobility": mobility.map(|x| x.mobility),
                "joint_rows": mobility.map(|x| x.joint_rows), "joint_rank": mobility.map(|x| x.joint_rank),
                "bodies": bodies, "joints": joints, "coordinates": m.placed.coordinate_names,
                "velocities": m.placed.velocity_names, "rows_names": rows, "removed": removed, "notes": notes,
            })
            .to_string())
        })
    }

    fn initial<'py>(&self, py: Python<'py>) -> (Array<'py>, Array<'py>) {
        let size = self.inner.size();
        (array(py, &[size.nq], self.inner.initial()), array(py, &[size.nv], vec![0.0; size.nv]))
    }

    #[pyo3(signature = (t, q, v, targets, rates, tolerance))]
    fn assemble<'py>(
        &self,
        py: Python<'py>,
        t: f64,
        q: PyReadonlyArray1<'py, f64>,
        v: PyReadonlyArray1<'py, f64>,
        targets: Vec<(usize, f64)>,
        rates: Vec<(usize, f64)>,
        tolerance: f64,
    ) -> PyResult<(Array<'py>, Array<'py>, String)> {
        guarded(py, || {
            let (q, _) = self.state(&q, &v)?;
            let place = |q: &[f64]| self.inner.place(t, q, &targets);
            let (q, v, said) = hand::assemble(&self.inner, t, q, &targets, &rates, tolerance, place)
                .map_err(|e| failure::system(py, e))?;
            Ok((array(py, &[q.len()], q), array(py, &[v.len()], v), said))
        })
    }

    /// All positions that close for the input values in the closed position q: (q, branches, residual) of each, words of
    /// the blocks, notes.
    #[pyo3(signature = (t, q, inputs))]
    fn assemblies<'py>(
        &self,
        py: Python<'py>,
        t: f64,
        q: PyReadonlyArray1<'py, f64>,
        inputs: Option<Vec<usize>>,
    ) -> PyResult<(Vec<Assembled<'py>>, Vec<String>, Vec<String>)> {
        guarded(py, || {
            let q = vector(&q, self.nq(), "q")?;
            let all = self.inner.assemblies(t, &q, inputs.as_deref()).map_err(|e| failure::system(py, e))?;
            let found = all.found.into_iter().map(|a| (array(py, &[a.q.len()], a.q), a.branches, a.residual)).collect();
            Ok((found, all.blocks, all.notes))
        })
    }

    /// (q, v) of this model where every body is and moves as in another one of the same description.
    fn carried_over<'py>(
        &self,
        py: Python<'py>,
        other: &Model,
        q: PyReadonlyArray1<'py, f64>,
        v: PyReadonlyArray1<'py, f64>,
    ) -> PyResult<(Array<'py>, Array<'py>)> {
        guarded(py, || {
            let (q, v) = other.state(&q, &v)?;
            let (q, v) = self.inner.carried_over(&other.inner, &q, &v);
            Ok((array(py, &[q.len()], q), array(py, &[v.len()], v)))
        })
    }

    fn mass_matrix<'py>(&self, py: Python<'py>, t: f64, q: PyReadonlyArray1<'py, f64>) -> PyResult<Array<'py>> {
        guarded(py, || {
            let n = self.nv();
            let q = vector(&q, self.nq(), "q")?;
            let (m, _, _) = self.mass_and_forces(t, &q, &vec![0.0; n]).map_err(|e| failure::system(py, e))?;
            Ok(array(py, &[n, n], m))
        })
    }
    fn forces<'py>(
        &self,
        py: Python<'py>,
        t: f64,
        q: PyReadonlyArray1<'py, f64>,
        v: PyReadonlyArray1<'py, f64>,
    ) -> PyResult<Array<'py>> {
        guarded(py, || {
            let (q, v) = self.state(&q, &v)?;
            let (_, h, _) = self.mass_and_forces(t, &q, &v).map_err(|e| failure::system(py, e))?;
            Ok(array(py, &[h.len()], h))
        })
    }
    fn constraints<'py>(&self, py: Python<'py>, t: f64, q: PyReadonlyArray1<'py, f64>) -> PyResult<Array<'py>> {
        guarded(py, || {
            let q = vector(&q, self.nq(), "q")?;
            let (phi, _, _) = self.position(t, &q).map_err(|e| failure::system(py, e))?;
            Ok(array(py, &[phi.len()], phi))
        })
    }
    fn jacobian<'py>(&self, py: Python<'py>, t: f64, q: PyReadonlyArray1<'py, f64>) -> PyResult<Array<'py>> {
        guarded(py, || {
            let q = vector(&q, self.nq(), "q")?;
            let (_, c, _) = self.position(t, &q).map_err(|e| failure::system(py, e))?;
            let rows: Vec<usize> = (0..self.rows()).collect();
            let c = dense_rows(&self.inner, &c, &rows);
            Ok(array(py, &[self.rows(), self.nv()], c.into_vec()))
        })
    }
    fn rate<'py>(&self, py: Python<'py>, t: f64, q: PyReadonlyArray1<'py, f64>) -> PyResult<Array<'py>> {
        guarded(py, || {
            let q = vector(&q, self.nq(), "q")?;
            let (_, _, a) = self.position(t, &q).map_err(|e| failure::system(py, e))?;
            Ok(array(py, &[a.len()], a))
        })
    }
    fn bias<'py>(
        &self,
        py: Python<'py>,
        t: f64,
        q: PyReadonlyArray1<'py, f64>,
        v: PyReadonlyArray1<'py, f64>,
    ) -> PyResult<Array<'py>> {
        guarded(py, || {
            let (q, v) = self.state(&q, &v)?;
            let (_, _, b) = self.mass_and_forces(t, &q, &v).map_err(|e| failure::system(py, e))?;
            Ok(array(py, &[b.len()], b))
        })
    }
    fn acceleration<'py>(
        &self,
        py: Python<'py>,
        t: f64,
        q: PyReadonlyArray1<'py, f64>,
        v: PyReadonlyArray1<'py, f64>,
    ) -> PyResult<(Array<'py>, Array<'py>)> {
        guarded(py, || {
            let (q, v) = self.state(&q, &v)?;
            let (vdot, lambda) = hand::acceleration(&self.inner, t, &q, &v).map_err(|e| failure::system(py, e))?;
            Ok((array(py, &[vdot.len()], vdot), array(py, &[lambda.len()], lambda)))
        })
    }
    fn measure<'py>(&self, py: Python<'py>, t: f64, q: PyReadonlyArray1<'py, f64>) -> PyResult<Array<'py>> {
        guarded(py, || {
            let q = vector(&q, self.nq(), "q")?;
            let rho = hand::measure(&self.inner, t, &q).map_err(|e| failure::system(py, e))?;
            Ok(array(py, &[rho.len()], rho))
        })
    }

    #[pyo3(signature = (options, t_eval, q, v, progress, tangent=None))]
    fn simulate<'py>(
        &self,
        py: Python<'py>,
        options: &str,
        t_eval: PyReadonlyArray1<'py, f64>,
        q: PyReadonlyArray1<'py, f64>,
        v: PyReadonlyArray1<'py, f64>,
        progress: Option<Py<PyAny>>,
        tangent: Option<TangentFunctions>,
    ) -> PyResult<Bound<'py, PyDict>> {
        guarded(py, || {
            let options = read_options(py, options)?;
            let (q, v) = self.state(&q, &v)?;
            let mut scratch = self.inner.scratch();
            let size = self.inner.size();
            let (mut phi, mut a, mut b) = (vec![0.0; size.rows], vec![0.0; size.rows], vec![0.0; size.rows]);
            let mut c = vec![0.0; self.inner.pattern().nnz()];
            let energy = |x: &Sample| {
                self.inner.position(x.t, &x.q, &mut scratch, &mut phi, &mut c, &mut a)?;
                self.inner.velocity(x.t, &x.q, &x.v, &mut scratch, &mut b)?;
                self.inner.energy(x.t, &x.q, &x.v, &scratch).map(Some)
            };
            run::run(py, &self.inner, &options, &t_eval, (&q, &v), run::tangent(self.nv(), tangent), progress, energy)
        })
    }

    fn observe<'py>(
        &self,
        py: Python<'py>,
        t: PyReadonlyArray1<'py, f64>,
        q: PyReadonlyArray2<'py, f64>,
        v: PyReadonlyArray2<'py, f64>,
    ) -> PyResult<Bound<'py, PyDict>> {
        guarded(py, || {
            let m = &self.inner;
            let size = m.size();
            let t = any_vector(&t);
            let (nt, nb, nj) = (q.shape()[0], m.spec.bodies.len(), m.spec.joints.len());
            let (q, v) = (self.rows_of(&q, size.nq, "q")?, self.rows_of(&v, size.nv, "v")?);
            let mut s = m.scratch();
            let (mut phi, mut a, mut b) = (vec![0.0; size.rows], vec![0.0; size.rows], vec![0.0; size.rows]);
            let mut c = vec![0.0; m.pattern().nnz()];
            let (mut position, mut rotation, mut velocity, mut spin) = (vec![], vec![], vec![], vec![]);
            let (mut jq, mut jv, mut point) = (vec![], vec![], vec![]);
            let (mut kinetic, mut potential) = (vec![], vec![]);
            let mut tracker = partita_model::observe::TurnCounter::new(m);
            for i in 0..nt {
                let (qi, vi) = (&q[i * size.nq..(i + 1) * size.nq], &v[i * size.nv..(i + 1) * size.nv]);
                m.position(t[i], qi, &mut s, &mut phi, &mut c, &mut a).map_err(|e| failure::system(py, e))?;
                m.velocity(t[i], qi, vi, &mut s, &mut b).map_err(|e| failure::system(py, e))?;
                let (k, p) = m.energy(t[i], qi, vi, &s).map_err(|e| failure::system(py, e))?;
                kinetic.push(k);
                potential.push(p);
                m.look(qi, vi, &mut s);
                for body in 0..nb {
                    let x = m.body_state(body, &s);
                    position.extend(x.position.0);
                    rotation.extend(x.rotation.0.concat());
                    velocity.extend(x.velocity.0);
                    spin.extend(x.angular_velocity.0);
                }
                for j in 0..nj {
                    let mut x = m.joint_state(j, qi, vi, &s);
                    tracker.unwrap(j, t[i], &mut x);
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
        })
    }

    fn reactions<'py>(
        &self,
        py: Python<'py>,
        t: PyReadonlyArray1<'py, f64>,
        q: PyReadonlyArray2<'py, f64>,
        v: PyReadonlyArray2<'py, f64>,
        vdot: PyReadonlyArray2<'py, f64>,
        multipliers: PyReadonlyArray2<'py, f64>,
    ) -> PyResult<Bound<'py, PyDict>> {
        guarded(py, || {
            let m = &self.inner;
            let size = m.size();
            let t = any_vector(&t);
            let (nt, nj) = (q.shape()[0], m.spec.joints.len());
            let (q, v) = (self.rows_of(&q, size.nq, "q")?, self.rows_of(&v, size.nv, "v")?);
            let vdot = self.rows_of(&vdot, size.nv, "vdot")?;
            let lambda = self.rows_of(&multipliers, size.rows, "multipliers")?;
            let mut s = m.scratch();
            let (mut force, mut moment, mut drive, mut frame, mut residual) = (vec![], vec![], vec![], vec![], vec![]);
            for i in 0..nt {
                let row = |x: &[f64], w: usize| x[i * w..(i + 1) * w].to_vec();
                let (qi, vi, ai) = (row(&q, size.nq), row(&v, size.nv), row(&vdot, size.nv));
                let li = row(&lambda, size.rows);
                let r = m.reactions(t[i], &qi, &vi, &ai, &li, &mut s).map_err(|e| failure::system(py, e))?;
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
        })
    }

    /// Forces and moments of all joints at nt samples, by augmented joint coordinates.
    fn augmented_reactions<'py>(
        &self,
        py: Python<'py>,
        t: PyReadonlyArray1<'py, f64>,
        q: PyReadonlyArray2<'py, f64>,
        v: PyReadonlyArray2<'py, f64>,
        vdot: PyReadonlyArray2<'py, f64>,
        multipliers: PyReadonlyArray2<'py, f64>,
    ) -> PyResult<(Array<'py>, Array<'py>)> {
        guarded(py, || {
            let m = &self.inner;
            let size = m.size();
            let t = any_vector(&t);
            let (nt, nj) = (q.shape()[0], m.spec.joints.len());
            let (q, v) = (self.rows_of(&q, size.nq, "q")?, self.rows_of(&v, size.nv, "v")?);
            let vdot = self.rows_of(&vdot, size.nv, "vdot")?;
            let lambda = self.rows_of(&multipliers, size.rows, "multipliers")?;
            let mut s = m.scratch();
            let (mut force, mut moment) = (Vec::with_capacity(3 * nt * nj), Vec::with_capacity(3 * nt * nj));
            for i in 0..nt {
                let (qi, vi) = (&q[i * size.nq..(i + 1) * size.nq], &v[i * size.nv..(i + 1) * size.nv]);
                let (ai, li) = (&vdot[i * size.nv..(i + 1) * size.nv], &lambda[i * size.rows..(i + 1) * size.rows]);
                let wrenches =
                    m.augmented_reactions(t[i], qi, vi, ai, li, &mut s).map_err(|e| failure::system(py, e))?;
                for w in wrenches {
                    force.extend(w.force.0);
                    moment.extend(w.moment.0);
                }
            }
            Ok((array(py, &[nt, nj, 3], force), array(py, &[nt, nj, 3], moment)))
        })
    }

    fn determined<'py>(
        &self,
        py: Python<'py>,
        t: f64,
        q: PyReadonlyArray1<'py, f64>,
        in_joint_frame: bool,
    ) -> PyResult<Bound<'py, PyArrayDyn<bool>>> {
        guarded(py, || {
            let q = vector(&q, self.nq(), "q")?;
            let flags = analysis::determined::determined(&self.inner, t, &q, in_joint_frame)
                .map_err(|e| failure::analysis(py, e))?;
            Ok(shaped(py, &[flags.len(), 6], flags.concat()))
        })
    }

    fn report(&self, py: Python<'_>, t: f64, q: PyReadonlyArray1<'_, f64>) -> PyResult<String> {
        guarded(py, || {
            let q = vector(&q, self.nq(), "q")?;
            let report = analysis::report::report(&self.inner, t, &q).map_err(|e| failure::analysis(py, e))?;
            serde_json::to_string(&report).map_err(|e| failure::unexpected(e.to_string()))
        })
    }
}
