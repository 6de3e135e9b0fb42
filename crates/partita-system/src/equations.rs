//! User-defined equations S1-S5: dense matrices from functions, as a [`ConstrainedSystem`](crate::ConstrainedSystem).

mod closing;
pub mod derivatives;
pub mod full;

use crate::closing::Closing;
use crate::system::{project_dense, Guards, Levels, Manifold, Methods, Metric, Varied};
use crate::system::{Structure, SystemError, SystemRef, Tangent};
use closing::UserClosing;
use partita_math::dense;
use partita_math::elimination::Pattern;

/// User-defined equations of a constrained system. Matrices are dense, row by row.
pub trait Equations: Send + Sync {
    /// Coordinates (and velocities) n.
    fn n(&self) -> usize;
    /// Rows of C.
    fn rows(&self) -> usize;
    /// Rows of Φ: the first ones; the rest of C is nonholonomic.
    fn holonomic(&self) -> usize;
    /// Name of coordinate i.
    fn name(&self, i: usize) -> String;
    /// Whether a is not zero.
    fn rheonomic(&self) -> bool;
    /// M(t, q) (n x n).
    fn mass(&self, t: f64, q: &[f64], out: &mut [f64]) -> Result<(), SystemError>;
    /// h(t, q, v) (n).
    fn forces(&self, t: f64, q: &[f64], v: &[f64], out: &mut [f64]) -> Result<(), SystemError>;
    /// Φ(t, q) (holonomic).
    fn constraints(&self, t: f64, q: &[f64], out: &mut [f64]) -> Result<(), SystemError>;
    /// C(t, q) (rows x n).
    fn jacobian(&self, t: f64, q: &[f64], out: &mut [f64]) -> Result<(), SystemError>;
    /// a(t, q) (rows).
    fn rate(&self, t: f64, q: &[f64], out: &mut [f64]) -> Result<(), SystemError>;
    /// b(t, q, v) (rows).
    fn bias(&self, t: f64, q: &[f64], v: &[f64], out: &mut [f64]) -> Result<(), SystemError>;
    /// The function that closes the loops, if there is one.
    fn explicit_closing(&self) -> Option<&dyn ExplicitClosing> {
        None
    }
}

/// A closed form of the positions of [`Equations`].                                                (37)
pub trait ExplicitClosing {
    /// The coordinates that [`close`](Self::close) computes: the dependent ones.
    fn dependent(&self) -> &[usize];
    /// Replace those coordinates in q by the ones that close the loops.
    ///
    /// q holds their last values on entry: an angle should be returned to the nearest whole turn. Where the loops
    /// cannot close, fail with [`SystemError::Limit`] or return non-finite values: the step is then shortened.
    ///
    /// # Errors
    /// `Limit`, and errors of the function.
    fn close(&self, t: f64, q: &mut [f64]) -> Result<(), SystemError>;
}

/// [`Equations`] as a constrained system.
pub struct UserSystem<E: Equations> {
    /// The equations.
    pub equations: E,
    structure: Structure,
    /// Whether derivatives are to be compared with differences.
    checked: bool,
}

/// The quantities last evaluated.
pub struct UserScratch {
    mass: Vec<f64>,
    mass_known: bool,
    factor: Vec<f64>,
    factor_known: bool,
    h: Vec<f64>,
    h_known: bool,
    work: Vec<f64>,
}

impl<E: Equations> UserSystem<E> {
    /// Wrap equations.
    pub fn new(equations: E) -> Self {
        let pattern = Pattern::dense(equations.rows(), equations.n());
        let mut structure = Structure::of_equations(pattern, equations.holonomic(), |i| equations.name(i));
        structure.rheonomic = equations.rheonomic();
        Self { equations, structure, checked: false }
    }

    /// With derivatives that are compared with differences wherever a motion is examined.
    #[must_use]
    pub fn checked(mut self, checked: bool) -> Self {
        self.checked = checked;
        self
    }

    /// Whether derivatives are to be compared with differences.
    pub fn is_checked(&self) -> bool {
        self.checked
    }

    /// With these characteristic lengths: the large displacement of each coordinate, 1 for an angle.
    #[must_use]
    pub fn with_lengths(mut self, lengths: Vec<f64>) -> Self {
        let velocities = &mut self.structure.velocities;
        if lengths.len() == velocities.len() {
            velocities.iter_mut().zip(lengths).for_each(|(v, length)| v.displacement = length);
        }
        self
    }

    fn mass(&self, t: f64, q: &[f64], s: &mut UserScratch) -> Result<(), SystemError> {
        if !s.mass_known {
            self.equations.mass(t, q, &mut s.mass)?;
            s.mass_known = true;
        }
        Ok(())
    }

    fn factor(&self, t: f64, q: &[f64], s: &mut UserScratch) -> Result<(), SystemError> {
        self.mass(t, q, s)?;
        if !s.factor_known {
            s.factor.copy_from_slice(&s.mass);
            dense::cholesky(&mut s.factor, self.equations.n())
                .map_err(|e| SystemError::Mass { name: self.equations.name(e.index), pivot: e.pivot })?;
            s.factor_known = true;
        }
        Ok(())
    }

