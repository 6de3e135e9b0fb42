//! The motion in a tangent basis times position coordinates: the one implementation of all reduced forms.
//!
//! ```text
//! y = (position coordinates, u, work),   v = Dᵀ u + γ,   M_d u' = D (h − M δ)                 (F1)
//! ```
//!
//! What a basis is, and how q is found, is told by [`Tangent`] and [`Positions`]; what remains is the same for all of them: a
//! step is tried, judged, taken, its choice renewed, singular positions passed, outputs closed.

use super::{Formulation, Step, Verdict};
use crate::options::FormulationOptions;
use crate::positions::all::All;
use crate::positions::chart::Chart;
use crate::positions::independent::Independent;
use crate::positions::inverse_kinematics::InverseKinematics;
use crate::positions::newton::Newton;
use crate::positions::{needs_positions, Positions};
use crate::record::{Journal, Output, PartitionEvent, Sample};
use crate::reduction::Reduction;
use crate::singular::change_point::Passage;
use crate::singular::consistency::Watch;
use crate::system::{ConstrainedSystem, SystemError};
use crate::tangent::basis::gram_schmidt::GramSchmidt;
use crate::tangent::basis::Basis;
use crate::tangent::blocks::Blocks;
use crate::tangent::frozen::Frozen;
use crate::tangent::instant::Describer;
use crate::tangent::partition::Chosen;
use crate::tangent::user::Given;
use crate::tangent::{Occasion, Tangent};
use partita_math::dense;

/// Where a singular position is expected, the distance must be below this part of what it is now: a little beside it the
/// distance is small already, and a guess that is off by more than this is none.
const CONFIRMED: f64 = 0.3;

/// A motion in the tangent T with the position coordinates P.
pub struct Motion<'s, S: ConstrainedSystem + 's, T, P> {
    name: &'static str,
    system: &'s S,
    k: usize,
    tangent: T,
    positions: P,
    observes_work: bool,
    describer: Describer<'s, S>,
    /// Margin at the end of the step that was judged.
    margin: Option<(f64, u64)>,
    /// Was anything evaluated since?
    moved: bool,
    passage: Passage,
    passing: bool,
    /// What is open at the ends of steps.
    watch: Watch,
    v: Vec<f64>,
    vdot: Vec<f64>,
    residual: Vec<f64>,
}

/// A partition and all coordinates (k + nq states): `projective`, and with an infinite threshold `fixed`.
pub type Projective<'s, S> = Motion<'s, S, Chosen<'s, S>, All>;
/// A partition and its coordinates, the others by Newton's method (2k states).
pub type WehageHaug<'s, S> = Motion<'s, S, Chosen<'s, S>, Independent<Newton>>;
/// Blocks and their inputs, the loops closed by inverse kinematics (2k states).
pub type ExplicitClosing<'s, S> = Motion<'s, S, Blocks<'s, S>, Independent<InverseKinematics>>;
/// A frozen basis and all coordinates.
pub type TangentVelocities<'s, S> = Motion<'s, S, Frozen<'s, S>, All>;
/// A frozen basis and a chart of the closed positions (2k states).
pub type TangentSpace<'s, S> = Motion<'s, S, Frozen<'s, S>, Chart>;
/// The user's basis and all coordinates.
pub type UserTangent<'s, S> = Motion<'s, S, Given<'s, S>, All>;

impl<'s, S: ConstrainedSystem> Projective<'s, S> {
    /// For a system of the given rank (see [`crate::start::analyse`]).
    pub fn new(system: &'s S, rank: usize, options: &FormulationOptions) -> Self {
        let name = if options.exchange.is_finite() { "projective" } else { "fixed" };
        let positions = All::new(system.size().nq, options.correction);
        Self::with(name, system, Chosen::new(system, rank, options), positions)
    }
}

impl<'s, S: ConstrainedSystem> WehageHaug<'s, S> {
    /// For a system of the given rank. There must be no nonholonomic rows. There is nothing left to correct.
    pub fn new(system: &'s S, rank: usize, options: &FormulationOptions) -> Result<Self, SystemError> {
        needs_positions(system, "wehage-haug", "integrates as many coordinates as velocities")?;
        let positions = Independent::new(system, rank, Newton::default());
        Ok(Self::with("wehage-haug", system, Chosen::new(system, rank, options), positions))
    }
}

