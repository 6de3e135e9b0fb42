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

/// Free axes of a joint of one kind, at most three, and the Cholesky factor of their Gram matrix.
struct Lines<S> {
    count: usize,
    axes: [Vec3<S>; 3],
    /// Of each, its number among all free axes.
    numbers: [usize; 3],
    gram: [S; 9],
    /// Positive unless the axes are in line (gimbal lock).
    apart: S,
}

impl<S: Scalar> Lines<S> {
    fn new(axes: impl Iterator<Item = (usize, Vec3<S>)>) -> Self {
        let (o, mut count) = (S::zero(), 0);
        let (mut lines, mut numbers) = ([Vec3::zero(); 3], [0; 3]);
        for (i, a) in axes {
            (lines[count], numbers[count]) = (a, i);
            count += 1;
        }
        let (n, mut gram, mut apart) = (count, [o; 9], S::one());
        for i in 0..n {
            for j in 0..n {
                gram[i * n + j] = lines[i].dot(lines[j]);
            }
        }
        let diagonal: [S; 3] = std::array::from_fn(|i| if i < n { gram[i * n + i] } else { S::one() });
        if n > 0 {
            dense::cholesky_straight(&mut gram[..n * n], n);
        }
        for i in 0..n {
            let (root, least) = (gram[i * n + i], diagonal[i].scale(tolerance::LOST_PIVOT));
            // NaN is not above 0
            apart = apart.where_positive(root * root - least, apart);
        }
        Self { count, axes: lines, numbers, gram, apart }
    }

    /// x with its components along the axes replaced by those wanted. Axes in line leave x unchanged: nothing
    /// distinguishes them.
    fn replace(&self, x: Vec3<S>, wanted: &impl Fn(usize) -> S) -> Vec3<S> {
        let n = self.count;
        if n == 0 {
            return x;
        }
        let axes = &self.axes[..n];
        let mut off = [S::zero(); 3];
        for (i, a) in axes.iter().enumerate() {
            off[i] = wanted(self.numbers[i]) - a.dot(x);
        }
        dense::cholesky_solve(&self.gram[..n * n], n, &mut off);
        let replaced = axes.iter().zip(off).fold(x, |x, (a, k)| x + a.times(k));
        Vec3::where_positive(self.apart, replaced, x)
    }
}

/// The free axes of a joint.
pub(crate) struct Free<S> {
    turns: Lines<S>,
    slides: Lines<S>,
}

impl<S: Scalar> Free<S> {
    /// Of axes that turn (true) or slide.
    pub(crate) fn new(axes: &[(bool, Vec3<S>)]) -> Self {
        let of = |turns: bool| Lines::new(axes.iter().enumerate().filter(|x| x.1 .0 == turns).map(|(i, a)| (i, a.1)));
        Self { turns: of(true), slides: of(false) }
    }

    /// `w` with its components along the axes replaced by those wanted of each.
    pub(crate) fn with_along(&self, w: &Wrench<S>, wanted: impl Fn(usize) -> S) -> Wrench<S> {
        Wrench { moment: self.turns.replace(w.moment, &wanted), force: self.slides.replace(w.force, &wanted) }
    }
}

/// The shortest wrench with these efforts along the free axes (turns, slides) of a joint. Where two turns are not
/// perpendicular it is not along the axis of an effort: that would do work on the other turn.
pub fn wrench_of_efforts(axes: &[(bool, Vec3<f64>)], efforts: &[f64]) -> Wrench {
    Free::new(axes).with_along(&Wrench::default(), |i| efforts[i])
}
