//! Block triangular form: which rows belong to which unknowns, and what must be solved together.             (L2)

/// A row for each column `0..cols`, so that no row serves twice; `None` if there is no such assignment.
///
/// Augmenting paths after a greedy start; rows × entries at the worst, proportional to the entries for chains of loops.
pub(super) fn matching(rows: &[Vec<usize>], cols: usize) -> Option<Vec<usize>> {
    const FREE: usize = usize::MAX;
    let mut row_of = vec![FREE; cols];
    let mut matched = vec![false; rows.len()];
    for (i, row) in rows.iter().enumerate() {
        if let Some(&c) = row.iter().find(|&&c| row_of[c] == FREE) {
            row_of[c] = i;
            matched[i] = true;
        }
    }
    let mut seen = vec![usize::MAX; cols];
    for start in 0..rows.len() {
        if matched[start] {
            continue;
        }
        // depth first, (row, next entry to try, column it was entered by)
        let mut stack = vec![(start, 0usize, FREE)];
        while let Some(top) = stack.last_mut() {
            let (row, next) = (top.0, top.1);
            let Some(&c) = rows[row].get(next) else {
                stack.pop();
                continue;
            };
            top.1 += 1;
            if seen[c] == start {
                continue;
            }
            seen[c] = start;
            if row_of[c] == FREE {
                // turn the path over
                let mut c = c;
                while let Some((row, _, entered)) = stack.pop() {
                    row_of[c] = row;
                    c = entered;
                }
                matched[start] = true;
                break;
            }
            stack.push((row_of[c], 0, c));
        }
    }
    row_of.iter().all(|&r| r != FREE).then_some(row_of)
}

/// Strongly connected components, each after those its members point to (Tarjan).
pub(super) fn components(points_to: &[Vec<usize>]) -> Vec<Vec<usize>> {
    const NEW: usize = usize::MAX;
    let n = points_to.len();
    let (mut index, mut low, mut on_stack) = (vec![NEW; n], vec![0usize; n], vec![false; n]);
    let (mut stack, mut found, mut count) = (Vec::new(), Vec::new(), 0);
    for start in 0..n {
        if index[start] != NEW {
            continue;
        }
        let mut calls = vec![(start, 0usize)];
        while let Some(top) = calls.last_mut() {
            let (node, next) = *top;
            if next == 0 {
                (index[node], low[node]) = (count, count);
                count += 1;
                stack.push(node);
                on_stack[node] = true;
            }
            if let Some(&to) = points_to[node].get(next) {
                top.1 += 1;
                if index[to] == NEW {
                    calls.push((to, 0));
                } else if on_stack[to] {
                    low[node] = low[node].min(index[to]);
                }
                continue;
            }
            calls.pop();
            if let Some(&(parent, _)) = calls.last() {
                low[parent] = low[parent].min(low[node]);
            }
            if low[node] == index[node] {
                let mut component = Vec::new();
                while let Some(i) = stack.pop() {
                    on_stack[i] = false;
                    component.push(i);
                    if i == node {
                        break;
                    }
                }
                component.sort_unstable();
                found.push(component);
            }
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Random matrices with a hidden permutation: the matching is complete, and in the order of the components every
    /// row needs only columns of its own and of earlier components.
    #[test]
    fn block_triangular_form_of_random_patterns() {
        let mut rng = fastrand::Rng::with_seed(17);
        for _ in 0..300 {
            let n = rng.usize(1..15);
            let mut hidden: Vec<usize> = (0..n).collect();
            rng.shuffle(&mut hidden);
            let rows: Vec<Vec<usize>> =
                (0..n).map(|i| (0..n).filter(|&c| c == hidden[i] || rng.f64() < 1.5 / n as f64).collect()).collect();
            let row_of = matching(&rows, n).unwrap();
            let mut used = row_of.clone();
            used.sort_unstable();
            assert_eq!(used, (0..n).collect::<Vec<_>>());
            assert!(row_of.iter().enumerate().all(|(c, &r)| rows[r].contains(&c)));
            let needs: Vec<Vec<usize>> = row_of.iter().map(|&r| rows[r].clone()).collect();
            let mut done = vec![false; n];
            let parts = components(&needs);
            assert_eq!(parts.iter().map(Vec::len).sum::<usize>(), n);
            for part in parts {
                part.iter().for_each(|&c| done[c] = true);
                assert!(part.iter().all(|&c| needs[c].iter().all(|&d| done[d])));
            }
        }
    }

    #[test]
    fn a_matrix_without_a_complete_matching_is_reported() {
        assert_eq!(matching(&[vec![0], vec![0]], 2), None);
        assert_eq!(matching(&[vec![0, 1], vec![0]], 2), Some(vec![1, 0]));
    }
}
