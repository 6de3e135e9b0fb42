//! Queries of the mechanism that closed forms answer: all assemblies, positions for targets, the closing itself.

use super::instant::Instant;
use super::{inputs, LoopClosing, Work};
use crate::model::Model;
use partita_math::tolerance;
use partita_system::closing::Closing;
use partita_system::prelude::*;
use partita_system::{SystemError, SystemRef};

/// Maximum number of combinations of branches that are examined.
const COMBINATIONS: usize = 4096;

/// One way to put the mechanism together.
#[derive(Clone, Debug, PartialEq)]
pub struct Assembled {
    /// Coordinates (nq).
    pub q: Vec<f64>,
    /// Sign of each block of the closing, 0 where there is none.
    pub branches: Vec<i8>,
    /// Largest |Φ|.
    pub residual: f64,
}

/// All assemblies of the mechanism for given inputs.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Assemblies {
    /// The assemblies that close.
    pub found: Vec<Assembled>,
    /// Names of the blocks, in the order of the branches.
    pub blocks: Vec<String>,
    /// What the list does not contain, in words.
    pub notes: Vec<String>,
}

impl<'m> LoopClosing<'m> {
    /// See [`Model::loop_closing`].
    pub(crate) fn of(
        model: SystemRef<'m, Model>,
        t: f64,
        q: &[f64],
        inputs: Option<&[usize]>,
    ) -> Result<Self, SystemError> {
        model.refuse_rates()?;
        let nv = model.size().nv;
        let at = Instant::new(model, t, q)?;
        let Some(inputs) = inputs else { return inputs::choose(&at, t, q) };
        let mut sorted = inputs.to_vec();
        sorted.sort_unstable();
        sorted.dedup();
        if sorted.len() != inputs.len() || sorted.iter().any(|&i| i >= nv) {
            return Err(SystemError::argument(
                "inputs",
                format!("the inputs {inputs:?} must be different numbers of velocities below {nv}"),
            ));
        }
        let mut plan = Self::new(&at, q, &sorted)?;
        plan.close(t, &mut q.to_vec())?;
        Ok(plan)
    }

    /// Whether all steps have a closed form.
    pub fn is_explicit(&self) -> bool {
        !self.steps.iter().any(|s| matches!(s.work, Work::Implicit(_)))
    }

    /// Largest |Φ| at (t, q).
    fn residual(&mut self, t: f64, q: &[f64]) -> Result<f64, SystemError> {
        self.model.position(t, q, &mut self.scratch, &mut self.phi, &mut self.c, &mut self.a)?;
        Ok(self.phi.iter().fold(0.0, |m: f64, x| m.max(x.abs())))
    }

    /// Largest |Φ| in characteristic displacements at the last [`residual`](Self::residual).
    fn closure_error(&self) -> f64 {
        self.phi.iter().enumerate().fold(0.0, |m: f64, (i, x)| m.max(x.abs() / self.model.structure().rows[i].size()))
    }
}

