//! The equations of a mechanism as functions in C.
//!
//! ```text
//! accelerations   t, q, v → v'                                                            (P1-P3)
//! to_joints       positions of the actuators, q near by → q, positions of the joints      (37), or Newton's method
//! to_actuators    positions of the joints, q near by → q, positions of the actuators
//! jacobian        q → rates of the joints per rate of each actuator: rows of Dᵀ           (P1, P2)
//! inertia         q → mass matrix in the rates of the actuators                           (P3)
//! margin          q → distance from where the actuators cannot cause every motion
//! ```
//!
//! Each function is recorded for one choice of coordinates, made at one position; it returns 1 where that choice or its
//! branch does not serve.

use crate::evaluator::Evaluator;
use crate::freed::Along;
use crate::loop_closure::STRAIGHT;
use crate::model::Model;
use crate::spin;
use partita_math::scalar::{c_head, Numbers, Recorder, Recording, Scalar};
use partita_system::closing::Closing;
use partita_system::prelude::*;
use partita_system::rates::LevelsOver;
use partita_system::reduction::Reduction;
use partita_system::system::Tangent;
use partita_system::{start, SystemError};

/// A function in C.
#[derive(Clone, Debug)]
pub struct CFunction {
    /// Its name.
    pub name: String,
    /// Its declaration, without the semicolon.
    pub head: String,
    /// All of it.
    pub text: String,
    /// Operations of arithmetic, sines and the like.
    pub operations: usize,
}

/// Some preference that no ratio of lengths outweighs. Scale: factor of rho. Reason: the coordinates of the actuators are
/// taken first, whatever they measure.
const TAKEN_FIRST: f64 = 1e6;

/// Recorded inputs and results.
struct Function<'a> {
    name: String,
    inputs: Vec<Numbers<'a>>,
    outputs: Vec<Numbers<'a>>,
}

impl Function<'_> {
    fn record(
        self,
        f: impl FnOnce(&[Recorder]) -> Result<Vec<Recorder>, SystemError>,
    ) -> Result<CFunction, SystemError> {
        let count = self.inputs.iter().map(|x| x.count.unwrap_or(1)).sum();
        let made = Recording::new(count, f)?.lean();
        let (name, inputs, outputs) = (self.name, &self.inputs[..], &self.outputs[..]);
        Ok(CFunction {
            head: c_head(&name, inputs, outputs, true),
            text: made.c(&name, inputs, outputs, true),
            operations: made.counts().total(),
            name,
        })
    }
}

/// The equations over recording numbers, and a refusal where elements call functions of the user.
fn recorder(model: &Model) -> Result<Evaluator<Recorder>, SystemError> {
    model.over::<Recorder>().map_err(|e| SystemError::argument("mechanism", e.to_string()))
}

impl Model {
    /// `int NAME_accelerations(double t, const double q[], const double v[], double vdot[])` in the coordinates that are
    /// best at (t, q); v as the constraints allow.
    ///
    /// # Errors
    /// Singular positions; elements that call functions of the user, and friction that follows reactions.
    pub fn c_accelerations(&self, name: &str, t: f64, q: &[f64]) -> Result<CFunction, SystemError> {
        let rank = start::analyse(self, t, q)?.rank;
        let mut r = Reduction::new(self, rank);
        start::choose_partition(&mut r, t, q, None, None)?;
        let e = recorder(self)?;
        let (size, choice) = (self.size(), r.choice());
        let function = Function {
            name: format!("{name}_accelerations"),
            inputs: vec![Numbers::one("t"), Numbers::array("q", size.nq), Numbers::array("v", size.nv)],
            outputs: vec![Numbers::array("vdot", size.nv)],
        };
        function.record(|x| {
            let mut out = self.evaluation(&e, choice);
            let (q, v) = (&x[1..1 + size.nq], &x[1 + size.nq..]);
            let u: Vec<Recorder> = choice.independent.iter().map(|&i| v[i]).collect();
            out.levels(x[0], q, &u)?;
            let excess = out.excess();
            Ok(out.vdot.into_iter().chain([excess]).collect())
        })
    }

    /// `int NAME_rates(const double q[], const double v[], double qdot[])`: q' = N(q) v.                         (S2)
    ///
    /// # Errors
    /// As [`c_accelerations`](Self::c_accelerations).
    pub fn c_rates(&self, name: &str) -> Result<CFunction, SystemError> {
        let (e, size) = (recorder(self)?, self.size());
        let function = Function {
            name: format!("{name}_rates"),
            inputs: vec![Numbers::array("q", size.nq), Numbers::array("v", size.nv)],
            outputs: vec![Numbers::array("qdot", size.nq)],
        };
        function.record(|x| {
            let mut qdot = vec![Recorder::zero(); size.nq];
            e.rate(&x[..size.nq], &x[size.nq..], &mut qdot);
            Ok(qdot.into_iter().chain([-Recorder::one()]).collect())
        })
    }