impl<'s, S: ConstrainedSystem> ExplicitClosing<'s, S> {
    /// For a system of the given rank. There must be no nonholonomic rows.
    pub fn new(system: &'s S, rank: usize, options: &FormulationOptions) -> Result<Self, SystemError> {
        needs_positions(system, "explicit-closing", "computes dependent coordinates from independent ones")?;
        let positions = Independent::new(system, rank, InverseKinematics::default());
        Ok(Self::with("explicit-closing", system, Blocks::new(system, rank, options)?, positions))
    }
}

impl<'s, S: ConstrainedSystem> TangentVelocities<'s, S> {
    /// For a system of the given rank, with S from a rule.
    pub fn new(system: &'s S, rank: usize, basis: Box<dyn Basis>, options: &FormulationOptions) -> Self {
        let (name, positions) = (basis.name(), All::new(system.size().nq, options.correction));
        Self::with(name, system, Frozen::new(system, rank, basis, options.renew), positions)
    }
}

impl<'s, S: ConstrainedSystem> TangentSpace<'s, S> {
    /// For a system of the given rank without nonholonomic rows.
    pub fn new(system: &'s S, rank: usize, options: &FormulationOptions) -> Result<Self, SystemError> {
        needs_positions(system, "tangent-space", "parametrises closed positions")?;
        let tangent = Frozen::new(system, rank, Box::new(GramSchmidt), options.renew);
        Ok(Self::with("tangent-space", system, tangent, Chart::new(system, rank, options.renew)?))
    }
}

impl<'s, S: ConstrainedSystem> UserTangent<'s, S> {
    /// For a system of the given rank; needs the user's tangent velocities in the options. Their functions may count whole turns.
    pub fn new(system: &'s S, rank: usize, options: &FormulationOptions) -> Result<Self, SystemError> {
        let Some(map) = &options.tangent else {
            let message =
                "user-tangent needs tangent velocities: hand over tangent=, the matrix D^T as a function of (t, q)";
            return Err(SystemError::Request(message.into()));
        };
        let positions = All::new(system.size().nq, options.correction).whole_turns();
        Ok(Self::with("user-tangent", system, Given::new(system, rank, map.clone()), positions))
    }
}

