//! On which inputs the outputs of a recording depend.

use super::{Operation, Recording};

impl Recording {
    /// For each output the inputs that its derivatives depend on, of up to 64 marked ones: `marks` has a bit for each of them,
    /// 0 elsewhere.
    ///
    /// What a case is decided by does not count, only what may be taken; products with the constant 0 are 0. An output may
    /// depend on fewer inputs, never on more.
    ///
    /// # Panics
    /// If `marks` is shorter than the inputs.
    pub fn dependences(&self, marks: &[u64]) -> Vec<u64> {
        use Operation as O;
        assert!(marks.len() >= self.inputs, "{} marks for a recording of {}", marks.len(), self.inputs);
        // the inputs, or none and the constant 0
        let mut of: Vec<(u64, bool)> = Vec::with_capacity(self.operations.len());
        for operation in &self.operations {
            let at = |slot: u32| of[slot as usize];
            let either = |x: u32, y: u32| (at(x).0 | at(y).0, at(x).1 && at(y).1);
            of.push(match *operation {
                O::Input(k) => (marks[k as usize], false),
                O::Constant(c) => (0, c == 0.0),
                O::Mul(x, y) if at(x).1 || at(y).1 => (0, true),
                O::Div(x, _) | O::OverOrZero(x, _) if at(x).1 => (0, true),
                O::Scale(_, factor) if factor == 0.0 => (0, true),
                O::Scale(x, _) | O::Neg(x) | O::Abs(x) => at(x),
                O::Add(x, y) | O::Sub(x, y) | O::Max(x, y) | O::Min(x, y) | O::WherePositive(_, x, y) => either(x, y),
                O::Mul(x, y) | O::Div(x, y) | O::OverOrZero(x, y) | O::Atan2(x, y) | O::Hypot(x, y) => {
                    (either(x, y).0, false)
                }
                O::Sqrt(x) | O::Power(x, _) | O::Sin(x) | O::Cos(x) => (at(x).0, false),
                O::Round(_) | O::Reached(..) => (0, false),
            });
        }
        self.outputs.iter().map(|&slot| of[slot as usize].0).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scalar::{Cases, Recorder, Scalar};

    #[test]
    fn outputs_depend_on_what_they_are_made_of() {
        let made = Recording::new(4, |x| {
            let nothing = Recorder::zero() * x[0];
            let taken = x[0].where_positive(x[1], x[2] * x[3]);
            Ok::<_, ()>(vec![x[0] + x[1].sin_cos().0, nothing + x[3], taken, x[2].round(), nothing.sqrt(), x[3] / x[1]])
        })
        .unwrap();
        assert_eq!(made.dependences(&[1, 2, 4, 8]), [3, 8, 14, 0, 0, 10]);
        assert_eq!(made.dependences(&[0, 1, 0, 0]), [1, 0, 1, 0, 0, 1]);
    }
}
