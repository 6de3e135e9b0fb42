//! From one segment to the next: what actions change at an instant, and what happened there.

use super::maker::{refuse, Maker};
use super::mode::{Bounds, Mode, Own, StickSlip, RATE_AT_REST};
use super::settle::Settled;
use super::{Action, Happening, JointImpulse, Kind, Law, Transition};
use crate::determined::determined;
use crate::error::AnalysisError;
use crate::outputs::{energies, reactions, Forces, States};
use crate::run::impact::{Acting, Impact, Reached};
use partita_math::tolerance;
use partita_model::Model;
use partita_system::event::{MotionState, Occurrence};
use partita_system::positions::turns;
use partita_system::prelude::*;
use partita_system::record::Output;
use partita_system::start;

/// Impulses of all joints with which velocities change by `dv`, with those along the rows.
fn of_joints(
    model: &Model,
    (t, q): (f64, &[f64]),
    dv: &[f64],
    along: &[f64],
) -> Result<Vec<JointImpulse>, AnalysisError> {
    let (times, rest, none) = ([t], vec![0.0; dv.len()], vec![0.0; along.len()]);
    let states = States { t: &times, q, v: &rest };
    // reactions are linear in accelerations and multipliers: the loads of the instant are in both
    let with = reactions(model, &states, &Forces { vdot: dv, multipliers: along }, &mut || Ok(()))?;
    let without = reactions(model, &states, &Forces { vdot: &rest, multipliers: &none }, &mut || Ok(()))?;
    let known = determined(model.permanent(), t, q, false)?;
    let part = |table: usize, i: usize| with[table][i] - without[table][i];
    let joint = |(j, known): (usize, [bool; 6])| {
        let mut wrench = [0.0; 6];
        for i in 0..3 {
            (wrench[i], wrench[3 + i]) = (part(0, 3 * j + i), part(1, 3 * j + i));
        }
        (wrench, known)
    };
    Ok(known.into_iter().enumerate().map(joint).collect())
}

/// Refuse to part a joint where a body goes on spinning about an axis about which it has no inertia: by the mechanisms
/// before and after, whose kinetic energies differ by that of the spin, which is held there.
fn check_spins(before: &Model, after: &Model, (t, q, v): (f64, &[f64], &[f64])) -> Result<(), AnalysisError> {
    let (times, go) = ([t], || Ok(()));
    let states = States { t: &times, q, v };
    let [first, last] = [before, after].map(|model| energies(model, &states, &mut go.clone()));
    let (first, last) = (first?[0][0], last?[0][0]);
    if (first - last).abs() > tolerance::SOLUTION_ROUNDING * first.max(last) {
        return Err(refuse(format!(
            "at t = {t:.6} s a body is parted that spins about an axis about which it has no inertia, so that its motion is \
             not determined from there on; give it inertia about all axes"
        )));
    }
    Ok(())
}

impl Maker {
    /// Rows of the mechanism itself, without what events hold, that are combinations of its others, as its runs find them;
    /// none at a singular position.
    fn dropped(&self, whole: &Model, t: f64, q: &[f64]) -> Vec<usize> {
        let own = whole.permanent();
        let rows = self.plan.model.rows_of(own);
        let found = start::analyse(own, t, q).map(|start| start.dropped).unwrap_or_default();
        let is_held = |row: &usize| !own.structure().rows[*row].is_drive;
        found.into_iter().filter(is_held).map(|row| rows[row]).collect()
    }

    /// These actions, with what they decide at a state in the place of each decision.
    pub(super) fn decided(&self, actions: &[Action], at: &MotionState) -> Result<Vec<Action>, AnalysisError> {
        let mut all = Vec::with_capacity(actions.len());
        for action in actions {
            match action {
                Action::Decide(i) => all.extend(self.plan.decisions.decide(*i, at)?),
                other => all.push(other.clone()),
            }
        }
        Ok(all)
    }

