//! Plans against dense elimination, on random patterns and on chains of loops.

use super::*;
use crate::dense::{lu, lu_solve, Matrix};
use crate::factor::svd;
use crate::scalar::{Dual, Lanes, Recorder, Recording};

/// C_D x = b and C_Dᵀ y = b for every scalar; the values of C first, then b.
fn both<T: Scalar>(made: &Plan, input: &[T], nrhs: usize) -> Vec<T> {
    let (values, b) = input.split_at(input.len() - made.rank() * nrhs);
    let mut work = vec![T::zero(); made.factor_len()];
    made.eliminate(values, &mut work);
    let (mut x, mut y) = (b.to_vec(), b.to_vec());
    made.solve(&work, &mut x, nrhs);
    made.solve_transposed(&work, &mut y, nrhs);
    x.append(&mut y);
    x
}

#[test]
fn every_scalar_goes_through_the_same_elimination() {
    let mut rng = fastrand::Rng::with_seed(50);
    for (size, density) in [(3, 0.7), (9, 0.4), (40, 0.2)] {
        let pattern = sparse(&mut rng, size, size + 2, density);
        let values = random_values(&mut rng, pattern.nnz());
        let made = plan(&pattern, &values, size).unwrap();
        for nrhs in [1, 4, 6] {
            let mut input = values.clone();
            input.extend(random_values(&mut rng, size * nrhs));
            let along = random_values(&mut rng, input.len());
            let moved = |h: f64| -> Vec<f64> { input.iter().zip(&along).map(|(x, d)| x + h * d).collect() };
            let plain = both(&made, &input, nrhs);
            let dual: Vec<Dual> = input.iter().zip(&along).map(|(x, d)| Dual::new(*x, [*d])).collect();
            let h = 1e-6;
            let (ahead, behind) = (both(&made, &moved(h), nrhs), both(&made, &moved(-h), nrhs));
            let size = plain.iter().fold(1.0, |m: f64, x| m.max(x.abs()));
            for (i, x) in both(&made, &dual, nrhs).iter().enumerate() {
                assert_eq!(x.re.to_bits(), plain[i].to_bits());
                // h² of the third derivative, which grows with the fourth power of the solution
                let slope = (ahead[i] - behind[i]) / (2.0 * h);
                assert!((x.eps[0] - slope).abs() < 1e-9 * size.powi(4), "{} {slope} {size}", x.eps[0]);
            }
            let lanes: Vec<Lanes> =
                (0..input.len()).map(|i| Lanes::from_fn(|l| input[i] + 1e-3 * l as f64 * along[i])).collect();
            let lanes = both(&made, &lanes, nrhs);
            let tape = Recording::new(input.len(), |x: &[Recorder]| Ok::<_, ()>(both(&made, x, nrhs))).unwrap();
            let (mut work, mut out) = (vec![0.0; tape.len()], vec![0.0; tape.outputs()]);
            for l in 0..Lanes::COUNT {
                let there: Vec<f64> = input.iter().zip(&along).map(|(x, d)| x + 1e-3 * l as f64 * d).collect();
                let single = both(&made, &there, nrhs);
                assert!(single.iter().zip(&lanes).all(|(x, y)| x.to_bits() == y.0[l].to_bits()));
                tape.evaluate(&there, &mut work, &mut out);
                assert!(single.iter().zip(&out).all(|(x, y)| x.to_bits() == y.to_bits()));
            }
        }
    }
}

#[test]
fn the_check_afterwards_agrees_with_the_guard() {
    let pattern = Pattern::from_rows(2, &[vec![0, 1], vec![0, 1]]);
    let made = plan(&pattern, &[2.0, 1.0, 1.0, 2.0], 2).unwrap();
    let mut work = vec![0.0; made.factor_len()];
    for values in [[2.0, 1.0, 1.0, 2.0], [2.0, 1.0, 1.0, 0.5001], [f64::NAN, 1.0, 1.0, 2.0]] {
        made.eliminate(&values, &mut work);
        let after = made.check(&work);
        assert_eq!(after.is_ok(), made.factor(&values, &mut work).is_ok());
    }
}

