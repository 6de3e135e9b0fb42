//! The criterion for plain matrices M and C, without a mechanism.

use crate::error::AnalysisError;
use partita_math::dense::{self, Matrix};
use partita_math::elimination::Pattern;
use partita_math::rank::independent_rows;
use partita_math::tolerance;
use partita_system::equations::{Equations, UserSystem};
use partita_system::partition::criterion::Quality;
use partita_system::partition::geometry::Geometry;
use partita_system::partition::split::Split;
use partita_system::partition::Selection;
use partita_system::reduction::Reduction;
use partita_system::start;
use partita_system::tangent::chooser;
use partita_system::SystemError;

/// M and C at one point, as a system at rest.
struct Frozen {
    mass: Matrix,
    c: Matrix,
}

impl Equations for Frozen {
    fn n(&self) -> usize {
        self.mass.rows()
    }
    fn rows(&self) -> usize {
        self.c.rows()
    }
    fn holonomic(&self) -> usize {
        self.c.rows()
    }
    fn name(&self, i: usize) -> String {
        format!("coordinate {i}")
    }
    fn rheonomic(&self) -> bool {
        false
    }
    fn mass(&self, _: f64, _: &[f64], out: &mut [f64]) -> Result<(), SystemError> {
        out.copy_from_slice(self.mass.data());
        Ok(())
    }
    fn forces(&self, _: f64, _: &[f64], _: &[f64], out: &mut [f64]) -> Result<(), SystemError> {
        out.fill(0.0);
        Ok(())
    }
    fn constraints(&self, _: f64, _: &[f64], out: &mut [f64]) -> Result<(), SystemError> {
        out.fill(0.0);
        Ok(())
    }
    fn jacobian(&self, _: f64, _: &[f64], out: &mut [f64]) -> Result<(), SystemError> {
        out.copy_from_slice(self.c.data());
        Ok(())
    }
    fn rate(&self, _: f64, _: &[f64], out: &mut [f64]) -> Result<(), SystemError> {
        out.fill(0.0);
        Ok(())
    }
    fn bias(&self, _: f64, _: &[f64], _: &[f64], out: &mut [f64]) -> Result<(), SystemError> {
        out.fill(0.0);
        Ok(())
    }
}

/// Options of the choice of coordinates.
#[derive(Clone, Debug, Default)]
pub struct Choice {
    /// The rule.
    pub rule: Selection,
    /// Switches with a smaller gain are not made; 1 or more.
    pub threshold: f64,
    /// Preferences that multiply ρ.
    pub weights: Option<Vec<f64>>,
    /// The independent coordinates themselves, instead of a rule.
    pub fixed: Option<Vec<usize>>,
}

/// A partition and its properties.
#[derive(Clone, Debug)]
pub struct Chosen {
    /// Indices, A and D.
    pub split: Split,
    /// P4.
    pub rho: Vec<f64>,
    /// σ and √μ.
    pub quality: Quality,
}

/// M (n x n) and C (m x n), checked.
pub struct Matrices(UserSystem<Frozen>);

impl Matrices {
    /// # Errors
    /// `Argument` for shapes that do not fit, numbers that are not finite, and a mass matrix that is none.
    pub fn new(mass: Matrix, c: Matrix) -> Result<Self, AnalysisError> {
        let n = mass.rows();
        let refuse = |argument: &'static str, message: String| Err(AnalysisError::Argument { argument, message });
        if n == 0 || n != mass.cols() {
            return refuse("mass", format!("mass is {n} x {}; it must be square and not empty", mass.cols()));
        }
        if c.cols() != n {
            let message = format!(
                "jacobian has {} columns, mass is {n} x {n}; both must have one column for each \
                coordinate",
                c.cols()
            );
            return refuse("jacobian", message);
        }
        for (what, x) in [("mass", &mass), ("jacobian", &c)] {
            if x.data().iter().any(|x| !x.is_finite()) {
                return refuse(what, format!("{what} has an entry that is not finite"));
            }
        }
        let size = mass.max_abs();
        for i in 0..n {
            for j in 0..i {
                let (a, b) = (mass[(i, j)], mass[(j, i)]);
                // what summing in another order can leave
                if (a - b).abs() > tolerance::EQUAL * size {
                    let message = format!(
                        "mass is not symmetric: M[{i},{j}] = {a}, M[{j},{i}] = {b}; symmetrise it as (M + M^T) / 2"
                    );
                    return refuse("mass", message);
                }
            }
        }
        let mut l = mass.data().to_vec();
        if let Err(e) = dense::cholesky(&mut l, n) {
            let message = format!(
                "mass is not positive definite: pivot {:.3e} at coordinate {}; every coordinate needs inertia",
                e.pivot, e.index
            );
            return refuse("mass", message);
        }
        Ok(Self(UserSystem::new(Frozen { mass, c })))
    }

    fn n(&self) -> usize {
        self.0.equations.mass.rows()
    }

    /// Reduction with the rank of C and no motion.
    fn reduction(&self) -> Result<(Reduction<'_, UserSystem<Frozen>>, Vec<f64>), SystemError> {
        let (n, c) = (self.n(), &self.0.equations.c);
        let q = vec![0.0; n];
        let mut probe = Reduction::new(&self.0, 0);
        probe.position(0.0, &q)?;
        probe.refresh_scales(0.0, &q)?;
        // no motion to test redundancy with: the rank is that of the matrix given
        let rank = independent_rows(&Pattern::dense(c.rows(), n), c.data(), probe.scales(), tolerance::REDUNDANT).rank;
        Ok((Reduction::new(&self.0, rank), q))
    }

