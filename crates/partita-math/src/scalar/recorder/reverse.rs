//! A recording backwards: the gradient of a weighed sum of its outputs by all inputs, at a few times the cost of the outputs,
//! however many inputs there are.
//!
//! ```text
//! x̄ = Σ ∂f/∂x f̄   over all operations f that use x, from the last one to the first
//! ```
//!
//! Written over any scalar: over plain numbers it is evaluated, over recording ones it is a recording itself.

use super::{Operation, Recorder, Recording};
use crate::scalar::Scalar;

/// The derivative of a constant power, at least 1.
fn slope_of_power<S: Scalar>(x: S, exponent: f64) -> S {
    let linear = exponent == 1.0;
    let slope = if linear { S::one() } else { x.power(exponent).over_or_zero(x) };
    slope.scale(exponent)
}

impl Recording {
    /// The values of all operations.
    fn values<S: Scalar>(&self, inputs: &[S], out: &mut Vec<S>) {
        out.clear();
        out.reserve(self.operations.len());
        for operation in &self.operations {
            let at = |slot: u32| out[slot as usize];
            let x = match *operation {
                Operation::Input(k) => inputs[k as usize],
                Operation::Constant(c) => S::from_f64(c),
                Operation::Add(x, y) => at(x) + at(y),
                Operation::Sub(x, y) => at(x) - at(y),
                Operation::Mul(x, y) => at(x) * at(y),
                Operation::Div(x, y) => at(x) / at(y),
                Operation::OverOrZero(x, y) => at(x).over_or_zero(at(y)),
                Operation::Neg(x) => -at(x),
                Operation::Sqrt(x) => at(x).sqrt(),
                Operation::Power(x, exponent) => at(x).power(exponent),
                Operation::Sin(x) => at(x).sin_cos().0,
                Operation::Cos(x) => at(x).sin_cos().1,
                Operation::Atan2(x, y) => at(x).atan2(at(y)),
                Operation::Hypot(x, y) => at(x).hypot(at(y)),
                Operation::Abs(x) => at(x).abs(),
                Operation::Round(x) => at(x).round(),
                Operation::Max(x, y) => at(x).max(at(y)),
                Operation::Min(x, y) => at(x).min(at(y)),
                Operation::WherePositive(x, y, n) => at(x).where_positive(at(y), at(n)),
                Operation::Reached(x, b) => (S::from_f64(b) - at(x)).where_positive(-S::one(), S::one()),
                Operation::Scale(x, factor) => at(x).scale(factor),
            };
            out.push(x);
        }
    }

    /// Adds to `gradient` the derivatives by the inputs of the outputs, each with its weight; `values` and `adjoints` are
    /// memory.
    ///
    /// # Panics
    /// If `inputs`, `weights` or `gradient` are shorter than the recording requires.
    pub fn pull_back<S: Scalar>(
        &self,
        inputs: &[S],
        weights: &[S],
        (values, adjoints): (&mut Vec<S>, &mut Vec<S>),
        gradient: &mut [S],
    ) {
        self.values(inputs, values);
        adjoints.clear();
        adjoints.resize(self.operations.len(), S::zero());
        for (&slot, weight) in self.outputs.iter().zip(weights) {
            adjoints[slot as usize] += *weight;
        }
        for (i, operation) in self.operations.iter().enumerate().rev() {
            let (before, rest) = adjoints.split_at_mut(i);
            let (own, at) = (rest[0], |slot: u32| values[slot as usize]);
            let mut add = |slot: u32, x: S| before[slot as usize] += x;
            match *operation {
                Operation::Input(k) => gradient[k as usize] += own,
                Operation::Constant(_) | Operation::Round(_) | Operation::Reached(..) => {}
                Operation::Add(x, y) => {
                    add(x, own);
                    add(y, own);
                }
                Operation::Sub(x, y) => {
                    add(x, own);
                    add(y, -own);
                }
                Operation::Mul(x, y) => {
                    add(x, own * at(y));
                    add(y, own * at(x));
                }
                Operation::Div(x, y) => {
                    let part = own / at(y);
                    add(x, part);
                    add(y, -(part * values[i]));
                }
                Operation::OverOrZero(x, y) => {
                    let part = own.over_or_zero(at(y));
                    add(x, part);
                    add(y, -(part * values[i]));
                }
                Operation::Neg(x) => add(x, -own),
                // where the root is 0 only what does not depend on it is differentiated
                Operation::Sqrt(x) => add(x, own.over_or_zero(values[i].scale(2.0))),
                Operation::Power(x, exponent) => {
                    add(x, own * slope_of_power(at(x), exponent));
                }
                Operation::Sin(x) => add(x, own * at(x).sin_cos().1),
                Operation::Cos(x) => add(x, -(own * at(x).sin_cos().0)),
                Operation::Atan2(y, x) => {
                    let square = at(x) * at(x) + at(y) * at(y);
                    let part = own.over_or_zero(square);
                    add(y, part * at(x));
                    add(x, -(part * at(y)));
                }
                Operation::Hypot(x, y) => {
                    let part = own.over_or_zero(values[i]);
                    add(x, part * at(x));
                    add(y, part * at(y));
                }
                Operation::Abs(x) => add(x, (-at(x)).where_positive(-own, own)),
                Operation::Max(x, y) => {
                    let second = at(y) - at(x);
                    add(x, second.where_positive(S::zero(), own));
                    add(y, second.where_positive(own, S::zero()));
                }
                Operation::Min(x, y) => {
                    let second = at(x) - at(y);
                    add(x, second.where_positive(S::zero(), own));
                    add(y, second.where_positive(own, S::zero()));
                }
                Operation::WherePositive(x, y, n) => {
                    add(y, at(x).where_positive(own, S::zero()));
                    add(n, at(x).where_positive(S::zero(), own));
                }
                Operation::Scale(x, factor) => add(x, own.scale(factor)),
            }
        }
    }

