//! The programs of all choices that members need, and which member takes which.

use super::lanes::{Lanes32, LeavingMember, Member};
use super::{admissible, scouted, worded, Members, Scouted, MOST_DOF};
use crate::outputs::Rows;
use partita_integrate::options::Options;
use partita_math::program::Work;
use partita_model::motion_programs::MotionPrograms;
use partita_model::Model;
use partita_system::prelude::*;
use partita_system::reduction::Reduction;
use std::ops::Range;
use std::sync::Arc;

/// Choices with their orders of elimination at most.
const MOST_CHOICES: usize = 12;
/// Longest program, in instructions: beyond it the recursions of an ordinary run, which share work among loops,
/// are as fast.
const LONGEST: usize = 20_000;
/// A pivot that is smaller wants another order, or another choice. Scale: the pivot where the order was chosen. Reason:
/// less than a digit is lost then.
const FADING: f64 = 0.2;
/// A pivot that is smaller spoils the step. Scale: the pivot where the order was chosen. Reason: a stage may lie beyond the
/// end of the step before, at which it was larger than [`FADING`].
pub(super) const SPOILT: f64 = 0.05;
/// An order serves a position of the scouted motions if its pivots are larger. Scale: the pivot where the order was chosen.
/// Reason: other members have others there; twice [`FADING`].
const SERVES: f64 = 0.4;
/// Gain of another choice that is tolerated where none serves better. Scale: factor on the volume of the choice. Reason: a
/// digit of accuracy.
const TOLERATED: f64 = 10.0;

/// One choice: its programs, and what its numbers are compared with.
pub(super) struct Choice {
    pub programs: MotionPrograms,
    pub independent: Vec<usize>,
    /// Pivots where the order was chosen.
    pub references: Vec<f64>,
    /// `s_j / s_i` of each entry of A.
    pub ratios: Vec<f64>,
    /// Natural sizes of q and v_I.
    pub sizes: Vec<f64>,
}

/// All choices, shared by threads.
pub(super) struct Engines {
    choices: Vec<Arc<Choice>>,
    options: Options,
    /// Gain from which on another choice is taken.
    threshold: f64,
}

/// One choice with the memory of one thread.
pub(super) struct Engine {
    pub lanes: Lanes32,
    pub one: Work<f64, 1>,
    pub waiting: Vec<Member>,
}

/// How well a choice serves a state: its smallest pivot, in those where it was chosen, and the largest gain of another.
#[derive(Clone, Copy)]
struct Fitness {
    pivot: f64,
    gain: f64,
}

impl Choice {
    fn fitness(&self, one: &Work<f64, 1>) -> Fitness {
        let (p, [_, _, _, rank]) = (&self.programs, self.programs.sizes);
        let out = |o: usize| one.output(&p.end, o)[0];
        let mut pivot = f64::INFINITY;
        for k in 0..rank {
            let x = out(p.end_pivots() + k) / self.references[k];
            pivot = if x < pivot || x.is_nan() { x } else { pivot };
        }
        let gain = self.ratios.iter().enumerate().fold(0.0, |m: f64, (j, s)| m.max(s * out(p.end_a() + j).abs()));
        Fitness { pivot, gain }
    }
}

impl Engines {
    /// Those that serve the scouted motions; otherwise why there are none.
    pub fn new(model: &Model, what: &Members) -> Result<Self, String> {
        let (rank, positions) = scouted(model, what)?;
        let k = model.size().nv - rank;
        if k == 0 || k > MOST_DOF {
            return Err(format!("{k} degrees of freedom"));
        }
        let options = Options { rtol: what.request.rtol, atol: what.request.atol.into(), ..Options::default() };
        let mut all = Self { choices: Vec::new(), options, threshold: what.request.switch_threshold };
        let mut works: Vec<Work<f64, 1>> = Vec::new();
        let values = what.numbers(0).to_vec();
        let at_rest = vec![0.0; model.size().nv];
        for Scouted { t, q, independent } in positions {
            let serves = |(choice, one): (&Arc<Choice>, &mut Work<f64, 1>)| {
                choice.independent == independent && {
                    set(choice, one, (t, &q, &at_rest), &values);
                    choice.fitness(one).pivot > SERVES
                }
            };
            if all.choices.iter().zip(&mut works).any(serves) || all.choices.len() == MOST_CHOICES {
                continue;
            }
            let mut r = Reduction::dense(model, rank);
            let made = r
                .position(t, &q)
                .and_then(|()| r.refresh_scales(t, &q))
                .and_then(|()| r.set_partition(t, &independent));
            if made.is_err() {
                continue;
            }
            let programs = model.motion_programs(&r, what.parameters).map_err(worded)?;
            if programs.end.len() > LONGEST {
                return Err(format!("{} operations in an evaluation", programs.end.len()));
            }
            let s = r.scales();
            let choice = r.choice();
            let ratio = |&i: &usize| choice.independent.iter().map(move |&j| s[j] / s[i]);
            let mut sizes = vec![1.0; model.size().nq];
            for i in 0..model.size().nv {
                let own = model.structure().coordinates_of(i);
                if own.len() == 1 {
                    sizes[own.start] = model.structure().displacement(i);
                }
            }
            sizes.extend(choice.independent.iter().map(|&i| model.structure().displacement(i)));
            let mut new = Choice {
                ratios: choice.dependent.iter().flat_map(ratio).collect(),
                independent: independent.clone(),
                references: vec![1.0; programs.sizes[3]],
                sizes,
                programs,
            };
            let mut one = new.programs.end.work::<f64, 1>();
            set(&new, &mut one, (t, &q, &at_rest), &values);
            for k in 0..new.references.len() {
                new.references[k] = one.output(&new.programs.end, new.programs.end_pivots() + k)[0];
            }
            all.choices.push(Arc::new(new));
            works.push(one);
        }
        match all.choices.is_empty() {
            true => Err("no choice of coordinates could be recorded".into()),
            false => Ok(all),
        }
    }

