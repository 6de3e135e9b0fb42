//! Distance from the nearest singular position: the smallest singular value of C.                       (X1)

use super::Reduction;
use crate::system::ConstrainedSystem;
use partita_math::tolerance;

/// Memory for the distances of all clusters, and what they need of the choice.
#[derive(Clone, Debug, Default)]
pub(super) struct Distance {
    clusters: Vec<Sums>,
    u: LeftVector,
    w: LeftVector,
    of_choice: OfChoice,
}

/// What the choice determines, by steps of the elimination and by independent velocities.
#[derive(Clone, Debug, Default)]
struct OfChoice {
    /// The right-hand side of the first solve.
    first: Vec<f64>,
    /// Displacements of rows, of dependent and of independent velocities.
    rows: Vec<f64>,
    dependent: Vec<f64>,
    independent: Vec<f64>,
    /// Clusters of steps and of independent velocities.
    of_step: Vec<u32>,
    of_column: Vec<u32>,
}

/// A left vector u and uᵀC.
#[derive(Clone, Debug, Default)]
struct LeftVector {
    /// By steps of the elimination.
    by_rows: Vec<f64>,
    dependent: Vec<f64>,
    independent: Vec<f64>,
}

impl LeftVector {
    fn lay_out(&mut self, rank: usize, k: usize) {
        self.by_rows.resize(rank, 0.0);
        self.dependent.resize(rank, 0.0);
        self.independent.resize(k, 0.0);
    }
}

impl Distance {
    /// For this number of kept rows, of degrees of freedom, and of clusters, in a new choice.
    pub fn lay_out(&mut self, rank: usize, k: usize, clusters: usize) {
        self.clusters.resize(clusters.max(1), Sums::default());
        self.u.lay_out(rank, k);
        self.w.lay_out(rank, k);
        self.of_choice.lay_out(rank, k);
    }
}

impl OfChoice {
    /// Memory for another choice, which is looked at when a distance is asked for.
    fn lay_out(&mut self, rank: usize, k: usize) {
        let Self { first, rows, dependent, independent, of_step, of_column } = self;
        for (x, count) in [(first, rank), (rows, rank), (dependent, rank), (independent, k)] {
            x.clear();
            x.reserve(count);
        }
        for (x, count) in [(of_step, rank), (of_column, k)] {
            x.clear();
            x.reserve(count);
        }
    }
}

/// Products of the left vectors u and w of one cluster.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    /// u·u, w·w, u·w.
    u: f64,
    w: f64,
    uw: f64,
    /// |uᵀC|², |wᵀC|², (uᵀC)·(wᵀC).
    uc: f64,
    wc: f64,
    ucwc: f64,
    /// What u and w contribute to the vector for which |uᵀC| is least.
    parts: (f64, f64),
}

impl Sums {
    /// Of components of u and w, that of this vector.
    fn combined(&self, u: f64, w: f64) -> f64 {
        self.parts.0 * u + self.parts.1 * w
    }

    /// The multiple of u that w contains.
    fn shared(&self) -> f64 {
        if self.u > 0.0 {
            self.uw / self.u
        } else {
            0.0
        }
    }

    /// What u and w, orthogonal to each other, contribute to the unit vector for which |uᵀC| is least.
    fn least(&self) -> (f64, f64) {
        let (u, w) = (self.u.sqrt(), self.w.sqrt());
        if w <= tolerance::NEGLIGIBLE * u {
            return (1.0 / u, 0.0);
        }
        // cosine and sine of half the angle of (across, along)
        let (across, along) = (self.uc / self.u - self.wc / self.w, 2.0 * self.ucwc / (u * w));
        let length = (across * across + along * along).sqrt();
        if length == 0.0 {
            return (0.0, 1.0 / w);
        }
        // the larger of the two without cancellation
        let larger = (0.5 * (1.0 + across.abs() / length)).sqrt();
        let smaller = 0.5 * along.abs() / (length * larger);
        let (cosine, sine) = if across >= 0.0 { (larger, smaller) } else { (smaller, larger) };
        (-sine.copysign(along) / u, cosine / w)
    }
}

/// Other contents for a vector.
fn refill<T>(to: &mut Vec<T>, from: impl Iterator<Item = T>) {
    to.clear();
    to.extend(from);
}

