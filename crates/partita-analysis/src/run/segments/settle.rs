//! Velocities after an instant, and what holds from there on: stops that press, frictions that stick.

use super::maker::{refuse, Maker};
use super::mode::{Bounds, FrictionOf, Mode, Own, StickSlip, RATE_AT_REST};
use crate::error::AnalysisError;
use crate::run::impact::{Acting, Impact, OneSided, Rates, Reached};
use partita_math::tolerance;
use partita_system::event::Occurrence;
use std::collections::BTreeSet;

/// Frictions that change between sticking and slipping until a combination holds. Reason: far more than pairs of the few
/// that come to rest together.
const MOST_FLIPS: usize = 200;

/// Frictions of which every combination is looked at where these changes do not end. Reason: 3⁶ combinations take some
/// milliseconds.
const MOST_COMBINED: usize = 6;

/// A combination of frictions that stick and slip, judged by its accelerations.
struct Judged {
    /// How the frictions act.
    now: Vec<StickSlip>,
    pushed: Reached,
    /// The rows that are held.
    held: Vec<usize>,
    /// The first one that cannot act so, and how it does.
    flip: Option<(usize, StickSlip)>,
    /// Those that contacts hold at rest.
    stops: Vec<(usize, StickSlip)>,
}

/// Accelerations with frictions.
pub(super) struct Rubbed {
    /// How they act.
    pub(super) frictions: Vec<StickSlip>,
    pub(super) pushed: Reached,
    /// The rows that are held, those of what sticks among them.
    pub(super) held: Vec<usize>,
    /// How strong all of them together may be, in the mass metric.
    pub(super) strength: f64,
}

/// How hard what begins to slip is pushed where the next forces are decided. Scale: largest acceleration that the forces
/// may give it. Reason: far above what counts as none, far below what is seen.
const PERTURBATION: f64 = 1e-6;

/// What follows from an instant.
pub(super) struct Settled {
    pub(super) reached: Reached,
    /// The stops that press.
    pub(super) pressing: BTreeSet<usize>,
    /// Those that are closed and need not, as what is held or sticks holds them.
    pub(super) covered: BTreeSet<usize>,
    /// How the frictions act.
    pub(super) frictions: Vec<StickSlip>,
    /// One whose infinitely many impacts are over so soon.
    pub(super) accumulated: Option<(usize, f64)>,
}

fn sense(x: f64) -> i8 {
    if x > 0.0 {
        1
    } else {
        -1
    }
}

impl Maker {
    /// Velocities after an instant, and the stops that press and the frictions that stick from there on; `held` are rows
    /// with their rates and `set` those of this instant alone, `passed` what has just ceased to last.
    pub(super) fn settled(
        &self,
        (acting, t, q): (&Acting, f64, &[f64]),
        impact: &Impact,
        (held, set): (&Rates, &Rates),
        (closed, passed): (&[usize], &[Own]),
        (mode, occurred): (&Mode, &[Occurrence]),
    ) -> Result<Settled, AnalysisError> {
        let mut sides: Vec<OneSided> = closed.iter().map(|&i| self.stops[i].side).collect();
        let mut stays = vec![false; sides.len()];
        let rows: Vec<usize> = held.iter().map(|x| x.0).collect();
        let mut accumulated = None;
        loop {
            let reached = impact.velocities(held, set, &sides)?;
            let after = Impact::new(acting, t, q, &reached.v)?;
            for ((stays, side), &i) in stays.iter_mut().zip(&sides).zip(closed) {
                let stop = &self.stops[i];
                // where all comes to rest nothing is fast
                let still = (RATE_AT_REST * stop.size).max(tolerance::EQUAL * after.fastest(*side));
                *stays |= after.rate(*side) <= still;
            }
            let resting: Vec<OneSided> = sides.iter().zip(&stays).filter(|x| *x.1).map(|x| *x.0).collect();
            let still = |i: usize| {
                let x = &self.frictions[i];
                let side = x.side();
                let (rate, fastest) = (after.rate(side), after.fastest(side).max(impact.fastest(side)));
                let small = tolerance::EQUAL * fastest;
                // it has just come to rest, and nothing has moved it since
                let stopped = occurred.iter().any(|o| o.event == x.event) && (rate - impact.rate(side)).abs() <= small;
                stopped || rate.abs() <= small.max(RATE_AT_REST * x.size)
            };
            let still: Vec<bool> = (0..self.frictions.len()).map(still).collect();
            let before = (&mode.frictions[..], passed);
            let Rubbed { frictions, pushed, held: mut all, strength } =
                self.rubbed((acting, t, q, &reached.v), (&after, &still), (&rows, &resting), before)?;
            // one that comes back at once, and hardly leaves, stays
            let low = |&i: &usize| {
                let (side, stop) = (sides[i], &self.stops[closed[i]]);
                let (rate, growth) = (after.rate(side), after.growth(side, &pushed.v));
                let height = -0.5 * rate * rate / growth;
                let bounces = stop.bounds == Bounds::Position && !stays[i];
                bounces && growth < 0.0 && height <= tolerance::CLOSED * stop.size
            };
            let fallen: Vec<usize> = (0..sides.len()).filter(low).collect();
            if fallen.is_empty() {
                let force = |i: usize| after.contact_acceleration(sides[i], &pushed);
                let still = |i: usize| {
                    let rubbed = after.length(sides[i].row) * strength;
                    tolerance::EQUAL * (after.strongest(sides[i]) + rubbed)
                };
                let opened = |i: usize| passed.contains(&Own::Press(closed[i])) && force(i) < still(i);
                let rests = |i: &usize| stays[*i] && after.growth(sides[*i], &pushed.v) <= still(*i);
                // those that need not press, as others that do hold them, come last
                let (loaded, idle): (Vec<usize>, Vec<usize>) =
                    (0..sides.len()).filter(rests).filter(|&i| force(i) >= 0.0).partition(|&i| force(i) > 0.0);
                let (mut pressing, mut covered) = (BTreeSet::new(), BTreeSet::new());
                for i in loaded.into_iter().chain(idle) {
                    let row = sides[i].row;
                    if after.follows(row, &all) && !after.follows(row, acting.always) {
                        if after.growth(sides[i], &pushed.v) < -still(i) {
                            return Err(self.at_dead_point(t, closed[i]));
                        }
                        covered.insert(closed[i]);
                    } else if !opened(i) {
                        pressing.insert(closed[i]);
                        all.push(row);
                    }
                }
                return Ok(Settled { reached, pressing, covered, frictions, accumulated });
            }
            for i in fallen {
                let side = sides[i];
                if 0.0 < side.restitution && side.restitution < 1.0 {
                    let next = -2.0 * after.rate(side) / after.growth(side, &pushed.v);
                    let tail = next / (1.0 - side.restitution);
                    accumulated = accumulated.or((t + tail > t).then_some((closed[i], tail)));
                }
                (stays[i], sides[i].restitution) = (true, 0.0);
            }
        }
    }