    /// Memory of one thread.
    pub fn memory(&self) -> Vec<Engine> {
        let engine = |choice: &Arc<Choice>| {
            let lanes = Lanes32::new(choice.clone(), &self.options)?;
            Some(Engine { lanes, one: choice.programs.end.work(), waiting: Vec::new() })
        };
        self.choices.iter().filter_map(engine).collect()
    }

    /// The choice that serves a member best: of those without a better one the one with the largest pivots.
    fn best(&self, member: &Member, what: &Members, memory: &mut [Engine]) -> Option<usize> {
        let mut best: Option<(bool, f64, usize)> = None;
        for (c, engine) in memory.iter_mut().enumerate() {
            set(&self.choices[c], &mut engine.one, (member.t, &member.q, &member.v), what.numbers(member.index));
            let found = self.choices[c].fitness(&engine.one);
            let good = found.gain <= self.threshold;
            if found.pivot > FADING && found.gain <= TOLERATED {
                let better = |b: &(bool, f64, usize)| (good, found.pivot) > (b.0, b.1);
                if best.as_ref().is_none_or(better) {
                    best = Some((good, found.pivot, c));
                }
            }
        }
        best.map(|x| x.2)
    }

    /// All members of a batch: their rows, and those that are left to an ordinary run.
    pub fn run(
        &self,
        model: &Model,
        what: &Members,
        members: Range<usize>,
        memory: &mut [Engine],
        rows: &mut Rows,
        left: &mut Vec<usize>,
    ) {
        for index in members {
            let (q, v) = what.state(model, index);
            let finite = q.iter().chain(v).all(|x| x.is_finite());
            let member = Member::new(index, what.request.t0, q, v);
            match (finite && admissible(model, what, index)).then(|| self.best(&member, what, memory)).flatten() {
                Some(c) => memory[c].waiting.push(member),
                None => left.push(index),
            }
        }
        while let Some(c) = (0..memory.len()).max_by_key(|&c| memory[c].waiting.len()) {
            let mut waiting = std::mem::take(&mut memory[c].waiting);
            if waiting.is_empty() {
                break;
            }
            // the first in the list begins first
            waiting.reverse();
            let mut moved = Vec::new();
            memory[c].lanes.run(model, what, &mut waiting, rows, self.threshold, &mut |x| moved.push(x));
            for x in moved {
                match x {
                    LeavingMember::Alone(index) => left.push(index),
                    LeavingMember::Elsewhere(member) => match self.best(&member, what, memory) {
                        Some(to) if to != c || member.fits => memory[to].waiting.push(member),
                        _ => left.push(member.index),
                    },
                }
            }
        }
        left.sort_unstable();
    }

    /// Least pivot and largest gain with which a lane stays.
    pub fn stays(pivot: f64, gain: f64, threshold: f64) -> bool {
        pivot > FADING && gain <= threshold
    }
}

/// Evaluate the end of a choice at a state.
fn set(choice: &Choice, one: &mut Work<f64, 1>, (t, q, v): (f64, &[f64], &[f64]), values: &[f64]) {
    let p = &choice.programs.end;
    one.input(p, 0)[0] = t;
    q.iter().enumerate().for_each(|(i, x)| one.input(p, 1 + i)[0] = *x);
    let first = 1 + q.len();
    choice.independent.iter().enumerate().for_each(|(j, &i)| one.input(p, first + j)[0] = v[i]);
    let first = first + choice.independent.len();
    values.iter().enumerate().for_each(|(j, x)| one.input(p, first + j)[0] = *x);
    one.prepare(p);
    one.evaluate(p);
}
