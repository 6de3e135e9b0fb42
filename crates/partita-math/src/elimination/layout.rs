//! The symbolic part of a plan, kept with the pattern because the same pivots are chosen again and again.

use super::blocks::Blocks;
use super::choice::Step;
use super::program::Program;
use super::Pattern;
use std::sync::{Arc, Mutex, PoisonError};

/// Maximum number of entries of the factors of all layouts that are kept together.
const KEPT: usize = 100_000;
/// Largest number of layouts kept.
const MOST: usize = 16;

/// An elimination by these pivots: it follows from the pattern and from their order alone.
#[derive(Debug)]
pub(super) struct Layout {
    pub pivot_rows: Vec<usize>,
    pub pivot_cols: Vec<usize>,
    pub program: Program,
    /// Diagonal block of each step, and the effect of the order of its steps on the sign of its determinant.
    pub blocks: Blocks,
}

impl Layout {
    fn new(pattern: &Pattern, steps: &[Step]) -> Self {
        let pivot_rows: Vec<usize> = steps.iter().map(|s| s.row).collect();
        let pivot_cols: Vec<usize> = steps.iter().map(|s| s.col).collect();
        let blocks = Blocks::new(pattern, &pivot_rows, &pivot_cols);
        Self { program: Program::new(pattern, steps), blocks, pivot_rows, pivot_cols }
    }

    fn is_of(&self, steps: &[Step]) -> bool {
        let pivots = self.pivot_rows.iter().zip(&self.pivot_cols);
        self.pivot_rows.len() == steps.len() && steps.iter().zip(pivots).all(|(s, (r, c))| s.row == *r && s.col == *c)
    }
}

/// Layouts of one pattern, the latest last. They only make plans cheaper, and are ignored in comparisons.
#[derive(Debug, Default)]
pub(super) struct Layouts(Mutex<Vec<Arc<Layout>>>);

impl Layouts {
    /// The layout of these steps.
    pub fn of(&self, pattern: &Pattern, steps: &[Step]) -> Arc<Layout> {
        let kept = || self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(found) = kept().iter().rev().find(|x| x.is_of(steps)) {
            return found.clone();
        }
        let made = Arc::new(Layout::new(pattern, steps));
        let mut kept = kept();
        kept.push(made.clone());
        let mut sizes: usize = kept.iter().map(|x| x.program.len()).sum();
        while kept.len() > MOST || sizes > KEPT {
            sizes -= kept.remove(0).program.len();
        }
        made
    }
}

/// A copy of a pattern begins without any.
impl Clone for Layouts {
    fn clone(&self) -> Self {
        Self::default()
    }
}

impl PartialEq for Layouts {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

impl Eq for Layouts {}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::elimination::{Plan, PlanOptions};

    /// Plans of a pattern are those of a fresh copy of it, to the last bit, whatever plans were made before and how many.
    #[test]
    fn plans_do_not_depend_on_those_before() {
        let mut rng = fastrand::Rng::with_seed(7);
        let rows: Vec<Vec<usize>> = (0..6).map(|i| (0..9).filter(|j| (i * 5 + j * 3) % 4 != 1).collect()).collect();
        let pattern = Pattern::from_rows(9, &rows);
        let (all_rows, scale) = (vec![true; 6], vec![1.0; 9]);
        let mut met = std::collections::HashSet::new();
        for round in 0..300 {
            let values: Vec<f64> = (0..pattern.nnz()).map(|_| 2.0 * rng.f64() - 1.0).collect();
            let columns: Vec<bool> = (0..9).map(|j| round % 3 == 0 || (round + j) % 9 > 1).collect();
            let plan = |p: &Pattern| {
                Plan::new(p, &values, &all_rows, &columns, &scale[..6], &scale, 6, PlanOptions::default()).unwrap()
            };
            let (kept, fresh) = (plan(&pattern), plan(&pattern.clone()));
            assert_eq!((kept.pivot_rows(), kept.pivot_cols()), (fresh.pivot_rows(), fresh.pivot_cols()));
            let solved = |plan: &Plan| {
                let mut work = vec![0.0; plan.factor_len()];
                plan.factor(&values, &mut work).unwrap();
                let (mut x, mut signs) = ((0..6).map(f64::from).collect::<Vec<_>>(), Vec::new());
                plan.solve(&work, &mut x, 1);
                let blocks = plan.signs(&work, &mut signs);
                (work.iter().chain(&x).map(|x| x.to_bits()).collect::<Vec<_>>(), signs, blocks)
            };
            assert_eq!(solved(&kept), solved(&fresh));
            met.insert((kept.pivot_rows().to_vec(), kept.pivot_cols().to_vec()));
            assert!(pattern.layouts.0.lock().unwrap().len() <= MOST);
        }
        assert!(met.len() > MOST, "{}", met.len());
    }

    /// The same pivots are laid out once.
    #[test]
    fn the_same_pivots_are_laid_out_once() {
        let pattern = Pattern::dense(2, 3);
        let plan = |x: f64| {
            let values = [1.0, x, 0.0, 0.0, 1.0, 0.5];
            let (rows, columns) = ([true; 2], [true, true, false]);
            Plan::new(&pattern, &values, &rows, &columns, &[1.0; 2], &[1.0; 3], 2, PlanOptions::default()).unwrap()
        };
        assert_eq!((plan(0.1).rank(), plan(0.2).rank()), (2, 2));
        assert_eq!(pattern.layouts.0.lock().unwrap().len(), 1);
    }
}
