//! Members of one choice of coordinates, each in a lane with its own time and step.

use super::engine::{Choice, Engines, SPOILT};
use super::{report, Members};
use crate::outputs::Rows;
use partita_integrate::lane_steps::{lane, lane_mut, LaneSteps};
use partita_integrate::options::Options;
use partita_integrate::simulate::Status;
use partita_integrate::step_size::{controller, StepController};
use partita_integrate::tableau::DOP853;
use partita_math::program::{Program, Work};
use partita_math::scalar::Lanes;
use partita_math::tolerance;
use partita_model::Model;
use partita_system::positions::turns;
use std::sync::Arc;

/// Groups of eight members to an instruction. Reason: four hide the latency of the arithmetic, and their work still lies in
/// the first cache.
const GROUPS: usize = 4;
const LANES: usize = GROUPS * Lanes::COUNT;
/// Steps of all lanes between two looks for an interrupt. Reason: some milliseconds.
const LOOK: u32 = 256;
/// Attempts of a step that stages spoil. Reason: another choice, or a shorter step, serves at once or not at all.
const ATTEMPTS: u32 = 3;
/// Largest correction at the end of a step. Scale: natural size of the coordinate. Reason: no remainder of S3 is as large;
/// a motion that changed its branch is.
const LARGEST_CORRECTION: f64 = 1e-3;
/// Steps of a member at most. Reason: an ordinary run goes on, and can be interrupted.
const MOST_STEPS: u64 = 100_000;

type Eights = [Lanes; GROUPS];

/// A member between two steps.
pub(super) struct Member {
    pub index: usize,
    pub t: f64,
    pub q: Vec<f64>,
    pub v: Vec<f64>,
    /// Whether the choice that it left would serve on.
    pub fits: bool,
    turns: Vec<i32>,
    /// Length of the next step; 0 before the first one.
    step: f64,
    controller: StepController,
    /// Next output.
    next: usize,
    steps: u64,
    spoilt: u32,
}

impl Member {
    pub fn new(index: usize, t: f64, q: &[f64], v: &[f64]) -> Self {
        Self {
            index,
            t,
            q: q.to_vec(),
            v: v.to_vec(),
            fits: true,
            turns: vec![0; q.len()],
            step: 0.0,
            controller: controller(&DOP853),
            next: 0,
            steps: 0,
            spoilt: 0,
        }
    }
}

/// A member that leaves.
pub(super) enum LeavingMember {
    /// To an ordinary run, from its start.
    Alone(usize),
    /// To another choice.
    Elsewhere(Member),
}

/// A member ready for its first step here: state and slope.
struct Ready {
    member: Member,
    y: Vec<f64>,
    slope: Vec<f64>,
}

/// The lanes of one thread for one choice.
pub(super) struct Lanes32 {
    choice: Arc<Choice>,
    steps: LaneSteps<GROUPS>,
    rates: Work<Lanes, GROUPS>,
    end: Work<Lanes, GROUPS>,
    output: Work<Lanes, GROUPS>,
    slots: Vec<Option<Member>>,
    /// Of members before their first step here.
    starts: LaneSteps<GROUPS>,
    start_rates: Work<Lanes, GROUPS>,
    start_end: Work<Lanes, GROUPS>,
    ready: Vec<Ready>,
    /// A state that can be evaluated, for lanes without a member.
    sound: Vec<f64>,
    /// Ends of the steps.
    t_new: [f64; LANES],
    /// Smallest pivots of the stages.
    least: [f64; LANES],
    /// Steps of all lanes so far.
    rounds: u32,
}

fn put(work: &mut Work<Lanes, GROUPS>, p: &Program, input: usize, l: usize, x: f64) {
    *lane_mut(work.input(p, input), l) = x;
}

fn get(work: &Work<Lanes, GROUPS>, p: &Program, output: usize, l: usize) -> f64 {
    lane(work.output(p, output), l)
}

impl Lanes32 {
    /// None for a method that lanes do not know.
    pub fn new(choice: Arc<Choice>, options: &Options) -> Option<Self> {
        let p = &choice.programs;
        let steps = || LaneSteps::new(&DOP853, options, &choice.sizes);
        Some(Self {
            steps: steps()?,
            starts: steps()?,
            rates: p.rates.work(),
            end: p.end.work(),
            output: p.output.work(),
            start_rates: p.rates.work(),
            start_end: p.end.work(),
            slots: (0..LANES).map(|_| None).collect(),
            ready: Vec::new(),
            sound: Vec::new(),
            t_new: [0.0; LANES],
            least: [f64::INFINITY; LANES],
            rounds: 0,
            choice,
        })
    }

