//! A rule of choice in use: applied at one instant, or after every step of a run.
//!
//! The default, the collective rule, needs none of this during a run: P6 on the results of P1 suffices.

use crate::error::Result;
use crate::manifold::orthogonal::dense_rows;
use crate::partition::persistence::Persistence;
use crate::partition::{
    complete_pivoting, criterion, determinant, geometric, individual, normalised_determinant, volume, Selection,
};
use crate::reduction::Reduction;
use crate::singular::dead_point;
use crate::start;
use crate::system::{ConstrainedSystem, SystemError};
use partita_math::tolerance;

/// The choice of a rule at one instant; exact unless a determinant rule had too many partitions to compare them all.
pub use crate::partition::volume::Largest as Choice;

/// Refuses weights, and a window, where the rule has no use for them.
///
/// # Errors
/// `Argument`, with the rule and the argument to omit or to give.
pub fn check(selection: Selection, weights: Option<&[f64]>, window: Option<f64>) -> Result<()> {
    let name = selection.name();
    let refuse = |argument: &str, message: String| Err(SystemError::argument(argument, message));
    if weights.is_some() && matches!(selection, Selection::Determinant | Selection::CompletePivoting) {
        return refuse(
            "weights",
            format!(
                "selection \"{name}\" compares plain entries of C and uses no weights; omit them, or use \
                 \"normalised-determinant\""
            ),
        );
    }
    match (selection, window) {
        (Selection::Persistence, None) => refuse(
            "window",
            format!(
                "selection \"{name}\" needs a window, the time over which the coordinates should remain good: one \
                 turn of the machine, or several periods"
            ),
        ),
        (Selection::Persistence, Some(x)) if !(x > 0.0 && x.is_finite()) => {
            refuse("window", format!("window = {x} s; give a positive time"))
        }
        (Selection::Persistence, _) | (_, None) => Ok(()),
        (_, Some(x)) => refuse(
            "window",
            format!(
                "window = {x} s has no meaning for selection \"{name}\"; omit it, or use selection \"persistence\""
            ),
        ),
    }
}

/// The choice of the rule at the point last evaluated, with the scales of the reduction.
///
/// Persistence, which has no past here, chooses as the collective rule by P5 alone.
///
/// # Errors
/// `Choice` where complete pivoting finds too few pivots.
pub fn ask<S: ConstrainedSystem>(
    r: &Reduction<S>,
    t: f64,
    selection: Selection,
    weights: Option<&[f64]>,
) -> Result<Choice> {
    let (k, now) = (r.k(), &r.planned.partition.independent);
    let exact = |independent| Choice { independent, exact: true };
    Ok(match selection {
        Selection::Collective | Selection::Greedy | Selection::Persistence => {
            exact(criterion::choose(&r.at.dt, k, &r.at.md_factor, &r.scale.s2, weights))
        }
        Selection::Individual => exact(individual::choose(&measures(r), k, weights)),
        Selection::Determinant => determinant::choose(&r.at.dt, now, r.scales()),
        Selection::NormalisedDeterminant => normalised_determinant::choose(&r.at.dt, now, r.scales(), weights),
        Selection::Geometric => exact(geometric::choose(&r.at.dt, k, &r.at.md_factor, &displacements(r), weights)),
        Selection::CompletePivoting => {
            let rows: Vec<usize> = (0..r.size().rows).collect();
            let c = dense_rows(&*r.system, &r.at.c, &rows);
            match complete_pivoting::choose(&c, r.rank()) {
                Some((independent, _)) => exact(independent),
                None => {
                    let reason = format!("C has fewer than {} nonzero pivots", r.rank());
                    return Err(impossible(r, t, selection, &[], reason));
                }
            }
        }
    })
}

/// Improvement of `next` over the present choice, in the rule's own measure, at the point last evaluated.
fn gain<S: ConstrainedSystem>(r: &Reduction<S>, selection: Selection, weights: Option<&[f64]>, next: &[usize]) -> f64 {
    let now = &r.planned.partition.independent;
    match selection {
        Selection::Determinant | Selection::CompletePivoting => determinant::ratio(&r.at.dt, now, r.scales(), next),
        Selection::Geometric => geometric::ratio(&r.at.dt, now, &displacements(r), weights, next),
        Selection::Individual => individual::ratio(&measures(r), weights, now, next),
        _ => normalised_determinant::ratio(&r.at.dt, now, r.scales(), weights, next),
    }
}

/// In words, the quantity that grew.
fn measure_name(selection: Selection) -> &'static str {
    match selection {
        Selection::Determinant => "|det C_D| in the units given",
        Selection::CompletePivoting => "|det C_D| from complete pivoting",
        Selection::Individual => "the measure of a single coordinate",
        Selection::Geometric => "the volume of the choice in characteristic displacements",
        _ => "the volume of the choice",
    }
}

