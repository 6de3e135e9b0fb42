//! The equations of a mechanism as tapes, which other tools replay over numbers of their own.
//!
//! ```text
//! motion    t | q | v_I | u | parameters   q', v_I', v, v', λ, Φ, bodies, joints, reactions, sensors, ...    (S2, P1-P3, R1)
//! closed    t | q | v_I | u | parameters   q with the remainder of S3 removed once                              (34)
//! residual  t | q | v   | u | parameters   Φ, C, a, b, M, h, q'                                              (S1-S5)
//! ```
//! `u` are inputs: efforts, and motions of drives with their derivatives.

use crate::carried::{CarriedState, Observable};
use crate::error::DescriptionError;
use crate::evaluator::Evaluator;
use crate::model::Model;
use crate::motion_programs::Varied;
use partita_math::scalar::{Recorder, Recording, Scalar};
use partita_system::prelude::*;
use partita_system::rates::MotionOver;
use partita_system::reduction::Reduction;
use partita_system::SystemError;

/// What one input gives, by numbers of u: they take the places of numbers given from outside.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Channel {
    /// An effort: one number.
    Effort,
    /// A drive, by the value that it prescribes and as many of its derivatives as make two or three numbers.
    Course(usize),
}

impl Channel {
    /// Numbers of u.
    pub fn count(self) -> usize {
        match self {
            Self::Effort => 1,
            Self::Course(n) => n,
        }
    }

    /// The numbers given from outside at time t: an effort, or the course of a drive, which begins at t.
    fn given(self, t: Recorder, u: &[Recorder]) -> Vec<Recorder> {
        match self {
            Self::Effort => u.to_vec(),
            Self::Course(_) => {
                let at = |i: usize| u.get(i).copied().unwrap_or_default();
                vec![t, at(0), at(1), at(2).scale(0.5), Recorder::zero()]
            }
        }
    }
}