    /// All waiting members, the last in the list first, to their ends or until they leave.
    pub fn run(
        &mut self,
        model: &Model,
        what: &Members,
        waiting: &mut Vec<Member>,
        rows: &mut Rows,
        threshold: f64,
        leave: &mut dyn FnMut(LeavingMember),
    ) {
        loop {
            self.rounds = self.rounds.wrapping_add(1);
            if self.rounds % LOOK == 0 && (what.interrupted)() {
                self.slots.fill_with(|| None);
                self.ready.clear();
                waiting.clear();
                break;
            }
            self.refill(what, waiting, rows, leave);
            if self.slots.iter().all(Option::is_none) {
                break;
            }
            self.plan(what);
            self.stages();
            let errors = self.steps.finish();
            self.evaluate_end();
            let taken = self.judge(what, &errors, leave);
            let outputs = self.outputs(what, &taken, rows, leave);
            self.commit(model, what, &outputs, &errors, rows, threshold, leave);
        }
    }

    // ---- members in and out

    fn refill(
        &mut self,
        what: &Members,
        waiting: &mut Vec<Member>,
        rows: &mut Rows,
        leave: &mut dyn FnMut(LeavingMember),
    ) {
        let mut changed = false;
        for l in 0..LANES {
            if self.slots[l].is_some() {
                continue;
            }
            while self.ready.is_empty() && !waiting.is_empty() {
                self.make_ready(what, waiting, rows, leave);
            }
            let Some(Ready { member, y, slope }) = self.ready.pop() else {
                self.rest(l);
                continue;
            };
            self.load(l, &y, &slope);
            let p = &self.choice.programs;
            let first = 1 + y.len();
            for (j, x) in what.numbers(member.index).iter().enumerate() {
                put(&mut self.rates, &p.rates, first + j, l, *x);
                put(&mut self.end, &p.end, first + j, l, *x);
                put(&mut self.output, &p.output, first + j, l, *x);
            }
            self.slots[l] = Some(member);
            self.sound = y;
            changed = true;
        }
        if changed && !what.parameters.is_empty() {
            let p = &self.choice.programs;
            self.rates.prepare(&p.rates);
            self.end.prepare(&p.end);
            self.output.prepare(&p.output);
        }
    }

    fn load(&mut self, l: usize, y: &[f64], slope: &[f64]) {
        for (i, x) in y.iter().enumerate() {
            *lane_mut(&mut self.steps.y[i], l) = *x;
        }
        for (to, x) in self.steps.slope(0).iter_mut().zip(slope) {
            *lane_mut(to, l) = *x;
        }
    }

    /// Lane l without a member.
    fn rest(&mut self, l: usize) {
        let y = std::mem::take(&mut self.sound);
        self.load(l, &y, &vec![0.0; y.len()]);
        *lane_mut(&mut self.steps.h, l) = 0.0;
        self.sound = y;
    }

