//! The tangent of an explicit closing: A, η and ξ block by block from small systems (38), nothing factored over all loops.
//!
//! The inputs are those for which the system closes its loops by inverse kinematics; which ones is the system's choice, or the
//! user's. An input that runs into a dead point of its block is changed between steps where the choice is the system's own.
//! (Woernle 1988; Hiller, Kecskeméthy; catalogue row 15.)

use super::dense::DenseTangent;
use super::solver::BlockSolver;
use super::{Occasion, Tangent};
use crate::closing::Closing;
use crate::options::FormulationOptions;
use crate::record::Verdict;
use crate::record::{Correction, FormulationCounters, Journal, PartitionEvent};
use crate::reduction::Reduction;
use crate::singular::dead_point::dead_point;
use crate::start;
use crate::system::{ConstrainedSystem, SystemError};

/// Steps after which the scales are looked at again, and after which a system that had no better inputs is asked again.
pub(super) const PERIOD: u32 = 8;

/// The tangent of a closing in use. Of the options it reads `independent` (inputs that stay) and `exchange` (hysteresis of a
/// change of inputs).
pub struct Blocks<'s, S: ConstrainedSystem> {
    pub(super) r: Reduction<'s, S>,
    pub(super) d: DenseTangent,
    pub(super) fixed: Option<Vec<usize>>,
    pub(super) exchange: f64,
    /// None before the start.
    pub(super) loops: Option<Loops<'s>>,
    force: Vec<f64>,
    lambda: Vec<f64>,
    /// A, row by row in the order of the unknowns (r x k).
    pub(super) gains: Vec<f64>,
    steps_since_scales: u32,
    /// Steps to go before the system is asked for other inputs again.
    pub(super) patience: u32,
    /// Gain of an exchange when it was last asked.
    pub(super) asked_at: f64,
    pub(super) next: Option<Box<dyn Closing + Send + 's>>,
    pub(super) events: Vec<PartitionEvent>,
    counters: FormulationCounters,
}

/// A closing in use.
pub(super) struct Loops<'s> {
    pub(super) closing: Box<dyn Closing + Send + 's>,
    solver: BlockSolver,
    pub(super) unknown: Vec<usize>,
}

impl<'s, S: ConstrainedSystem> Blocks<'s, S> {
    /// For a system of the given rank (see [`crate::start::analyse`]). There must be no nonholonomic rows.
    pub fn new(system: &'s S, rank: usize, options: &FormulationOptions) -> Result<Self, SystemError> {
        let size = system.size();
        let (n, k) = (size.nv, size.nv - rank);
        let mut fixed = options.independent.clone();
        if let Some(inputs) = &mut fixed {
            *inputs = start::distinct("inputs", inputs, n)?;
            if inputs.len() != k {
                return Err(SystemError::Request(format!(
                    "{} inputs were asked for, but the mechanism has {k} degrees of freedom; name as many, or \
                     none",
                    inputs.len()
                )));
            }
        }
        Ok(Self {
            r: Reduction::dense(system, rank),
            d: DenseTangent::new(n, k),
            fixed,
            exchange: options.exchange,
            loops: None,
            force: vec![0.0; n],
            lambda: vec![0.0; size.rows],
            gains: vec![0.0; rank * k],
            steps_since_scales: 0,
            patience: 0,
            asked_at: 0.0,
            next: None,
            events: Vec::new(),
            counters: FormulationCounters::default(),
        })
    }

    /// The closing in use.
    ///
    /// # Errors
    /// Before the start, when none was chosen.
    pub fn closing(&mut self) -> Result<&mut (dyn Closing + Send + 's), SystemError> {
        match &mut self.loops {
            Some(loops) => Ok(&mut *loops.closing),
            None => Err(SystemError::Request("no closing was chosen before the evaluation".into())),
        }
    }

    /// The position level at q; refuses a q that the closing has left open by more than `limit` (in reaches).
    pub fn check_closed(&mut self, t: f64, q: &[f64], limit: f64) -> Result<(), SystemError> {
        self.r.position(t, q)?;
        let system = self.r.system;
        let wide = |&(i, phi): &(usize, &f64)| phi.is_nan() || phi.abs() > limit * system.row_reach(i).unwrap_or(1.0);
        match self.r.phi.iter().enumerate().find(wide) {
            None => Ok(()),
            Some((row, phi)) => Err(SystemError::Request(format!(
                "the explicit closing leaves {} open by {phi:.3e} at t = {t}; check the function that closes the loops, and that it \
                 takes the branch of the start",
                system.row_words(row)
            ))),
        }
    }

