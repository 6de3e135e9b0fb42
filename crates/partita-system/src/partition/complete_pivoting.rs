//! Complete pivoting: Gauss elimination of C in the units given, always with the largest remaining entry; the columns
//! of the first r pivots are dependent.
//!
//! For comparison: the classical way to partition coordinates (Wehage, Haug 1982), and that of the dynamic selection of
//! states in Modelica tools. The result depends on units, those of the rows as well as those of the coordinates.

use partita_math::dense::Matrix;
use partita_math::tolerance;

/// The n − r remaining velocities, ascending, and the last pivot over the first one. `None`: C has fewer than `rank`
/// nonzero pivots. Ties go to the first row, then the lower column. Cost: m n r.
pub fn choose(c: &Matrix, rank: usize) -> Option<(Vec<usize>, f64)> {
    let (m, n) = (c.rows(), c.cols());
    let mut x = c.clone();
    let (mut rows, mut free): (Vec<usize>, Vec<usize>) = ((0..m).collect(), (0..n).collect());
    let (mut first, mut last) = (1.0, 1.0);
    for step in 0..rank {
        let mut best = (0.0, 0, 0);
        for (p, &i) in rows.iter().enumerate() {
            for (o, &j) in free.iter().enumerate() {
                if x[(i, j)].abs() > best.0 * (1.0 + tolerance::TIE) {
                    best = (x[(i, j)].abs(), p, o);
                }
            }
        }
        if best.0 == 0.0 {
            return None;
        }
        last = best.0;
        if step == 0 {
            first = best.0;
        }
        let (row, column) = (rows.remove(best.1), free.remove(best.2));
        for &i in &rows {
            let factor = x[(i, column)] / x[(row, column)];
            for &j in &free {
                let y = factor * x[(row, j)];
                x[(i, j)] -= y;
            }
        }
    }
    Some((free, last / first))
}