    /// Slopes and first steps of some members, which come off the list.
    fn make_ready(
        &mut self,
        what: &Members,
        waiting: &mut Vec<Member>,
        rows: &mut Rows,
        leave: &mut dyn FnMut(LeavingMember),
    ) {
        let choice = self.choice.clone();
        let (p, [nq, nv, k, _]) = (&choice.programs, choice.programs.sizes);
        let dim = nq + k;
        let mut members: Vec<Member> = Vec::with_capacity(LANES);
        while members.len() < LANES {
            let Some(member) = waiting.pop() else { break };
            members.push(member);
        }
        for l in 0..LANES {
            // lanes without a member repeat the last one
            let m = &members[l.min(members.len() - 1)];
            for (work, program) in [(&mut self.start_end, &p.end), (&mut self.start_rates, &p.rates)] {
                put(work, program, 0, l, m.t);
                m.q.iter().enumerate().for_each(|(i, x)| put(work, program, 1 + i, l, *x));
                choice.independent.iter().enumerate().for_each(|(j, &i)| put(work, program, 1 + nq + j, l, m.v[i]));
                let numbers = what.numbers(m.index).iter().enumerate();
                numbers.for_each(|(j, x)| put(work, program, 1 + dim + j, l, *x));
            }
        }
        self.start_end.prepare(&p.end);
        self.start_rates.prepare(&p.rates);
        self.start_end.evaluate(&p.end);
        // the state as corrected, and its slope
        for i in 0..dim {
            self.starts.y[i] = match i < nq {
                true => *self.start_end.output(&p.end, i),
                false => *self.start_end.input(&p.end, 1 + i),
            };
            self.starts.slope(0)[i] = *self.start_end.output(&p.end, nq + i);
        }
        let guesses: Vec<f64> = (0..LANES).map(|l| self.starts.first_guess(l)).collect();
        let span = what.request.t_end - what.request.t0;
        for l in 0..LANES {
            let h = guesses[l].min(span);
            let t = members[l.min(members.len() - 1)].t;
            put(&mut self.start_rates, &p.rates, 0, l, t + h);
            for i in 0..dim {
                let y = lane(&self.starts.y[i], l) + h * lane(&self.starts.slope(0)[i], l);
                put(&mut self.start_rates, &p.rates, 1 + i, l, y);
            }
        }
        self.start_rates.evaluate(&p.rates);
        for (l, mut member) in members.into_iter().enumerate() {
            let corrected = |i: usize| get(&self.start_end, &p.end, i, l);
            let velocity = |i: usize| get(&self.start_end, &p.end, 2 * nq + k + i, l);
            let slope: Vec<f64> = (0..dim).map(|i| get(&self.start_end, &p.end, nq + i, l)).collect();
            if member.step == 0.0 {
                // written so that NaN fails
                let fastest = member.v.iter().fold(0.0, |m: f64, v| m.max(v.abs()));
                let closed =
                    (0..nq).all(|i| (corrected(i) - member.q[i]).abs() <= tolerance::CLOSED_IN_RUN * choice.sizes[i]);
                let along = (0..nv).all(|i| (velocity(i) - member.v[i]).abs() <= tolerance::WORST_ROUNDING * fastest);
                if !(closed && along && slope.iter().all(|x| x.is_finite())) {
                    leave(LeavingMember::Alone(member.index));
                    continue;
                }
                let guess = guesses[l].min(span);
                let there: Vec<f64> = (0..dim).map(|i| get(&self.start_rates, &p.rates, i, l)).collect();
                let better = self.starts.second_guess(l, guess, &there);
                member.step = if better.is_finite() { better.min(span) } else { guess };
                while what.t_eval.get(member.next).is_some_and(|t| *t <= member.t) {
                    let q: Vec<f64> = (0..nq).map(corrected).collect();
                    let v: Vec<f64> = (0..nv).map(velocity).collect();
                    write(rows, &member, &q, &v);
                    member.next += 1;
                }
                if member.t >= what.request.t_end {
                    report(rows, member.index, Status::Finished, true, 0);
                    continue;
                }
            }
            let y = (0..dim).map(|i| lane(&self.starts.y[i], l)).collect();
            self.ready.push(Ready { member, y, slope });
        }
        // the first that came is the first to go
        self.ready.reverse();
    }

    /// The member of lane l, as it was before the step.
    fn take(&mut self, l: usize) -> Option<Member> {
        let mut member = self.slots[l].take()?;
        for (i, q) in member.q.iter_mut().enumerate() {
            *q = lane(&self.steps.y[i], l);
        }
        let nq = member.q.len();
        for (j, &i) in self.choice.independent.iter().enumerate() {
            member.v[i] = lane(&self.steps.y[nq + j], l);
        }
        Some(member)
    }

    fn send_away(&mut self, l: usize, leave: &mut dyn FnMut(LeavingMember)) {
        if let Some(member) = self.slots[l].take() {
            leave(LeavingMember::Alone(member.index));
        }
        self.rest(l);
    }

    // ---- one step

    fn plan(&mut self, what: &Members) {
        for l in 0..LANES {
            let Some(member) = &self.slots[l] else { continue };
            let rest = what.request.t_end - member.t;
            let (h, t_new) = match rest <= tolerance::TO_THE_END * member.step {
                true => (rest, what.request.t_end),
                false => {
                    // to the end as rounded
                    let t_new = member.t + member.step;
                    (t_new - member.t, t_new)
                }
            };
            *lane_mut(&mut self.steps.h, l) = h;
            self.t_new[l] = t_new;
        }
    }

    fn time(&self, l: usize) -> f64 {
        self.slots[l].as_ref().map_or(0.0, |m| m.t)
    }