    /// The map between actuators and joints, both given by velocities with one coordinate each: see the
    /// [module](self). Nothing is prescribed: drives are left out. `to_actuators` and `inverse_jacobian` need as many
    /// joints as actuators, and are left out otherwise.
    ///
    /// # Errors
    /// As [`c_accelerations`](Self::c_accelerations), and where the actuators or the joints do not determine the position.
    pub fn c_actuator_map(
        &self,
        name: &str,
        (t, q): (f64, &[f64]),
        actuators: &[usize],
        joints: &[usize],
    ) -> Result<Vec<CFunction>, SystemError> {
        let free = self.released(&[]).map_err(|e| SystemError::argument("mechanism", e.to_string()))?;
        if free.structure().rheonomic {
            let message =
                "the mechanism has conditions that depend on time; a map between actuators and joints has none";
            return Err(SystemError::argument("mechanism", message.into()));
        }
        let by_actuators = Inputs::new(&free, (t, q), actuators, "actuators")?;
        let mut made = vec![by_actuators.closing(&format!("{name}_to_joints"), "actuators", ("joints", joints))?];
        let by_joints = match joints.len() == actuators.len() {
            true => Some(Inputs::new(&free, (t, q), joints, "joints")?),
            false => None,
        };
        if let Some(by_joints) = &by_joints {
            made.push(by_joints.closing(&format!("{name}_to_actuators"), "joints", ("actuators", actuators))?);
        }
        made.push(by_actuators.jacobian(&format!("{name}_jacobian"), joints)?);
        if let Some(by_joints) = &by_joints {
            made.push(by_joints.jacobian(&format!("{name}_inverse_jacobian"), actuators)?);
        }
        made.push(by_actuators.inertia(&format!("{name}_inertia"))?);
        Ok(made)
    }
}

/// Velocities from which all others follow: those named, and idle rotations, which move nothing else.
struct Inputs<'m> {
    model: &'m Model,
    t: f64,
    q: &'m [f64],
    named: Vec<usize>,
    reduction: Reduction<'m, Model>,
    e: Evaluator<Recorder>,
}