/// Plans with everything eligible and every scale 1.
fn plan(pattern: &Pattern, values: &[f64], rank: usize) -> Result<Plan, PlanError> {
    let (m, n) = (pattern.rows, pattern.cols);
    Plan::new(
        pattern,
        values,
        &vec![true; m],
        &vec![true; n],
        &vec![1.0; m],
        &vec![1.0; n],
        rank,
        PlanOptions::default(),
    )
}

/// Each place is filled with the given probability; the diagonal always.
fn sparse(rng: &mut fastrand::Rng, rows: usize, cols: usize, density: f64) -> Pattern {
    let columns: Vec<Vec<usize>> = (0..rows)
        .map(|i| {
            let mut row: Vec<usize> = (0..cols).filter(|&j| i == j || rng.f64() < density).collect();
            rng.shuffle(&mut row);
            row
        })
        .collect();
    Pattern::from_rows(cols, &columns)
}

fn random_values(rng: &mut fastrand::Rng, count: usize) -> Vec<f64> {
    (0..count).map(|_| 2.0 * rng.f64() - 1.0).collect()
}

/// The block of C in the order of the steps.
fn block(pattern: &Pattern, values: &[f64], plan: &Plan) -> Matrix {
    let mut dense = Matrix::new(pattern.rows, pattern.cols);
    for i in 0..pattern.rows {
        for p in pattern.row(i) {
            dense[(i, pattern.col_idx[p])] = values[p];
        }
    }
    let mut out = Matrix::new(plan.rank(), plan.rank());
    for (k, &i) in plan.pivot_rows().iter().enumerate() {
        for (l, &j) in plan.pivot_cols().iter().enumerate() {
            out[(k, l)] = dense[(i, j)];
        }
    }
    out
}

/// Residuals of both systems relative to the size of the solution.
fn check(pattern: &Pattern, values: &[f64], plan: &Plan, rng: &mut fastrand::Rng) {
    let mut work = vec![0.0; plan.factor_len()];
    plan.factor(values, &mut work).unwrap();
    let (r, c) = (plan.rank(), block(pattern, values, plan));
    for nrhs in 0..7 {
        let b = Matrix::from_vec(r, nrhs, random_values(rng, r * nrhs));
        let mut x = b.clone();
        plan.solve(&work, x.data_mut(), nrhs);
        residual_is_small(&c, &x, &b);
        let mut y = b.clone();
        plan.solve_transposed(&work, y.data_mut(), nrhs);
        residual_is_small(&c.transpose(), &y, &b);
    }
    let (mut memory, mut found) = (SparseScratch::new(r), Vec::new());
    for step in (0..r).step_by(1 + r / 7) {
        let (mut x, mut y) = (Matrix::new(r, 1), Matrix::new(r, 1));
        x[(step, 0)] = 0.5 + rng.f64();
        plan.solve_transposed_sparse(&work, &[(step, x[(step, 0)])], &mut memory, &mut found);
        found.iter().for_each(|&(k, value)| y[(k, 0)] = value);
        residual_is_small(&c.transpose(), &y, &x);
        plan.solve_transposed(&work, x.data_mut(), 1);
        let difference = x.data().iter().zip(y.data()).fold(0.0_f64, |m, (p, q)| m.max((p - q).abs()));
        assert!(difference <= 1e-11 * (1.0 + x.max_abs()), "{difference:e}");
    }
}

fn residual_is_small(a: &Matrix, x: &Matrix, b: &Matrix) {
    let product = a.matmul(x);
    let worst = product.data().iter().zip(b.data()).fold(0.0_f64, |m, (p, q)| m.max((p - q).abs()));
    assert!(worst <= 1e-11 * (1.0 + x.max_abs()), "residual {worst:e}");
}