    fn stages(&mut self) {
        let choice = self.choice.clone();
        let p = &choice.programs;
        let dim = choice.sizes.len();
        self.least = [f64::INFINITY; LANES];
        let start: Eights = std::array::from_fn(|g| Lanes::from_fn(|l| self.time(g * Lanes::COUNT + l)));
        for stage in 1..self.steps.stages() {
            self.steps.at_stage(stage, &mut self.rates.inputs(&p.rates)[1..=dim]);
            self.evaluate_rates(&start, self.steps.node(stage), stage);
            for (k, reference) in choice.references.iter().enumerate() {
                let found = *self.rates.output(&p.rates, dim + k);
                for l in 0..LANES {
                    let x = lane(&found, l) / reference;
                    // NaN stays
                    self.least[l] = if x >= self.least[l] { self.least[l] } else { x };
                }
            }
        }
    }

    /// The slope at this node, into a slot.
    fn evaluate_rates(&mut self, start: &Eights, node: f64, slot: usize) {
        let p = &self.choice.programs.rates;
        *self.rates.input(p, 0) =
            std::array::from_fn(|g| Lanes::from_fn(|l| start[g].0[l] + node * self.steps.h[g].0[l]));
        self.rates.evaluate(p);
        for (i, to) in self.steps.slope(slot).iter_mut().enumerate() {
            *to = *self.rates.output(p, i);
        }
    }

    fn evaluate_end(&mut self) {
        let p = &self.choice.programs.end;
        for l in 0..LANES {
            put(&mut self.end, p, 0, l, self.t_new[l]);
        }
        let dim = self.choice.sizes.len();
        self.end.inputs(p)[1..=dim].copy_from_slice(&self.steps.y_new);
        self.end.evaluate(p);
    }

    /// Lanes whose step is taken; the others try a shorter one, or leave.
    fn judge(&mut self, what: &Members, errors: &Eights, leave: &mut dyn FnMut(LeavingMember)) -> Vec<usize> {
        let choice = self.choice.clone();
        let (p, [nq, _, k, rank]) = (&choice.programs, choice.programs.sizes);
        let shortest = tolerance::SOLUTION_ROUNDING * (what.request.t_end - what.request.t0);
        let mut taken = Vec::with_capacity(LANES);
        for l in 0..LANES {
            let Some(member) = &mut self.slots[l] else { continue };
            let (error, h) = (lane(errors, l), lane(&self.steps.h, l));
            if h == 0.0 {
                // the time does not resolve the step: an ordinary run says so
                self.send_away(l, leave);
                continue;
            }
            if error > 1.0 && error.is_finite() {
                member.step = h * member.controller.rejected(error);
                if member.step < shortest {
                    self.send_away(l, leave);
                }
                continue;
            }
            let of_end = |o: usize| get(&self.end, &p.end, o, l);
            let mut least = self.least[l];
            for (j, reference) in choice.references.iter().enumerate().take(rank) {
                let x = of_end(p.end_pivots() + j) / reference;
                least = if x >= least { least } else { x };
            }
            let corrected = (0..nq)
                .all(|i| (of_end(i) - lane(&self.steps.y_new[i], l)).abs() <= LARGEST_CORRECTION * choice.sizes[i]);
            let closed = of_end(p.end_closure()) <= tolerance::CLOSED_FORM;
            // NaN fails
            if !(error <= 1.0 && least > SPOILT && corrected && closed) {
                member.spoilt += 1;
                let again = member.spoilt < ATTEMPTS && error.is_finite() && least <= SPOILT;
                match self.take(l) {
                    Some(mut member) if again => {
                        member.fits = false;
                        leave(LeavingMember::Elsewhere(member));
                    }
                    Some(member) => leave(LeavingMember::Alone(member.index)),
                    None => {}
                }
                self.rest(l);
                continue;
            }
            for i in 0..nq {
                *lane_mut(&mut self.steps.y_new[i], l) = get(&self.end, &p.end, i, l);
            }
            taken.push(l);
        }
        let end = self.steps.end_slot();
        for i in 0..nq + k {
            let found = *self.end.output(&p.end, nq + i);
            self.steps.slope(end)[i] = found;
        }
        taken
    }