    /// The derivatives along a direction as a recording. Its inputs are the first `moving` ones of this one and their changes,
    /// then the others and theirs; its outputs those of this one and their changes.
    #[must_use]
    pub fn tangent(&self, moving: usize) -> Self {
        let (all, others) = (self.inputs, self.inputs - moving);
        let made = Self::new(2 * all, |x: &[Recorder]| {
            let (first, rest) = x.split_at(2 * moving);
            let inputs: Vec<Recorder> = first[..moving].iter().chain(&rest[..others]).copied().collect();
            let changes: Vec<Recorder> = first[moving..].iter().chain(&rest[others..]).copied().collect();
            let (mut values, mut along) = (Vec::new(), Vec::with_capacity(self.operations.len()));
            self.values(&inputs, &mut values);
            for (i, operation) in self.operations.iter().enumerate() {
                let change = self.change(*operation, i, (&values, &along), &changes);
                along.push(change);
            }
            let of = |from: &[Recorder]| self.outputs.iter().map(|&slot| from[slot as usize]).collect::<Vec<_>>();
            Ok::<_, std::convert::Infallible>([of(&values), of(&along)].concat())
        });
        match made {
            Ok(made) => made.lean(),
            Err(never) => match never {},
        }
    }

    /// How the result of operation i changes with its operands.
    fn change<S: Scalar>(&self, operation: Operation, i: usize, (values, along): (&[S], &[S]), changes: &[S]) -> S {
        let at = |slot: u32| values[slot as usize];
        let d = |slot: u32| along[slot as usize];
        match operation {
            Operation::Input(k) => changes[k as usize],
            Operation::Constant(_) | Operation::Round(_) | Operation::Reached(..) => S::zero(),
            Operation::Add(x, y) => d(x) + d(y),
            Operation::Sub(x, y) => d(x) - d(y),
            Operation::Mul(x, y) => d(x) * at(y) + at(x) * d(y),
            Operation::Div(x, y) => (d(x) - values[i] * d(y)) / at(y),
            Operation::OverOrZero(x, y) => (d(x) - values[i] * d(y)).over_or_zero(at(y)),
            Operation::Neg(x) => -d(x),
            Operation::Sqrt(x) => d(x).over_or_zero(values[i].scale(2.0)),
            Operation::Power(x, exponent) => d(x) * slope_of_power(at(x), exponent),
            Operation::Sin(x) => d(x) * at(x).sin_cos().1,
            Operation::Cos(x) => -(d(x) * at(x).sin_cos().0),
            Operation::Atan2(y, x) => (at(x) * d(y) - at(y) * d(x)).over_or_zero(at(x) * at(x) + at(y) * at(y)),
            Operation::Hypot(x, y) => (at(x) * d(x) + at(y) * d(y)).over_or_zero(values[i]),
            Operation::Abs(x) => (-at(x)).where_positive(-d(x), d(x)),
            Operation::Max(x, y) => (at(y) - at(x)).where_positive(d(y), d(x)),
            Operation::Min(x, y) => (at(x) - at(y)).where_positive(d(y), d(x)),
            Operation::WherePositive(x, y, n) => at(x).where_positive(d(y), d(n)),
            Operation::Scale(x, factor) => d(x).scale(factor),
        }
    }

