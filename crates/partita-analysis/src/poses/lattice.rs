//! Stations on a lattice of values of the goals: a pose is a single step away from the nearest one.
//!
//! The *stations*, positions at the points of the lattice, lie on paths from the start that branch: each is reached from
//! the next one towards the start. Poses near one another share their stations, and each takes the last step alone,
//! eight poses at a time. A step that the rules for following a curve refuse, or over which the determinant of the loops
//! changes by half, is not taken: such poses are followed from the station, and where that needs short steps, all the way
//! from the start.

use super::continuation::{Continuation, Start, WATCHED};
use super::explicit::STORED;
use super::goal::Target;
use partita_math::scalar::{Cases, Lanes, Scalar};
use partita_math::tolerance;
use partita_model::evaluator::Evaluator;
use partita_model::loop_closure::{Adjacent, AdjacentClosing, AdjacentScratch};
use partita_model::Model;
use partita_system::manifold::follow::LONGEST_PREDICTION;
use partita_system::manifold::least_change::FIRST_CORRECTION;
use partita_system::prelude::*;
use partita_system::SystemError;
use std::collections::{HashMap, HashSet};
use std::sync::{Arc, OnceLock};

/// Distance of neighbouring points of the lattice. Unit: characteristic displacement. Reason: no goal of a pose is
/// farther than one stride from the nearest point.
const SPACING: f64 = 2.0 * tolerance::STRIDE;
/// Longer last steps are not taken. Scale: characteristic displacement. Reason: as for a step along a curve.
const LONGEST_LAST: f64 = LONGEST_PREDICTION;
/// Stations are stored where this many poses share one.
const SHARED: usize = 4;
/// A point of the lattice, relative to the start.
type Cell = Vec<i64>;

/// A position at a point of the lattice.
struct Station {
    start: Start,
    /// How poses are reached from it; none where they are not.
    step: OnceLock<Option<LastStep>>,
}

/// What the last step needs to know.
struct LastStep {
    plan: Arc<AdjacentClosing>,
    /// Of the loops, by the plan.
    determinant: f64,
    /// Velocities per unit rate of each goal.
    directions: Vec<Vec<f64>>,
}

impl Station {
    fn new(start: Start) -> Arc<Self> {
        Arc::new(Self { start, step: OnceLock::new() })
    }
}

/// The point next to this one towards the start, for any but the start.
fn before(cell: &[i64]) -> Cell {
    let n = cell.iter().map(|c| c.abs()).max().unwrap_or(0).max(1);
    cell.iter().map(|c| c.signum() * ((2 * c.abs() * (n - 1) + n) / (2 * n))).collect()
}

fn is_start(cell: &[i64]) -> bool {
    cell.iter().all(|c| *c == 0)
}

/// The lattice of one set of goals, with the stations that many poses share.
pub(super) struct Lattice<'m> {
    model: &'m Model,
    t: f64,
    targets: &'m [Target],
    own: Vec<(usize, usize)>,
    evaluator: Evaluator<Lanes>,
    first: Arc<Station>,
    /// The plan at the start, which is used as far as it is good.
    plan: Arc<AdjacentClosing>,
    stored: HashMap<Cell, Option<Arc<Station>>>,
}

impl<'m> Lattice<'m> {
    /// Where it applies: to independent goals that are coordinates, of mechanisms that any numbers can be put into.
    pub fn new(model: &'m Model, t: f64, targets: &'m [Target], start: &Start) -> Option<Self> {
        let own: Vec<(usize, usize)> = targets.iter().filter_map(Target::own).collect();
        let fits = own.len() == targets.len()
            && start.free.iter().all(|free| *free)
            && start.is_watched()
            && model.size().nv <= WATCHED
            && !model.equations().calls_functions();
        let evaluator = fits.then(|| model.over::<Lanes>().ok()).flatten()?;
        let held: Vec<usize> = own.iter().map(|own| own.1).collect();
        let plan = Arc::new(model.adjacent_closing(t, &start.q, &held).ok()??);
        let first = Station::new(start.clone());
        Some(Self { model, t, targets, own, evaluator, first, plan, stored: HashMap::new() })
    }

