//! Efforts of couplings and drives that no joint feels: least in what they exert, once the joints have their share.

use crate::error::AnalysisError;
use crate::stress::{Pose, Stress};
use partita_math::dense::Matrix;
use partita_math::factor::{least_squares_min_norm, svd_full};
use partita_math::tolerance;
use partita_model::rows::Owner;
use std::collections::{BTreeMap, HashMap};

/// What a unit effort of a condition exerts: column of the component, and its value.
type Exerted = Vec<(usize, f64)>;

/// Change the multipliers `lambda` along all combinations of `stresses` that load no joint, so that the sum of squares of
/// what couplings and drives exert (forces, moments over `length`) is the least. `own`: the multiplier of a row of the
/// mechanism in space.
pub(super) fn share(
    (pose, stresses): (&Pose, &[Stress]),
    length: f64,
    own: &dyn Fn(usize) -> Option<usize>,
    lambda: &mut [f64],
) -> Result<(), AnalysisError> {
    for set in connected(stresses, own) {
        let set: Vec<&Stress> = set.into_iter().map(|i| &stresses[i]).collect();
        let (rows, cols) = exerted(pose, &set, length)?;
        let mut efforts = Matrix::new(set.len(), cols);
        for (k, stress) in set.iter().enumerate() {
            for (row, x) in &stress.conditions {
                rows[row].iter().for_each(|&(j, u)| efforts[(k, j)] += x * u);
            }
        }
        let sizes: Vec<f64> = (0..set.len()).map(|k| norm(efforts.row(k))).collect();
        if sizes.iter().any(|x| !(*x > 0.0 && x.is_finite())) {
            continue;
        }
        let numbers = |e| AnalysisError::Argument {
            argument: "q",
            message: format!("the efforts of redundant couplings could not be distributed here: {e}"),
        };
        let loads = loads(&set, &sizes, length);
        let parts = svd_full(&loads).map_err(numbers)?;
        let loading = parts.s.iter().filter(|s| **s > tolerance::TAKES_PART).count();
        let free = set.len() - loading;
        let mut given = vec![0.0; cols];
        for (&row, unit) in &rows {
            let x = own(row).map_or(0.0, |i| lambda[i]);
            unit.iter().for_each(|&(j, u)| given[j] -= x * u);
        }
        if free == 0 || !given.iter().all(|x| x.is_finite()) {
            continue;
        }
        // combinations that load no joint, and what they exert
        let combination = |k: usize, b: usize| parts.u[(k, loading + b)] / sizes[k];
        let mut along = Matrix::new(cols, free);
        for (k, b) in (0..set.len()).flat_map(|k| (0..free).map(move |b| (k, b))) {
            let x = combination(k, b);
            if x != 0.0 {
                efforts.row(k).iter().enumerate().for_each(|(j, u)| along[(j, b)] += x * u);
            }
        }
        let (weights, _) = least_squares_min_norm(&along, &given, tolerance::NULL_VALUE).map_err(numbers)?;
        for (k, stress) in set.iter().enumerate() {
            let alpha: f64 = weights.iter().enumerate().map(|(b, x)| x * combination(k, b)).sum();
            for &(row, x) in &stress.conditions {
                if let Some(i) = own(row) {
                    lambda[i] += alpha * x;
                }
            }
        }
    }
    Ok(())
}

/// The wrenches of joints in each self-stress, beside efforts of size 1.
fn loads(set: &[&Stress], sizes: &[f64], length: f64) -> Matrix {
    let mut index: HashMap<usize, usize> = HashMap::new();
    for (j, _) in set.iter().flat_map(|s| &s.joints) {
        let next = index.len();
        index.entry(*j).or_insert(next);
    }
    let mut found = Matrix::new(set.len(), 6 * index.len());
    for (k, stress) in set.iter().enumerate() {
        for (j, w) in &stress.joints {
            for c in 0..3 {
                found[(k, 6 * index[j] + c)] = w.force.0[c] / sizes[k];
                found[(k, 6 * index[j] + 3 + c)] = w.moment.0[c] / (length * sizes[k]);
            }
        }
    }
    found
}

/// What unit efforts of all conditions in the set exert, and the number of components.
fn exerted(pose: &Pose, set: &[&Stress], length: f64) -> Result<(BTreeMap<usize, Exerted>, usize), AnalysisError> {
    let mut columns: HashMap<(Owner, usize), usize> = HashMap::new();
    let mut rows: BTreeMap<usize, Exerted> = BTreeMap::new();
    for (row, _) in set.iter().flat_map(|s| &s.conditions) {
        if rows.contains_key(row) {
            continue;
        }
        let owner = pose.model.row_names[*row].owner;
        let mut unit = Vec::new();
        pose.exerted(*row, length, |part, x| {
            let next = columns.len();
            unit.push((*columns.entry((owner, part)).or_insert(next), x));
        })?;
        rows.insert(*row, unit);
    }
    Ok((rows, columns.len()))
}

/// Self-stresses in which conditions take part whose multipliers are known, in sets that share no condition and no joint.
fn connected(stresses: &[Stress], own: &dyn Fn(usize) -> Option<usize>) -> Vec<Vec<usize>> {
    let takes_part = |s: &Stress| !s.conditions.is_empty() && s.conditions.iter().all(|(row, _)| own(*row).is_some());
    let all: Vec<usize> = (0..stresses.len()).filter(|&i| takes_part(&stresses[i])).collect();
    let mut set_of: Vec<usize> = (0..all.len()).collect();
    fn root(set_of: &mut [usize], mut i: usize) -> usize {
        while set_of[i] != i {
            set_of[i] = set_of[set_of[i]];
            i = set_of[i];
        }
        i
    }
    let mut seen: HashMap<(bool, usize), usize> = HashMap::new();
    for (k, &i) in all.iter().enumerate() {
        let conditions = stresses[i].conditions.iter().map(|(row, _)| (true, *row));
        for key in conditions.chain(stresses[i].joints.iter().map(|(j, _)| (false, *j))) {
            let other = *seen.entry(key).or_insert(k);
            let (a, b) = (root(&mut set_of, other), root(&mut set_of, k));
            set_of[a.max(b)] = a.min(b);
        }
    }
    let mut found: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    for (k, &i) in all.iter().enumerate() {
        let of = root(&mut set_of, k);
        found.entry(of).or_default().push(i);
    }
    found.into_values().collect()
}

fn norm(x: &[f64]) -> f64 {
    x.iter().map(|x| x * x).sum::<f64>().sqrt()
}
