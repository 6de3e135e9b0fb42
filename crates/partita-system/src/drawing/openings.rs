//! What the conditions that misfit say along a motion: from it follows which drawing would fit.

use super::{moved, started, Ways};
use crate::reduction::Reduction;
use crate::system::{ConstrainedSystem, SystemError};

/// Length of the motion, in reaches of the velocity that moves most: what opens by the cube of it is still a thousand times
/// what rounding leaves...
const FAR: f64 = 0.6;
/// ... in so many steps.
const STEPS: usize = 8;
/// Self-stresses that have grown so much since the start tell of a singular position: what misfits is magnified there, and
/// nothing is learned of it.
const GROWN: f64 = 1.5;

/// A position along the motion, closed with the rows kept.
pub struct Place {
    /// Coordinates.
    pub q: Vec<f64>,
    /// C there.
    pub c: Vec<f64>,
    /// What each row left out says.
    pub said: Vec<Said>,
}

/// A row left out, less what the rows kept say of it.
pub struct Said {
    /// Rows and their weights, over sizes: a self-stress of length one.
    pub rows: Vec<(usize, f64)>,
    /// What it stands open by.
    pub open: f64,
}

/// Places along motions of a mechanism of so many `freedoms`, drives released. Empty: nothing can be moved.
///
/// # Errors
/// Where nothing can be evaluated at (t, q).
pub fn openings<S: ConstrainedSystem>(
    system: &S,
    (t, q): (f64, &[f64]),
    freedoms: usize,
) -> Result<Vec<Place>, SystemError> {
    let mut r = Reduction::geometric_dense(system, system.size().nv.saturating_sub(freedoms));
    let Some(home) = started(&mut r, t, q)? else { return Ok(Vec::new()) };
    let Some((first, longest)) = place(&r, &home) else { return Ok(Vec::new()) };
    let mut places = vec![first];
    let ways = Ways::new(&r, Vec::new());
    for direction in 0..ways.count {
        for sign in [1.0, -1.0] {
            moved(&mut r, (t, &home), &ways, (direction, sign), (FAR, STEPS), &mut |r, there| match place(r, there) {
                Some((place, length)) if length < GROWN * longest => {
                    places.push(place);
                    true
                }
                _ => false,
            })?;
        }
    }
    Ok(places)
}

/// What is said at the last position, and the longest self-stress, its row counting one.
fn place<S: ConstrainedSystem>(r: &Reduction<S>, q: &[f64]) -> Option<(Place, f64)> {
    let (system, pattern) = (r.system, r.system.pattern());
    let mut of_row = vec![0.0; system.size().nv];
    let (mut said, mut longest) = (Vec::new(), 1.0f64);
    for &row in r.dropped().iter().filter(|i| !system.row_is_drive(**i)) {
        of_row.fill(0.0);
        pattern.row(row).for_each(|e| of_row[pattern.col_idx[e]] = r.c[e]);
        // C_Dᵀ w = (C_i)_D: the row as a sum of kept ones
        let mut w: Vec<f64> = r.partition.dependent.iter().map(|&i| of_row[i]).collect();
        r.solve_transposed(&mut w);
        let size = r.row_size(row);
        let kept = || r.partition.rows.iter().copied().zip(w.iter().map(|w| w / size));
        let square = 1.0 + kept().map(|(i, w)| (w * r.row_size(i)).powi(2)).sum::<f64>();
        if !square.is_finite() {
            return None;
        }
        let length = square.sqrt();
        longest = longest.max(length);
        let rows: Vec<(usize, f64)> = std::iter::once((row, 1.0 / (size * length)))
            .chain(kept().filter(|x| x.1 != 0.0).map(|(i, w)| (i, -w / length)))
            .collect();
        let open = rows.iter().map(|&(i, w)| w * r.phi[i]).sum();
        said.push(Said { rows, open });
    }
    Some((Place { q: q.to_vec(), c: r.c.clone(), said }, longest))
}