    /// With the stations for the poses of these values, where they are shared.
    ///
    /// # Errors
    /// Those of functions that the conditions call.
    pub fn with_stations(mut self, values: &[f64]) -> Result<Self, SystemError> {
        let poses = values.len() / self.targets.len();
        let directions = self.model.size().nv * self.targets.len();
        let most = (STORED / (self.first.start.numbers() + directions)).min(poses / SHARED);
        let (mut cells, mut cell) = (HashSet::new(), Cell::new());
        for of in values.chunks(self.targets.len()) {
            self.cell(of, &mut cell);
            while !is_start(&cell) && cells.len() <= most && !cells.contains(&cell) {
                let next = before(&cell);
                cells.insert(std::mem::replace(&mut cell, next));
            }
        }
        if cells.len() > most {
            return Ok(self);
        }
        // each after the one next to it towards the start
        let mut cells: Vec<Cell> = cells.into_iter().collect();
        cells.sort_unstable_by_key(|cell| cell.iter().map(|c| c.abs()).max());
        let mut continuation = Continuation::new(self.model, self.targets, self.t);
        for cell in cells {
            let found = self.after(&mut continuation, &before(&cell), &cell)?;
            self.stored.insert(cell, found);
        }
        Ok(self)
    }

    /// The nearest point of the lattice.
    fn cell(&self, values: &[f64], cell: &mut Cell) {
        let from = self.targets.iter().zip(&self.first.start.y);
        let of = |(value, (x, y)): (&f64, (&Target, &f64))| ((value - y) / (SPACING * x.displacement)).round() as i64;
        cell.clear();
        cell.extend(values.iter().zip(from).map(of));
    }

    fn values(&self, cell: &[i64]) -> Vec<f64> {
        let from = self.targets.iter().zip(&self.first.start.y);
        cell.iter().zip(from).map(|(c, (x, y))| y + *c as f64 * (SPACING * x.displacement)).collect()
    }

    /// The station that is stored for a point: none, or one that cannot be reached, or one.
    fn known(&self, cell: &[i64]) -> Option<Option<Arc<Station>>> {
        if is_start(cell) {
            return Some(Some(self.first.clone()));
        }
        self.stored.get(cell).cloned()
    }

    fn step(
        &self,
        continuation: &mut Continuation<'m>,
        from: &Station,
        to: &[i64],
    ) -> Result<Option<Arc<Station>>, SystemError> {
        Ok(continuation.start_at(&from.start, &self.values(to))?.map(Station::new))
    }

    /// How poses are reached from a station; none where they are not.
    fn last_step(
        &self,
        continuation: &mut Continuation<'m>,
        station: &Station,
    ) -> Result<Option<LastStep>, SystemError> {
        let q = &station.start.q;
        let (mut plan, mut determinant) = (self.plan.clone(), self.plan.determinant(self.model, self.t, q)?);
        if determinant.is_none() {
            let held: Vec<usize> = self.own.iter().map(|own| own.1).collect();
            let Some(own) = self.model.adjacent_closing(self.t, q, &held)? else { return Ok(None) };
            determinant = own.determinant(self.model, self.t, q)?;
            plan = Arc::new(own);
        }
        let Some(determinant) = determinant else { return Ok(None) };
        Ok(Some(LastStep { plan, determinant, directions: continuation.directions(&station.start)? }))
    }

    /// The station after a stored one.
    fn after(
        &self,
        continuation: &mut Continuation<'m>,
        from: &[i64],
        to: &[i64],
    ) -> Result<Option<Arc<Station>>, SystemError> {
        match self.known(from).flatten() {
            Some(from) => self.step(continuation, &from, to),
            None => Ok(None),
        }
    }
}

/// The station of a pose, or else the last one on the path to it.
#[derive(Clone)]
struct Reached {
    station: Arc<Station>,
    is_own: bool,
}

/// Poses one step away from their stations.
pub(super) struct LastSteps<'l, 'm> {
    lattice: &'l Lattice<'m>,
    /// The point of the lattice last looked up that is not stored.
    last: (Cell, Reached),
    cell: Cell,
    memory: AdjacentScratch<Lanes>,
    q: Vec<Lanes>,
    dv: Vec<Lanes>,
    /// Stations of the poses of a batch.
    stations: [Option<Reached>; Lanes::COUNT],
    /// Coordinates of the poses of a batch, row by row, and whether they were found.
    found: Vec<f64>,
    closed: [bool; Lanes::COUNT],
}