/// A recording, and of each part of its outputs its name and how many numbers it has.
#[derive(Clone, Debug)]
pub struct NamedRecording {
    /// The recording, reduced.
    pub recording: Recording,
    /// Its outputs.
    pub parts: Vec<(&'static str, usize)>,
}

/// The recordings of one choice of coordinates.
#[derive(Clone, Debug)]
pub struct Tapes {
    /// At a state of the choice.
    pub motion: NamedRecording,
    /// One correction of the position.
    pub closed: NamedRecording,
    /// The equations in all velocities.
    pub residual: NamedRecording,
}

type Parts = Vec<(&'static str, Vec<Recorder>)>;

impl NamedRecording {
    fn new(
        inputs: usize,
        given: impl FnOnce(&[Recorder]) -> Vec<Recorder>,
        f: impl FnOnce(&[Recorder]) -> Result<Parts, DescriptionError>,
    ) -> Result<Self, DescriptionError> {
        let mut parts = Vec::new();
        let recording = Recording::with_given(inputs, given, |x| {
            let found = f(x)?;
            parts = found.iter().map(|(name, all)| (*name, all.len())).collect();
            Ok::<_, DescriptionError>(found.into_iter().flat_map(|(_, all)| all).collect())
        })?;
        Ok(Self { recording: recording.lean(), parts })
    }
}

impl Model {
    /// The recordings for the choice of a reduction, with inputs in the places of numbers given from outside, and these
    /// parameters; the motion with what is observed, too.
    ///
    /// # Errors
    /// As [`over_with`](Self::over_with) and [`observers`](Self::observers), and for functions that are known in `f64`
    /// alone; parameters of a repaired drawing, which other numbers would repair differently.
    pub fn tapes(
        &self,
        r: &Reduction<Self>,
        channels: &[Channel],
        parameters: &[Varied],
        observed: &[Observable],
    ) -> Result<Tapes, DescriptionError> {
        let refused = |e: &SystemError| {
            DescriptionError::new("mechanism", &self.spec.name, format!("its equations cannot be recorded: {e}"))
        };
        if let (Some(_), Some((name, _))) = (&self.geometry().drawn, parameters.first()) {
            let message =
                "the drawing is repaired when it is compiled, and other numbers would be repaired differently; \
                           set them by with_parameters, or draw it without the error";
            return Err(DescriptionError::new("parameter", name, message));
        }
        // names are checked before, as errors of a recording are those of its equations
        self.observers(&self.over_with::<Recorder>(&[])?, observed, "outputs")?;
        let (size, k) = (self.size(), r.choice().k());
        let (nq, nv) = (size.nq, size.nv);
        let acting: usize = channels.iter().map(|c| c.count()).sum();
        let numbers: usize = parameters.iter().map(|p| p.1).sum();
        // of inputs that begin with t, q and so many velocities
        let given = |velocities: usize| {
            move |x: &[Recorder]| {
                let mut next = 1 + nq + velocities;
                let each = channels.iter().flat_map(|c| {
                    next += c.count();
                    c.given(x[0], &x[next - c.count()..next])
                });
                each.collect()
            }
        };
        let over = |x: &[Recorder], velocities: usize| {
            let mut next = 1 + nq + velocities + acting;
            let changes: Vec<(&str, &[Recorder])> = parameters
                .iter()
                .map(|(name, count)| {
                    next += count;
                    (name.as_str(), &x[next - count..next])
                })
                .collect();
            self.over_with::<Recorder>(&changes)
        };
        let inputs = |velocities: usize| 1 + nq + velocities + acting + numbers;
        let state =
            |x: &[Recorder], velocities: usize| (x[0], x[1..1 + nq].to_vec(), x[1 + nq..1 + nq + velocities].to_vec());
        Ok(Tapes {
            motion: NamedRecording::new(inputs(k), given(k), |x| {
                self.record_motion(&over(x, k)?, r, state(x, k), observed).map_err(|e| refused(&e))
            })?,
            closed: NamedRecording::new(inputs(k), given(k), |x| {
                let (e, (t, mut q, _)) = (over(x, k)?, state(x, k));
                e.normalise(&mut q);
                self.evaluation(&e, r.choice()).correct(t, &mut q).map_err(|e| refused(&e))?;
                e.normalise(&mut q);
                Ok(vec![("q", q)])
            })?,
            residual: NamedRecording::new(inputs(nv), given(nv), |x| {
                self.record_residual(&over(x, nv)?, state(x, nv)).map_err(|e| refused(&e))
            })?,
        })
    }

    fn record_motion(
        &self,
        e: &Evaluator<Recorder>,
        r: &Reduction<Self>,
        (t, q, u): (Recorder, Vec<Recorder>, Vec<Recorder>),
        observed: &[Observable],
    ) -> Result<Parts, SystemError> {
        let (choice, size) = (r.choice(), self.size());
        let zeros = |n: usize| vec![Recorder::zero(); n];
        let mut x = self.evaluation(e, choice);
        x.levels(t, &q, &u)?;
        let (mut qdot, mut closing, mut dv) = (zeros(size.nq), zeros(size.nq), zeros(size.nv));
        e.rate(&q, &x.v, &mut qdot);
        x.closing(&mut dv);
        e.rate(&q, &dv, &mut closing);
        let (v, vdot) = (x.v.clone(), x.vdot.clone());
        let (mut residual, mut work, mut lambda) = (zeros(size.nv), zeros(size.nv.max(size.rows)), zeros(size.rows));
        x.of.inverse_dynamics(t, &q, &v, &vdot, &mut residual)?;
        choice.multipliers(&x.factors, &residual, &mut work, &mut lambda);
        let excess = x.excess();
        let mut s = e.scratch();
        let (mut phi, mut c, mut a) = (zeros(size.holonomic), zeros(self.pattern().col_idx.len()), zeros(size.rows));
        let (mut b, mut mass, mut h) = (zeros(size.rows), zeros(size.nv * size.nv), zeros(size.nv));
        e.position(t, &q, &mut s, &mut phi, &mut c, &mut a)?;
        e.velocity(t, &q, &v, &mut s, &mut b)?;
        e.dynamics(t, &q, &v, &mut s, &mut mass, &mut h)?;
        e.look(&q, &v, &mut s);
        let (bodies, joints) = e.poses_and_points(&s);
        let [kinetic, potential, _] = e.energies(t, &q, &v, &s)?;
        let found = e.reactions(t, &q, &v, &vdot, &lambda, &mut s)?;
        let reactions = found.joints.iter().flat_map(|w| w.force.0.into_iter().chain(w.moment.0)).collect();
        let observers =
            self.observers(e, observed, "outputs").map_err(|e| SystemError::argument("outputs", e.to_string()))?;
        let mut sensors = zeros(observed.len());
        observers.read(e, &mut s, &CarriedState { t, q: &q, v: &v, forces: Some((&vdot, &lambda)) }, &mut sensors)?;
        let udot = choice.independent.iter().map(|&i| vdot[i]).collect();
        Ok(vec![
            ("qdot", qdot),
            ("udot", udot),
            ("closing", closing),
            ("excess", vec![excess]),
            ("v", v),
            ("vdot", vdot),
            ("multipliers", lambda),
            ("phi", phi),
            ("bodies", bodies),
            ("joints", joints),
            ("energy", vec![kinetic, potential]),
            ("reactions", reactions),
            ("sensors", sensors),
        ])
    }

    fn record_residual(
        &self,
        e: &Evaluator<Recorder>,
        (t, q, v): (Recorder, Vec<Recorder>, Vec<Recorder>),
    ) -> Result<Parts, SystemError> {
        let size = self.size();
        let zeros = |n: usize| vec![Recorder::zero(); n];
        let (pattern, nv) = (self.pattern(), size.nv);
        let mut s = e.scratch();
        let (mut phi, mut c, mut a) = (zeros(size.holonomic), zeros(pattern.col_idx.len()), zeros(size.rows));
        let (mut b, mut mass, mut h, mut qdot) = (zeros(size.rows), zeros(nv * nv), zeros(nv), zeros(size.nq));
        e.position(t, &q, &mut s, &mut phi, &mut c, &mut a)?;
        e.velocity(t, &q, &v, &mut s, &mut b)?;
        e.dynamics(t, &q, &v, &mut s, &mut mass, &mut h)?;
        e.rate(&q, &v, &mut qdot);
        let mut jacobian = zeros(size.rows * nv);
        for row in 0..size.rows {
            for entry in pattern.row_ptr[row]..pattern.row_ptr[row + 1] {
                jacobian[row * nv + pattern.col_idx[entry]] = c[entry];
            }
        }
        // the lower triangle is what is computed
        let mass = (0..nv * nv).map(|at| mass[(at / nv).max(at % nv) * nv + (at / nv).min(at % nv)]).collect();
        Ok(vec![("phi", phi), ("C", jacobian), ("a", a), ("b", b), ("M", mass), ("h", h), ("qdot", qdot)])
    }
}
