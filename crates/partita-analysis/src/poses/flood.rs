//! Poses over a grid, each reached from a neighbour: what lies behind a hole is found as well, in short steps.
//!
//! From the pose next to the start steps lead to the neighbours in turn. Where none leads on, the loops are closed as
//! nearly as they can be with the goals met, from the nearest pose on: if they stay open, the pose is out of reach; if
//! they close, shorter steps and the direct path are tried, and from a pose that is reached so the steps go on.

use super::continuation::Start;
use super::field::Duty;
use super::goal::Target;
use super::many::{put, RESULT};
use super::nearest::nearly;
use super::numeric::{Numeric, SHORTEST_NEAR};
use super::outcome::{Outcome, PoseNumbers};
use crate::error::AnalysisError;
use crate::outputs::{whole, Watch};
use partita_math::sorting::sort_by;
use partita_math::tolerance;
use partita_model::Model;
use partita_system::prelude::*;
use partita_system::SystemError;
use std::collections::VecDeque;

/// Poses between two checks for an interrupt by the user.
const PATIENCE: usize = 32;

/// Loops with a larger closure error are open, also where it is known to four digits. Scale: characteristic displacement.
/// Reason: ten times the steps that are left.
const CLEARLY_OPEN: f64 = 1e-3;

/// What is known of a pose.
enum Cell {
    /// Nothing yet.
    New,
    /// It was reached.
    Reached(Box<Start>),
    /// It was not, from here the nearest position with its loops open was sought last.
    Open(Vec<f64>),
}

struct Flood<'a, 'm> {
    numeric: Numeric<'a, 'm>,
    shape: &'a [usize],
    values: &'a [f64],
    width: usize,
    cells: Vec<Cell>,
    /// Reached poses whose neighbours were not tried.
    front: VecDeque<usize>,
    tables: Vec<Vec<f64>>,
    nq: usize,
}

/// The tables of poses over a grid of this shape, the last dimension fastest.
pub(super) fn flooded<'m>(
    (model, t): (&'m Model, f64),
    targets: &'m [Target],
    start: &'m Start,
    (shape, values): (&[usize], &[f64]),
    watch: Watch,
) -> Result<Vec<Vec<f64>>, AnalysisError> {
    let (width, nq) = (targets.len(), model.size().nq);
    let count = values.len() / width;
    if shape.iter().product::<usize>() != count {
        let message = format!("a grid of shape {shape:?} has not {count} positions");
        return Err(SystemError::argument("targets", message).into());
    }
    let tables = [nq, width, RESULT].map(|w| vec![f64::NAN; w * count]).to_vec();
    let cells = (0..count).map(|_| Cell::New).collect();
    let numeric = Numeric::new(model, t, targets, start, None);
    let mut flood = Flood { numeric, shape, values, width, cells, front: VecDeque::new(), tables, nq };
    // the poses by their distance from the start
    let far = |i: &usize| {
        let of = values[i * width..][..width].iter().zip(&start.y).zip(targets);
        of.map(|((value, y), x)| ((value - y) / x.displacement).powi(2)).sum::<f64>()
    };
    let mut order: Vec<usize> = (0..count).collect();
    sort_by(&mut order, |a, b| far(a).total_cmp(&far(b)));
    let mut done = 0;
    // of the poses around it those that are reached directly
    for &first in &order {
        if let Some(there) = flood.numeric.continuation.start_at(start, &values[first * width..][..width])? {
            flood.take(first, there)?;
            break;
        }
        pause(&mut done, watch)?;
    }
    flood.spread(&mut done, watch)?;
    // then outwards, the nearest to what was reached first
    let mut waiting: VecDeque<usize> = order.into();
    while let Some(i) = flood.next(&mut waiting) {
        flood.settle(i, start)?;
        flood.spread(&mut done, watch)?;
        pause(&mut done, watch)?;
    }
    Ok(flood.tables)
}

fn pause(done: &mut usize, watch: &mut dyn FnMut() -> Result<(), AnalysisError>) -> Result<(), AnalysisError> {
    *done += 1;
    if *done % PATIENCE == 0 {
        watch()?;
    }
    Ok(())
}

impl Flood<'_, '_> {
    fn of(&self, i: usize) -> &[f64] {
        &self.values[i * self.width..][..self.width]
    }

