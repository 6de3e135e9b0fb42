//! LU factors of small complex matrices, with partial pivoting.

use super::Singular;

/// A complex number: its real and imaginary part.
pub type Complex = [f64; 2];

#[inline(always)]
fn times([a, b]: Complex, [c, d]: Complex) -> Complex {
    [a * c - b * d, a * d + b * c]
}

/// 1/x, scaled by its larger part so that nothing overflows.
fn reciprocal([a, b]: Complex) -> Complex {
    if a.abs() >= b.abs() {
        let (r, d) = (b / a, a + b * (b / a));
        [1.0 / d, -r / d]
    } else {
        let (r, d) = (a / b, b + a * (a / b));
        [r / d, -1.0 / d]
    }
}

/// `x ← x − f y`.
#[inline(always)]
fn subtract(x: &mut [Complex], f: Complex, y: &[Complex]) {
    for (x, y) in x.iter_mut().zip(y) {
        let [re, im] = times(f, *y);
        x[0] -= re;
        x[1] -= im;
    }
}

/// Factors `P A = L U` in place with row exchanges; 4n³/3 multiply-adds. L has a unit diagonal (not stored); `piv[k]` (n) is the
/// row exchanged with row k at step k.
///
/// # Errors
/// A column that is zero or not finite.
pub fn lu_complex(a: &mut [Complex], n: usize, piv: &mut [usize]) -> Result<(), Singular> {
    let size = |[re, im]: Complex| re.abs() + im.abs();
    for k in 0..n {
        let (mut best, mut pivot) = (k, size(a[k * n + k]));
        for i in k + 1..n {
            let candidate = size(a[i * n + k]);
            // a NaN, once met, stays the pivot and is refused below
            if candidate > pivot || candidate.is_nan() {
                (best, pivot) = (i, candidate);
            }
        }
        if pivot == 0.0 || !pivot.is_finite() {
            return Err(Singular { index: k, pivot });
        }
        piv[k] = best;
        let (upper, below) = a.split_at_mut((k + 1) * n);
        let top = &mut upper[k * n..];
        if best != k {
            let start = (best - k - 1) * n;
            top.swap_with_slice(&mut below[start..start + n]);
        }
        let inverse = reciprocal(top[k]);
        for row in below.chunks_exact_mut(n).take(n - k - 1) {
            let l = times(row[k], inverse);
            row[k] = l;
            subtract(&mut row[k + 1..], l, &top[k + 1..]);
        }
    }
    Ok(())
}

/// `b ← A⁻¹ b` with the factors of [`lu_complex`].
pub fn lu_complex_solve(a: &[Complex], n: usize, piv: &[usize], b: &mut [Complex]) {
    piv[..n].iter().enumerate().for_each(|(k, p)| b.swap(k, *p));
    for k in 0..n {
        let x = b[k];
        for i in k + 1..n {
            subtract(&mut b[i..=i], a[i * n + k], &[x]);
        }
    }
    for k in (0..n).rev() {
        let mut x = b[k];
        for j in k + 1..n {
            subtract(std::slice::from_mut(&mut x), a[k * n + j], &b[j..=j]);
        }
        b[k] = times(x, reciprocal(a[k * n + k]));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_solved_satisfies_its_equations_whatever_the_order_of_rows() {
        for n in 0..9_usize {
            // without a pivot on the diagonal at first, and of very different sizes
            let of = |i: usize, j: usize| {
                let x = ((7 * i + 3 * j + i * j) % 11) as f64 - 4.7;
                [
                    if i == j { 0.0 } else { x * 10f64.powi(i as i32 - 3) },
                    if (i + j) % n.max(1) == 1 { 2.5 } else { 0.0 },
                ]
            };
            let original: Vec<Complex> = (0..n * n).map(|e| of(e / n, e % n)).collect();
            let x: Vec<Complex> = (0..n).map(|i| [1.0 + i as f64, 0.5 - i as f64]).collect();
            let mut b = vec![[0.0; 2]; n];
            for i in 0..n {
                for j in 0..n {
                    let [re, im] = times(original[i * n + j], x[j]);
                    b[i] = [b[i][0] + re, b[i][1] + im];
                }
            }
            let (mut a, mut piv) = (original, vec![0; n]);
            if n == 1 {
                assert!(lu_complex(&mut a, n, &mut piv).is_err(), "zero");
                continue;
            }
            lu_complex(&mut a, n, &mut piv).unwrap();
            lu_complex_solve(&a, n, &piv, &mut b);
            for (b, x) in b.iter().zip(&x) {
                assert!((b[0] - x[0]).abs() + (b[1] - x[1]).abs() < 1e-9, "{n}: {b:?} {x:?}");
            }
        }
    }
}
