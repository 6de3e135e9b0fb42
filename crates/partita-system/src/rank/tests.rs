//! Branches whose degrees of freedom are known in closed form, also next to where they cross.

use super::{Branch, Cut, Kernel};
use crate::equations::{Equations, UserSystem};
use crate::error::Result;

/// z² f(x, y) = 0: z is locked on the plane z = 0 at the second order, where f is not 0; there other branches cross it.
#[derive(Clone, Copy)]
struct Locked {
    /// f and its gradient.
    f: fn(f64, f64) -> [f64; 3],
}

impl Equations for Locked {
    fn n(&self) -> usize {
        3
    }
    fn rows(&self) -> usize {
        1
    }
    fn holonomic(&self) -> usize {
        1
    }
    fn name(&self, i: usize) -> String {
        ["x", "y", "z"][i].into()
    }
    fn rheonomic(&self) -> bool {
        false
    }
    fn mass(&self, _: f64, _: &[f64], out: &mut [f64]) -> Result<()> {
        out.fill(0.0);
        (0..3).for_each(|i| out[4 * i] = 1.0);
        Ok(())
    }
    fn forces(&self, _: f64, _: &[f64], _: &[f64], out: &mut [f64]) -> Result<()> {
        out.fill(0.0);
        Ok(())
    }
    fn constraints(&self, _: f64, q: &[f64], out: &mut [f64]) -> Result<()> {
        out[0] = q[2] * q[2] * (self.f)(q[0], q[1])[0];
        Ok(())
    }
    fn jacobian(&self, _: f64, q: &[f64], out: &mut [f64]) -> Result<()> {
        let [f, x, y] = (self.f)(q[0], q[1]);
        out.copy_from_slice(&[q[2] * q[2] * x, q[2] * q[2] * y, 2.0 * q[2] * f]);
        Ok(())
    }
    fn rate(&self, _: f64, _: &[f64], out: &mut [f64]) -> Result<()> {
        out.fill(0.0);
        Ok(())
    }
    fn bias(&self, _: f64, _: &[f64], _: &[f64], out: &mut [f64]) -> Result<()> {
        out.fill(0.0);
        Ok(())
    }
}

fn branch(f: fn(f64, f64) -> [f64; 3], home: [f64; 2], level: f64) -> Branch {
    let system = UserSystem::new(Locked { f });
    Kernel::new(&system, 0.0).branch(&[home[0], home[1], 0.0], Cut::Level(level)).unwrap().unwrap()
}

#[test]
fn what_is_locked_at_the_second_order_does_not_move_wherever_branches_cross() {
    for level in [1e-5, 1e-7, 1e-9] {
        for home in [[0.7, 0.4], [0.3, -0.5], [-0.02, 0.9], [0.4, 0.01]] {
            // nowhere, along two lines, along a circle
            for f in [|_, _| [1.0, 0.0, 0.0], |x, y| [x * y, y, x], |x, y| [x * x + y * y - 1.0, 2.0 * x, 2.0 * y]] {
                let found = branch(f, home, level);
                assert_eq!((found.dof, found.kernel), (2, 3), "{home:?} at {level:e}");
            }
        }
    }
}

#[test]
fn what_is_not_locked_is_free() {
    for level in [1e-3, 1e-7] {
        let found = branch(|_, _| [0.0; 3], [0.7, 0.4], level);
        assert_eq!((found.dof, found.kernel), (3, 3));
        assert!(found.points.iter().all(|x| x.closure_error == 0.0));
    }
}
