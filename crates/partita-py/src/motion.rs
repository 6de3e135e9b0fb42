//! Motions of a mechanism: the states of a run, or given ones, and what is computed from them where they are.

use crate::arrays::{array, entries_of, rows_of, shaped};
use crate::failure::{self, guarded, raise};
use crate::outputs::{named, watched};
use crate::run::Account;
use crate::state::Array;
use numpy::{PyArray1, PyArray2, PyArrayDyn, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2};
use partita_analysis::determined::{self, DIRECTIONS};
use partita_analysis::outputs::{self, Forces, States};
use partita_analysis::sharing;
use partita_model::Model;
use partita_system::prelude::*;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::sync::Arc;

/// States of a mechanism at nt outputs, with their accelerations and multipliers; constant.
///
/// The arrays are those that Python sees, so that no output exists twice.
#[pyclass(frozen, module = "partita._core")]
pub struct Motion {
    model: Arc<Model>,
    t: Py<PyArray1<f64>>,
    q: Py<PyArray2<f64>>,
    v: Py<PyArray2<f64>>,
    acting: Acting,
    /// Where joints are parted: numbers of outputs one after the other, each with the mechanism that moves there.
    stages: Vec<(usize, Arc<Model>)>,
}

/// Outputs of one mechanism, copied.
struct Picked {
    t: Vec<f64>,
    q: Vec<f64>,
    v: Vec<f64>,
    vdot: Vec<f64>,
    multipliers: Vec<f64>,
}

impl Picked {
    /// These outputs of a mechanism, and of its multipliers those of these rows.
    fn new(whole: &Model, states: &States, forces: Option<&Forces>, outputs: &[usize], rows: &[usize]) -> Self {
        let (t, [q, v, vdot, multipliers]) = (Vec::new(), [const { Vec::new() }; 4]);
        let mut picked = Self { t, q, v, vdot, multipliers };
        for &i in outputs {
            let (now, at, rates) = states.at(whole, i);
            picked.t.push(now);
            picked.q.extend_from_slice(at);
            picked.v.extend_from_slice(rates);
            if let Some((bend, lambda)) = forces.map(|forces| forces.at(whole, i)) {
                picked.vdot.extend_from_slice(bend);
                picked.multipliers.extend(rows.iter().map(|&row| lambda[row]));
            }
        }
        picked
    }
    fn states(&self) -> States<'_> {
        States { t: &self.t, q: &self.q, v: &self.v }
    }
    fn forces(&self) -> Forces<'_> {
        Forces { vdot: &self.vdot, multipliers: &self.multipliers }
    }
}

/// Values of the conditions of a mechanism, in places of those of the whole one; `absent` where it has none.
fn spread(whole: &Model, own: &Model, values: &[f64], (count, absent): (usize, f64)) -> Vec<f64> {
    let (first, all) = (whole.closing_rows, whole.size().rows - whole.closing_rows);
    let rows = whole.rows_of(own);
    let conditions = &rows[own.closing_rows..];
    let mut found = vec![absent; count * all];
    for (i, x) in values.iter().enumerate() {
        found[i / conditions.len() * all + conditions[i % conditions.len()] - first] = *x;
    }
    found
}

/// Origin of accelerations and multipliers.
enum Acting {
    /// Computed when first needed, with everything else that describes the outputs of a run.
    Log(Py<Account>),
    Given(Option<Py<PyArray2<f64>>>, Option<Py<PyArray2<f64>>>),
}

/// Boolean values.
type Flags<'py> = Bound<'py, PyArrayDyn<bool>>;
type Table<'py> = PyReadonlyArray2<'py, f64>;

