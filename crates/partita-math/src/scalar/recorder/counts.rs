//! How many operations of each kind a recording consists of.

use super::{Operation, Recording};

/// Operations by kind; inputs and constants cost nothing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct OperationCounts {
    /// Sums, differences and changes of sign.
    pub sums: usize,
    /// Products.
    pub products: usize,
    /// Quotients and roots.
    pub quotients: usize,
    /// Sines, cosines, angles and other powers.
    pub functions: usize,
    /// Absolute values, roundings and the taking of one of two numbers.
    pub cases: usize,
}

impl OperationCounts {
    /// All of them.
    pub fn total(&self) -> usize {
        self.sums + self.products + self.quotients + self.functions + self.cases
    }
}

impl Recording {
    /// Its operations by kind; those of a [`lean`](Self::lean) recording are the ones that its outputs need.
    pub fn counts(&self) -> OperationCounts {
        use Operation as O;
        let mut counts = OperationCounts::default();
        for operation in &self.operations {
            let kind = match operation {
                O::Input(_) | O::Constant(_) => continue,
                O::Add(..) | O::Sub(..) | O::Neg(_) => &mut counts.sums,
                O::Mul(..) | O::Scale(..) => &mut counts.products,
                O::Div(..) | O::OverOrZero(..) | O::Sqrt(_) | O::Hypot(..) => &mut counts.quotients,
                O::Power(..) | O::Sin(_) | O::Cos(_) | O::Atan2(..) => &mut counts.functions,
                O::Abs(_) | O::Round(_) | O::Max(..) | O::Min(..) | O::WherePositive(..) | O::Reached(..) => {
                    &mut counts.cases
                }
            };
            *kind += 1;
        }
        counts
    }
}

#[cfg(test)]
mod tests {
    use super::OperationCounts;
    use crate::scalar::{Cases, Recorder, Recording, Scalar};

    #[test]
    fn each_kind_once_and_equal_operations_once() {
        let made = Recording::new(2, |x| {
            let root = (x[0] * x[0] + x[1] * x[1]).sqrt();
            let again = (x[0] * x[0] + x[1] * x[1]).sqrt();
            let unused = x[0].sin_cos().0;
            let _ = unused * Recorder::from_f64(2.0);
            Ok::<_, ()>(vec![root.max(again.atan2(x[0]))])
        });
        let lean = made.unwrap().lean().counts();
        assert_eq!(lean, OperationCounts { sums: 1, products: 2, quotients: 1, functions: 1, cases: 1 });
        assert_eq!(lean.total(), 6);
    }
}