#[test]
fn both_systems_are_solved_for_small_and_large_patterns() {
    let mut rng = fastrand::Rng::with_seed(41);
    for (size, density) in
        [(1, 1.0), (2, 1.0), (3, 0.5), (6, 0.4), (12, 1.0), (30, 0.1), (64, 0.05), (65, 0.05), (150, 0.02), (90, 1.0)]
    {
        for _ in 0..5 {
            let pattern = sparse(&mut rng, size, size + size / 3, density);
            let values = random_values(&mut rng, pattern.nnz());
            let made = plan(&pattern, &values, size).unwrap();
            check(&pattern, &values, &made, &mut rng);
        }
    }
}

#[test]
fn solution_equals_that_of_dense_elimination() {
    let mut rng = fastrand::Rng::with_seed(42);
    for size in [2, 5, 20, 80] {
        let pattern = sparse(&mut rng, size, size, 0.3);
        let mut values = random_values(&mut rng, pattern.nnz());
        for i in 0..size {
            for p in pattern.row(i) {
                if pattern.col_idx[p] == i {
                    values[p] += 10.0;
                }
            }
        }
        let made = plan(&pattern, &values, size).unwrap();
        let mut work = vec![0.0; made.factor_len()];
        made.factor(&values, &mut work).unwrap();
        let b = random_values(&mut rng, size);
        let mut x = b.clone();
        made.solve(&work, &mut x, 1);
        let mut a = block(&pattern, &values, &made).into_vec();
        let (mut piv, mut y) = (vec![0; size], b);
        lu(&mut a, size, &mut piv).unwrap();
        lu_solve(&a, size, &piv, &mut y);
        assert!(x.iter().zip(&y).all(|(p, q)| (p - q).abs() < 1e-12));
    }
}

#[test]
fn one_plan_serves_other_values() {
    let mut rng = fastrand::Rng::with_seed(43);
    let pattern = sparse(&mut rng, 40, 50, 0.1);
    let values = random_values(&mut rng, pattern.nnz());
    let made = plan(&pattern, &values, 40).unwrap();
    for _ in 0..20 {
        let moved: Vec<f64> = values.iter().map(|v| v * (1.0 + 1e-3 * rng.f64())).collect();
        check(&pattern, &moved, &made, &mut rng);
    }
}

#[test]
fn dependent_rows_are_never_chosen() {
    let mut rng = fastrand::Rng::with_seed(44);
    for size in [4, 20, 100] {
        for _ in 0..10 {
            // Rows size.. are combinations of two earlier ones.
            let base = sparse(&mut rng, size, size + 5, 3.0 / size as f64);
            let mut rows: Vec<Vec<(usize, f64)>> =
                (0..size).map(|i| base.col_idx[base.row(i)].iter().map(|&j| (j, 0.5 + rng.f64())).collect()).collect();
            for _ in 0..size / 2 {
                let (p, q) = (rng.usize(0..size), rng.usize(0..size));
                let mut sum = rows[p].clone();
                for &(j, v) in &rows[q] {
                    match sum.iter_mut().find(|e| e.0 == j) {
                        Some(e) => e.1 -= 0.7 * v,
                        None => sum.push((j, -0.7 * v)),
                    }
                }
                rows.push(sum);
            }
            rng.shuffle(&mut rows);
            let (pattern, values) = compress(size + 5, &rows);
            let full = plan(&pattern, &values, size).unwrap();
            assert!(full.smallest_pivot() > 1e-6);
            check(&pattern, &values, &full, &mut rng);
            match plan(&pattern, &values, size + 1).unwrap_err() {
                PlanError::RankDeficient { found, wanted, best } => {
                    assert_eq!((found, wanted), (size, size + 1));
                    assert!(best < 1e-10);
                }
                other => panic!("{other}"),
            }
        }
    }
}