/// `found`, what a run of the model reports, with its motion.
pub fn with_motion<'py>(
    py: Python<'py>,
    model: &Arc<Model>,
    found: Bound<'py, PyDict>,
) -> PyResult<Bound<'py, PyDict>> {
    let item = |d: &Bound<'py, PyDict>, key: &str| d.as_any().get_item(key);
    let arrays = item(&found, "arrays")?.cast_into::<PyDict>()?;
    let log = item(&found, "log")?.cast_into::<Account>()?;
    let alone = |stages: &Vec<(usize, Arc<Model>)>| stages.iter().all(|x| Arc::ptr_eq(&x.1, model));
    let motion = Motion {
        model: model.clone(),
        stages: Some(log.get().stages()).filter(|stages| !alone(stages)).unwrap_or_default(),
        t: item(&arrays, "t")?.cast_into()?.unbind(),
        q: item(&arrays, "q")?.cast_into()?.unbind(),
        v: item(&arrays, "v")?.cast_into()?.unbind(),
        acting: Acting::Log(log.unbind()),
    };
    found.set_item("motion", motion.into_pyobject(py)?)?;
    Ok(found)
}

fn known(py: Python<'_>, which: &[usize], count: usize, what: &str) -> PyResult<()> {
    match which.iter().find(|&&i| i >= count) {
        None => Ok(()),
        Some(i) => {
            let message = format!("there is no {what} {i}; there are {count}, numbered from 0");
            Err(raise(py, "ArgumentError", &message, &[("argument", what.into())]))
        }
    }
}

/// The numbers `which`, if they exist; all without them.
fn chosen(py: Python<'_>, which: Option<Vec<usize>>, count: usize, what: &str) -> PyResult<Vec<usize>> {
    let which = which.unwrap_or_else(|| (0..count).collect());
    known(py, &which, count, what).map(|()| which)
}