    /// What to say where two branches meet and the inputs lead no further: a dead point of theirs, or, where a drive leads, a
    /// limit of the block that meets its other branch first.
    pub fn undecided(&self, t: f64, q: &[f64]) -> SystemError {
        let Some(loops) = &self.loops else { return SystemError::Limit { block: String::new(), t, shortfall: 0.0 } };
        let closing = &loops.closing;
        let blocks = closing.blocks().iter().zip(closing.state());
        let worst = blocks.min_by(|x, y| x.1.pivot.total_cmp(&y.1.pivot));
        let block = worst.map_or_else(String::new, |(block, _)| block.words.clone());
        if closing.inputs().is_empty() {
            return SystemError::Limit { block, t, shortfall: 0.0 };
        }
        let seen = format!("{block} would have to go over to its other branch, where it meets this one");
        dead_point(self.r.system, self.r.rank(), t, q, closing.inputs(), seen)
    }

    /// Use a closing from the closed position q on.
    fn adopt(&mut self, t: f64, q: &mut [f64], mut closing: Box<dyn Closing + Send + 's>) -> Result<(), SystemError> {
        closing.close(t, q)?;
        self.r.position(t, q)?;
        let solver = BlockSolver::new(self.r.system, closing.inputs(), closing.blocks(), self.r.rank(), &self.r.c)?;
        self.d.dt.fill(0.0);
        self.d.gamma.fill(0.0);
        self.d.delta.fill(0.0);
        for (j, &i) in closing.inputs().iter().enumerate() {
            self.d.dt[i * self.r.k() + j] = 1.0;
        }
        self.loops = Some(Loops { unknown: solver.unknown().collect(), solver, closing });
        self.counters.plans += 1;
        self.r.refresh_scales(t, q)
    }

    pub(super) fn inputs(&self) -> &[usize] {
        self.loops.as_ref().map_or(&[], |l| l.closing.inputs())
    }

    fn names(&self, velocities: &[usize]) -> String {
        velocities.iter().map(|&i| self.r.system.velocity_name(i)).collect::<Vec<_>>().join(", ")
    }
}

