//! Discontinuities at known times: steps end there, so that none is passed unseen and none spoils the order of a step.

use partita_math::tolerance;

/// The known times, ascending.
#[derive(Clone, Debug, Default)]
pub(crate) struct KnownTimes(Vec<f64>);

impl KnownTimes {
    /// Of these ascending times.
    pub(crate) fn new(times: Vec<f64>) -> Self {
        Self(times)
    }

    /// The first one after t towards `end`, which counts itself.
    pub(crate) fn ahead(&self, t: f64, end: f64) -> Option<f64> {
        let times = &self.0;
        let next = match end > t {
            true => times.get(times.partition_point(|c| *c <= t)).filter(|c| **c <= end),
            false => times.partition_point(|c| *c < t).checked_sub(1).map(|i| &times[i]).filter(|c| **c >= end),
        };
        next.copied()
    }

    /// The one at t, which was located up to rounding: a step that ends beside it cannot go on.
    pub(crate) fn at(&self, t: f64) -> Option<f64> {
        let i = self.0.partition_point(|c| *c < t);
        let beside = self.0[i.saturating_sub(1)..(i + 1).min(self.0.len())].iter().copied();
        beside.into_iter().find(|c| (c - t).abs() <= tolerance::SUM_ROUNDING * t.abs())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_next_time_is_found_in_both_directions_and_the_end_counts() {
        let times = KnownTimes::new(vec![1.0, 2.0, 3.0]);
        for (t, end, next) in [
            (0.0, 9.0, Some(1.0)),
            (1.0, 9.0, Some(2.0)),
            (2.5, 3.0, Some(3.0)),
            (2.5, 2.9, None),
            (3.0, 9.0, None),
            (9.0, 0.0, Some(3.0)),
            (3.0, 0.0, Some(2.0)),
            (1.5, 1.0, Some(1.0)),
            (1.0, 0.0, None),
        ] {
            assert_eq!(times.ahead(t, end), next, "from {t} to {end}");
        }
    }

    #[test]
    fn a_time_is_met_up_to_rounding() {
        let times = KnownTimes::new(vec![1.0, 2.0]);
        for beside in [2.0, 2.0 + f64::EPSILON, 2.0 - 2.0 * f64::EPSILON] {
            assert_eq!(times.at(beside), Some(2.0));
        }
        assert_eq!((times.at(2.0 + 1e-9), times.at(5.0), KnownTimes::default().at(0.0)), (None, None, None));
    }
}