impl Motion {
    /// Given states, copied: t (nt), the others with a row for each time.
    pub fn new<'py>(
        py: Python<'py>,
        model: &Arc<Model>,
        t: &PyReadonlyArray1<'py, f64>,
        (q, v): (&Table<'py>, &Table<'py>),
        (vdot, multipliers): (Option<&Table<'py>>, Option<&Table<'py>>),
    ) -> PyResult<Self> {
        let (size, t) = (model.size(), entries_of(t));
        let table = |x: &Table<'py>, width: usize, what: &str| {
            let rows = rows_of(x, t.len(), width, what)?.into_owned();
            Ok::<_, PyErr>(array(py, &[t.len(), width], rows).cast_into::<PyArray2<f64>>()?.unbind())
        };
        Ok(Self {
            model: model.clone(),
            stages: Vec::new(),
            q: table(q, size.nq, "q")?,
            v: table(v, size.nv, "v")?,
            acting: Acting::Given(
                vdot.map(|x| table(x, size.nv, "vdot")).transpose()?,
                multipliers.map(|x| table(x, size.rows, "multipliers")).transpose()?,
            ),
            t: array(py, &[t.len()], t.into_owned()).cast_into::<PyArray1<f64>>()?.unbind(),
        })
    }

    /// Result of `ask` about the states.
    fn of_states<T>(&self, py: Python<'_>, ask: impl FnOnce(&Model, &States) -> PyResult<T>) -> PyResult<T> {
        guarded(py, || {
            let (t, q, v) = (self.t.bind(py).readonly(), self.q.bind(py).readonly(), self.v.bind(py).readonly());
            let (t, size) = (entries_of(&t), self.model.size());
            let (q, v) = (rows_of(&q, t.len(), size.nq, "q")?, rows_of(&v, t.len(), size.nv, "v")?);
            ask(&self.model, &States { t: &t, q: &q, v: &v })
        })
    }

    /// Tables of the outputs `which` (none: all) by the mechanisms that move there: `ask` has one of them, outputs and
    /// rows of the whole mechanism that its own are.
    fn staged(
        &self,
        count: usize,
        which: Option<&[usize]>,
        mut ask: impl FnMut(&Model, &[usize], &[usize]) -> PyResult<Vec<Vec<f64>>>,
    ) -> PyResult<Vec<Vec<f64>>> {
        let everywhere = [(count, self.model.clone())];
        let stages: &[(usize, Arc<Model>)] = if self.stages.is_empty() { &everywhere } else { &self.stages };
        let all: Vec<usize> = (0..count).collect();
        let which = which.unwrap_or(&all);
        let (mut first, mut found): (usize, Vec<Vec<f64>>) = (0, Vec::new());
        for (count, model) in stages {
            let here = |x: &(usize, &usize)| (first..first + count).contains(x.1);
            let (places, outputs): (Vec<usize>, Vec<usize>) =
                which.iter().enumerate().filter(here).map(|(place, i)| (place, *i)).unzip();
            first += count;
            if outputs.is_empty() && !(found.is_empty() && first == all.len()) {
                continue;
            }
            let own = ask(model, &outputs, &self.model.rows_of(model))?;
            found.resize(own.len(), Vec::new());
            for (to, from) in found.iter_mut().zip(&own) {
                let width = from.len().checked_div(outputs.len()).unwrap_or(0);
                to.resize(width * which.len(), f64::NAN);
                for (&place, row) in places.iter().zip(from.chunks(width.max(1))) {
                    to[place * width..][..width].copy_from_slice(row);
                }
            }
        }
        Ok(found)
    }

    /// As `of_states`, for tables that depend on which joints are apart; `ask` has the rows as `staged` says.
    fn of_states_apart(
        &self,
        py: Python<'_>,
        ask: impl Fn(&Model, &States, &[usize]) -> PyResult<Vec<Vec<f64>>>,
    ) -> PyResult<Vec<Vec<f64>>> {
        self.of_states(py, |m, states| match self.stages.is_empty() {
            true => ask(m, states, &m.rows_of(m)),
            false => self.staged(states.len(), None, |own, outputs, rows| {
                ask(own, &Picked::new(m, states, None, outputs, rows).states(), rows)
            }),
        })
    }

    /// The same with what acts there, at the outputs `which`; none: at all.
    fn of_forces_apart(
        &self,
        py: Python<'_>,
        which: Option<&[usize]>,
        ask: impl Fn(&Model, &States, &Forces, &[usize]) -> PyResult<Vec<Vec<f64>>>,
    ) -> PyResult<Vec<Vec<f64>>> {
        self.of_forces(py, |m, states, forces| match (which, self.stages.is_empty()) {
            (None, true) => ask(m, states, forces, &m.rows_of(m)),
            _ => self.staged(states.len(), which, |own, outputs, rows| {
                let picked = Picked::new(m, states, Some(forces), outputs, rows);
                ask(own, &picked.states(), &picked.forces(), rows)
            }),
        })
    }

    /// Number of outputs.
    fn count(&self, py: Python<'_>) -> PyResult<usize> {
        self.t.bind(py).len()
    }

    /// v' or λ at the outputs, by its name.
    fn acting<'py>(&self, py: Python<'py>, what: &str) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let found = match &self.acting {
            Acting::Log(log) => Some(log.get().described(py)?.as_any().get_item(what)?.cast_into()?),
            Acting::Given(vdot, multipliers) => {
                (if what == "vdot" { vdot } else { multipliers }).as_ref().map(|x| x.bind(py).clone())
            }
        };
        let missing =
            || raise(py, "ArgumentError", &format!("this motion has no {what}"), &[("argument", what.into())]);
        found.ok_or_else(missing)
    }

    /// Result of `ask` about the states and their accelerations.
    fn of_accelerations<T>(
        &self,
        py: Python<'_>,
        ask: impl FnOnce(&Model, &States, &[f64]) -> PyResult<T>,
    ) -> PyResult<T> {
        self.of_states(py, |m, states| {
            let vdot = self.acting(py, "vdot")?.readonly();
            ask(m, states, &rows_of(&vdot, states.len(), m.size().nv, "vdot")?)
        })
    }

    /// Result of `ask` about the states and what acts there.
    fn of_forces<T>(&self, py: Python<'_>, ask: impl FnOnce(&Model, &States, &Forces) -> PyResult<T>) -> PyResult<T> {
        self.of_accelerations(py, |m, states, vdot| {
            let lambda = self.acting(py, "multipliers")?.readonly();
            let lambda = rows_of(&lambda, states.len(), m.size().rows, "multipliers")?;
            ask(m, states, &Forces { vdot, multipliers: &lambda })
        })
    }
}