fn compress(cols: usize, rows: &[Vec<(usize, f64)>]) -> (Pattern, Vec<f64>) {
    let columns: Vec<Vec<usize>> = rows.iter().map(|row| row.iter().map(|e| e.0).collect()).collect();
    let values = rows.iter().flatten().map(|e| e.1).collect();
    (Pattern::from_rows(cols, &columns), values)
}

#[test]
fn only_eligible_rows_and_columns_are_used() {
    let mut rng = fastrand::Rng::with_seed(45);
    for size in [6, 70] {
        let pattern = sparse(&mut rng, 2 * size, 2 * size, 0.9);
        let values = random_values(&mut rng, pattern.nnz());
        let rows: Vec<bool> = (0..2 * size).map(|i| i % 2 == 1).collect();
        let cols: Vec<bool> = (0..2 * size).map(|j| j >= size).collect();
        let ones = vec![1.0; 2 * size];
        let made = Plan::new(&pattern, &values, &rows, &cols, &ones, &ones, size, PlanOptions::default()).unwrap();
        assert!(made.pivot_rows().iter().all(|&i| rows[i]));
        assert!(made.pivot_cols().iter().all(|&j| cols[j]));
        check(&pattern, &values, &made, &mut rng);
    }
}

#[test]
fn units_of_rows_and_columns_do_not_change_the_choice() {
    let mut rng = fastrand::Rng::with_seed(46);
    let pattern = sparse(&mut rng, 10, 14, 0.4);
    let values = random_values(&mut rng, pattern.nnz());
    let reference = plan(&pattern, &values, 10).unwrap();
    let (rows, cols): (Vec<f64>, Vec<f64>) =
        ((0..10).map(|i| 10_f64.powi(i - 5)).collect(), (0..14).map(|j| 2_f64.powi(3 * (j % 5))).collect());
    let mut changed = values.clone();
    for i in 0..10 {
        for p in pattern.row(i) {
            changed[p] /= rows[i] * cols[pattern.col_idx[p]];
        }
    }
    let made =
        Plan::new(&pattern, &changed, &[true; 10], &[true; 14], &rows, &cols, 10, PlanOptions::default()).unwrap();
    assert_eq!(made.pivot_rows(), reference.pivot_rows());
    assert_eq!(made.pivot_cols(), reference.pivot_cols());
}

#[test]
fn guard_trips_when_a_pivot_shrinks_or_is_not_finite() {
    let pattern = Pattern::dense(2, 2);
    let made = plan(&pattern, &[2.0, 1.0, 1.0, 2.0], 2).unwrap();
    let mut work = vec![0.0; made.factor_len()];
    assert!(made.factor(&[2.0, 1.9, 1.9, 2.0], &mut work).is_ok());
    let shrunk = made.factor(&[2.0, 2.0, 2.0, 2.01], &mut work).unwrap_err();
    assert_eq!(shrunk.step, 1);
    assert!((shrunk.reference - 1.5).abs() < 1e-15);
    assert!((shrunk.pivot - 0.01).abs() < 1e-12);
    for bad in [f64::NAN, f64::INFINITY] {
        assert!(made.factor(&[bad, 1.0, 1.0, 2.0], &mut work).is_err());
        let refused = plan(&pattern, &[2.0, 1.0, 1.0, bad], 2).unwrap_err();
        assert_eq!(refused, PlanError::NotFinite { row: 1 });
    }
}

#[test]
fn rank_zero_needs_nothing() {
    let made = plan(&Pattern::dense(0, 3), &[], 0).unwrap();
    assert_eq!(made.factor_len(), 0);
    made.factor::<f64>(&[], &mut []).unwrap();
    made.solve::<f64>(&[], &mut [], 1);
    made.solve_transposed::<f64>(&[], &mut [], 5);
}