impl<S: ConstrainedSystem> Reduction<'_, S> {
    /// How far the mechanism is from a singular position at the last tangent: falls linearly to zero towards one. With
    /// the number of the plan it belongs to: values of different choices of rows are not comparable.
    ///
    /// It is the smallest singular value of C, rows and coordinates measured in characteristic displacements. At a dead
    /// point of its coordinates C_D alone loses rank, and twice where the mechanism is singular there (a parallelogram
    /// whose hinges come into one line, by the position of a bar). So the left singular vector u of C_D, by inverse
    /// iteration, is improved by a step along the gradient of |uᵀC|² / |u|², for which the same system is solved: the
    /// two span what C_D loses. Four solves with the current factors.
    ///
    /// One per cluster; the smallest is reported.
    pub fn distance(&mut self) -> (f64, u64) {
        let mut d = std::mem::take(&mut self.distance);
        if d.of_choice.first.len() != self.planned.rank {
            self.look_at_choice(&mut d.of_choice);
        }
        let least = if self.planned.plan.is_some() { self.least_singular_value(&mut d) } else { f64::INFINITY };
        self.distance = d;
        (least, self.counts.plans)
    }

    /// Sizes and clusters of the choice in use.
    fn look_at_choice(&self, of: &mut OfChoice) {
        let partition = &self.planned.partition;
        let cluster = |i: &usize| self.planned.clusters.of_velocity[*i];
        let displacement = |i: &usize| self.scale.displacement[*i];
        // irregular, so that no self-stress of a mechanism is orthogonal to it
        let first = partition.rows.iter().map(|&row| 1.0 + 0.5 * (row as f64 * 1.7).sin());
        refill(&mut of.first, first);
        refill(&mut of.rows, (0..self.planned.rank).map(|step| self.size_of_row(step)));
        refill(&mut of.dependent, partition.dependent.iter().map(displacement));
        refill(&mut of.independent, partition.independent.iter().map(displacement));
        // steps pair rows with dependent velocities of the same cluster
        refill(&mut of.of_step, partition.dependent.iter().map(cluster));
        refill(&mut of.of_column, partition.independent.iter().map(cluster));
    }

    fn least_singular_value(&self, Distance { clusters, u, w, of_choice }: &mut Distance) -> f64 {
        let (of_step, of_column) = (&of_choice.of_step[..], &of_choice.of_column[..]);
        let of_step = |step: usize| of_step[step] as usize;
        let of_column = |j: usize| of_column[j] as usize;
        u.dependent.copy_from_slice(&of_choice.first);
        clusters.fill(Sums::default());
        self.improve(u, of_choice);
        for (step, (x, y)) in u.by_rows.iter().zip(&u.dependent).enumerate() {
            let sums = &mut clusters[of_step(step)];
            sums.u += x * x;
            sums.uc += y * y;
        }
        u.independent.iter().enumerate().for_each(|(j, y)| clusters[of_column(j)].uc += y * y);

        // the gradient, less its part that leads to u itself
        for (step, (x, u)) in w.dependent.iter_mut().zip(&u.by_rows).enumerate() {
            let sums = &clusters[of_step(step)];
            *x = -sums.uc / sums.u * u;
        }
        for &(step, e, j) in &self.planned.spread_entries {
            let (step, j) = (step as usize, j as usize);
            w.dependent[step] +=
                self.at.c[e as usize] * of_choice.independent[j] / of_choice.rows[step] * u.independent[j];
        }
        self.improve(w, of_choice);
        for (step, (x, y)) in u.by_rows.iter().zip(&w.by_rows).enumerate() {
            clusters[of_step(step)].uw += x * y;
        }
        for step in 0..self.planned.rank {
            let sums = &mut clusters[of_step(step)];
            let shared = sums.shared();
            w.by_rows[step] -= shared * u.by_rows[step];
            w.dependent[step] -= shared * u.dependent[step];
            sums.w += w.by_rows[step].powi(2);
            sums.wc += w.dependent[step].powi(2);
            sums.ucwc += u.dependent[step] * w.dependent[step];
        }
        for (j, (x, y)) in u.independent.iter().zip(&mut w.independent).enumerate() {
            let sums = &mut clusters[of_column(j)];
            *y -= sums.shared() * x;
            sums.wc += *y * *y;
            sums.ucwc += x * *y;
        }

        // sums of squares, as small as they are, where a root of the quadratic equation would be round-off
        for sums in clusters.iter_mut() {
            (sums.parts, sums.uc) = (sums.least(), 0.0);
        }
        for step in 0..self.planned.rank {
            let sums = &mut clusters[of_step(step)];
            u.by_rows[step] = sums.combined(u.by_rows[step], w.by_rows[step]);
            sums.uc += sums.combined(u.dependent[step], w.dependent[step]).powi(2);
        }
        for (j, (x, y)) in u.independent.iter().zip(&w.independent).enumerate() {
            let sums = &mut clusters[of_column(j)];
            sums.uc += sums.combined(*x, *y).powi(2);
        }
        clusters.iter().filter(|x| x.u > 0.0).fold(f64::INFINITY, |m, x| m.min(x.uc)).sqrt()
    }

    /// From the right-hand side x in `dependent`: y = C_D⁻¹ x, the vector C_D⁻ᵀ y, and its products with C.
    fn improve(&self, left: &mut LeftVector, of: &OfChoice) {
        let Some(plan) = &self.planned.plan else { return };
        let LeftVector { by_rows, dependent, independent } = left;
        dependent.iter_mut().zip(&of.rows).for_each(|(x, size)| *x *= size);
        plan.solve(&self.at.factors, dependent, 1);
        dependent.iter_mut().zip(&of.dependent).for_each(|(x, size)| *x /= size);
        by_rows.iter_mut().zip(&*dependent).zip(&of.dependent).for_each(|((to, x), size)| *to = x / size);
        plan.solve_transposed(&self.at.factors, by_rows, 1);
        independent.fill(0.0);
        for &(step, e, j) in &self.planned.spread_entries {
            independent[j as usize] += self.at.c[e as usize] * by_rows[step as usize];
        }
        independent.iter_mut().zip(&of.independent).for_each(|(x, size)| *x *= size);
        by_rows.iter_mut().zip(&of.rows).for_each(|(x, size)| *x *= size);
    }

    /// Displacement of the row of a step.
    pub(super) fn size_of_row(&self, step: usize) -> f64 {
        self.system.structure().rows[self.planned.partition.rows[step]].size()
    }

    /// The kept row that depends most on the others next to a singular position: the largest component of the left
    /// singular vector of the last [`distance`](Self::distance), rows in characteristic displacements.
    pub fn weakest_row(&self) -> Option<usize> {
        let rows = self.distance.u.by_rows.iter().zip(&self.planned.partition.rows);
        rows.max_by(|a, b| a.0.abs().total_cmp(&b.0.abs())).map(|(_, &row)| row)
    }
}