impl Model {
    /// Explicit closing for these input velocities, on the branch of the closed position q; see
    /// [`loop_closure`](crate::loop_closure).
    ///
    /// Inputs: as many velocities as degrees of freedom, or `None` for those that order the most loops and have the
    /// best pivots. Fails for absolute coordinates, open positions and inputs that do not determine the others here.
    pub fn loop_closing(&self, t: f64, q: &[f64], inputs: Option<&[usize]>) -> Result<LoopClosing<'_>, SystemError> {
        LoopClosing::of(self.into(), t, q, inputs)
    }

    /// Conditions on rates alone do not determine positions.
    fn refuse_rates(&self) -> Result<(), SystemError> {
        match self.own.full.conditions.iter().find(|c| !c.holonomic) {
            None => Ok(()),
            Some(c) => {
                let message = format!(
                    "{} constrains rates only, not positions, so inverse kinematics cannot close the loops; use \
                     another formulation (\"projective\")",
                    c.owner.words(&self.spec)
                );
                Err(SystemError::argument("formulation", message))
            }
        }
    }

    /// All positions that close for the input values in the closed position q: every combination of branches, those
    /// that cannot close left out. The first one is q's own.
    ///
    /// Of implicit blocks only the solution near q is found; the notes say so. Fails for more than 4096 combinations.
    /// Cost: one closing for each combination.
    pub fn assemblies(&self, t: f64, q: &[f64], inputs: Option<&[usize]>) -> Result<Assemblies, SystemError> {
        let mut closing = self.loop_closing(t, q, inputs)?;
        let own: Vec<i8> = closing.state().iter().map(|s| s.branch).collect();
        let free: Vec<usize> = (0..own.len()).filter(|&i| own[i] != 0).collect();
        let count = 1usize.checked_shl(free.len() as u32).unwrap_or(usize::MAX);
        if free.len() >= usize::BITS as usize || count > COMBINATIONS {
            return Err(SystemError::argument(
                "mechanism",
                format!(
                "{} blocks have two branches each, 2^{} assemblies: more than {COMBINATIONS}; request a part of the \
                 mechanism",
                free.len(),
                free.len()
            ),
            ));
        }
        let mut all =
            Assemblies { blocks: closing.blocks().iter().map(|b| b.words.clone()).collect(), ..Assemblies::default() };
        let implicit: Vec<&str> = closing.blocks().iter().filter(|b| !b.explicit).map(|b| b.words.as_str()).collect();
        if !implicit.is_empty() {
            all.notes.push(format!("only the solution near the given position was sought in {}", implicit.join("; ")));
        }
        let mut skipped = 0;
        for combination in 0..count {
            let mut branches = own.clone();
            for (bit, &i) in free.iter().enumerate() {
                if combination >> bit & 1 == 1 {
                    branches[i] = -own[i];
                }
            }
            closing.set_branches(&branches);
            let mut there = q.to_vec();
            match closing.close(t, &mut there) {
                Ok(()) => {}
                Err(SystemError::Limit { .. }) => {
                    skipped += 1;
                    continue;
                }
                Err(e) => return Err(e),
            }
            let residual = closing.residual(t, &there)?;
            if closing.closure_error() > tolerance::CLOSED_FORM {
                skipped += 1;
                continue;
            }
            all.found.push(Assembled { q: there, branches, residual });
        }
        if skipped > 0 {
            all.notes.push(format!("{skipped} of {count} combinations of branches cannot close"));
        }
        Ok(all)
    }

    /// Closed forms instead of continuation: from the closed position q to the targets `(coordinate, value)`, on its
    /// branches.
    ///
    /// `None` where that does not apply: the targets are not a set of inputs, a loop is not explicit, or a limit or a
    /// change point (where branches meet) may be in between. The inputs vary linearly and in steps, so that none is
    /// skipped and whole turns are counted. The result is verified to close.
    pub fn at_targets(&self, t: f64, q: &[f64], targets: &[(usize, f64)]) -> Option<Vec<f64>> {
        let mut inputs = Vec::with_capacity(targets.len());
        for &(i, value) in targets {
            if i >= self.size().nq || !value.is_finite() {
                return None;
            }
            inputs.push(self.structure().coordinates[i].velocity?);
        }
        let mut closing = self.loop_closing(t, q, Some(&inputs)).ok()?;
        if !closing.is_explicit() {
            return None;
        }
        let far = targets
            .iter()
            .zip(&inputs)
            .fold(0.0, |m: f64, (&(i, value), &v)| m.max((value - q[i]).abs() / self.structure().displacement(v)));
        let strides = (far / tolerance::STRIDE).ceil().max(1.0);
        if far > tolerance::FARTHEST {
            return None;
        }
        let mut there = q.to_vec();
        let mut pivots: Vec<f64> = closing.state().iter().map(|s| s.pivot).collect();
        for k in 1..=strides as usize {
            let part = k as f64 / strides;
            for &(i, value) in targets {
                there[i] = if part == 1.0 { value } else { q[i] + (value - q[i]) * part };
            }
            closing.close(t, &mut there).ok()?;
            for (before, now) in pivots.iter_mut().zip(closing.state()) {
                // a pivot that halves within a step may have passed zero, or may reach it next
                if now.branch != 0 && tolerance::HALF_LOST * now.pivot < (now.pivot - *before).abs() {
                    return None;
                }
                *before = now.pivot;
            }
        }
        closing.residual(t, &there).ok()?;
        (closing.closure_error() <= tolerance::CLOSED_FORM).then_some(there)
    }
}
