//! Runs that go on from one another, as between the communication points of a co-simulation: how the motion stands is plain
//! data, which can be kept, come back to and written.

use super::mode::{Mode, StickSlip};
use super::{Happening, MakeFunctions, Plan, RunState, Segment};
use crate::error::AnalysisError;
use crate::run::Request;
use partita_system::record::Output;
use std::collections::{BTreeMap, BTreeSet};
use std::ops::ControlFlow;
use std::sync::Arc;

/// How a motion stands between two runs: which rows act, and how often each event has happened.
#[derive(Clone, Debug, PartialEq)]
pub struct ModeState {
    mode: Mode,
    count: Vec<u64>,
}

/// What a run of a relay came to.
pub struct Gone {
    /// In the order of time.
    pub segments: Vec<Segment>,
    /// What happened.
    pub happenings: Vec<Happening>,
    /// How the motion stands at its end.
    pub mode_state: ModeState,
}

/// What makes them; the models of modes are kept.
pub struct Relay {
    plan: Arc<Plan>,
    functions: MakeFunctions,
    state: RunState,
    /// What happened at the start.
    first: Vec<Happening>,
    /// When the last run ended.
    ended: f64,
}

impl Relay {
    /// At a closed state.
    ///
    /// # Errors
    /// Where the motion cannot start.
    pub fn new(
        plan: Plan,
        functions: MakeFunctions,
        request: &Request,
        start: (&[f64], &[f64]),
    ) -> Result<Self, AnalysisError> {
        let plan = Arc::new(plan);
        let mut state = RunState::new(plan.clone(), functions()?, request, start)?;
        let first = std::mem::take(&mut state.maker.happenings);
        Ok(Self { plan, functions, state, first, ended: request.t0 })
    }

    /// How the motion stands where it starts, its velocities there, as what is closed closes, and what happened.
    pub fn started(&self) -> (ModeState, &[f64], &[Happening]) {
        (self.mode_state(), &self.state.now.v, &self.first)
    }

    fn mode_state(&self) -> ModeState {
        ModeState { mode: self.state.mode.clone(), count: self.state.maker.count.clone() }
    }

    /// On from a state to the end of the request, with outputs at these times.
    ///
    /// # Errors
    /// Where it cannot begin.
    pub fn go_on(
        &mut self,
        from: &ModeState,
        (q, v): (&[f64], &[f64]),
        request: &Request,
        t_eval: &[f64],
        watch: &mut dyn FnMut(f64) -> ControlFlow<()>,
    ) -> Result<Gone, AnalysisError> {
        if request.t0 != self.ended {
            // what they remember of the motion is that of another one
            *self.state.maker.functions.0.lock().unwrap_or_else(std::sync::PoisonError::into_inner) =
                (self.functions)()?;
        }
        self.ended = f64::NAN;
        let state = &mut self.state;
        (state.mode, state.maker.count) = (from.mode.clone(), from.count.clone());
        state.now =
            Output { t: request.t0, q: q.to_vec(), v: v.to_vec(), turns: vec![0; q.len()], ..Output::default() };
        (state.work, state.exchanged, state.at_once) = (0.0, None, 0);
        state.maker.happenings.clear();
        let segments = state.go_on(request, t_eval, watch)?.into_iter().map(|x| x.1).collect();
        self.ended = request.t_end;
        let happenings = std::mem::take(&mut self.state.maker.happenings);
        Ok(Gone { segments, happenings, mode_state: self.mode_state() })
    }

    /// How a motion stands, as numbers.
    pub fn numbers(&self, of: &ModeState) -> Vec<f64> {
        let Mode { locked, pressing, covered, frictions, whole } = &of.mode;
        let mut found: Vec<f64> = of.count.iter().map(|x| *x as f64).collect();
        found.extend(self.plan.switched.iter().map(|name| f64::from(u8::from(locked.contains(name)))));
        let stop = |i: usize| f64::from(u8::from(pressing.contains(&i)) + 2 * u8::from(covered.contains(&i)));
        found.extend((0..self.state.maker.stops.len()).map(stop));
        found.extend(frictions.iter().map(|x| match x {
            StickSlip::Sticks => 0.0,
            StickSlip::Slips(sign) => f64::from(*sign),
            StickSlip::Rests(sign) => 10.0 + f64::from(*sign),
        }));
        for i in 0..self.plan.inputs.len() {
            let value = whole.inputs.get(&i).map(|bits| f64::from_bits(*bits));
            found.extend([f64::from(u8::from(value.is_some())), value.unwrap_or(0.0)]);
        }
        found
    }

    /// How a motion stands, of its numbers; none of any others. Joints that are apart have none.
    pub fn from_numbers(&self, numbers: &[f64]) -> Option<ModeState> {
        let sizes = [self.plan.events.len(), self.plan.switched.len(), self.state.maker.stops.len()];
        let (frictions, inputs) = (self.state.maker.frictions.len(), self.plan.inputs.len());
        if numbers.len() != sizes.iter().sum::<usize>() + frictions + 2 * inputs {
            return None;
        }
        let mut rest = numbers;
        let mut taken = |n: usize| {
            let (head, tail) = rest.split_at(n);
            rest = tail;
            head
        };
        let count = taken(sizes[0]).iter().map(|x| *x as u64).collect();
        let names = self.plan.switched.iter().zip(taken(sizes[1]));
        let locked = names.filter(|x| *x.1 != 0.0).map(|x| x.0.clone()).collect();
        let stops = taken(sizes[2]);
        let of = |bit: u8| (0..stops.len()).filter(|&i| stops[i] as u8 & bit != 0).collect::<BTreeSet<usize>>();
        let friction = |x: &f64| match *x as i8 {
            0 => Some(StickSlip::Sticks),
            sign @ (-1 | 1) => Some(StickSlip::Slips(sign)),
            sign @ 9..=11 => Some(StickSlip::Rests(sign - 10)),
            _ => None,
        };
        let frictions = taken(frictions).iter().map(friction).collect::<Option<Vec<_>>>()?;
        let set: BTreeMap<usize, u64> = taken(2 * inputs)
            .chunks(2)
            .enumerate()
            .filter(|(_, x)| x[0] != 0.0)
            .map(|(i, x)| (i, x[1].to_bits()))
            .collect();
        let mode = Mode { locked, pressing: of(1), covered: of(2), frictions, ..Mode::default() };
        let whole = super::mode::Whole { inputs: set, ..Default::default() };
        Some(ModeState { mode: Mode { whole, ..mode }, count })
    }
}