impl<'m> Inputs<'m> {
    fn new(
        model: &'m Model,
        (t, q): (f64, &'m [f64]),
        named: &[usize],
        argument: &'static str,
    ) -> Result<Self, SystemError> {
        let size = model.size();
        if let Some(i) = named.iter().find(|i| **i >= size.nv) {
            let message = format!("there is no velocity {i}; there are {}", size.nv);
            return Err(SystemError::argument(argument, message));
        }
        if let Some(&i) = named.iter().find(|&&i| model.structure().velocities[i].coordinates.len() != 1) {
            let message = format!(
                "{} has no coordinate of its own; name joints that turn or slide",
                model.structure().velocities[i].name
            );
            return Err(SystemError::argument(argument, message));
        }
        let rank = start::analyse(model, t, q)?.rank;
        let (dof, spins) = (size.nv - rank, spin::idle(&model.spec, &model.own.placed).len());
        if named.len() != dof && named.len() + spins != dof {
            let message = format!(
                "{} velocities are named, but the mechanism has {} degrees of freedom{}",
                named.len(),
                dof - spins.min(dof),
                if spins > 0 { format!(" beside {spins} idle rotations") } else { String::new() }
            );
            return Err(SystemError::argument(argument, message));
        }
        let mut reduction = Reduction::dense(model, rank);
        let mut independent = named.to_vec();
        if named.len() < dof {
            let weights: Vec<f64> = (0..size.nv).map(|i| if named.contains(&i) { TAKEN_FIRST } else { 1.0 }).collect();
            start::choose_partition(&mut reduction, t, q, Some(&weights), None)?;
            independent.clone_from(&reduction.planned.partition.independent);
        }
        // refuses by name those that do not determine the others
        start::choose_partition(&mut reduction, t, q, None, Some(&independent))?;
        Ok(Self { model, t, q, named: named.to_vec(), reduction, e: recorder(model)? })
    }

    /// Coordinate of a velocity that has one.
    fn place(&self, velocity: usize) -> usize {
        self.model.structure().velocities[velocity].coordinates.start
    }

    /// Column of a named velocity among the independent ones.
    fn columns(&self) -> Vec<usize> {
        let independent = &self.reduction.planned.partition.independent;
        self.named.iter().filter_map(|i| independent.iter().position(|x| x == i)).collect()
    }

    /// Positions from positions.
    fn closing(&self, name: &str, from: &str, (to, wanted): (&str, &[usize])) -> Result<CFunction, SystemError> {
        let nq = self.model.size().nq;
        let closing = self.model.loop_closing(self.t, self.q, Some(&self.reduction.planned.partition.independent))?;
        let n = self.named.len();
        // where nothing has a closed form, one iteration is written once
        let iterates = closing.blocks().iter().all(|b| !b.explicit);
        let (given, pose, found) = (Numbers::array(from, n), Numbers::array("q", nq), Numbers::array(to, wanted.len()));
        let function = Function {
            name: if iterates { format!("{name}_iteration") } else { name.to_string() },
            inputs: vec![given, pose],
            outputs: vec![pose, found],
        };
        let iterations = if iterates { 1 } else { STRAIGHT };
        let made = function.record(|x| {
            let mut q = x[n..].to_vec();
            self.named.iter().zip(x).for_each(|(&i, x)| q[self.place(i)] = *x);
            let t = Recorder::from_f64(self.t);
            let excess = closing.close_in(iterations, &self.e, t, &mut q, &mut closing.scratch_over(&self.e))?;
            let found: Vec<Recorder> = wanted.iter().map(|&i| q[self.place(i)]).collect();
            Ok(q.into_iter().chain(found).chain([excess]).collect())
        })?;
        if !iterates {
            return Ok(made);
        }
        let head = c_head(name, &[given, pose], &[pose, found], true);
        let text = format!(
            "static {}\n{head}\n{{\n    int refused = 1;\n    for (int i = 0; refused && i < {STRAIGHT}; i++)\n        \
             refused = {}({from}, q, {to});\n    return refused;\n}}\n",
            made.text, made.name
        );
        Ok(CFunction { name: name.to_string(), head, text, operations: STRAIGHT * made.operations })
    }

    /// Rates of the wanted velocities per rate of each named one.
    fn jacobian(&self, name: &str, wanted: &[usize]) -> Result<CFunction, SystemError> {
        let (k, n) = (self.reduction.choice().columns, self.named.len());
        let function = Function {
            name: name.to_string(),
            inputs: vec![Numbers::array("q", self.model.size().nq)],
            outputs: vec![Numbers::array("jacobian", wanted.len() * n)],
        };
        function.record(|q| {
            let mut x = self.model.evaluation(&self.e, self.reduction.choice());
            x.position(Recorder::from_f64(self.t), q)?;
            let columns = self.columns();
            let rows = wanted.iter().flat_map(|&i| columns.iter().map(move |&c| i * k + c));
            Ok(rows.map(|at| x.dt[at]).chain([x.excess()]).collect())
        })
    }

    /// Mass matrix in the rates of the named velocities, idle rotations left to themselves, and |k_s|², which is 1 over
    /// what each moves with all joints open: the largest eigenvalue of |k_i| M_ij |k_j| is 1 / margin².
    fn inertia(&self, name: &str) -> Result<CFunction, SystemError> {
        let (k, n, nv) = (self.reduction.choice().columns, self.named.len(), self.model.size().nv);
        let freed = self.model.freed();
        let function = Function {
            name: name.to_string(),
            inputs: vec![Numbers::array("q", self.model.size().nq)],
            outputs: vec![Numbers::array("inertia", n * n), Numbers::array("lengths2", n)],
        };
        function.record(|q| {
            let (t, rest) = (Recorder::from_f64(self.t), vec![Recorder::zero(); nv]);
            let mut x = self.model.evaluation(&self.e, self.reduction.choice());
            self.e.look(q, &rest, &mut x.of.s);
            let length2 =
                |&i| freed.length2(&self.e, (t, q), &x.of.s, std::iter::once((Along::Velocity(i), Recorder::one())));
            let lengths2 = self.named.iter().map(length2).collect::<Result<Vec<_>, _>>()?;
            x.position(t, q)?;
            x.of.velocity(t, q, &rest, &mut x.b)?;
            x.of.project((t, q, &rest), &Tangent { k, dt: &x.dt, delta: &rest }, &mut x.md, &mut x.hd)?;
            // the others first: what their elimination leaves is the matrix with no effort on them
            let columns = self.columns();
            let others = (0..k).filter(|c| !columns.contains(c));
            let order: Vec<usize> = others.chain(columns.iter().copied()).collect();
            let mut m: Vec<Recorder> = order
                .iter()
                .flat_map(|&i| order.iter().map(move |&j| (i, j)))
                .map(|(i, j)| x.md[i.max(j) * k + i.min(j)])
                .collect();
            for pivot in 0..k - n {
                for i in pivot + 1..k {
                    let factor = m[i * k + pivot] / m[pivot * k + pivot];
                    for j in pivot + 1..k {
                        let change = factor * m[pivot * k + j];
                        m[i * k + j] -= change;
                    }
                }
            }
            let entry = |at: usize| m[(k - n + at / n) * k + k - n + at % n];
            Ok((0..n * n).map(entry).chain(lengths2).chain([x.excess()]).collect())
        })
    }
}