/// A chain of four-bars in joint angles: two conditions on the three angles of each loop, the last of them shared
/// with the next loop. Each loop transmits its motion with a ratio near 1.
fn chain(rng: &mut fastrand::Rng, loops: usize) -> (Pattern, Vec<f64>) {
    let mut rows = Vec::new();
    for first in (0..loops).map(|l| 2 * l) {
        let (coupler, ratio) = (2.0 * rng.f64() - 1.0, 0.95 + 0.1 * rng.f64());
        for _ in 0..2 {
            let (x, y) = (0.5 + rng.f64(), rng.f64() - 1.5);
            rows.push(vec![(first, x * coupler + y * ratio), (first + 1, -x), (first + 2, -y)]);
        }
    }
    compress(2 * loops + 1, &rows)
}

#[test]
fn fill_of_a_long_chain_grows_with_its_length_only() {
    let mut rng = fastrand::Rng::with_seed(47);
    for loops in [100, 10_000] {
        let (pattern, values) = chain(&mut rng, loops);
        let clock = std::time::Instant::now();
        let made = plan(&pattern, &values, 2 * loops).unwrap();
        println!(
            "{loops} loops: plan {:?}, {} entries for {} rows, smallest pivot {:e}",
            clock.elapsed(),
            made.nnz_factors(),
            2 * loops,
            made.smallest_pivot()
        );
        assert!(made.nnz_factors() <= 4 * 2 * loops);
        let mut work = vec![0.0; made.factor_len()];
        made.factor(&values, &mut work).unwrap();
    }
}

#[test]
fn absolute_coordinates_of_a_long_chain_fill_in_little() {
    // Three coordinates per body, two revolute conditions per neighbour: rows of six entries.
    let mut rng = fastrand::Rng::with_seed(48);
    let bodies = 10_000;
    let rows: Vec<Vec<(usize, f64)>> = (0..2 * bodies)
        .map(|i| {
            let first = (i / 2) * 3;
            (first..first + 6).map(|j| (j, 2.0 * rng.f64() - 1.0)).collect()
        })
        .collect();
    let (pattern, values) = compress(3 * bodies + 3, &rows);
    let clock = std::time::Instant::now();
    let made = plan(&pattern, &values, 2 * bodies).unwrap();
    println!(
        "{bodies} bodies: plan {:?}, {} entries, smallest pivot {:e}",
        clock.elapsed(),
        made.nnz_factors(),
        made.smallest_pivot()
    );
    assert!(made.nnz_factors() <= 6 * 2 * bodies);
}

#[test]
fn a_column_shared_by_every_loop_costs_nothing_extra() {
    let mut rng = fastrand::Rng::with_seed(49);
    let loops = 5_000;
    let rows: Vec<Vec<(usize, f64)>> = (0..2 * loops)
        .map(|i| {
            let first = 1 + i / 2 * 2;
            [0, first, first + 1].map(|j| (j, 2.0 * rng.f64() - 1.0)).to_vec()
        })
        .collect();
    let (pattern, values) = compress(2 * loops + 1, &rows);
    let clock = std::time::Instant::now();
    let made = plan(&pattern, &values, 2 * loops).unwrap();
    println!("star of {loops} loops: plan {:?}", clock.elapsed());
    assert!(made.nnz_factors() <= 4 * 2 * loops);
}

/// Sign of a determinant, true for negative, by dense elimination.
fn negative(m: &Matrix) -> bool {
    let n = m.rows();
    let (mut a, mut pivots) = (m.data().to_vec(), vec![0; n]);
    lu(&mut a, n, &mut pivots).unwrap();
    let swaps = pivots.iter().enumerate().filter(|(i, p)| i != *p).count();
    (0..n).fold(swaps % 2 == 1, |sign, i| sign ^ (a[i * n + i] < 0.0))
}