    /// ρ of every coordinate.                                                                   (P4)
    ///
    /// # Errors
    /// Where no partition can be found; likewise below.
    pub fn measure(&self) -> Result<Vec<f64>, AnalysisError> {
        Ok(self.choose(&Choice { threshold: 1.0, ..Choice::default() })?.rho)
    }

    /// A partition by a rule, or the one named.
    ///
    /// # Errors
    /// `Argument` also for an invalid choice.
    pub fn choose(&self, choice: &Choice) -> Result<Chosen, AnalysisError> {
        let n = self.n();
        if choice.threshold < 1.0 || choice.threshold.is_nan() {
            let message = format!("threshold = {}; a switch must enlarge the volume: give 1 or more", choice.threshold);
            return Err(AnalysisError::Argument { argument: "threshold", message });
        }
        if let Some(i) = choice.fixed.iter().flatten().find(|&&i| i >= n) {
            let message = format!("fixed names coordinate {i}; there are {n}, numbered from 0");
            return Err(AnalysisError::Argument { argument: "fixed", message });
        }
        let (mut r, q) = self.reduction()?;
        let weights = choice.weights.as_deref();
        match (&choice.fixed, choice.rule) {
            (Some(fixed), _) => start::choose_partition(&mut r, 0.0, &q, None, Some(fixed))?,
            (None, Selection::Collective) => {
                start::choose_with_threshold(&mut r, 0.0, &q, weights, choice.threshold)?;
            }
            (None, rule) => {
                chooser::check(rule, weights, None)?;
                chooser::choose_by(&mut r, 0.0, &q, rule, weights)?;
            }
        }
        r.evaluate(0.0, &q, &vec![0.0; r.k()])?;
        let mut rho = vec![0.0; n];
        r.measure(0.0, &q, &mut rho)?;
        let quality = r.quality(0.0, &q)?;
        Ok(Chosen { split: Split::new(0.0, &r.planned.partition, &self.0.equations.c)?, rho, quality })
    }

    /// Lengths, metrics and projectors; of redundant rows only those kept by the partition are used.
    ///
    /// D is that of the partition, or of S (k x n) if given: `D_S = (S Dᵀ)⁻ᵀ D` of any partition.      (36)
    ///
    /// # Errors
    /// As `choose`; `Argument` for an S of another shape, or that leaves a motion undetermined.
    pub fn geometry(
        &self,
        fixed: Option<Vec<usize>>,
        selector: Option<&Matrix>,
    ) -> Result<(Geometry, Split), AnalysisError> {
        let split = self.choose(&Choice { threshold: 1.0, fixed, ..Choice::default() })?.split;
        let Frozen { mass, c } = &self.0.equations;
        let mut kept = Matrix::new(split.rows.len(), self.n());
        for (i, &row) in split.rows.iter().enumerate() {
            kept.row_mut(i).copy_from_slice(c.row(row));
        }
        let name = |i: usize| self.0.equations.name(i);
        let mut chosen = Matrix::new(split.independent.len(), self.n());
        split.independent.iter().enumerate().for_each(|(j, &i)| chosen[(j, i)] = 1.0);
        let found = Geometry::new(mass, &kept, (&chosen, &split.d), &name)?;
        let Some(s) = selector else { return Ok((found, split)) };
        let d = basis_of_selector(s, &split.d, &found.k)?;
        Ok((Geometry::new(mass, &kept, (s, &d), &name)?, split))
    }
}

/// `D_S = (S Dᵀ)⁻ᵀ D` (k x n), so that `S D_Sᵀ = 1`; pivots are judged in the natural units `scales` of the velocities.
fn basis_of_selector(s: &Matrix, d: &Matrix, scales: &[f64]) -> Result<Matrix, AnalysisError> {
    let (k, n) = (d.rows(), d.cols());
    let refuse = |message: String| AnalysisError::Argument { argument: "selector", message };
    if (s.rows(), s.cols()) != (k, n) {
        let message =
            format!("selector is {} x {}; with {k} degrees of freedom it must be {k} x {n}", s.rows(), s.cols());
        return Err(refuse(message));
    }
    let length = |x: f64, (entry, scale): (&f64, f64)| x.hypot(entry * scale);
    let own: Vec<f64> = (0..k).map(|i| s.row(i).iter().zip(scales.iter().copied()).fold(0.0, length)).collect();
    let other: Vec<f64> =
        (0..k).map(|i| d.row(i).iter().zip(scales.iter().map(|x| 1.0 / x)).fold(0.0, length)).collect();
    let mut sd = s.matmul(&d.transpose());
    for i in 0..k {
        sd.row_mut(i).iter_mut().zip(&other).for_each(|(x, length)| *x /= own[i] * length);
    }
    let (mut lu, mut pivots) = (sd.into_vec(), vec![0; k]);
    let ratio = dense::lu(&mut lu, k, &mut pivots).map_or(0.0, |()| dense::lu_pivot_ratio(&lu, k)).max(0.0);
    if k > 0 && ratio < tolerance::SINGULAR_PIVOT {
        return Err(refuse(format!(
            "selector leaves a motion undetermined: S D^T has a scaled pivot of {ratio:.2e} (limit {:.0e}); its rows must be \
             independent of each other and of the constraints",
            tolerance::SINGULAR_PIVOT
        )));
    }
    // column by column
    let mut columns = d.transpose();
    for j in 0..n {
        let x = columns.row_mut(j);
        x.iter_mut().zip(&other).for_each(|(x, length)| *x /= length);
        dense::lu_solve_transposed(&lu, k, &pivots, x);
        x.iter_mut().zip(&own).for_each(|(x, length)| *x /= length);
    }
    Ok(columns.transpose())
}