impl<'l, 'm> LastSteps<'l, 'm> {
    /// Poses of one batch.
    pub const BATCH: usize = Lanes::COUNT;

    pub fn new(lattice: &'l Lattice<'m>) -> Self {
        let size = lattice.model.size();
        Self {
            lattice,
            last: (vec![0; lattice.targets.len()], Reached { station: lattice.first.clone(), is_own: true }),
            cell: Vec::with_capacity(lattice.targets.len()),
            memory: AdjacentScratch::new(lattice.model, &lattice.evaluator),
            q: vec![Lanes::zero(); size.nq],
            dv: vec![Lanes::zero(); size.nv],
            stations: std::array::from_fn(|_| None),
            found: vec![0.0; size.nq * Self::BATCH],
            closed: [false; Lanes::COUNT],
        }
    }

    /// The coordinates of a pose of the last batch, if it was found.
    pub fn pose(&self, i: usize) -> Option<&[f64]> {
        let nq = self.q.len();
        self.closed[i].then(|| &self.found[i * nq..][..nq])
    }

    /// The position of the last batch from which a pose that was not found may be reached.
    pub fn near(&self, i: usize) -> Option<&Start> {
        self.stations[i].as_ref().map(|reached| &reached.station.start)
    }

    /// The station of `self.cell`, or else the last one on the path to it.
    fn station(&mut self, continuation: &mut Continuation<'m>) -> Result<Reached, SystemError> {
        if let Some(Some(station)) = self.lattice.known(&self.cell) {
            return Ok(Reached { station, is_own: true });
        }
        if self.last.0 == self.cell {
            return Ok(self.last.1.clone());
        }
        let (mut path, mut point, mut is_own) = (Vec::new(), self.cell.clone(), true);
        let mut station = loop {
            match self.lattice.known(&point) {
                Some(Some(station)) => break station,
                // nor is what lies beyond it
                Some(None) => {
                    path.clear();
                    is_own = false;
                }
                None => path.push(point.clone()),
            }
            point = before(&point);
        };
        while let Some(to) = path.pop() {
            let Some(next) = self.lattice.step(continuation, &station, &to)? else {
                is_own = false;
                break;
            };
            station = next;
        }
        let reached = Reached { station, is_own };
        self.last.0.clone_from(&self.cell);
        self.last.1.clone_from(&reached);
        Ok(reached)
    }

