//! The tangent of an explicit closing: the partition whose independent velocities are the inputs of its blocks.
//!
//! C_D is block-triangular in the blocks, so its elimination has no fill outside them: A, η and ξ follow block by block
//! (38). The inputs are those for which the system closes its loops by inverse kinematics, chosen by the system or the
//! user. An input that reaches a dead point of its block is replaced between steps where the choice is the system's
//! own. (Woernle 1988; Hiller, Kecskeméthy.)

use super::base::PERIOD;
use super::{Base, Occasion, TangentChoice, TangentClosing, TangentLevels, TangentReplay};
use crate::closing::Closing;
use crate::error::Result;
use crate::options::FormulationOptions;
use crate::partition::normalised_determinant;
use crate::record::{Correction, History, PartitionEvent, StepDecision};
use crate::reduction::{Reduction, Sides};
use crate::singular::dead_point::dead_point;
use crate::start;
use crate::system::{ConstrainedSystem, SystemError, SystemRef};
use partita_math::formatted;
use partita_math::tolerance;

/// Number of steps after which the inputs are chosen again at the latest, with a gain that has not doubled: the cost of
/// one plan is then negligible.
const MOST_PATIENCE: u32 = 1024;
/// The tangent of a closing in use. Of the options it reads `independent` (fixed inputs) and `switch_threshold`
/// (hysteresis of a change of inputs).
pub struct Blocks<'s, S: ConstrainedSystem> {
    base: Base<'s, S>,
    fixed: Option<Vec<usize>>,
    switch_threshold: f64,
    /// None before the start.
    closing: Option<Box<dyn Closing + Send + 's>>,
    /// Steps until other inputs are chosen again, and the number after the last choice: choosing requires
    /// planning, and an answer without improvement is likely to recur.
    patience: u32,
    waited: u32,
    /// The least gain of a switch since the last choice.
    asked_at: f64,
    next: Option<Box<dyn Closing + Send + 's>>,
}

impl<'s, S: ConstrainedSystem> Blocks<'s, S> {
    /// For a system of the given rank (see [`crate::start::analyse`]). There must be no nonholonomic rows.
    pub fn new(system: impl Into<SystemRef<'s, S>>, rank: usize, options: &FormulationOptions) -> Result<Self> {
        let system = system.into();
        let size = system.size();
        let (n, k) = (size.nv, size.nv - rank);
        let mut fixed = options.independent.clone();
        if let Some(inputs) = &mut fixed {
            *inputs = start::distinct(inputs, n)?;
            if inputs.len() != k {
                return Err(SystemError::argument(
                    "independent",
                    format!(
                        "{} inputs were requested, but the number of degrees of freedom is {k}; name as many, or \
                     none",
                        inputs.len()
                    ),
                ));
            }
        }
        let (base, switch_threshold) = (Base::new(Reduction::dense(system, rank)), options.switch_threshold);
        Ok(Self { base, fixed, switch_threshold, closing: None, patience: 0, waited: 0, asked_at: 0.0, next: None })
    }

    /// The closing in use.
    ///
    /// # Errors
    /// Before the start, when none was chosen.
    pub fn closing(&mut self) -> Result<&mut (dyn Closing + Send + 's)> {
        match &mut self.closing {
            Some(closing) => Ok(&mut **closing),
            None => Err(SystemError::Unchosen("closing")),
        }
    }

    /// The position level at q; refuses a q whose closure error exceeds `limit` (in characteristic displacements).
    pub fn check_closed(&mut self, t: f64, q: &[f64], limit: f64) -> Result<()> {
        let r = &mut self.base.r;
        r.position(t, q)?;
        let wide = |&(i, phi): &(usize, &f64)| phi.is_nan() || phi.abs() > limit * r.row_size(i);
        match r.at.phi.iter().enumerate().find(wide) {
            None => Ok(()),
            Some((row, phi)) => Err(SystemError::argument(
                "closing",
                format!(
                "the explicit closing leaves a closure error of {1} in {0} at t = {t}; check the closing function, \
                 and that it follows the branch of the initial state",
                r.system.structure().rows[row].description,
                formatted(*phi)
            ),
            )),
        }
    }

