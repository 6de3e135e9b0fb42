//! Evaluations inside a step by compiled code, with the bits of those by levels.
//!
//! Only rates are computed: the end of a step, outputs and everything that looks at the levels evaluates these. Where a
//! pivot comes near its guard, a number is not finite or an evaluation would fail, the levels decide.

use super::Motion;
use crate::compiled::{Compilation, CompiledRates};
use crate::positions::Positions;
use crate::reduction::Reduction;
use crate::system::ConstrainedSystem;
use crate::tangent::Tangent;
use partita_math::program::Compiler;
use std::sync::Arc;

/// The compiled rates of the choice in use.
#[derive(Debug)]
pub(super) struct CompiledMotion {
    compiler: &'static dyn Compiler,
    when: Compilation,
    /// Number of the plan that they belong to.
    plan: u64,
    rates: Option<Arc<CompiledRates>>,
    /// Whether there is a power among them.
    power: bool,
    inputs: Vec<f64>,
    outputs: Vec<f64>,
    /// Evaluations.
    count: u64,
}

impl CompiledMotion {
    /// For motions of a system in all coordinates and independent velocities; none where nothing is ever compiled.
    pub(super) fn new<S: ConstrainedSystem>(r: &Reduction<S>, when: Compilation) -> Option<Self> {
        let compiler = <dyn Compiler>::installed().filter(|_| when != Compilation::Never)?;
        if r.system.rheonomic() {
            return None;
        }
        let (nq, power) = (r.size().nq, r.system.has_power());
        Some(Self {
            compiler,
            when,
            plan: 0,
            rates: None,
            power,
            inputs: vec![0.0; nq + r.k() + 1],
            outputs: vec![0.0; nq + r.k() + usize::from(power) + r.rank() + 1],
            count: 0,
        })
    }

    /// The rates at (t, y) by the code for the choice in use; false where there is none, or where it does not apply.
    fn evaluate<S: ConstrainedSystem>(&mut self, r: &Reduction<S>, t: f64, y: &[f64], dy: &mut [f64]) -> bool {
        if self.plan != r.plans {
            self.plan = r.plans;
            self.rates = r.system.compiled_rates(&r.choice());
        }
        let Some(rates) = &self.rates else { return false };
        let program = || r.system.rates_program(&r.choice());
        let Some(code) = rates.code(self.compiler, self.when, program) else { return false };
        let state = self.inputs.len() - 1;
        self.inputs[..state].copy_from_slice(&y[..state]);
        self.inputs[state] = t;
        code.evaluate(&self.inputs, &mut self.outputs);
        let (rates, watched) = self.outputs.split_at(state + usize::from(self.power));
        let (excess, pivots) = watched.split_last().unwrap_or((&f64::NAN, &[]));
        let within = *excess <= 0.0 && r.clearly_regular(pivots);
        if !within || !rates.iter().all(|x| x.is_finite()) {
            return false;
        }
        dy[..rates.len()].copy_from_slice(rates);
        self.count += 1;
        true
    }
}

impl<'s, S: ConstrainedSystem + 's, T: Tangent<'s, S>, P: Positions<'s, S, T>> Motion<'s, S, T, P> {
    /// Evaluate rates by compiled code; for motions in all coordinates and the independent velocities of a partition.
    pub(super) fn compiling(mut self, when: Compilation) -> Self {
        self.compiled = CompiledMotion::new(self.tangent.seen(), when).filter(|_| self.prescribed.is_empty());
        self
    }

    /// The rates at (t, y) by compiled code; false where the levels must evaluate them.
    #[inline]
    pub(super) fn compiled_rates(&mut self, t: f64, y: &[f64], dy: &mut [f64]) -> bool {
        let Some(compiled) = &mut self.compiled else { return false };
        if self.monitor.crosses_next || self.looking || self.guards.waits() {
            return false;
        }
        let r = self.tangent.reduction();
        let done = compiled.evaluate(r, t, y, dy);
        if done {
            r.factorisations += u64::from(r.rank() > 0);
            self.behind = true;
        }
        done
    }

    /// Evaluations by compiled code.
    pub(super) fn compiled_count(&self) -> u64 {
        self.compiled.as_ref().map_or(0, |x| x.count)
    }
}
