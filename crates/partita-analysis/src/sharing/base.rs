//! A basis of the self-stresses, for inspection.

use super::{with_rule, Rule, SharingScratch};
use crate::error::AnalysisError;
use crate::geometry::lifted;
use partita_math::dense::Matrix;
use partita_math::factor;
use partita_math::spatial::{Mat3, Vec3};
use partita_math::tolerance;
use partita_model::Model;
use partita_system::prelude::*;

/// Orthonormal self-stresses at one position: a basis of all that can be added to the reactions there.
#[derive(Clone, Debug, Default)]
pub struct SelfStresses {
    /// Force and moment about the joint's point on its child, world axes, of every joint in each self-stress (s x 6
    /// nj).
    pub wrenches: Vec<f64>,
    /// Effort of every drive in each (s x drives).
    pub efforts: Vec<f64>,
    /// Number of them.
    pub count: usize,
    /// What moments are divided by to be compared with forces.
    pub length: f64,
}

/// The self-stresses at (t, q), orthonormal in the metric of the rule, in an order that depends on the mechanism alone:
/// the first loads some component as heavily as any can, the next loads it not at all and another one as heavily as is
/// left.
///
/// For inspection; dense, O(s² nj).
///
/// # Errors
/// Where the mechanism cannot be compiled in space or has no rank.
pub fn self_stresses(model: &Model, t: f64, q: &[f64]) -> Result<SelfStresses, AnalysisError> {
    let (nj, nd) = (model.spec.joints.len(), model.drives().len());
    let none = SelfStresses { length: model.length(), ..SelfStresses::default() };
    with_rule(model, Some((t, q)), |rule| {
        let Some(Rule { twin, sharing, .. }) = rule else { return Ok(none) };
        let q = lifted(model, twin, q);
        let mut memory = sharing.memory();
        sharing.stresses(t, &q, &mut memory)?;
        if !sharing.rows(&q, &mut memory) {
            return Ok(none);
        }
        twin.equations().look(&q, &vec![0.0; twin.size().nv], memory.model.equations());
        let SharingScratch { rows, stresses, .. } = &memory;
        // every component has a column here, loaded or not
        let (components, of_column) = (6 * rows.joints.len(), rows.components());
        let mut given = Matrix::new(rows.scales.len(), components);
        for i in 0..rows.scales.len() {
            rows.row(i).for_each(|(j, x)| given[(i, of_column[j])] = x);
        }
        let parts = factor::svd(&given).map_err(|e| AnalysisError::Argument {
            argument: "state",
            message: format!("no orthonormal basis of the self-stresses was found here: {e}"),
        })?;
        let s = parts.rank(tolerance::NULL_VALUE);
        // weights of the rows given, per unit length of the base: base = weights given
        let mut weights = Matrix::new(s, given.rows());
        for (a, i) in (0..s).flat_map(|a| (0..given.rows()).map(move |i| (a, i))) {
            weights[(a, i)] = parts.u[(i, a)] / parts.s[a];
        }
        // the same along the joints' axes, so that the order does not depend on the world's
        let turned: Vec<Mat3<f64>> = rows
            .joints
            .iter()
            .map(|&j| if sharing.metric.alike { twin.joint_frame(j, &memory.model) } else { Mat3::identity() })
            .collect();
        let mut along = Matrix::new(s, components);
        for a in 0..s {
            for (offset, axes) in turned.iter().enumerate().flat_map(|(p, m)| [(6 * p, m), (6 * p + 3, m)]) {
                let x = Vec3(std::array::from_fn(|c| parts.v[(offset + c, a)]));
                along.row_mut(a)[offset..offset + 3].copy_from_slice(&axes.apply_transposed(x).0);
            }
        }
        turn_to_pivots(&mut along, &mut weights);
        let mut found = SelfStresses { wrenches: vec![0.0; s * 6 * nj], efforts: vec![0.0; s * nd], count: s, ..none };
        for a in 0..s {
            for ((stress, scale), x) in rows.of(stresses).zip(weights.row(a)) {
                for (j, w) in &stress.joints {
                    let to = &mut found.wrenches[(a * nj + j) * 6..][..6];
                    to.iter_mut().zip(w.force.0.iter().chain(&w.moment.0)).for_each(|(to, w)| *to += x * scale * w);
                }
                for (d, effort) in &stress.drives {
                    found.efforts[a * nd + d] += x * scale * effort;
                }
            }
        }
        Ok(found)
    })
}

/// Turn an orthonormal basis (rows of `along`) so that row i is the projection of a unit component onto the complement
/// of the rows before it, the longest there is, the first of equals; `weights` along with it.
fn turn_to_pivots(along: &mut Matrix, weights: &mut Matrix) {
    let (s, n) = (along.rows(), along.cols());
    for a in 0..s {
        let size = |j: usize, along: &Matrix| (a..s).map(|i| along[(i, j)].powi(2)).sum::<f64>();
        let most = (0..n).fold(0.0, |m: f64, j| m.max(size(j, along)));
        let Some(pivot) = (0..n).find(|&j| size(j, along) >= (1.0 - tolerance::EQUAL_IN_SIX_DIGITS) * most) else {
            return;
        };
        // rotate rows a.. so that row a takes all of column `pivot`, one pair after the other
        for i in a + 1..s {
            let (x, y) = (along[(a, pivot)], along[(i, pivot)]);
            let r = x.hypot(y);
            if r == 0.0 {
                continue;
            }
            let (cos, sin) = (x / r, y / r);
            for m in [&mut *along, &mut *weights] {
                for j in 0..m.cols() {
                    let (x, y) = (m[(a, j)], m[(i, j)]);
                    (m[(a, j)], m[(i, j)]) = (cos * x + sin * y, cos * y - sin * x);
                }
            }
        }
        if along[(a, pivot)] < 0.0 {
            along.row_mut(a).iter_mut().chain(weights.row_mut(a)).for_each(|x| *x = -*x);
        }
    }
}