    /// Poses next to one, those along the axes first.
    fn neighbours(&self, i: usize) -> Vec<usize> {
        let mut index = vec![0; self.shape.len()];
        let mut rest = i;
        for (x, n) in index.iter_mut().zip(self.shape).rev() {
            (*x, rest) = (rest % n, rest / n);
        }
        let mut found: Vec<(usize, usize)> = Vec::new();
        let all = 3usize.pow(self.shape.len() as u32);
        for code in 0..all {
            let (mut to, mut moved, mut left) = (0, 0, code);
            let inside = index.iter().zip(self.shape).all(|(&x, &n)| {
                let by = left % 3;
                left /= 3;
                moved += usize::from(by != 1);
                to = to * n + (x + by).saturating_sub(1).min(n - 1);
                x + by >= 1 && x + by <= n
            });
            if inside && moved > 0 {
                found.push((moved, to));
            }
        }
        sort_by(&mut found, |a, b| a.cmp(b));
        found.into_iter().map(|(_, to)| to).collect()
    }

    /// Enter a pose that was reached.
    fn take(&mut self, i: usize, there: Start) -> Result<(), AnalysisError> {
        let values = self.values[i * self.width..][..self.width].to_vec();
        self.numeric.there.clone_from(&there.q);
        let found = self.numeric.agreeing(&values, false);
        self.enter(i, &found, &values);
        if found.outcome == Outcome::Closed {
            self.cells[i] = Cell::Reached(Box::new(there));
            self.front.push_back(i);
        } else {
            self.cells[i] = Cell::Open(there.q);
        }
        Ok(())
    }

    /// Write a pose.
    fn enter(&mut self, i: usize, found: &PoseNumbers, reached: &[f64]) {
        let widths = [self.nq, self.width, RESULT];
        let mut rows = whole(&mut self.tables, &widths);
        put(found, reached, &mut rows, i);
        if found.outcome == Outcome::Closed {
            rows.row(0, i).copy_from_slice(&self.numeric.there);
        }
    }

    /// Reach what steps from neighbour to neighbour lead to.
    fn spread(
        &mut self,
        done: &mut usize,
        watch: &mut dyn FnMut() -> Result<(), AnalysisError>,
    ) -> Result<(), AnalysisError> {
        while let Some(i) = self.front.pop_front() {
            for to in self.neighbours(i) {
                let Cell::Reached(from) = &self.cells[i] else { break };
                if matches!(self.cells[to], Cell::Reached(_)) {
                    continue;
                }
                let values = &self.values[to * self.width..][..self.width];
                if let Some(there) = self.numeric.continuation.start_near(from, values, SHORTEST_NEAR)? {
                    self.take(to, there)?;
                }
                pause(done, watch)?;
            }
        }
        Ok(())
    }

    /// The next pose of which nothing is known beside one of which something is; without one the first.
    fn next(&self, waiting: &mut VecDeque<usize>) -> Option<usize> {
        waiting.retain(|&i| matches!(self.cells[i], Cell::New));
        let beside =
            waiting.iter().position(|&i| self.neighbours(i).iter().any(|&j| !matches!(self.cells[j], Cell::New)));
        waiting.remove(beside.unwrap_or(0))
    }

    /// What becomes of a pose that no step leads to.
    fn settle(&mut self, i: usize, start: &Start) -> Result<(), AnalysisError> {
        let values = self.of(i).to_vec();
        let beside = self.neighbours(i);
        let near = beside.iter().find_map(|&j| match &self.cells[j] {
            Cell::Reached(there) => Some((there.q.clone(), there.y.clone())),
            _ => None,
        });
        let from = near.clone().or_else(|| {
            beside.iter().find_map(|&j| match &self.cells[j] {
                Cell::Open(q) => Some((q.clone(), self.tables[1][j * self.width..][..self.width].to_vec())),
                _ => None,
            })
        });
        if let Some((q, y)) = from {
            let found = self.numeric.open(&q, &y, &values, nearly)?;
            // next to a limit four digits do not tell
            let far = found.shortfall.is_nan() || self.numeric.continuation.field.worst(Duty::Soft) > CLEARLY_OPEN;
            if found.outcome == Outcome::Open && far {
                self.cells[i] = Cell::Open(self.numeric.there.clone());
                self.enter(i, &found, &y);
                return Ok(());
            }
            for &j in &beside {
                let Cell::Reached(from) = &self.cells[j] else { continue };
                if let Some(there) = self.numeric.continuation.start_near(from, &values, tolerance::SHORTEST_STEP)? {
                    return self.take(i, there);
                }
            }
        }
        let found = self.numeric.pose(0, &values)?;
        if found.outcome == Outcome::Closed {
            let q = self.numeric.there.clone();
            if let Some(there) = self.started(start, &q)? {
                return self.take(i, there);
            }
        }
        let reached = self.numeric.reached.clone();
        self.enter(i, &found, &reached);
        self.cells[i] = Cell::Open(self.numeric.there.clone());
        Ok(())
    }

    /// A start at a pose that was reached directly.
    fn started(&mut self, start: &Start, q: &[f64]) -> Result<Option<Start>, SystemError> {
        let there = self.numeric.continuation.start(q)?;
        Ok((there.free == start.free).then_some(there))
    }
}