    /// What a stop or a freewheel holds turns back at a singular position, which no force along it can prevent.
    fn at_dead_point(&self, t: f64, stop: usize) -> AnalysisError {
        refuse(format!(
            "at t = {t} s the mechanism is in a singular position for \"{}\": what it stops is at a dead point and is turned \
             back there, which no force along it can prevent; stop another coordinate, which moves there",
            self.plan.events[self.stops[stop].event].name
        ))
    }

    /// How the frictions act at (t, q, v), and the accelerations there. Those that move slip. Of those at rest all that do
    /// not carry as much as they can stick to begin with; the first one that would have to carry too much slips, the
    /// first one that would slip against its force sticks, until none is left (for equal magnitudes at rest and in motion
    /// the rule of the least index, which ends).
    pub(super) fn rubbed(
        &self,
        (acting, t, q, v): (&Acting, f64, &[f64], &[f64]),
        (after, still): (&Impact, &[bool]),
        (rows, resting): (&[usize], &[OneSided]),
        before: (&[StickSlip], &[Own]),
    ) -> Result<Rubbed, AnalysisError> {
        let count = self.frictions.len();
        if count == 0 {
            let pushed = after.accelerations(rows, resting, &[])?;
            return Ok(Rubbed { frictions: Vec::new(), pushed, held: rows.to_vec(), strength: 0.0 });
        }
        let level = |x: &FrictionOf| acting.model.friction_levels(x.force, t, (q, v));
        let levels = self.frictions.iter().map(level).collect::<Result<Vec<_>, _>>()?;
        let levels: Vec<[f64; 2]> = levels.into_iter().map(Option::unwrap_or_default).collect();
        let side = |i: usize| self.frictions[i].side();
        let strength: f64 = (0..count).map(|i| after.length(side(i).row) * levels[i][1]).sum();
        // what is as small beside all forces and frictions is none
        let none = |i: usize| tolerance::EQUAL * (after.strongest(side(i)) + after.length(side(i).row) * strength);
        let (mut states, decided) = self.expected((after, still), (rows, resting), before)?;
        // one that begins to slip takes along those that carry as much as they can in its sense; those in the other stick
        let frees = |states: &mut [StickSlip], from: OneSided| -> Result<(), AnalysisError> {
            let sticks = (0..count).filter(|&j| states[j] == StickSlip::Sticks).map(|j| side(j).row);
            let held: Vec<usize> = rows.iter().copied().chain(sticks.filter(|&row| row != from.row)).collect();
            let with = [&held[..], &[from.row]].concat();
            // at rest until then, as others hold it
            let saturated = |j: usize| {
                let slips = side(j).row != from.row && !decided[j] && matches!(states[j], StickSlip::Slips(_));
                slips && after.follows(side(j).row, &with)
            };
            let others: Vec<usize> = (0..count).filter(|&j| saturated(j)).collect();
            if others.is_empty() {
                return Ok(());
            }
            let push = [(from.row, after.force_for(from, after.strongest(from)))];
            let [with, without] = [&push[..], &[]].map(|push| after.accelerations(&held, &[], push));
            let (with, without) = (with?, without?);
            for j in others {
                let moved = after.growth(side(j), &with.v) - after.growth(side(j), &without.v);
                let against = |sign: i8| f64::from(sign) * moved < -tolerance::EQUAL * after.strongest(side(j));
                if matches!(states[j], StickSlip::Slips(sign) if against(sign)) {
                    states[j] = StickSlip::Sticks;
                }
            }
            Ok(())
        };
        let toward = |i: usize, sign: i8| OneSided { sign: sign.into(), ..side(i) };
        // what has just ceased to last is in balance: where it goes on to is told by a small push
        let mut led = Vec::new();
        for own in before.1 {
            match own {
                Own::Slip(i, sign) if !decided[*i] => {
                    let from = toward(*i, *sign);
                    led.push((*i, after.force_for(from, PERTURBATION * after.strongest(from))));
                    frees(&mut states, from)?;
                }
                Own::Press(stop) => frees(&mut states, self.stops[*stop].side)?,
                Own::Slip(..) => {}
            }
        }
        let judged = |states: &[StickSlip], turning: &[bool]| -> Result<Judged, AnalysisError> {
            let mut held = rows.to_vec();
            let mut now = states.to_vec();
            for i in 0..count {
                let row = side(i).row;
                match states[i] {
                    StickSlip::Sticks if after.follows(row, &held) => now[i] = StickSlip::Rests(0),
                    StickSlip::Sticks => held.push(row),
                    StickSlip::Slips(_) | StickSlip::Rests(_) => {}
                }
            }
            for i in (0..count).filter(|&i| !decided[i] && !turning[i]) {
                if let (StickSlip::Slips(sign), true) = (now[i], after.follows(side(i).row, &held)) {
                    now[i] = StickSlip::Rests(sign);
                }
            }
            let force = |(i, state): (usize, &StickSlip)| {
                let [slips, rests] = state.signs();
                (side(i).row, -(slips * levels[i][0] + rests * levels[i][1]))
            };
            let mut applied: Vec<(usize, f64)> = now.iter().enumerate().map(force).collect();
            let slipping = led.iter().filter(|x| matches!(now[x.0], StickSlip::Slips(_)));
            applied.extend(slipping.map(|&(i, push)| (side(i).row, push)));
            let pushed = after.accelerations(&held, resting, &applied)?;
            let flip = (0..count).filter(|&i| !decided[i]).find_map(|i| match now[i] {
                StickSlip::Sticks => {
                    let carried = pushed.multipliers[side(i).row];
                    let over = carried.abs() > levels[i][1] * (1.0 + tolerance::EQUAL);
                    over.then(|| (i, StickSlip::Slips(-sense(carried))))
                }
                StickSlip::Slips(sign) => {
                    let against = f64::from(sign) * after.growth(side(i), &pushed.v) < -none(i);
                    against.then_some((i, StickSlip::Sticks))
                }
                StickSlip::Rests(_) => {
                    let growth = after.growth(side(i), &pushed.v);
                    let turns = growth.abs() > none(i);
                    turns.then(|| (i, StickSlip::Slips(sense(growth))))
                }
            });
            let flip = match flip {
                None => self.overridden((after, &pushed), (rows, resting), (&held, &applied), &now)?,
                found => found,
            };
            // a contact that presses holds, too
            let presses = |x: &&OneSided| after.contact_acceleration(**x, &pushed) > 0.0;
            let stopped: Vec<usize> =
                held.iter().copied().chain(resting.iter().filter(presses).map(|x| x.row)).collect();
            // but not one that it moves past a dead point
            let rests =
                |i: usize| after.growth(side(i), &pushed.v).abs() <= none(i) && after.follows(side(i).row, &stopped);
            let stops = (0..count).filter(|&i| !decided[i] && !turning[i]).filter_map(|i| match now[i] {
                StickSlip::Slips(sign) if rests(i) => Some((i, StickSlip::Rests(sign))),
                _ => None,
            });
            let stops = stops.collect();
            Ok(Judged { now, pushed, held, flip, stops })
        };
        let done = |x: Judged| Rubbed { frictions: x.now, pushed: x.pushed, held: x.held, strength };
        // those that others hold at a dead point, where they are at rest for an instant alone
        let mut turning = vec![false; count];
        for _ in 0..MOST_FLIPS {
            let found = judged(&states, &turning)?;
            if let Some((i, to)) = found.flip {
                turning[i] |= matches!(found.now[i], StickSlip::Rests(_));
                states[i] = to;
                if let StickSlip::Slips(sign) = to {
                    frees(&mut states, toward(i, sign))?;
                }
                continue;
            }
            if found.stops.is_empty() {
                return Ok(done(found));
            }
            found.stops.iter().for_each(|&(i, to)| states[i] = to);
        }
        // the changes go round in a circle: every combination in turn, those first in which more sticks
        let open: Vec<usize> = (0..count).filter(|&i| !decided[i]).collect();
        let mut combinations: Vec<Vec<StickSlip>> = vec![Vec::new()];
        for _ in open.iter().take(MOST_COMBINED) {
            let one = [StickSlip::Sticks, StickSlip::Slips(1), StickSlip::Slips(-1)];
            combinations = combinations.iter().flat_map(|x| one.map(|state| [&x[..], &[state]].concat())).collect();
        }
        combinations.sort_by_key(|x| x.iter().filter(|state| **state != StickSlip::Sticks).count());
        let still = vec![false; count];
        for combination in combinations.iter().filter(|_| open.len() <= MOST_COMBINED) {
            open.iter().zip(combination).for_each(|(&i, &state)| states[i] = state);
            let mut found = judged(&states, &still)?;
            if found.flip.is_none() && !found.stops.is_empty() {
                found.stops.iter().for_each(|&(i, to)| states[i] = to);
                found = judged(&states, &still)?;
            }
            if found.flip.is_none() && found.stops.is_empty() {
                return Ok(done(found));
            }
        }
        let names: Vec<&str> = self.frictions.iter().map(|x| &*x.name).collect();
        Err(refuse(format!(
            "at t = {t} s it cannot be decided which of the frictions stick ({}): their magnitudes at rest exceed those in \
             motion so far that none of the combinations holds; make them more alike",
            names.join(", ")
        )))
    }