    /// Message where two branches meet and the inputs lead no further: a dead point of theirs, or, where a drive leads,
    /// a limit of the block that meets its other branch first.
    pub fn undecided(&self, t: f64, q: &[f64]) -> SystemError {
        self.at_dead_point(t, q, "would have to change to its other branch, which meets this one here")
    }

    /// As `undecided`, for the reason `seen` of the block with the smallest pivot.
    fn at_dead_point(&self, t: f64, q: &[f64], seen: &str) -> SystemError {
        let blocks = self.closing.iter().flat_map(|x| x.blocks().iter().zip(x.state()));
        let worst = blocks.min_by(|x, y| x.1.pivot.total_cmp(&y.1.pivot));
        let block = worst.map_or_else(String::new, |(block, _)| block.words.clone());
        if self.inputs().is_empty() {
            return SystemError::Limit { block, t, shortfall: 0.0 };
        }
        let r = &self.base.r;
        dead_point(&*r.system, r.rank(), t, q, self.inputs(), format!("{block} {seen}"))
    }

    /// Use a closing from the closed position q on.
    fn adopt(&mut self, t: f64, q: &mut [f64], mut closing: Box<dyn Closing + Send + 's>) -> Result<()> {
        self.check_blocks(&*closing)?;
        closing.close(t, q)?;
        let r = &mut self.base.r;
        r.position(t, q)?;
        r.refresh_scales(t, q)?;
        let chosen = r.set_partition(t, closing.inputs()).and_then(|()| r.tangent(t));
        self.closing = Some(closing);
        chosen.map_err(|e| self.pivotless(t, q, e))
    }

    /// Every velocity must be an input, or be solved for by one block.
    fn check_blocks(&self, closing: &dyn Closing) -> Result<()> {
        let system = self.base.r.system.clone();
        let mut solved = vec![false; system.size().nv];
        closing.inputs().iter().for_each(|&i| solved[i] = true);
        let refuse = |what: String| {
            Err(SystemError::argument(
                "formulation",
                format!("the explicit closing cannot be used: {what}; take another formulation"),
            ))
        };
        for block in closing.blocks() {
            for &i in &block.unknown {
                if std::mem::replace(&mut solved[i], true) {
                    let name = system.structure().velocities[i].name.clone();
                    return refuse(format!("{} solves for {name}, which is known already", block.words));
                }
            }
        }
        match solved.iter().position(|s| !s) {
            Some(i) => refuse(format!("no block solves for {}", system.structure().velocities[i].name)),
            None => Ok(()),
        }
    }

    fn pivotless(&self, t: f64, q: &[f64], e: SystemError) -> SystemError {
        match e {
            SystemError::Singular { .. } => self.at_dead_point(t, q, "has no pivot left"),
            other => other,
        }
    }

    fn inputs(&self) -> &[usize] {
        self.closing.as_ref().map_or(&[], |x| x.inputs())
    }

    /// Growth of the volume of the choice with other inputs.                                                     (31)
    fn growth(&self, inputs: &[usize]) -> f64 {
        let r = &self.base.r;
        match inputs.len() == r.k() {
            true => normalised_determinant::ratio(&r.at.dt, self.inputs(), r.scales(), None, inputs),
            false => 0.0,
        }
    }

    /// Ask the system for other inputs, occasionally or when the gain has grown; stores them in `self.next`.
    fn better_inputs(&mut self, t: f64, q: &[f64], gain: f64) -> bool {
        self.patience = self.patience.saturating_sub(1);
        self.asked_at = self.asked_at.min(gain);
        if self.patience > 0 && gain < tolerance::DOUBLED * self.asked_at {
            return false;
        }
        self.waited = (2 * self.waited).clamp(PERIOD, MOST_PATIENCE);
        (self.patience, self.asked_at) = (self.waited, gain);
        // a system that knows no closing here keeps the one in use, which reports its own limits
        let Ok(next) = S::closing(self.base.r.system.clone(), t, q, None) else { return false };
        // a gain by scales of some steps ago may have vanished; a failure here would recur in the next evaluation
        let better = next.inputs() != self.inputs()
            && self.base.r.refresh_scales(t, q).is_ok()
            && self.growth(next.inputs()) > self.switch_threshold;
        self.next = better.then_some(next);
        better
    }
}