fn displacements<S: ConstrainedSystem>(r: &Reduction<S>) -> Vec<f64> {
    r.system.structure().displacements().collect()
}

fn measures<S: ConstrainedSystem>(r: &Reduction<S>) -> Vec<f64> {
    let (mut work, mut rho) = (vec![0.0; r.k()], vec![0.0; r.size().nv]);
    criterion::measure_tangent(&r.at.dt, r.k(), &r.at.md_factor, &r.scale.s2, &mut work, &mut rho);
    rho
}

/// Make `independent` the partition, or report that the rule chose an impossible one.
pub fn adopt<S: ConstrainedSystem>(
    r: &mut Reduction<S>,
    t: f64,
    selection: Selection,
    independent: &[usize],
) -> Result<()> {
    r.set_partition(t, independent).map_err(|e| match e {
        SystemError::Singular { pivot, limit, .. } => {
            let reason = format!("C_D is singular, its smallest scaled pivot {pivot:.1e} is below {limit:.0e}");
            impossible(r, t, selection, independent, reason)
        }
        other => other,
    })?;
    r.tangent(t)
}

fn impossible<S: ConstrainedSystem>(
    r: &Reduction<S>,
    t: f64,
    selection: Selection,
    independent: &[usize],
    reason: String,
) -> SystemError {
    let names = r.system.structure().names(independent);
    let coordinates = if names.is_empty() { "nothing".into() } else { names };
    SystemError::Choice { rule: selection.name(), coordinates, t, reason }
}

/// Choose independent coordinates at `(t, q)` by a rule; persistence starts from the collective choice.
///
/// Ends with the reduction at `(t, q)` with the tangent of the new partition; returns whether the rule compared all
/// partitions.
///
/// # Errors
/// `Choice` where the rule chooses coordinates that cannot be independent; no other rule replaces it.
pub fn choose_by<S: ConstrainedSystem>(
    r: &mut Reduction<S>,
    t: f64,
    q: &[f64],
    selection: Selection,
    weights: Option<&[f64]>,
) -> Result<Choice> {
    let collective = matches!(selection, Selection::Collective | Selection::Persistence);
    if collective {
        start::choose_partition(r, t, q, weights, None)?;
    } else {
        start::first_partition(r, t, q)?;
    }
    if r.k() == 0 || r.rank() == 0 || collective {
        return Ok(Choice { independent: r.planned.partition.independent.clone(), exact: true });
    }
    r.at.v.fill(0.0);
    r.velocity(t, q)?;
    r.acceleration(t, q)?;
    let choice = ask(r, t, selection, weights)?;
    adopt(r, t, selection, &choice.independent)?;
    Ok(choice)
}

/// A change requested by the rule.
#[derive(Clone, Debug)]
pub struct Change {
    /// The new choice, ascending.
    pub independent: Vec<usize>,
    /// In words.
    pub reason: String,
}

/// A rule during a run: applied after every accepted step, it changes the partition when its own measure of another
/// choice exceeds that of the present one by more than the threshold.
///
/// Cost: that of the rule; a poor choice of the rule is kept, with its numbers.
pub struct Chooser {
    selection: Selection,
    switch_threshold: f64,
    weights: Option<Vec<f64>>,
    window: f64,
    persistence: Option<Persistence>,
    compared_all: bool,
}

impl Chooser {
    /// For any rule; see [`check`] for valid combinations.
    ///
    /// # Errors
    /// As [`check`].
    pub fn new(
        selection: Selection,
        switch_threshold: f64,
        weights: Option<&[f64]>,
        window: Option<f64>,
    ) -> Result<Self> {
        check(selection, weights, window)?;
        let window = window.unwrap_or(0.0);
        let weights = weights.map(<[f64]>::to_vec);
        Ok(Self { selection, switch_threshold, weights, window, persistence: None, compared_all: true })
    }

    /// The first choice, at `(t, q)`, and its reason: the rule's own, or `fixed`, the user's.
    ///
    /// # Errors
    /// As [`choose_by`]; a rule and coordinates of the user exclude each other.
    pub fn start<S: ConstrainedSystem>(
        &mut self,
        r: &mut Reduction<S>,
        t: f64,
        q: &[f64],
        fixed: Option<&[usize]>,
    ) -> Result<String> {
        if fixed.is_some() {
            if self.selection != Selection::Collective {
                let message = "independent coordinates and a selection were both given; give one of them";
                return Err(SystemError::argument("selection", message.into()));
            }
            start::choose_partition(r, t, q, None, fixed)?;
            return Ok("fixed by the user".into());
        }
        self.compared_all = choose_by(r, t, q, self.selection, self.weights.as_deref())?.exact;
        self.persistence = (self.selection == Selection::Persistence)
            .then(|| Persistence::new(self.window, self.switch_threshold, &r.planned.partition.independent));
        Ok(match self.selection {
            Selection::Collective => "largest projective measure at the start".into(),
            Selection::Persistence => "collective choice at the start, persistence from here on".into(),
            other => format!("chosen by the rule \"{}\" at the start", other.name()),
        })
    }