    /// Carry out actions at a state: the next mode and the velocities there.
    pub(super) fn change(
        &mut self,
        mode: &Mode,
        before: &Output,
        occurred: &[Occurrence],
    ) -> Result<(Mode, Vec<f64>, f64), AnalysisError> {
        let t = before.t;
        let q: Vec<f64> = before.q.iter().zip(&before.turns).map(|(q, n)| turns::whole(*q, *n)).collect();
        let mut next = mode.clone();
        let mut set: Vec<(usize, f64)> = Vec::new();
        let mut done: Vec<(usize, bool, Kind)> = Vec::new();
        // an event that holds several coordinates does one thing
        let mut note = |event: usize, rises: bool, kind: Kind| {
            if !done.contains(&(event, rises, kind)) {
                done.push((event, rises, kind));
            }
        };
        let (v, vdot) = (before.v.clone(), vec![0.0; before.v.len()]);
        let state = MotionState { t, q: q.clone(), v, vdot, multipliers: Vec::new() };
        for x in occurred {
            let Some(actions) = self.plan.actions.get(x.event) else { continue };
            for action in self.decided(actions, &state)? {
                match &action {
                    Action::Lock(name) => {
                        if next.locked.insert(name.clone()) {
                            note(x.event, x.rises, Kind::Lock);
                        }
                    }
                    Action::Release(name) => {
                        if next.locked.remove(name) {
                            note(x.event, x.rises, Kind::Release);
                        }
                    }
                    Action::Part(joint) => {
                        if next.whole.parted.insert(joint.clone()) {
                            note(x.event, x.rises, Kind::Release);
                        }
                    }
                    Action::Rates(rates) => {
                        for (name, rate) in rates {
                            let row = self.rows.get(name).copied();
                            let row = row.ok_or_else(|| refuse(format!("there is no drive \"{name}\"")))?;
                            set.push((row, *rate));
                        }
                        note(x.event, x.rises, Kind::Rates);
                    }
                    Action::Inputs(values) => {
                        let bits = values.iter().map(|(i, value)| (*i, value.to_bits()));
                        next.whole.inputs.extend(bits);
                        note(x.event, x.rises, Kind::Input);
                    }
                    Action::Stop { .. } | Action::Freewheel { .. } | Action::Friction { .. } | Action::Decide(_) => {}
                }
            }
        }
        let closed = self.closed(&state)?;
        let whole = self.whole(&next.whole)?;
        let rows = self.plan.model.rows_of(&whole);
        let always: Vec<usize> = self.always.iter().copied().filter(|x| rows.contains(x)).collect();
        if next.whole.parted != mode.whole.parted {
            check_spins(&*self.whole(&mode.whole)?, &whole, (t, &q, &before.v))?;
        }
        let dropped = self.dropped(&whole, t, &q);
        let count = self.plan.model.size().rows;
        let acting = Acting { model: &whole, rows: &rows, count, always: &always, dropped: &dropped };
        let impact = Impact::new(&acting, t, &q, &before.v)?;
        let mut held: Vec<(usize, f64)> = always.iter().map(|&row| (row, 0.0)).collect();
        held.extend(next.locked.iter().filter_map(|name| self.rows.get(name)).map(|&row| (row, 0.0)));
        let own = self.own(mode);
        let passed = occurred.iter().filter_map(|x| x.event.checked_sub(self.plan.events.len()));
        let passed: Vec<Own> = passed.filter_map(|i| own.get(i).copied()).collect();
        let Settled { reached, pressing, covered, frictions, accumulated } =
            self.settled((&acting, t, &q), &impact, (&held, &set), (&closed, &passed), (mode, occurred))?;
        let Reached { v, multipliers, energy } = reached;
        for &i in &closed {
            let stop = &self.stops[i];
            let rises = stop.side.sign < 0.0;
            let closes = impact.rate(stop.side) < -tolerance::SOLUTION_ROUNDING * impact.fastest(stop.side);
            let changes = (mode.rests(i), pressing.contains(&i) || covered.contains(&i));
            match (stop.bounds, changes) {
                (Bounds::Position, _) if closes => done.push((stop.event, rises, Kind::Impact)),
                // how it is at the start is no event, unless velocities jump
                (Bounds::Rate, (false, true)) if closes || !occurred.is_empty() => {
                    done.push((stop.event, rises, Kind::Lock));
                }
                (Bounds::Rate, (true, false)) => done.push((stop.event, !rises, Kind::Release)),
                _ => {}
            }
            match (stop.bounds, changes) {
                (Bounds::Position, (false, true)) => done.push((stop.event, rises, Kind::Rest)),
                (Bounds::Position, (true, false)) => done.push((stop.event, !rises, Kind::LiftOff)),
                _ => {}
            }
        }
        (next.pressing, next.covered) = (pressing, covered);
        for (i, (from, to)) in mode.frictions.iter().zip(&frictions).enumerate() {
            let (event, rises) = (self.frictions[i].event, to.sign() > 0);
            match (from, to) {
                _ if occurred.is_empty() => {}
                (StickSlip::Slips(_), StickSlip::Sticks | StickSlip::Rests(_)) => {
                    done.push((event, from.sign() < 0, Kind::Stick))
                }
                (_, StickSlip::Slips(_)) if from != to => done.push((event, rises, Kind::Slip)),
                _ => {}
            }
        }
        next.frictions = frictions;
        let moved = |(a, b): (&f64, &f64)| (a - b).abs() > tolerance::ROUNDING * a.abs().max(b.abs());
        let jumps = v.iter().zip(&before.v).any(moved);
        let (v, mut lost, impulses) = match jumps {
            true => (v, -energy, multipliers),
            false => (before.v.clone(), 0.0, Vec::new()),
        };
        let energy = -lost;
        let dv: Vec<f64> = v.iter().zip(&before.v).map(|(after, before)| after - before).collect();
        let along: Vec<f64> = if jumps { rows.iter().map(|&row| impulses[row]).collect() } else { Vec::new() };
        let joints = if jumps { of_joints(&whole, (t, &q), &dv, &along)? } else { Vec::new() };
        if !occurred.is_empty() {
            let mut laws: Vec<(usize, Law)> = Vec::new();
            if jumps {
                let after = Impact::new(&acting, t, &q, &v)?;
                laws.extend(held.iter().map(|x| (x.0, Law::Still)).chain(set.iter().map(|x| (x.0, Law::Set))));
                for &i in &closed {
                    let (side, loaded) = (self.stops[i].side, impulses[self.stops[i].side.row] != 0.0);
                    let still = after.rate(side).abs() <= RATE_AT_REST * self.stops[i].size;
                    laws.extend(loaded.then_some((side.row, if still { Law::Still } else { Law::Bounces })));
                }
            }
            let own = |&(row, law): &(usize, Law)| rows.iter().position(|x| *x == row).map(|row| (row, law));
            let laws = laws.iter().filter_map(own).collect();
            let (model, _) = self.model(mode)?;
            let causes = self.causes(mode, &model, occurred);
            self.transition = Some(Transition { whole: whole.clone(), causes, laws });
        }
        for (event, rises, kind) in done {
            let own = matches!(kind, Kind::Impact | Kind::Lock | Kind::Rates);
            let impulses = if own { impulses.clone() } else { Vec::new() };
            let joints = if own { joints.clone() } else { Vec::new() };
            let energy_lost = if own { std::mem::take(&mut lost) } else { 0.0 };
            let (before, after) = (before.clone(), v.clone());
            self.happenings.push(Happening { event, kind, rises, before, after, impulses, joints, energy_lost });
        }
        if let Some((i, rest)) = accumulated {
            let mut at = Output { v: v.clone(), ..before.clone() };
            at.t += rest;
            self.happenings.push(Happening {
                event: self.stops[i].event,
                kind: Kind::Accumulation,
                rises: self.stops[i].side.sign < 0.0,
                before: at,
                after: v.clone(),
                impulses: Vec::new(),
                joints: Vec::new(),
                energy_lost: 0.0,
            });
        }
        Ok((next, v, energy))
    }
}