    /// The gradient as a recording: its inputs are those of this one, then a weight for each output; its outputs are the
    /// derivatives by all inputs of this one.
    #[must_use]
    pub fn gradient(&self) -> Self {
        let made = Self::new(self.inputs + self.outputs.len(), |x: &[Recorder]| {
            let mut gradient = vec![Recorder::zero(); self.inputs];
            let (inputs, weights) = x.split_at(self.inputs);
            self.pull_back(inputs, weights, (&mut Vec::new(), &mut Vec::new()), &mut gradient);
            Ok::<_, std::convert::Infallible>(gradient)
        });
        match made {
            Ok(made) => made.lean(),
            Err(never) => match never {},
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scalar::Dual;

    /// Every operation once, of three numbers.
    fn mixture<S: Scalar>(x: &[S]) -> Vec<S> {
        let (s, c) = (x[0] * x[1]).sin_cos();
        let mut y = (s + S::from_f64(2.0)).sqrt() / (c.scale(0.5) - S::from_f64(3.0));
        y += x[2].abs() * s.atan2(c + x[2]) - s.hypot(c.scale(2.0)) + (x[0].scale(3.0)).round() * x[1];
        y -= x[2].abs().power(1.5) + x[1].power(3.0);
        y += s.max(x[2]) - x[0].min(s) * c.where_positive(x[1], s);
        let (start, [a, b, c, d]) = x[0].interval(&TABLE.0, &TABLE.1);
        let z = x[0] - start;
        vec![y.over_or_zero(x[1]) + -x[0], ((a * z + b) * z + c) * z + d * x[2]]
    }

    const TABLE: ([f64; 4], [[f64; 4]; 3]) =
        ([-2.0, -0.5, 0.7, 2.0], [[0.1, 0.2, -0.3, 0.4], [1.0, -2.0, 3.0, -4.0], [-0.2, 0.3, 0.5, 0.0]]);

    #[test]
    fn gradients_backwards_are_those_of_dual_numbers() {
        let recording = Recording::new(3, |x| Ok::<_, ()>(mixture(x))).unwrap();
        let (program, tangent) = (recording.gradient(), recording.tangent(2));
        let mut random = fastrand::Rng::with_seed(4);
        for _ in 0..200 {
            let x: [f64; 3] = std::array::from_fn(|_| 3.0 * random.f64() - 1.5);
            let weights: [f64; 2] = std::array::from_fn(|_| random.f64() - 0.5);
            let seeded: Vec<Dual<3>> =
                (0..3).map(|i| Dual::new(x[i], std::array::from_fn(|l| if l == i { 1.0 } else { 0.0 }))).collect();
            let found = mixture(&seeded);
            let mut plain = [0.0; 3];
            recording.pull_back(&x, &weights, (&mut Vec::new(), &mut Vec::new()), &mut plain);
            let (mut work, mut programmed) = (vec![0.0; program.len()], [0.0; 3]);
            program.evaluate(&[&x[..], &weights].concat(), &mut work, &mut programmed);
            for l in 0..3 {
                let change = |i: usize| if i == l { 1.0 } else { 0.0 };
                let inputs = [x[0], x[1], change(0), change(1), x[2], change(2)];
                let (mut work, mut out) = (vec![0.0; tangent.len()], [0.0; 4]);
                tangent.evaluate(&inputs, &mut work, &mut out);
                for (i, y) in found.iter().enumerate() {
                    assert!((out[i] - y.re).abs() <= 1e-12 * (1.0 + y.re.abs()));
                    assert!((out[2 + i] - y.eps[l]).abs() <= 1e-12 * (1.0 + y.eps[l].abs()));
                }
                let right: f64 = found.iter().zip(&weights).map(|(y, w)| w * y.eps[l]).sum();
                for own in [plain[l], programmed[l]] {
                    assert!((own - right).abs() <= 1e-12 * (1.0 + right.abs()), "{own} is not {right}");
                }
            }
        }
    }
}