impl<'s, S: ConstrainedSystem + 's, T: Tangent<'s, S>, P: Positions<'s, S, T>> Motion<'s, S, T, P> {
    fn with(name: &'static str, system: &'s S, tangent: T, positions: P) -> Self {
        let (n, r) = (system.size().nv, tangent.seen());
        Self {
            name,
            system,
            k: r.k(),
            describer: if r.is_dense() { Describer::dense(system, r.rank()) } else { Describer::new(system, r.rank()) },
            tangent,
            positions,
            observes_work: system.has_power() || system.rheonomic(),
            margin: None,
            moved: true,
            passage: Passage::default(),
            passing: false,
            watch: Watch::default(),
            v: vec![0.0; n],
            vdot: vec![0.0; n],
            residual: vec![0.0; n],
        }
    }

    /// The tangent, at the point last evaluated.
    pub fn tangent(&mut self) -> &mut T {
        &mut self.tangent
    }

    /// The levels of the tangent, at the point last evaluated.
    pub fn reduction(&mut self) -> &mut Reduction<'s, S> {
        self.tangent.reduction()
    }

    /// The position last found.
    pub fn position(&self) -> &[f64] {
        self.positions.q()
    }

    /// Where u and the work stand in y.
    fn places(&self) -> (usize, usize) {
        (self.positions.places(), self.positions.places() + self.k)
    }

    fn work(&self, y: &[f64]) -> f64 {
        if self.observes_work {
            y[self.places().1]
        } else {
            0.0
        }
    }

    /// All levels at (t, y).
    fn evaluate(&mut self, t: f64, y: &[f64]) -> Result<(), SystemError> {
        let (p, w) = self.places();
        let factored = self.positions.locate(&mut self.tangent, t, y, self.passing)?;
        let (tangent, q, u) = (&mut self.tangent, self.positions.q(), &y[p..w]);
        let levels = |tangent: &mut T| {
            tangent.tangent(t, q, factored)?;
            tangent.spread(u);
            tangent.accelerate(t, q, u)
        };
        levels(tangent).map_err(|e| tangent.blame(t, q, e))
    }

    /// Rates of all states at the point last evaluated.
    fn rates(&mut self, t: f64, y: &[f64], dy: &mut [f64]) -> Result<(), SystemError> {
        let (p, w) = self.places();
        self.positions.rates(&mut self.tangent, &y[p..w], dy);
        self.tangent.rates(&mut dy[p..w]);
        if self.observes_work {
            dy[w] = self.power(t)?;
        }
        Ok(())
    }

    /// dE/dt that is not the work of conservative forces: applied power and, for driven constraints, −λᵀa.
    ///
    /// −λᵀ a = λᵀ C v = (M v' − h)ᵀ γ, because the reaction does no work along the rows of D.
    fn power(&mut self, t: f64) -> Result<f64, SystemError> {
        let q = self.positions.q();
        let r = self.tangent.reduction();
        let mut p = r.system.power(t, q, &r.v, &mut r.scratch)?;
        if self.system.rheonomic() {
            self.tangent.full_acceleration(&mut self.vdot);
            let r = self.tangent.reduction();
            r.system.inverse_dynamics(t, q, &r.v, &self.vdot, &mut r.scratch, &mut self.residual)?;
            p += dense::dot(&self.residual, self.tangent.offset());
        }
        Ok(p)
    }

    /// A new choice at the point last evaluated; (q, v, v') stay the same. True if y and y' were rewritten.
    fn choose_anew(&mut self, t: f64, y: &mut [f64], dy: &mut [f64], why: Occasion) -> Result<bool, SystemError> {
        let (p, w) = self.places();
        self.v.copy_from_slice(&self.tangent.seen().v);
        self.tangent.full_acceleration(&mut self.vdot);
        let mut q = self.positions.q().to_vec();
        if !self.tangent.renew(t, &mut q, &self.v, why)? {
            return Ok(false);
        }
        self.positions.rewrite(&mut self.tangent, &q, y);
        self.tangent.select(&self.v, &mut y[p..w])?;
        self.tangent.select(&self.vdot, &mut dy[p..w])?; // S δ = 0
        self.tangent.reduction().v.copy_from_slice(&self.v);
        self.positions.rates(&mut self.tangent, &y[p..w], dy);
        Ok(true)
    }

    /// Is the singular position that is expected `ahead` after the state (t, y) really there?
    fn confirms(&mut self, t: f64, y: &[f64], ahead: f64) -> bool {
        if P::CLOSED || self.evaluate(t, y).is_err() {
            return true;
        }
        let Some((here, _)) = self.tangent.margin() else { return true };
        self.tangent.full_acceleration(&mut self.vdot);
        let v = &self.tangent.seen().v;
        let moved: Vec<f64> = v.iter().zip(&self.vdot).map(|(v, a)| ahead * (v + 0.5 * ahead * a)).collect();
        let mut q = self.positions.q().to_vec();
        self.system.step(&mut q, &moved);
        let there = t + ahead;
        let found = self.tangent.reduction().position(there, &q);
        // a plan made there was made for a place that the step keeps away from; one for here follows with the next evaluation
        match found.and_then(|()| self.tangent.tangent(there, &q, false)) {
            Ok(()) => self.tangent.margin().is_none_or(|m| m.0 < CONFIRMED * here),
            Err(_) => true,
        }
    }
}

