//! Velocities after an instant, and what holds from there on: stops that press, frictions that stick.

use super::maker::{refuse, Maker};
use super::mode::{Bounds, FrictionOf, Mode, Own, StickSlip, RATE_AT_REST};
use crate::error::AnalysisError;
use crate::run::impact::{Acting, Impact, OneSided, Rates, Reached};
use partita_math::tolerance;
use partita_system::event::Occurrence;
use std::collections::BTreeSet;

/// How the frictions act, the accelerations, and how strong all frictions together may be in the mass metric.
type Rubbed = (Vec<StickSlip>, Reached, f64);

/// Frictions that change between sticking and slipping until a combination holds. Reason: far more than pairs of the few
/// that come to rest together.
const MOST_FLIPS: usize = 1000;

/// What follows from an instant.
pub(super) struct Settled {
    pub(super) reached: Reached,
    /// The stops that press.
    pub(super) pressing: BTreeSet<usize>,
    /// How the frictions act.
    pub(super) frictions: Vec<StickSlip>,
    /// One whose infinitely many impacts are over so soon.
    pub(super) accumulated: Option<(usize, f64)>,
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
            for (stays, side) in stays.iter_mut().zip(&sides) {
                *stays |= after.rate(*side) <= tolerance::EQUAL * after.fastest(*side);
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
            let (frictions, pushed, strength) =
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
                let presses = |&i: &usize| {
                    let rubbed = after.length(sides[i].row) * strength;
                    let still = tolerance::EQUAL * (after.strongest(sides[i]) + rubbed);
                    let force = after.contact_acceleration(sides[i], &pushed);
                    let least = if passed.contains(&Own::Press(closed[i])) { still } else { 0.0 };
                    stays[i] && after.growth(sides[i], &pushed.v) <= still && force >= least
                };
                let pressing = (0..sides.len()).filter(presses).map(|i| closed[i]).collect();
                return Ok(Settled { reached, pressing, frictions, accumulated });
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

    /// How the frictions act at (t, q, v), and the accelerations there. Those that move slip. Of those at rest all that do
    /// not carry as much as they can stick to begin with; the first one that would have to carry too much slips, the first one that would slip against its force
    /// sticks, until none is left (for equal magnitudes at rest and in motion the rule of the least index, which ends).
    pub(super) fn rubbed(
        &self,
        (acting, t, q, v): (&Acting, f64, &[f64], &[f64]),
        (after, still): (&Impact, &[bool]),
        (rows, resting): (&[usize], &[OneSided]),
        (before, passed): (&[StickSlip], &[Own]),
    ) -> Result<Rubbed, AnalysisError> {
        let count = self.frictions.len();
        if count == 0 {
            return Ok((Vec::new(), after.accelerations(rows, resting, &[])?, 0.0));
        }
        let level = |x: &FrictionOf| acting.model.friction_levels(x.force, t, (q, v));
        let levels = self.frictions.iter().map(level).collect::<Result<Vec<_>, _>>()?;
        let levels: Vec<[f64; 2]> = levels.into_iter().map(Option::unwrap_or_default).collect();
        let side = |i: usize| self.frictions[i].side();
        let sense = |x: f64| if x > 0.0 { 1 } else { -1 };
        let bare = after.accelerations(rows, resting, &[])?;
        let mut acts = vec![StickSlip::Sticks; count];
        let mut decided = vec![false; count];
        for i in 0..count {
            let (rate, growth) = (after.rate(side(i)), after.growth(side(i), &bare.v));
            let moves = !still[i];
            let bound = after.follows(side(i).row, rows);
            let set_off = bound && growth.abs() > tolerance::EQUAL * after.strongest(side(i));
            let led = passed.iter().find_map(|x| match x {
                Own::Slip(k, sign) if *k == i => Some(*sign),
                _ => None,
            });
            (acts[i], decided[i]) = match (moves, set_off, led) {
                (true, ..) => (StickSlip::Slips(sense(rate)), true),
                (_, true, _) => (StickSlip::Slips(sense(growth)), true),
                (.., Some(sign)) => (StickSlip::Slips(sign), bound),
                _ if bound => (StickSlip::Rests(0), true),
                _ => match before[i] {
                    // as large as it can be, which it may be still
                    StickSlip::Rests(sign) if sign != 0 => (StickSlip::Slips(sign), false),
                    _ => (StickSlip::Sticks, false),
                },
            };
        }
        for _ in 0..MOST_FLIPS {
            let mut held = rows.to_vec();
            let mut applied = Vec::new();
            let mut now = acts.clone();
            for i in 0..count {
                let row = side(i).row;
                match acts[i] {
                    StickSlip::Sticks if after.follows(row, &held) => now[i] = StickSlip::Rests(0),
                    StickSlip::Sticks => held.push(row),
                    StickSlip::Slips(sign) | StickSlip::Rests(sign) => {
                        applied.push((row, -f64::from(sign) * levels[i][0]))
                    }
                }
            }
            let pushed = after.accelerations(&held, resting, &applied)?;
            // one that would hold against a stop or a freewheel, which never yields, slips
            let broken = resting.iter().find(|x| {
                after.follows(x.row, &held) && after.growth(**x, &pushed.v) < -tolerance::EQUAL * after.strongest(**x)
            });
            if let Some(broken) = broken {
                let without = |i: usize| held.iter().copied().filter(|&row| row != side(i).row).collect::<Vec<_>>();
                let sticks = |i: &usize| now[*i] == StickSlip::Sticks && !decided[*i];
                let yields = (0..count).filter(sticks).find(|&i| !after.follows(broken.row, &without(i)));
                if let Some(i) = yields {
                    let bare = after.accelerations(&without(i), resting, &applied)?;
                    acts[i] = StickSlip::Slips(sense(after.growth(side(i), &bare.v)));
                    continue;
                }
            }
            let flip = (0..count).filter(|&i| !decided[i]).find_map(|i| match now[i] {
                StickSlip::Sticks => {
                    let carried = pushed.multipliers[side(i).row];
                    let over = carried.abs() > levels[i][1] * (1.0 + tolerance::EQUAL);
                    over.then(|| (i, StickSlip::Slips(-sense(carried))))
                }
                StickSlip::Slips(sign) if !after.follows(side(i).row, &held) => {
                    let still = tolerance::EQUAL * after.strongest(side(i));
                    let against = f64::from(sign) * after.growth(side(i), &pushed.v) < -still;
                    against.then_some((i, StickSlip::Sticks))
                }
                _ => None,
            });
            if let Some((i, to)) = flip {
                acts[i] = to;
                continue;
            }
            for i in (0..count).filter(|&i| !decided[i]) {
                if let (StickSlip::Slips(sign), true) = (now[i], after.follows(side(i).row, &held)) {
                    now[i] = StickSlip::Rests(sign);
                }
            }
            let strengths = (0..count).map(|i| after.length(side(i).row) * levels[i][1]);
            return Ok((now, pushed, strengths.sum()));
        }
        let names: Vec<&str> = self.frictions.iter().map(|x| &*x.name).collect();
        Err(refuse(format!(
            "at t = {t} s it cannot be decided which of the frictions stick ({}): their magnitudes at rest exceed those in \
             motion so far that none of the combinations holds; make them more alike",
            names.join(", ")
        )))
    }
}
