//! Clusters: velocities and rows that are connected through C.
//!
//! C, C_D, A, D, η and ξ are block-diagonal over clusters, so each has its own choice of coordinates, its own switches
//! and its own margin. Clusters interact only through the reduced equations.

use partita_math::elimination::Pattern;

/// The blocks of a block-diagonal C.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Clusters {
    /// Cluster of each velocity.
    pub of_velocity: Vec<u32>,
    /// Cluster of each row; a row without entries belongs to the first.
    pub of_row: Vec<u32>,
    /// Number of clusters.
    pub count: usize,
}

impl Clusters {
    /// One cluster of everything.
    pub fn one(velocities: usize, rows: usize) -> Self {
        Self { of_velocity: vec![0; velocities], of_row: vec![0; rows], count: usize::from(velocities > 0) }
    }

    /// The finest clusters: velocities that meet in a row of `pattern`, or in one of the groups `together`, belong to one.
    /// Numbered in the order of their first velocities. Cost: entries.
    pub fn new<'g>(pattern: &Pattern, together: impl IntoIterator<Item = &'g [usize]>) -> Self {
        let mut forest: Vec<usize> = (0..pattern.cols).collect();
        fn root(forest: &mut [usize], mut i: usize) -> usize {
            while forest[i] != i {
                forest[i] = forest[forest[i]];
                i = forest[i];
            }
            i
        }
        let mut join = |group: &[usize]| {
            for pair in group.windows(2) {
                let (a, b) = (root(&mut forest, pair[0]), root(&mut forest, pair[1]));
                forest[a.max(b)] = a.min(b);
            }
        };
        (0..pattern.rows).for_each(|i| join(&pattern.col_idx[pattern.row(i)]));
        together.into_iter().for_each(&mut join);
        let mut number = vec![u32::MAX; pattern.cols];
        let mut count = 0;
        let mut of_velocity = Vec::with_capacity(pattern.cols);
        for i in 0..pattern.cols {
            let r = root(&mut forest, i);
            if number[r] == u32::MAX {
                number[r] = count;
                count += 1;
            }
            of_velocity.push(number[r]);
        }
        let of_row =
            (0..pattern.rows).map(|i| pattern.col_idx[pattern.row(i)].first().map_or(0, |&j| of_velocity[j])).collect();
        Self { of_velocity, of_row, count: count as usize }
    }

    /// Velocities of each cluster, ascending.
    pub fn velocities(&self) -> Vec<Vec<usize>> {
        gather(&self.of_velocity, self.count)
    }

    /// Rows of each cluster, ascending.
    pub fn rows(&self) -> Vec<Vec<usize>> {
        gather(&self.of_row, self.count)
    }
}

fn gather(of: &[u32], count: usize) -> Vec<Vec<usize>> {
    let mut lists = vec![Vec::new(); count];
    for (i, &c) in of.iter().enumerate() {
        lists[c as usize].push(i);
    }
    lists
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_and_groups_join_velocities() {
        let p = Pattern::from_rows(7, &[vec![0, 2], vec![2, 5], vec![], vec![6]]);
        let c = Clusters::new(&p, [&[1usize, 4][..]]);
        assert_eq!(c.count, 4);
        assert_eq!(c.velocities(), [vec![0, 2, 5], vec![1, 4], vec![3], vec![6]]);
        assert_eq!(c.rows(), [vec![0, 1, 2], vec![], vec![], vec![3]]);
        assert_eq!(Clusters::one(3, 2).rows(), [vec![0, 1]]);
    }
}