/// The determinant of some rows and columns of a square sparse matrix, rows and columns ascending: is it negative?
fn negative_block(pattern: &Pattern, values: &[f64], mut rows: Vec<usize>, mut cols: Vec<usize>) -> bool {
    rows.sort_unstable();
    cols.sort_unstable();
    let mut m = Matrix::new(rows.len(), rows.len());
    for (i, &row) in rows.iter().enumerate() {
        for e in pattern.row(row) {
            if let Some(j) = cols.iter().position(|&x| x == pattern.col_idx[e]) {
                m[(i, j)] = values[e];
            }
        }
    }
    negative(&m)
}

#[test]
fn blocks_have_the_signs_of_their_determinants_and_bounds_of_their_singular_values() {
    let mut rng = fastrand::Rng::with_seed(51);
    let mut several = 0;
    for _ in 0..60 {
        // full blocks in a chain, rows and columns shuffled
        let sizes = [2usize, 3, 1, 2];
        let n: usize = sizes.iter().sum();
        let (mut rows, mut cols): (Vec<usize>, Vec<usize>) = ((0..n).collect(), (0..n).collect());
        rng.shuffle(&mut rows);
        rng.shuffle(&mut cols);
        let mut lists = vec![Vec::new(); n];
        let mut start = 0usize;
        for size in sizes {
            for i in start..start + size {
                lists[rows[i]].extend((start.saturating_sub(1)..start + size).map(|j| cols[j]));
            }
            start += size;
        }
        let pattern = Pattern::from_rows(n, &lists);
        let mut signs = Vec::new();
        let values = random_values(&mut rng, pattern.nnz());
        let Ok(made) = plan(&pattern, &values, n) else { continue };
        // the same plan for other values
        let values: Vec<f64> = values.iter().map(|x| x + 0.1 * (rng.f64() - 0.5)).collect();
        let mut work = vec![0.0; made.factor_len()];
        if made.factor(&values, &mut work).is_err() {
            continue;
        }
        made.signs(&work, &mut signs);
        let count = signs.len() - 1;
        several += usize::from(count > 2);
        for (block, sign) in signs[..count].iter().enumerate() {
            let own =
                |of: &[usize]| (0..n).filter(|&k| made.layout.blocks.of_step[k] == block).map(|k| of[k]).collect();
            let wanted = negative_block(&pattern, &values, own(made.pivot_rows()), own(made.pivot_cols()));
            assert_eq!(*sign, wanted, "block {block} of {count}");
        }
        assert_eq!(signs[count], negative_block(&pattern, &values, rows, cols));

        let (mut blocks, scale): (_, Vec<f64>) = (Vec::new(), (0..n).map(|_| 0.5 + rng.f64()).collect());
        made.blocks(&values, &work, |k| (scale[k], 1.0 / scale[n - 1 - k]), &mut blocks);
        assert_eq!(blocks.len(), if count > 1 { count } else { 0 });
        for (block, found) in blocks.iter().enumerate() {
            let own: Vec<usize> = (0..n).filter(|&k| made.layout.blocks.of_step[k] == block).collect();
            let mut entries = Matrix::new(own.len(), own.len());
            for (i, &k) in own.iter().enumerate() {
                for e in pattern.row(made.pivot_rows()[k]) {
                    if let Some(j) = own.iter().position(|&l| made.pivot_cols()[l] == pattern.col_idx[e]) {
                        entries[(i, j)] = scale[k] * values[e] / scale[n - 1 - own[j]];
                    }
                }
            }
            let singular = svd(&entries).unwrap().s;
            let (least, bound) = (singular[own.len() - 1], found.least_singular_value());
            assert!(bound <= least * (1.0 + 1e-9), "{bound} {least}");
            // two values are in the worst case equal
            let near = if own.len() == 1 { 1.0 } else { 0.5f64.sqrt() };
            assert!(own.len() > 2 || bound >= near * least * (1.0 - 1e-9), "{bound} {least}");
        }
    }
    assert!(several > 20, "{several}");
}