#[pymethods]
impl Motion {
    #[getter]
    fn t<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.t.bind(py).clone()
    }
    #[getter]
    fn multipliers<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        guarded(py, || self.acting(py, "multipliers"))
    }

    /// Poses and twists of the bodies `which`; None: of all.
    #[pyo3(signature = (which=None))]
    fn bodies<'py>(&self, py: Python<'py>, which: Option<Vec<usize>>) -> PyResult<Bound<'py, PyDict>> {
        self.of_states(py, |m, states| {
            let which = chosen(py, which, m.spec.bodies.len(), "body")?;
            let (found, nb) = (watched(py, |watch| outputs::bodies(m, states, &which, watch))?, which.len());
            let shapes: [(&str, &[usize]); 4] = [
                ("body_position", &[nb, 3]),
                ("body_rotation", &[nb, 3, 3]),
                ("body_velocity", &[nb, 3]),
                ("body_angular_velocity", &[nb, 3]),
            ];
            named(py, states.len(), found, &shapes)
        })
    }

    /// Coordinates, velocities and points of the joints `which`; None: of all.
    #[pyo3(signature = (which=None))]
    fn joints<'py>(&self, py: Python<'py>, which: Option<Vec<usize>>) -> PyResult<Bound<'py, PyDict>> {
        self.of_states(py, |m, states| {
            let which = chosen(py, which, m.spec.joints.len(), "joint")?;
            let found = watched(py, |watch| outputs::joints(m, states, &which, watch))?;
            let shape = |j: &usize| m.shape(*j);
            let nq = which.iter().flat_map(|j| &shape(j).motions).map(partita_model::joint::Motion::coordinates).sum();
            let nv = which.iter().map(|j| shape(j).dof()).sum();
            let shapes: [(&str, &[usize]); 3] =
                [("joint_position", &[nq]), ("joint_velocity", &[nv]), ("joint_point", &[which.len(), 3])];
            named(py, states.len(), found, &shapes)
        })
    }

    /// Accelerations along the degrees of freedom of the joints `which` (nt, degrees of freedom); None: of all.
    #[pyo3(signature = (which=None))]
    fn joint_accelerations<'py>(&self, py: Python<'py>, which: Option<Vec<usize>>) -> PyResult<Array<'py>> {
        self.of_accelerations(py, |m, states, vdot| {
            let which = chosen(py, which, m.spec.joints.len(), "joint")?;
            let mut found = watched(py, |watch| outputs::joint_accelerations(m, states, vdot, &which, watch))?;
            let nv = which.iter().map(|&j| m.shape(j).dof()).sum();
            Ok(array(py, &[states.len(), nv], found.swap_remove(0)))
        })
    }

    /// Accelerations of the origins of the bodies `which`, and angular accelerations.
    fn body_accelerations<'py>(&self, py: Python<'py>, which: Vec<usize>) -> PyResult<Bound<'py, PyDict>> {
        self.of_accelerations(py, |m, states, vdot| {
            known(py, &which, m.spec.bodies.len(), "body")?;
            let found = watched(py, |watch| outputs::body_accelerations(m, states, vdot, &which, watch))?;
            let shape: &[usize] = &[which.len(), 3];
            named(py, states.len(), found, &[("body_acceleration", shape), ("body_angular_acceleration", shape)])
        })
    }

    /// Effect of applied force `number` of the description.
    fn load<'py>(&self, py: Python<'py>, number: usize) -> PyResult<Bound<'py, PyDict>> {
        let (_, n) = self.model.load_number(number).map_err(|e| failure::description(py, &e))?;
        let found = self
            .of_states_apart(py, |m, states, _| Ok(watched(py, |watch| outputs::load(m, states, number, watch))?.0))?;
        let shapes: [(&str, &[usize]); 6] = [
            ("power", &[]),
            ("potential", &[]),
            ("effort", &[]),
            ("point", &[n, 3]),
            ("force", &[n, 3]),
            ("moment", &[n, 3]),
        ];
        named(py, self.count(py)?, found, &shapes)
    }

    /// Kinetic and potential energy.
    fn energies<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let found =
            self.of_states_apart(py, |m, states, _| watched(py, |watch| outputs::energies(m, states, watch)))?;
        named(py, self.count(py)?, found, &[("kinetic", &[]), ("potential", &[])])
    }

    /// Wrench of one joint, effort of its drives and its axes.
    fn reaction<'py>(&self, py: Python<'py>, joint: usize) -> PyResult<Bound<'py, PyDict>> {
        known(py, &[joint], self.model.spec.joints.len(), "joint")?;
        let found = self.of_forces_apart(py, None, |m, states, forces, _| {
            watched(py, |watch| outputs::reaction(m, states, forces, joint, watch))
        })?;
        let nv = self.model.shape(joint).dof();
        let shapes: [(&str, &[usize]); 4] =
            [("force", &[3]), ("moment", &[3]), ("drive", &[nv]), ("joint_rotation", &[3, 3])];
        named(py, self.count(py)?, found, &shapes)
    }

    /// Whether part of the reactions is chosen by a rule, for which all joints are needed.
    fn shares_loads(&self, py: Python<'_>) -> PyResult<bool> {
        let found = self.of_forces_apart(py, None, |m, states, forces, _| {
            let shares = watched(py, |_| outputs::shares(m, states, forces))?;
            Ok(vec![vec![f64::from(u8::from(shares)); states.len()]])
        })?;
        Ok(found.concat().iter().any(|x| *x != 0.0))
    }

    /// Wrenches of all joints and efforts of the drives, by the recursion along the tree, at the outputs `which`; None:
    /// at all.
    #[pyo3(signature = (which=None))]
    fn reactions<'py>(&self, py: Python<'py>, which: Option<Vec<usize>>) -> PyResult<Bound<'py, PyDict>> {
        let (m, nj, count) = (&self.model, self.model.spec.joints.len(), self.count(py)?);
        known(py, which.as_deref().unwrap_or_default(), count, "output")?;
        let found = self.of_forces_apart(py, which.as_deref(), |own, states, forces, _| {
            let mut found = watched(py, |watch| outputs::reactions(own, states, forces, watch))?;
            let efforts = found.pop().unwrap_or_default();
            found.push(spread(m, own, &efforts, (states.len(), 0.0)));
            Ok(found)
        })?;
        let shapes: [(&str, &[usize]); 7] = [
            ("force", &[nj, 3]),
            ("moment", &[nj, 3]),
            ("drive", &[m.zero_position().joints.iter().map(|p| p.shape.dof()).sum()]),
            ("joint_rotation", &[nj, 3, 3]),
            ("residual", &[]),
            ("residuals", &[m.spec.bodies.len()]),
            ("effort", &[m.size().rows - m.closing_rows]),
        ];
        named(py, which.map_or(count, |which| which.len()), found, &shapes)
    }

    /// Forces and moments of all joints, by augmented joint coordinates.
    fn augmented_reactions<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let found = self.of_forces_apart(py, None, |m, states, forces, _| {
            watched(py, |watch| outputs::augmented(m, states, forces, watch))
        })?;
        let shape: &[usize] = &[self.model.spec.joints.len(), 3];
        named(py, self.count(py)?, found, &[("force", shape), ("moment", shape)])
    }

    /// Acceleration closure with its row, worst row of the closure, rank and margin.
    fn checks<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let found = self.of_forces_apart(py, None, |m, states, forces, rows| {
            let mut found = watched(py, |watch| outputs::checks(m, states, forces, watch))?;
            let in_whole = |row: &mut f64| *row = if row.is_finite() { rows[*row as usize] as f64 } else { *row };
            found[1..3].iter_mut().flatten().for_each(in_whole);
            Ok(found)
        })?;
        let names = ["acceleration_closure", "acceleration_row", "closure_row", "rank", "margin"];
        named(py, self.count(py)?, found, &names.map(|name| (name, &[][..])))
    }

    /// Flags of all joints in world axes and in joint axes (nt, nj, 6), of the efforts along their degrees of freedom
    /// (nt, degrees of freedom), and of the multipliers of couplings, drives and joints' own conditions (nt,
    /// conditions).
    fn determined<'py>(&self, py: Python<'py>) -> PyResult<[Flags<'py>; 4]> {
        let (m, nt, nj) = (&self.model, self.count(py)?, self.model.spec.joints.len());
        let found = self.of_states_apart(py, |own, states, _| {
            let part = own.permanent();
            let mut found = watched(py, |watch| determined::flags(part, states, watch))?;
            // those of drives that do not always hold are determined where they do
            let conditions = found.pop().unwrap_or_default();
            found.push(spread(m, part, &conditions, (states.len(), 1.0)));
            Ok(found)
        })?;
        let dof = m.zero_position().joints.iter().map(|p| p.shape.dof()).sum();
        let mut found = found.into_iter();
        let mut next = || found.next().unwrap_or_default().into_iter().map(|x| x != 0.0).collect::<Vec<bool>>();
        Ok([
            shaped(py, &[nt, nj, 6], next()),
            shaped(py, &[nt, nj, 6], next()),
            shaped(py, &[nt, dof], next()),
            shaped(py, &[nt, m.size().rows - m.closing_rows], next()),
        ])
    }

    /// Directions in which self-stresses load a joint: (nt, 2, 3, 3) for force and moment, in units of the level that
    /// counts as zero.
    fn self_stresses<'py>(&self, py: Python<'py>, joint: usize) -> PyResult<Array<'py>> {
        known(py, &[joint], self.model.spec.joints.len(), "joint")?;
        let found = self.of_states_apart(py, |m, states, _| {
            Ok(vec![watched(py, |watch| determined::directions(m.permanent(), states, joint, watch))?])
        })?;
        let (nt, found) = (self.count(py)?, found.concat());
        assert_eq!(found.len(), DIRECTIONS * nt);
        Ok(array(py, &[nt, 2, 3, 3], found))
    }

    /// Orthonormal self-stresses at output i: wrenches (s, nj, 6) in world axes, efforts of the drives (s, drives), and
    /// the length that moments are divided by.
    fn self_stress_basis<'py>(&self, py: Python<'py>, i: usize) -> PyResult<(Array<'py>, Array<'py>, f64)> {
        self.of_states(py, |m, states| {
            known(py, &[i], states.len(), "output")?;
            let (t, q, _) = states.at(m, i);
            let mut last = 0;
            let stage = self.stages.iter().find(|x| {
                last += x.0;
                i < last
            });
            let part = stage.map_or(m, |x| &x.1).permanent();
            let found = sharing::self_stresses(part, t, q).map_err(|e| failure::analysis(py, e))?;
            let wrenches = array(py, &[found.count, m.spec.joints.len(), 6], found.wrenches);
            let (own, all) = (part.spec.drives.len(), m.spec.drives.len());
            let mut efforts = vec![0.0; found.count * all];
            for i in 0..found.count {
                efforts[i * all..][..own].copy_from_slice(&found.efforts[i * own..][..own]);
            }
            Ok((wrenches, array(py, &[found.count, all], efforts), found.length))
        })
    }
}