    fn h(&self, t: f64, q: &[f64], v: &[f64], s: &mut UserScratch) -> Result<(), SystemError> {
        if !s.h_known {
            self.equations.forces(t, q, v, &mut s.h)?;
            s.h_known = true;
        }
        Ok(())
    }
}

impl<E: Equations> Levels for UserSystem<E> {
    type Scratch = UserScratch;
    fn structure(&self) -> &Structure {
        &self.structure
    }
    fn scratch(&self) -> UserScratch {
        let n = self.equations.n();
        UserScratch {
            mass: vec![0.0; n * n],
            mass_known: false,
            factor: vec![0.0; n * n],
            factor_known: false,
            h: vec![0.0; n],
            h_known: false,
            work: vec![0.0; n],
        }
    }
    fn position(
        &self,
        t: f64,
        q: &[f64],
        s: &mut UserScratch,
        phi: &mut [f64],
        c: &mut [f64],
        a: &mut [f64],
    ) -> Result<(), SystemError> {
        (s.mass_known, s.factor_known, s.h_known) = (false, false, false);
        if self.equations.rows() == 0 {
            return Ok(());
        }
        self.equations.constraints(t, q, phi)?;
        self.equations.jacobian(t, q, c)?;
        if self.structure.rheonomic {
            self.equations.rate(t, q, a)?;
        }
        Ok(())
    }
    fn velocity(&self, t: f64, q: &[f64], v: &[f64], s: &mut UserScratch, b: &mut [f64]) -> Result<(), SystemError> {
        s.h_known = false;
        if self.equations.rows() == 0 {
            return Ok(());
        }
        self.equations.bias(t, q, v, b)
    }
    fn dynamics(
        &self,
        t: f64,
        q: &[f64],
        v: &[f64],
        s: &mut UserScratch,
        mass: &mut [f64],
        h: &mut [f64],
    ) -> Result<(), SystemError> {
        self.mass(t, q, s)?;
        self.h(t, q, v, s)?;
        mass.copy_from_slice(&s.mass);
        h.copy_from_slice(&s.h);
        Ok(())
    }
    fn project(
        &self,
        t: f64,
        q: &[f64],
        v: &[f64],
        tangent: &Tangent,
        s: &mut UserScratch,
        md: &mut [f64],
        hd: &mut [f64],
    ) -> Result<(), SystemError> {
        self.mass(t, q, s)?;
        self.h(t, q, v, s)?;
        project_dense(&s.mass, &s.h, tangent, &mut s.work, md, hd);
        Ok(())
    }
    fn inverse_dynamics(
        &self,
        t: f64,
        q: &[f64],
        v: &[f64],
        vdot: &[f64],
        s: &mut UserScratch,
        out: &mut [f64],
    ) -> Result<(), SystemError> {
        self.mass(t, q, s)?;
        self.h(t, q, v, s)?;
        let n = vdot.len();
        for (i, x) in out.iter_mut().enumerate() {
            *x = dense::dot(&s.mass[i * n..(i + 1) * n], vdot) - s.h[i];
        }
        Ok(())
    }
}

impl<E: Equations> Metric for UserSystem<E> {
    fn inverse_mass_diagonal(
        &self,
        t: f64,
        q: &[f64],
        s: &mut UserScratch,
        out: &mut [f64],
    ) -> Result<(), SystemError> {
        self.factor(t, q, s)?;
        let n = out.len();
        // |L⁻¹ e_i|²
        for i in 0..n {
            s.work.fill(0.0);
            s.work[i] = 1.0;
            dense::cholesky_forward(&s.factor, n, &mut s.work);
            out[i] = dense::dot(&s.work, &s.work);
        }
        Ok(())
    }
    fn inverse_mass_columns(
        &self,
        t: f64,
        q: &[f64],
        which: &[usize],
        s: &mut UserScratch,
        out: &mut [f64],
    ) -> Result<(), SystemError> {
        self.factor(t, q, s)?;
        let n = self.equations.n();
        for (j, &c) in which.iter().enumerate() {
            s.work.fill(0.0);
            s.work[c] = 1.0;
            dense::cholesky_solve(&s.factor, n, &mut s.work);
            for i in 0..n {
                out[i * which.len() + j] = s.work[i];
            }
        }
        Ok(())
    }
}

impl<E: Equations> Manifold for UserSystem<E> {}

impl<E: Equations> Guards for UserSystem<E> {}

impl<E: Equations> Varied for UserSystem<E> {}

impl<E: Equations> Methods for UserSystem<E> {
    fn closing<'s>(
        system: SystemRef<'s, Self>,
        t: f64,
        q: &[f64],
        inputs: Option<&[usize]>,
    ) -> Result<Box<dyn Closing + Send + 's>, SystemError>
    where
        Self: 's,
    {
        Ok(Box::new(UserClosing::new(system, t, q, inputs)?))
    }
}