    /// The outputs inside the steps that are taken; those whose outputs close.
    fn outputs(
        &mut self,
        what: &Members,
        taken: &[usize],
        rows: &mut Rows,
        leave: &mut dyn FnMut(LeavingMember),
    ) -> Vec<usize> {
        let choice = self.choice.clone();
        let (p, [nq, nv, k, _]) = (&choice.programs, choice.programs.sizes);
        let due = |m: &Member, t_new: f64| what.t_eval.get(m.next).copied().filter(|t| *t <= t_new);
        let inside = taken
            .iter()
            .any(|&l| self.slots[l].as_ref().is_some_and(|m| due(m, self.t_new[l]).is_some_and(|t| t < self.t_new[l])));
        if inside {
            let start: Eights = std::array::from_fn(|g| Lanes::from_fn(|l| self.time(g * Lanes::COUNT + l)));
            for (slot, node) in self.steps.extra().collect::<Vec<_>>() {
                let dim = choice.sizes.len();
                self.steps.at_extra(slot, &mut self.rates.inputs(&p.rates)[1..=dim]);
                self.evaluate_rates(&start, node, slot);
            }
            self.steps.fill_dense();
        }
        let mut kept = taken.to_vec();
        loop {
            let mut asked: Vec<usize> = Vec::with_capacity(kept.len());
            for &l in &kept {
                let Some(member) = &self.slots[l] else { continue };
                let Some(t) = due(member, self.t_new[l]) else { continue };
                asked.push(l);
                put(&mut self.output, &p.output, 0, l, t);
                let theta = (t - member.t) / lane(&self.steps.h, l);
                for i in 0..nq + k {
                    let y = match t == self.t_new[l] {
                        true => lane(&self.steps.y_new[i], l),
                        false => self.steps.dense(l, i, theta),
                    };
                    put(&mut self.output, &p.output, 1 + i, l, y);
                }
            }
            if asked.is_empty() {
                return kept;
            }
            self.output.evaluate(&p.output);
            for l in asked {
                let closed = get(&self.output, &p.output, nq + nv, l) <= tolerance::CLOSED_FORM;
                let q: Vec<f64> = (0..nq).map(|i| get(&self.output, &p.output, i, l)).collect();
                let v: Vec<f64> = (0..nv).map(|i| get(&self.output, &p.output, nq + i, l)).collect();
                if !(closed && v.iter().all(|x| x.is_finite())) {
                    self.send_away(l, leave);
                    kept.retain(|x| *x != l);
                } else if let Some(member) = &mut self.slots[l] {
                    write(rows, member, &q, &v);
                    member.next += 1;
                }
            }
        }
    }

    fn commit(
        &mut self,
        model: &Model,
        what: &Members,
        taken: &[usize],
        errors: &Eights,
        rows: &mut Rows,
        threshold: f64,
        leave: &mut dyn FnMut(LeavingMember),
    ) {
        let choice = self.choice.clone();
        let (p, [nq, nv, k, rank]) = (&choice.programs, choice.programs.sizes);
        self.steps.accept(taken.iter().copied());
        for &l in taken {
            let Some(member) = &mut self.slots[l] else { continue };
            let h = lane(&self.steps.h, l);
            let next = h * member.controller.accepted(lane(errors, l));
            // a step shortened by the end does not change the planned length
            member.step = next.max(if h < member.step { member.step } else { 0.0 });
            member.t = self.t_new[l];
            member.steps += 1;
            member.spoilt = 0;
            for i in 0..nq {
                turns::reduce_one(model, i, lane_mut(&mut self.steps.y[i], l), &mut member.turns[i]);
            }
            let of_end = |o: usize| get(&self.end, &p.end, o, l);
            for (i, v) in member.v.iter_mut().enumerate() {
                *v = of_end(2 * nq + k + i);
            }
            if member.t >= what.request.t_end {
                report(rows, member.index, Status::Finished, true, member.steps);
                self.slots[l] = None;
                self.rest(l);
                continue;
            }
            if member.steps >= MOST_STEPS {
                self.send_away(l, leave);
                continue;
            }
            let pivot =
                (0..rank).fold(f64::INFINITY, |m: f64, j| m.min(of_end(p.end_pivots() + j) / choice.references[j]));
            let entries = choice.ratios.iter().enumerate();
            let gain = entries.fold(0.0, |m: f64, (j, s)| m.max(s * of_end(p.end_a() + j).abs()));
            if !Engines::stays(pivot, gain, threshold) {
                if let Some(mut member) = self.take(l) {
                    let v: Vec<f64> = (0..nv).map(|i| get(&self.end, &p.end, 2 * nq + k + i, l)).collect();
                    (member.v, member.fits) = (v, true);
                    leave(LeavingMember::Elsewhere(member));
                }
                self.rest(l);
            }
        }
    }
}

/// An output of a member, into its rows.
fn write(rows: &mut Rows, member: &Member, q: &[f64], v: &[f64]) {
    let (nq, nv, o) = (q.len(), v.len(), member.next);
    let to = &mut rows.row(0, member.index)[o * nq..][..nq];
    for (i, to) in to.iter_mut().enumerate() {
        *to = turns::whole(q[i], member.turns[i]);
    }
    rows.row(1, member.index)[o * nv..][..nv].copy_from_slice(v);
}