    /// Find poses, one for each row of `values`, at most eight.
    ///
    /// # Errors
    /// Those of functions that the conditions call.
    pub fn batch<'v>(
        &mut self,
        continuation: &mut Continuation<'m>,
        values: impl Iterator<Item = &'v [f64]>,
    ) -> Result<(), SystemError> {
        self.closed = [false; Lanes::COUNT];
        let mut of: [&[f64]; Lanes::COUNT] = [&[]; Lanes::COUNT];
        let mut plans: [Option<Arc<AdjacentClosing>>; Lanes::COUNT] = std::array::from_fn(|_| None);
        for (place, values) in values.enumerate() {
            self.lattice.cell(values, &mut self.cell);
            let reached = self.station(continuation)?;
            let step = &reached.station.step;
            if reached.is_own && step.get().is_none() {
                // another thread may be faster: both find the same
                let _ = step.set(self.lattice.last_step(continuation, &reached.station)?);
            }
            plans[place] = reached.step().map(|step| step.plan.clone());
            self.stations[place] = Some(reached);
            of[place] = values;
        }
        while let Some(plan) = plans.iter().find_map(Clone::clone) {
            let (mut group, mut count) = ([0; Lanes::COUNT], 0);
            for (place, own) in plans.iter_mut().enumerate() {
                if own.take_if(|own| Arc::ptr_eq(own, &plan)).is_some() {
                    group[count] = place;
                    count += 1;
                }
            }
            let group = &group[..count];
            // one that cannot be evaluated must not hinder the others
            if self.together(&plan, &of, group).is_err() {
                for one in group.chunks(1) {
                    if self.together(&plan, &of, one).is_err() {
                        self.closed[one[0]] = false;
                    }
                }
            }
        }
        Ok(())
    }

    /// The last steps of those poses of a batch that have this plan.
    fn together(&mut self, plan: &AdjacentClosing, of: &[&[f64]], indices: &[usize]) -> Result<(), SystemError> {
        let (model, e, nq) = (self.lattice.model, &self.lattice.evaluator, self.q.len());
        self.dv.fill(Lanes::zero());
        let mut determinants = [f64::NAN; Lanes::COUNT];
        for lane in 0..Lanes::COUNT {
            // lanes without a pose repeat the first one
            let index = indices[if lane < indices.len() { lane } else { 0 }];
            let Some((start, step)) = self.stations[index].as_ref().and_then(Reached::last_step) else { continue };
            determinants[lane] = step.determinant;
            self.q.iter_mut().zip(&start.q).for_each(|(q, x)| q.0[lane] = *x);
            let changes = of[index].iter().zip(&start.y).map(|(value, y)| value - y);
            for (direction, change) in step.directions.iter().zip(changes) {
                self.dv.iter_mut().zip(direction).for_each(|(dv, x)| dv.0[lane] += change * x);
            }
        }
        let mut travel = Lanes::zero();
        for (v, dv) in self.dv.iter().enumerate() {
            travel = travel.max(dv.abs() / Lanes::from_f64(model.structure().displacement(v)));
        }
        e.step(&mut self.q, &self.dv);
        e.normalise(&mut self.q);
        for (k, &(at, _)) in self.lattice.own.iter().enumerate() {
            indices.iter().enumerate().for_each(|(lane, index)| self.q[at].0[lane] = of[*index][k]);
        }
        let adjacent = plan.close(model, e, Lanes::from_f64(self.lattice.t), &mut self.q, &mut self.memory)?;
        for (lane, &index) in indices.iter().enumerate() {
            self.closed[index] = stays(&adjacent, lane, travel.0[lane], determinants[lane]);
            self.found[index * nq..][..nq].iter_mut().zip(&self.q).for_each(|(to, q)| *to = q.0[lane]);
        }
        Ok(())
    }
}

impl Reached {
    fn step(&self) -> Option<&LastStep> {
        self.station.step.get()?.as_ref().filter(|_| self.is_own)
    }

    fn last_step(&self) -> Option<(&Start, &LastStep)> {
        Some((&self.station.start, self.step()?))
    }
}

/// Whether a step, this long as predicted, has led to the adjacent position and to no other.
fn stays(adjacent: &Adjacent<Lanes>, lane: usize, travel: f64, determinant: f64) -> bool {
    let [first, second, third] = adjacent.corrections.map(|x| x.0[lane]);
    let kept = adjacent.determinant.0[lane] / determinant;
    let moved = first + second + third;
    travel <= LONGEST_LAST
        && first <= FIRST_CORRECTION
        && moved <= (tolerance::HALF_LOST * travel).max(tolerance::LAST_MOVE)
        && second <= (tolerance::CONVERGES * first).max(tolerance::LAST_MOVE)
        && third <= tolerance::LAST_MOVE
        && adjacent.closure_error.0[lane] <= tolerance::CLOSED
        && (kept - 1.0).abs() <= tolerance::HALF_LOST
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Paths to the start are straight to half a spacing, and end there.
    #[test]
    fn points_lie_beside_the_straight_path() {
        for cell in [vec![7, -3, 0], vec![1, 1], vec![-12, 5], vec![1]] {
            let (mut now, mut steps) = (cell.clone(), 0);
            while !is_start(&now) {
                let next = before(&now);
                let far = |c: &[i64]| c.iter().map(|c| c.abs()).max();
                assert_eq!(far(&next).map(|n| n + 1), far(&now));
                assert!(next.iter().zip(&now).all(|(a, b)| (a - b).abs() <= 1));
                let part = far(&next).unwrap() as f64 / far(&cell).unwrap() as f64;
                assert!(
                    next.iter().zip(&cell).all(|(a, c)| (*a as f64 - *c as f64 * part).abs() <= 1.5),
                    "{cell:?} {next:?}"
                );
                (now, steps) = (next, steps + 1);
            }
            assert_eq!(Some(steps), cell.iter().map(|c| c.abs()).max());
        }
    }
}