impl<'s, S: ConstrainedSystem> Tangent<'s, S> for Blocks<'s, S> {
    fn reduction(&mut self) -> &mut Reduction<'s, S> {
        &mut self.r
    }
    fn seen(&self) -> &Reduction<'s, S> {
        &self.r
    }
    fn start(&mut self, t: f64, q: &mut [f64], v: &[f64]) -> Result<(), SystemError> {
        let closing = self.r.system.closing(t, q, self.fixed.as_deref())?;
        self.adopt(t, q, closing)?;
        let speeds: Vec<f64> = self.inputs().iter().map(|&i| v[i]).collect();
        self.tangent(t, q, false)?;
        self.spread(&speeds);
        self.accelerate(t, q, &speeds)?;
        let reason = match &self.fixed {
            Some(_) => "inputs fixed by the user".to_string(),
            None => "inputs that close the loops explicitly".to_string(),
        };
        self.log(t, q, &[], reason)
    }
    fn select(&mut self, v: &[f64], u: &mut [f64]) -> Result<(), SystemError> {
        u.iter_mut().zip(self.inputs()).for_each(|(u, &i)| *u = v[i]);
        Ok(())
    }
    /// One motion per input with the others at rest, and the motion of time alone.         (38)
    fn tangent(&mut self, t: f64, q: &[f64], _factored: bool) -> Result<(), SystemError> {
        let Some(loops) = &mut self.loops else { return Ok(()) };
        let (k, c) = (self.r.k(), &self.r.c);
        self.counters.factorisations += 1;
        loops.solver.factor(c).map_err(|b| match c.iter().all(|x| x.is_finite()) {
            true => {
                let seen = format!("{} has no pivot left", loops.closing.blocks()[b].words);
                dead_point(self.r.system, self.r.rank(), t, q, loops.closing.inputs(), seen)
            }
            false => SystemError::NotFinite { what: "the constraint Jacobian".into(), t },
        })?;
        for j in 0..k {
            loops.solver.forward(c, &mut self.d.dt, |i| i * k + j, |_| 0.0);
        }
        if self.r.system.rheonomic() {
            loops.solver.forward(c, &mut self.d.gamma, |i| i, |row| self.r.a[row]);
        }
        Ok(())
    }
    fn spread(&mut self, u: &[f64]) {
        self.d.spread(u, &mut self.r.v);
    }
    fn accelerate(&mut self, t: f64, q: &[f64], _u: &[f64]) -> Result<(), SystemError> {
        let r = &mut self.r;
        r.system.velocity(t, q, &r.v, &mut r.scratch, &mut r.b)?;
        let Some(loops) = &mut self.loops else { return Ok(()) };
        loops.solver.forward(&r.c, &mut self.d.delta, |i| i, |row| r.b[row]);
        self.d.accelerate(r, t, q, |i| loops.closing.inputs().get(i).copied())
    }
    fn rates(&self, du: &mut [f64]) {
        du.copy_from_slice(&self.d.du);
    }
    fn full_acceleration(&self, out: &mut [f64]) {
        self.d.full_acceleration(out);
    }
    fn offset(&self) -> &[f64] {
        &self.d.gamma
    }
    /// Closed by inverse kinematics: there is nothing to correct.
    fn correct(&mut self, _t: f64, _q: &mut [f64], _rule: Correction) -> Result<bool, SystemError> {
        Ok(false)
    }
    fn judge(&mut self, t: f64, q: &[f64]) -> Verdict {
        self.next = None;
        if self.r.k() == 0 || self.r.rank() == 0 || self.fixed.is_some() {
            return Verdict::Keep;
        }
        let gain = self.gain();
        match gain > self.exchange && self.better_inputs(t, q, gain) {
            true => Verdict::Change,
            false => Verdict::Keep,
        }
    }
    fn attends(&self) -> bool {
        self.steps_since_scales + 1 >= PERIOD
    }
    fn accept(&mut self, t: f64, q: &[f64]) -> Result<(), SystemError> {
        self.steps_since_scales += 1;
        if self.steps_since_scales >= PERIOD {
            self.steps_since_scales = 0;
            // a failure here would be met by the next evaluation too, which reports it; the old scales serve till then
            let _ = self.r.refresh_scales(t, q);
        }
        Ok(())
    }
    fn renew(&mut self, t: f64, q: &mut [f64], v: &[f64], why: Occasion) -> Result<bool, SystemError> {
        let Some(next) = self.next.take().filter(|_| why == Occasion::Decayed) else { return Ok(false) };
        let before = self.inputs().to_vec();
        let growth = self.growth(next.inputs());
        let (from, to) = (self.names(&before), self.names(next.inputs()));
        self.adopt(t, q, next)?;
        self.counters.exchanges += 1;
        // M_d of the new choice, at the same (q, v)
        let speeds: Vec<f64> = self.inputs().iter().map(|&i| v[i]).collect();
        self.tangent(t, q, false)?;
        self.spread(&speeds);
        self.accelerate(t, q, &speeds)?;
        let reason = format!("{to} in the place of {from} as inputs: the volume of the choice grows by {growth:.3}");
        self.log(t, q, &before, reason)?;
        Ok(true)
    }
    /// Smallest singular value of C_D times √(1 + |A|²), all in reaches: as that of a partition.
    fn margin(&mut self) -> Option<(f64, u64)> {
        let (k, system) = (self.r.k(), self.r.system);
        let loops = self.loops.as_mut().filter(|_| self.r.rank() > 0)?;
        let smallest = loops.solver.smallest_singular_value(system, &self.r.c, &mut self.force, &mut self.lambda);
        let inputs = loops.closing.inputs();
        let part = |d: usize, j: usize| self.d.dt[d * k + j] * system.reach(inputs[j]) / system.reach(d);
        let mixed: f64 = loops.unknown.iter().map(|&d| (0..k).map(|j| part(d, j).powi(2)).sum::<f64>()).sum();
        Some((smallest * (1.0 + mixed).sqrt(), self.counters.plans))
    }
    fn gain(&mut self) -> f64 {
        self.best_gain()
    }
    fn independent<'a>(&'a self, within: Option<&'a PartitionEvent>) -> Option<&'a [usize]> {
        Some(within.map_or_else(|| self.inputs(), |event| &event.independent))
    }
    fn events(&self) -> &[PartitionEvent] {
        &self.events
    }
    fn report(&self, journal: &mut Journal) {
        journal.counters = self.counters;
        let Some(loops) = &self.loops else { return };
        journal.rows = loops.solver.rows().collect();
        journal.rows.sort_unstable();
        let words = loops.closing.blocks().iter().zip(loops.closing.state()).map(|(block, state)| {
            let how = if block.explicit { "in closed form" } else { "by Newton's method" };
            match state.branch {
                0 => format!("{} {how}", block.words),
                sign => format!("{} {how}, branch {sign:+}", block.words),
            }
        });
        let words: Vec<String> = words.collect();
        if !words.is_empty() {
            let inputs = self.names(self.inputs());
            journal
                .notes
                .push(format!("the loops are closed explicitly for the inputs {inputs}: {}", words.join("; ")));
        }
    }
}
