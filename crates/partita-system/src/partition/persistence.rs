//! Persistence: coordinates that remain good over a whole window of time, a turn of a machine for example.
//!
//! The measure of one instant prefers the coordinate that moves most at that time; one that is never the best, but
//! never bad either (a crank angle), needs no switches. The rule stores Dᵀ over the window and switches i for j where
//! the *least* volume of the new choice in the window exceeds that of the present one, provided it is not much worse at
//! present. A choice whose determinant changed its sign between two instants has passed through zero, and counts as
//! zero however far from it the instants lie.
//!
//! The least volume decides, not the average of log |Â|: a logarithm is integrable at a zero, so the average prefers a
//! coordinate that fails twice a turn and is large in between to one that never fails. For the four-bar in absolute
//! coordinates it is −0.7 for a position of the coupler that passes zero, −1.7 for the crank angle.
//!
//! The stored data belong to no partition: Dᵀ of a past instant relative to any other choice is one k x k solve away.
//! So a switch loses nothing of the window.

use super::volume;
use partita_math::tolerance;
use std::collections::VecDeque;

/// Instants that represent a window, many more than the switches in it; closer ones are left out.
const INSTANTS: usize = 256;
/// The least volume must grow by this factor. Scale: ratio of volumes. Reason: a dead band against rounding and the
/// grid of the steps.
const PERSISTENCE_GAIN: f64 = 1.05;

/// Dᵀ at one instant, and its volumes of the present choice and its neighbours.
struct Instant {
    t: f64,
    /// Number of switches before: signs compare between instants of one generation only.
    generation: u64,
    /// ln of the volume of the partition the rows belong to.
    base: f64,
    /// `Dᵀ` (n x k) in natural units.
    rows: Vec<f64>,
    /// Sign and ln of the volume of the present choice.
    own: (f64, f64),
    /// Sign and ln of the volume with the coordinate of the row instead of that of the column (n x k).
    neighbours: Vec<(f64, f64)>,
}

/// A switch and its reason.
#[derive(Clone, Debug, PartialEq)]
pub struct Proposal {
    /// The velocity that comes in.
    pub enters: usize,
    /// Position in the list of independent velocities of the one that leaves.
    pub leaves: usize,
    /// In words.
    pub reason: String,
}

/// The memory of one run.
pub struct Persistence {
    window: f64,
    switch_threshold: f64,
    independent: Vec<usize>,
    generation: u64,
    instants: VecDeque<Instant>,
}

impl Persistence {
    /// Stores `window` seconds. `switch_threshold` is the threshold for switches until the window is full, and how much
    /// worse a choice may be at present; infinite: nothing is ever switched.
    pub fn new(window: f64, switch_threshold: f64, independent: &[usize]) -> Self {
        Self { window, switch_threshold, independent: independent.to_vec(), generation: 0, instants: VecDeque::new() }
    }

    /// Store `rows`, Dᵀ of the present choice in natural units, and `base`, the ln of its volume, at the end of a step.
    ///
    /// A repeated step replaces its former entry. Cost: k³/3 + n k².
    pub fn record(&mut self, t: f64, rows: Vec<f64>, base: f64) {
        while self.instants.back().is_some_and(|last| last.t >= t) {
            self.instants.pop_back();
        }
        if self.instants.back().is_some_and(|last| t - last.t < self.window / INSTANTS as f64) {
            return;
        }
        self.push(t, rows, base);
        // the last one before the window stays: the window begins between it and the next
        while self.instants.len() > 2 && self.instants[1].t <= t - self.window {
            self.instants.pop_front();
        }
    }

    fn push(&mut self, t: f64, rows: Vec<f64>, base: f64) {
        let mut instant = Instant {
            t,
            generation: self.generation,
            base,
            rows,
            own: (0.0, f64::NEG_INFINITY),
            neighbours: Vec::new(),
        };
        judge(&mut instant, &self.independent);
        self.instants.push_back(instant);
    }