impl<'s, S: ConstrainedSystem + 's, T: Tangent<'s, S>, P: Positions<'s, S, T>> Formulation for Motion<'s, S, T, P> {
    fn dim(&self) -> usize {
        self.places().1 + usize::from(self.observes_work)
    }

    /// Where drives prescribe all motion, their work is what there is to integrate.
    fn controlled(&self) -> usize {
        self.places().1 + usize::from(self.observes_work && self.k == 0)
    }

    fn natural_sizes(&self, out: &mut [f64]) {
        out.fill(1.0);
        let (p, w) = self.places();
        let mut of_q = vec![1.0; self.system.size().nq];
        super::sizes_of_coordinates(self.system, &mut of_q);
        self.positions.sizes(&of_q, &mut out[..p]);
        // other tangent velocities are measured by the mass metric already
        let independent = self.tangent.independent(None).unwrap_or(&[]);
        if self.observes_work {
            out[w] = self.tangent.seen().natural_energy();
        }
        out[p..w].iter_mut().zip(independent).for_each(|(x, &i)| *x = self.system.reach(i));
    }

    fn start(&mut self, t: f64, q: &[f64], v: &[f64], y: &mut [f64]) -> Result<(), SystemError> {
        let (p, w) = self.places();
        let mut q = q.to_vec();
        self.tangent.start(t, &mut q, v)?;
        y.fill(0.0);
        self.positions.start(&mut self.tangent, t, &q, y);
        self.tangent.select(v, &mut y[p..w])
    }

    fn derivative(&mut self, t: f64, y: &[f64], dy: &mut [f64]) -> Result<(), SystemError> {
        self.moved = true;
        self.evaluate(t, y)?;
        self.rates(t, y, dy)
    }

    fn trial_end(
        &mut self,
        t: f64,
        y: &mut [f64],
        dy: &mut [f64],
        known: bool,
    ) -> Result<(Verdict, bool), SystemError> {
        let evaluates = self.positions.settle(&mut self.tangent, t, y)? || !known;
        if evaluates {
            self.derivative(t, y, dy)?;
        }
        self.moved = false;
        self.watch.look(t, self.tangent.seen());
        self.watch.check(t, self.positions.q(), self.tangent.seen())?;
        self.margin = self.tangent.margin();
        let mut verdict = self.positions.judge(&mut self.tangent, t, self.margin.map(|m| m.0));
        if verdict == Verdict::Keep {
            verdict = self.tangent.judge(t, self.positions.q());
        }
        if verdict == Verdict::Keep {
            verdict = match (self.positions.wants_change(), self.positions.is_stuck()) {
                (Some(_), _) => Verdict::Change,
                (None, true) => Verdict::Repeat,
                (None, false) => Verdict::Keep,
            };
        }
        Ok((verdict, evaluates))
    }

    fn commit(&mut self, verdict: Verdict, step: Step) -> Result<bool, SystemError> {
        let Step { t, y, dy, turns, pace } = step;
        if verdict == Verdict::Repeat {
            self.evaluate(t, y)?;
            if let Some(e) = self.positions.broken(&mut self.tangent, t) {
                return Err(e);
            }
            self.choose_anew(t, y, dy, Occasion::Spoilt)?;
            self.derivative(t, y, dy)?;
            return Ok(true);
        }
        self.watch.accept();
        if self.moved && (verdict == Verdict::Change || self.tangent.attends()) {
            self.evaluate(t, y)?; // outputs were evaluated since
        }
        let why = self.positions.wants_change().map_or(Occasion::Decayed, Occasion::Positions);
        self.positions.accept(&mut self.tangent, t, self.margin.map(|m| m.0));
        let mut rewritten = verdict == Verdict::Change && self.choose_anew(t, y, dy, why)?;
        self.tangent.accept(t, self.positions.q())?;
        rewritten |= self.positions.wrap(&self.tangent, y, turns);
        if let Some(pace) = pace {
            let mut passage = std::mem::take(&mut self.passage);
            self.passing = passage.foresee(t, pace, self.margin, |ahead| self.confirms(t, y, ahead));
            self.passage = passage;
        }
        Ok(rewritten)
    }

    fn state_at(&mut self, t: f64, y: &[f64], out: &mut Output) -> Result<(), SystemError> {
        let (p, w) = self.places();
        self.moved = true;
        let factored = self.positions.output(&mut self.tangent, t, y)?;
        self.tangent.tangent(t, self.positions.q(), factored)?;
        self.tangent.spread(&y[p..w]);
        out.set(t, self.positions.q(), &self.tangent.seen().v, self.work(y));
        self.system.normalise(&mut out.q);
        out.choice = self.tangent.events().len().saturating_sub(1);
        Ok(())
    }

    fn describe(
        &mut self,
        t: f64,
        q: &[f64],
        v: &[f64],
        within: Option<&PartitionEvent>,
        out: &mut Sample,
    ) -> Result<(), SystemError> {
        let Some(r) = self.describer.describe(t, q, v, self.tangent.independent(within), out)? else { return Ok(()) };
        if out.brief {
            return Ok(());
        }
        if let Some(quality) = self.tangent.quality(r, t, q, within)? {
            (out.sigma, out.sqrt_mu) = (quality.sigma, quality.sqrt_mu);
        }
        Ok(())
    }

    fn journal(&self) -> Journal {
        let mut journal = Journal { name: self.name, passages: self.passage.times.clone(), ..Journal::default() };
        (journal.open, journal.gaps) = (self.watch.open, self.watch.gaps);
        journal.events = self.tangent.events().to_vec();
        self.tangent.report(&mut journal);
        self.positions.report(&mut journal);
        journal
    }
}
