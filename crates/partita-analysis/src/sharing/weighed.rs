//! The metric in which reactions are least, and self-stresses in it as rows of a sparse matrix.

use crate::stress::Stress;
use partita_math::elimination::Pattern;
use partita_math::least_norm::LeastNorm;
use partita_math::spatial::Mat3;
use partita_math::tolerance;
use partita_model::reaction::Wrench;
use partita_model::Model;

/// Component i of a compliance, converted to that of a force: a moment is a force at a lever arm of this length.
fn as_of_a_force(length: f64, i: usize, c: f64) -> f64 {
    if i < 3 {
        c
    } else {
        c * length * length
    }
}

/// The least of the compliances given, if any is.
pub(super) fn least_compliance(model: &Model) -> Option<f64> {
    let given = model.spec.joints.iter().flat_map(|j| j.compliance.iter().flat_map(|c| c.iter().enumerate()));
    let as_force = given.filter(|(_, &c)| c > 0.0).map(|(i, &c)| as_of_a_force(model.length(), i, c));
    as_force.min_by(f64::total_cmp)
}

/// A joint that no self-stress loads.
const NONE: usize = usize::MAX;

/// Weights of the six components of each joint's wrench, square roots, along the joint's axes.
#[derive(Clone, Debug)]
pub(super) struct Metric {
    pub(super) weights: Vec<[f64; 6]>,
    /// Whether they are the same along all axes.
    pub(super) alike: bool,
}

impl Metric {
    pub(super) fn new(model: &Model) -> Self {
        let length = model.length();
        let joints = &model.spec.joints;
        let plain = |x: f64| [x, x, x, x / length, x / length, x / length];
        let Some(least) = least_compliance(model) else {
            return Self { weights: vec![plain(1.0); joints.len()], alike: true };
        };
        let as_force = |i: usize, c: f64| as_of_a_force(length, i, c);
        let rigid = tolerance::EQUAL_IN_SIX_DIGITS * least;
        let of = |c: &Option<[f64; 6]>| {
            let scale = plain(1.0);
            std::array::from_fn(|i| c.map_or(rigid, |c| as_force(i, c[i]).max(rigid)).sqrt() * scale[i])
        };
        Self { weights: joints.iter().map(|j| of(&j.compliance)).collect(), alike: false }
    }

    /// The wrench whose plain square is the metric's.
    pub(super) fn weighed(&self, j: usize, axes: &Mat3<f64>, w: &Wrench) -> [f64; 6] {
        let k = &self.weights[j];
        let (f, m) = match self.alike {
            true => (w.force, w.moment),
            false => (axes.apply_transposed(w.force), axes.apply_transposed(w.moment)),
        };
        std::array::from_fn(|i| k[i] * if i < 3 { f.0[i] } else { m.0[i - 3] })
    }
}

/// Self-stresses as a sparse matrix, without components that none of them loads.
#[derive(Default)]
pub(super) struct Rows {
    /// Where each row starts, the column of each entry, and its value.
    starts: Vec<usize>,
    columns: Vec<usize>,
    pub(super) values: Vec<f64>,
    pub(super) cols: usize,
    /// Joints that are loaded, and their axes.
    pub(super) joints: Vec<usize>,
    axes: Vec<Mat3<f64>>,
    /// Column of each of their components.
    column: Vec<[Option<usize>; 6]>,
    /// Number and scale of the self-stress of each row.
    pub(super) scales: Vec<(usize, f64)>,
    /// Place of each joint among them.
    index: Vec<usize>,
    /// Wrenches of all self-stresses, weighed.
    weighed: Vec<[f64; 6]>,
}

impl Rows {
    pub(super) fn fill(&mut self, metric: &Metric, stresses: &[Stress], axes_of: impl Fn(usize) -> Mat3<f64>) {
        let Self { starts, columns, values, cols, joints, axes, column, scales, index, weighed } = self;
        index.resize(metric.weights.len(), NONE);
        joints.drain(..).for_each(|j| index[j] = NONE);
        axes.clear();
        column.clear();
        weighed.clear();
        for (j, w) in stresses.iter().flat_map(|s| &s.joints) {
            if index[*j] == NONE {
                index[*j] = joints.len();
                joints.push(*j);
                axes.push(axes_of(*j));
                column.push([None; 6]);
            }
            let p = index[*j];
            let x = metric.weighed(*j, &axes[p], w);
            column[p].iter_mut().zip(x).filter(|(_, x)| *x != 0.0).for_each(|(column, _)| *column = Some(0));
            weighed.push(x);
        }
        *cols = 0;
        for column in column.iter_mut().flatten().flatten() {
            *column = *cols;
            *cols += 1;
        }
        starts.clear();
        starts.push(0);
        columns.clear();
        values.clear();
        scales.clear();
        let mut rest = weighed.iter();
        for (i, stress) in stresses.iter().enumerate() {
            let own = rest.as_slice().iter().take(stress.joints.len());
            let length = own.flatten().map(|x| x * x).sum::<f64>().sqrt();
            for ((j, _), x) in stress.joints.iter().zip(&mut rest).filter(|_| length > 0.0) {
                for (column, x) in column[index[*j]].iter().zip(x).filter_map(|(c, x)| Some(((*c)?, x))) {
                    columns.push(column);
                    values.push(x / length);
                }
            }
            if length > 0.0 {
                starts.push(columns.len());
                scales.push((i, 1.0 / length));
            }
        }
    }

    /// Entries of row i: column and value.
    pub(super) fn row(&self, i: usize) -> impl Iterator<Item = (usize, f64)> + '_ {
        let range = self.starts[i]..self.starts[i + 1];
        self.columns[range.clone()].iter().copied().zip(self.values[range].iter().copied())
    }

    pub(super) fn of<'a>(&'a self, stresses: &'a [Stress]) -> impl Iterator<Item = (&'a Stress, f64)> {
        self.scales.iter().map(|&(i, scale)| (&stresses[i], scale))
    }

    /// Reactions of all joints, weighed, along the columns.
    pub(super) fn take(&self, metric: &Metric, reactions: &[Wrench], along: &mut Vec<f64>) {
        along.resize(self.cols, 0.0);
        for ((&j, axes), column) in self.joints.iter().zip(&self.axes).zip(&self.column) {
            let weighed = metric.weighed(j, axes, &reactions[j]);
            column.iter().zip(weighed).filter_map(|(c, x)| Some(((*c)?, x))).for_each(|(c, x)| along[c] = x);
        }
    }

    /// The component of each column: six for each joint that is loaded.
    pub(super) fn components(&self) -> Vec<usize> {
        self.column.iter().flatten().enumerate().filter(|(_, c)| c.is_some()).map(|(i, _)| i).collect()
    }

    /// The previous solver if it has this pattern, otherwise a new one; the result does not depend on it.
    pub(super) fn solver<'a>(&self, solver: &'a mut Option<(Pattern, LeastNorm)>) -> &'a mut LeastNorm {
        let fits = |p: &Pattern| p.cols == self.cols && p.row_ptr == self.starts && p.col_idx == self.columns;
        if !solver.as_ref().is_some_and(|(pattern, _)| fits(pattern)) {
            *solver = None;
        }
        let made = || {
            let pattern = Pattern::new(self.scales.len(), self.cols, self.starts.clone(), self.columns.clone());
            let solver = LeastNorm::new(&pattern);
            (pattern, solver)
        };
        &mut solver.get_or_insert_with(made).1
    }
}