    /// Remember the end of an accepted step at t, the point last evaluated.
    pub fn record<S: ConstrainedSystem>(&mut self, r: &Reduction<S>, t: f64) {
        if self.persistence.is_some() {
            let (rows, base) = self.volumes(r);
            if let Some(p) = &mut self.persistence {
                p.record(t, rows, base);
            }
        }
    }

    /// Dᵀ in natural units and the ln of the volume of the present choice, preferences included.
    fn volumes<S: ConstrainedSystem>(&self, r: &Reduction<S>) -> (Vec<f64>, f64) {
        let now = &r.planned.partition.independent;
        let s: Vec<f64> = match &self.weights {
            Some(w) => r.scales().iter().zip(w).map(|(s, w)| s / w).collect(),
            None => r.scales().to_vec(),
        };
        // (28): vol² = 1 / (det M_d Π s_i²)
        let k = now.len();
        let base = now.iter().enumerate().map(|(j, &i)| -r.at.md_factor[j * k + j].ln() - s[i].ln()).sum();
        (volume::natural(&r.at.dt, now, &s), base)
    }

    /// The change requested by the rule at the point last evaluated, if any.
    ///
    /// # Errors
    /// As [`ask`].
    pub fn propose<S: ConstrainedSystem>(&mut self, r: &Reduction<S>, t: f64) -> Result<Option<Change>> {
        if !self.switch_threshold.is_finite() {
            return Ok(None);
        }
        let now = &r.planned.partition.independent;
        if let Some(p) = &self.persistence {
            return Ok(p.propose(t, &self.volumes(r).0).map(|x| {
                let mut independent = now.clone();
                independent[x.leaves] = x.enters;
                independent.sort_unstable();
                Change { independent, reason: x.reason }
            }));
        }
        let weights = self.weights.as_deref();
        let choice = ask(r, t, self.selection, weights)?;
        self.compared_all &= choice.exact;
        if choice.independent == *now {
            return Ok(None);
        }
        let gain = gain(r, self.selection, weights, &choice.independent);
        let reason = format!("{} grows by {gain:.3}", measure_name(self.selection));
        // a NaN is not a gain
        Ok((gain > self.switch_threshold).then_some(Change { independent: choice.independent, reason }))
    }

    /// Apply a change at the point last evaluated; evaluates the tangent of the new partition.
    ///
    /// # Errors
    /// `Choice` where the rule chooses coordinates that cannot be independent.
    pub fn change<S: ConstrainedSystem>(&mut self, r: &mut Reduction<S>, t: f64, change: &Change) -> Result<()> {
        let before = self.persistence.is_some().then(|| self.volumes(r));
        adopt(r, t, self.selection, &change.independent)?;
        if let (Some(p), Some((rows, base))) = (&mut self.persistence, before) {
            p.switched(t, rows, base, &change.independent);
        }
        Ok(())
    }

    /// Distinguish a choice that has become impossible from a singular position of the mechanism.
    ///
    /// The mechanism is regular if any other partition can be factored where this one cannot.
    pub fn blame<S: ConstrainedSystem>(&self, r: &Reduction<S>, t: f64, q: &[f64], e: SystemError) -> SystemError {
        let Some(seen) = dead_point::lost(r, t, q, &e) else { return e };
        let mut probe = Reduction::new(r.system.clone(), r.rank());
        let regular = start::first_partition(&mut probe, t, q).is_ok()
            && probe.smallest() >= tolerance::SINGULAR_PIVOT
            && dead_point::has_mass(&mut probe, t, q);
        if !regular {
            return e;
        }
        let reason = format!("{seen}, although the mechanism itself is not singular");
        impossible(r, t, self.selection, &r.planned.partition.independent, reason)
    }

    /// Notes for the user.
    pub fn notes(&self) -> Vec<String> {
        match self.compared_all {
            true => Vec::new(),
            false => vec![format!(
                "selection \"{}\": there are more than {} partitions; the largest determinant was searched by \
                 switches, and no single switch improves it",
                self.selection.name(),
                volume::LARGEST_ENUMERATION
            )],
        }
    }
}