    /// The choice was switched for `next` at `t`, where `rows` and `base` were those of the one before.
    ///
    /// Cost: all stored instants are judged again, k³/3 + n k² each.
    pub fn switched(&mut self, t: f64, rows: Vec<f64>, base: f64, next: &[usize]) {
        if self.instants.back().is_none_or(|last| last.t < t) {
            self.push(t, rows.clone(), base);
        }
        self.generation += 1;
        self.independent = next.to_vec();
        for instant in &mut self.instants {
            judge(instant, next);
        }
        // the same instant once more as the first of the new generation, so that no sign is lost between the two
        if let Some(now) = volume::relative_to(&rows, next) {
            let base = base + volume::log_minor(&rows, next);
            self.push(t, now, base);
        }
    }

    /// The switch to be made, with `rows` those of the present choice. Cost: n k for each stored instant.
    pub fn propose(&self, t: f64, rows: &[f64]) -> Option<Proposal> {
        let (n, k) = (rows.len() / self.independent.len().max(1), self.independent.len());
        let pairs = || (0..n).filter(|i| !self.independent.contains(i)).flat_map(|i| (0..k).map(move |j| (i, j)));
        let largest = pairs().fold(None, |best: Option<(usize, usize)>, (i, j)| match best {
            Some((a, b)) if rows[i * k + j].abs() <= rows[a * k + b].abs() * (1.0 + tolerance::TIE) => best,
            _ => Some((i, j)),
        });
        let (enters, leaves) = largest?;
        let gain = rows[enters * k + leaves].abs();
        let full = self.instants.front().is_some_and(|first| first.t <= t - self.window);
        let limit =
            if full { (1.0 / tolerance::WEAK_CHOICE).max(self.switch_threshold) } else { self.switch_threshold };
        if gain > limit {
            let why = if full { "the present choice is degrading" } else { "the window is not full yet" };
            let reason = format!("the volume of the choice grows by {gain:.3}, and {why}");
            return Some(Proposal { enters, leaves, reason });
        }
        if !full || !self.switch_threshold.is_finite() {
            return None;
        }
        let (own, least) = self.least(n * k);
        let better = pairs()
            .filter(|(i, j)| rows[i * k + j].abs() > 1.0 / self.switch_threshold)
            .filter(|(i, j)| least[i * k + j] > own + PERSISTENCE_GAIN.ln())
            .fold(None, |best: Option<(usize, usize)>, (i, j)| match best {
                Some((a, b)) if least[i * k + j] <= least[a * k + b] + tolerance::TIE => best,
                _ => Some((i, j)),
            });
        let (enters, leaves) = better?;
        let reason = format!(
            "its volume stayed above {:.3} for {} s, that of the old choice {}",
            least[enters * k + leaves].exp(),
            self.window,
            if own == f64::NEG_INFINITY { "passed zero".into() } else { format!("fell to {:.3}", own.exp()) }
        );
        Some(Proposal { enters, leaves, reason })
    }

    /// Least ln of the volume over the window: of the present choice, and of its neighbours.
    fn least(&self, pairs: usize) -> (f64, Vec<f64>) {
        let (mut own, mut least) = (f64::INFINITY, vec![f64::INFINITY; pairs]);
        let mut before: Option<&Instant> = None;
        for now in &self.instants {
            let before = before.replace(now).filter(|b| b.generation == now.generation);
            let passed = |b: (f64, f64), x: (f64, f64)| b.0 * x.0 < 0.0;
            own = own.min(if before.is_some_and(|b| passed(b.own, now.own)) { f64::NEG_INFINITY } else { now.own.1 });
            for (e, (least, &x)) in least.iter_mut().zip(&now.neighbours).enumerate() {
                let zero = before.is_some_and(|b| passed(b.neighbours[e], x));
                // a NaN (the present choice singular to the last bit) gives no information on the neighbour
                *least = least.min(if zero { f64::NEG_INFINITY } else { x.1 });
            }
        }
        (own, least)
    }
}

/// Volumes of the choice `independent` and its neighbours at an instant.
fn judge(instant: &mut Instant, independent: &[usize]) {
    let k = independent.len();
    let mut block: Vec<f64> = independent.iter().flat_map(|&i| &instant.rows[i * k..(i + 1) * k]).copied().collect();
    let (sign, log) = volume::signed_log(&mut block, k);
    instant.own = (sign, instant.base + log);
    let own = instant.own;
    instant.neighbours = match volume::relative_to(&instant.rows, independent) {
        Some(x) => x.iter().map(|x| (sign * x.signum(), own.1 + x.abs().ln())).collect(),
        None => vec![(0.0, f64::NAN); instant.rows.len()],
    };
}
