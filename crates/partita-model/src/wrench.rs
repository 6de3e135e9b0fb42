//! Wrenches, and their components along the free axes of a joint.

use partita_math::dense;
use partita_math::scalar::Scalar;
use partita_math::spatial::{Mat3, Vec3};
use partita_math::tolerance;

/// Moment about a point, and force.
#[derive(Clone, Copy, Debug)]
pub struct Wrench<S = f64> {
    /// Moment.
    pub moment: Vec3<S>,
    /// Force.
    pub force: Vec3<S>,
}

impl<S: Scalar> Default for Wrench<S> {
    fn default() -> Self {
        Self { moment: Vec3::zero(), force: Vec3::zero() }
    }
}

impl<S: Scalar> Wrench<S> {
    /// The same wrench about a point that lies `arm` before the old one (old = new + arm).
    pub(crate) fn about(&self, arm: Vec3<S>) -> Self {
        Self { moment: self.moment + arm.cross(self.force), force: self.force }
    }
    pub(crate) fn add(&mut self, o: &Self) {
        self.moment += o.moment;
        self.force += o.force;
    }
    pub(crate) fn opposite(&self) -> Self {
        Self { moment: -self.moment, force: -self.force }
    }
    /// The part out of the x-y plane of the mechanism.
    pub(crate) fn across(&self) -> Self {
        let ([mx, my, _], [_, _, fz], o) = (self.moment.0, self.force.0, S::zero());
        Self { moment: Vec3([mx, my, o]), force: Vec3([o, o, fz]) }
    }
    /// In the axes of the world.
    pub(crate) fn out_of(&self, basis: &Mat3<S>) -> Self {
        Self { moment: basis.apply_transposed(self.moment), force: basis.apply_transposed(self.force) }
    }
}

/// Along `axes` (at most three): replace the components of x by `wanted`. Axes in line (gimbal lock) leave x unchanged:
/// nothing distinguishes them.
fn replace<S: Scalar>(x: Vec3<S>, axes: &[Vec3<S>], wanted: &[S]) -> Vec3<S> {
    let n = axes.len();
    if n == 0 {
        return x;
    }
    let mut gram = [S::zero(); 9];
    let mut off = [S::zero(); 3];
    for i in 0..n {
        for j in 0..n {
            gram[i * n + j] = axes[i].dot(axes[j]);
        }
        off[i] = wanted[i] - axes[i].dot(x);
    }
    let mut apart = S::one();
    let diagonal: [S; 3] = std::array::from_fn(|i| if i < n { gram[i * n + i] } else { S::one() });
    dense::cholesky_straight(&mut gram[..n * n], n);
    for i in 0..n {
        let (root, least) = (gram[i * n + i], diagonal[i].scale(tolerance::LOST_PIVOT));
        // NaN is not above 0
        apart = apart.where_positive(root * root - least, apart);
    }
    dense::cholesky_solve(&gram[..n * n], n, &mut off);
    let replaced = axes.iter().zip(off).fold(x, |x, (a, k)| x + a.times(k));
    Vec3::where_positive(apart, replaced, x)
}

/// `w` with its components along the free axes of a joint replaced by those wanted of each.
pub(crate) fn with_along<S: Scalar>(axes: &[(bool, Vec3<S>)], w: &Wrench<S>, wanted: impl Fn(usize) -> S) -> Wrench<S> {
    let along = |x: Vec3<S>, turns: bool| {
        let (mut lines, mut efforts, mut n) = ([Vec3::zero(); 3], [S::zero(); 3], 0);
        for (i, a) in axes.iter().enumerate().filter(|(_, a)| a.0 == turns) {
            (lines[n], efforts[n]) = (a.1, wanted(i));
            n += 1;
        }
        replace(x, &lines[..n], &efforts[..n])
    };
    Wrench { moment: along(w.moment, true), force: along(w.force, false) }
}

/// The shortest wrench with these efforts along the free axes (turns, slides) of a joint. Where two turns are not
/// perpendicular it is not along the axis of an effort: that would do work on the other turn.
pub fn wrench_of_efforts(axes: &[(bool, Vec3<f64>)], efforts: &[f64]) -> Wrench {
    with_along(axes, &Wrench::default(), |i| efforts[i])
}