    /// How the frictions act as far as the rates and the held rows alone say, and which of these are decided.
    fn expected(
        &self,
        (after, still): (&Impact, &[bool]),
        (rows, resting): (&[usize], &[OneSided]),
        (before, passed): (&[StickSlip], &[Own]),
    ) -> Result<(Vec<StickSlip>, Vec<bool>), AnalysisError> {
        let bare = after.accelerations(rows, resting, &[])?;
        let state = |i: usize| {
            let side = self.frictions[i].side();
            let growth = after.growth(side, &bare.v);
            let bound = after.follows(side.row, rows);
            let set_off = bound && growth.abs() > tolerance::EQUAL * after.strongest(side);
            let led = passed.iter().find_map(|x| match x {
                Own::Slip(k, sign) if *k == i => Some(*sign),
                _ => None,
            });
            match (still[i], set_off, led) {
                (false, ..) => (StickSlip::Slips(sense(after.rate(side))), true),
                (_, true, _) => (StickSlip::Slips(sense(growth)), true),
                (.., Some(sign)) => (StickSlip::Slips(sign), bound),
                _ if bound => (StickSlip::Rests(0), true),
                _ => match before[i] {
                    // as large as it can be, which it may be still
                    StickSlip::Rests(sign) if sign != 0 => (StickSlip::Slips(sign), false),
                    _ => (StickSlip::Sticks, false),
                },
            }
        };
        Ok((0..self.frictions.len()).map(state).unzip())
    }

    /// A friction that cannot stick, as what it holds together with others would then move into a stop; and how it slips.
    fn overridden(
        &self,
        (after, pushed): (&Impact, &Reached),
        (rows, resting): (&[usize], &[OneSided]),
        (held, applied): (&[usize], &Rates),
        now: &[StickSlip],
    ) -> Result<Option<(usize, StickSlip)>, AnalysisError> {
        let closes = |x: &&OneSided| after.growth(**x, &pushed.v) < -tolerance::EQUAL * after.strongest(**x);
        for stop in resting.iter().filter(closes).filter(|x| !after.follows(x.row, rows)) {
            for (i, friction) in self.frictions.iter().enumerate().rev().filter(|x| now[x.0] == StickSlip::Sticks) {
                let others: Vec<usize> = held.iter().copied().filter(|&row| row != friction.row).collect();
                if after.follows(stop.row, &others) {
                    continue;
                }
                let side = friction.side();
                let growth = after.growth(side, &after.accelerations(&others, resting, applied)?.v);
                if growth.abs() > tolerance::EQUAL * after.strongest(side) {
                    return Ok(Some((i, StickSlip::Slips(sense(growth)))));
                }
            }
        }
        Ok(None)
    }
}