impl<'s, S: ConstrainedSystem> TangentLevels<'s, S> for Blocks<'s, S> {
    fn base(&self) -> &Base<'s, S> {
        &self.base
    }
    fn base_mut(&mut self) -> &mut Base<'s, S> {
        &mut self.base
    }
    fn tangent(&mut self, t: f64, q: &[f64], _factored: bool) -> Result<()> {
        let evaluated = self.base.r.tangent(t);
        evaluated.map_err(|e| self.pivotless(t, q, e))
    }
}

impl<'s, S: ConstrainedSystem> TangentChoice<'s, S> for Blocks<'s, S> {
    fn start(&mut self, t: f64, q: &mut [f64], v: &[f64]) -> Result<()> {
        let closing = S::closing(self.base.r.system.clone(), t, q, self.fixed.as_deref())?;
        self.adopt(t, q, closing)?;
        self.base.evaluate(t, q, v)?;
        let reason = match &self.fixed {
            Some(_) => "inputs fixed by the user",
            None => "inputs that close the loops explicitly",
        };
        self.base.log(t, q, &[], reason.into())
    }
    fn judge(&mut self, t: f64, q: &[f64]) -> StepDecision {
        self.next = None;
        self.base.fading = self.base.r.rows_fade();
        if self.base.is_rigid_or_free() || self.fixed.is_some() {
            return StepDecision::Keep;
        }
        let gain = self.base.r.best_switch().map_or(0.0, |x| x.gain);
        match gain > self.switch_threshold && self.better_inputs(t, q, gain) {
            true => StepDecision::Change,
            false => StepDecision::Keep,
        }
    }
    fn attends(&self) -> bool {
        self.base.fading || self.base.steps_since_scales + 1 >= PERIOD
    }
    fn accept(&mut self, t: f64, q: &[f64]) -> Result<()> {
        self.base.accept(t, q, true);
        Ok(())
    }
    fn renew(&mut self, t: f64, q: &mut [f64], v: &[f64], why: Occasion) -> Result<bool> {
        let Some(next) = self.next.take().filter(|_| why == Occasion::Decayed) else { return Ok(false) };
        let before = self.inputs().to_vec();
        let growth = self.growth(next.inputs());
        let (from, to) = (self.base.names(&before), self.base.names(next.inputs()));
        self.adopt(t, q, next)?;
        self.waited = 0;
        self.base.switches += 1;
        self.base.evaluate(t, q, v)?;
        let reason = format!("{to} replace {from} as inputs: the volume of the choice grows by {growth:.3}");
        self.base.log(t, q, &before, reason)?;
        Ok(true)
    }
    fn independent<'a>(&'a self, within: Option<&'a PartitionEvent>) -> Option<&'a [usize]> {
        Some(within.map_or_else(|| self.inputs(), |event| &event.independent))
    }
    fn report(&self, history: &mut History) {
        let words = self.closing.iter().flat_map(|x| x.blocks().iter().zip(x.state())).map(|(block, state)| {
            let how = if block.explicit { "in closed form" } else { "by Newton's method" };
            match state.branch {
                0 => format!("{} {how}", block.words),
                sign => format!("{} {how}, branch {sign:+}", block.words),
            }
        });
        let words: Vec<String> = words.collect();
        if !words.is_empty() {
            let inputs = self.base.names(self.inputs());
            let all = words.join("; ");
            history.notes.push(format!("the loops are closed explicitly for the inputs {inputs}: {all}"));
        }
    }
}

impl<'s, S: ConstrainedSystem> TangentReplay<'s, S> for Blocks<'s, S> {}

impl<'s, S: ConstrainedSystem> TangentClosing<'s, S> for Blocks<'s, S> {
    /// Closed by inverse kinematics: there is nothing to correct.
    fn correction(&mut self, _t: f64, _q: &[f64], _rule: Correction, _dv: &mut [f64]) -> Result<bool> {
        Ok(false)
    }
    fn sides(&self, sides: &mut Sides) {
        self.base.r.sides(sides);
    }
    fn choice_of_sides(&self) -> (u64, u64) {
        (self.base.r.choices(), 0)
    }
    fn margin(&mut self) -> Option<(f64, u64)> {
        // with the same inputs and rows distances are comparable, whatever the order of elimination
        (self.base.r.rank() > 0).then(|| (self.base.r.distance().0, self.base.r.choices()))
    }
}
