//! Rows and unknowns of C for the steps of a plan.                                                         (L2)

use super::instant::Instant;
use super::{btf, LoopClosing, Work};
use partita_system::closing::{Block, BlockState};
use partita_system::prelude::*;
use partita_system::SystemError;

impl LoopClosing<'_> {
    /// The first implicit block of the remaining steps: rows and velocities.
    pub(super) fn next_implicit(&self, at: &Instant, missing: &[usize]) -> Option<(Vec<usize>, Vec<usize>)> {
        let nv = self.model.size().nv;
        let mut within = vec![false; nv];
        for &e in missing {
            for v in self.graph.edges[e].velocities() {
                within[v] = self.inputs.binary_search(&v).is_err();
            }
        }
        let unknown: Vec<usize> = (0..nv).filter(|&v| within[v]).collect();
        let rows = at.rows(&within);
        if rows.len() != unknown.len() {
            return None;
        }
        let (row_of, mut needs) = at.structure(&rows, &unknown)?;
        let index = |v: usize| unknown.binary_search(&v).ok();
        for &e in missing {
            // the velocities of a ball are found together
            tie(&mut needs, &self.graph.edges[e].velocities().filter_map(index).collect::<Vec<_>>());
        }
        let first = btf::components(&needs).into_iter().next()?;
        Some((first.iter().map(|&i| row_of[i]).collect(), first.iter().map(|&i| unknown[i]).collect()))
    }

    /// Other rows that the unknowns of an implicit block close, all else being known by then, if they depend exactly on
    /// its own rows; rows that depend only within the drawing tolerance are not added.
    pub(super) fn that_follow(&self, at: &Instant, missing: &[usize], rows: &[usize], unknown: &[usize]) -> Vec<usize> {
        let all: Vec<usize> = missing.iter().flat_map(|&e| self.graph.edges[e].velocities()).collect();
        let later = |v: &usize| all.contains(v) && !unknown.contains(v) && self.inputs.binary_search(v).is_err();
        let columns = |r: usize| at.pattern().row(r).map(|e| at.pattern().col_idx[e]);
        let others = (0..self.model.size().holonomic).filter(|&r| {
            !rows.contains(&r) && columns(r).any(|v| unknown.contains(&v)) && !columns(r).any(|v| later(&v))
        });
        at.that_follow_exactly(rows, others)
    }

    /// Rows and unknowns of C for the steps: block triangular, with the steps that are coupled in C in one block.
    pub(super) fn plan_blocks(&mut self, at: &Instant, rows: &[usize]) -> Result<(), SystemError> {
        let nv = self.model.size().nv;
        let unknown: Vec<usize> = (0..nv).filter(|v| self.inputs.binary_search(v).is_err()).collect();
        let Some((row_of, mut needs)) = at.structure(rows, &unknown) else {
            return Err(SystemError::argument(
                "independent",
                "the loop-closure rows are dependent for these inputs; choose other inputs".into(),
            ));
        };
        let mut step_of = vec![usize::MAX; unknown.len()];
        let mut own: Vec<Vec<usize>> = Vec::new();
        for (s, step) in self.steps.iter().enumerate() {
            let mine: Vec<usize> = step
                .edges
                .iter()
                .flat_map(|&e| self.graph.edges[e].velocities())
                .filter_map(|v| unknown.binary_search(&v).ok())
                .collect();
            mine.iter().for_each(|&i| step_of[i] = s);
            tie(&mut needs, &mine);
            own.push(mine);
        }
        let mut listed: Vec<(usize, Vec<usize>, Vec<usize>)> = Vec::new();
        // steps that find only coordinates of cut joints have nothing at the level of C
        for (s, mine) in own.iter().enumerate() {
            if mine.is_empty() {
                listed.push((s, Vec::new(), Vec::new()));
            }
        }
        for component in btf::components(&needs) {
            let mut steps: Vec<usize> = component.iter().map(|&i| step_of[i]).filter(|&s| s != usize::MAX).collect();
            steps.sort_unstable();
            steps.dedup();
            let Some((&last, earlier)) = steps.split_last() else { continue };
            listed.extend(earlier.iter().map(|&s| (s, Vec::new(), Vec::new())));
            let mut block_rows: Vec<usize> = component.iter().map(|&i| row_of[i]).collect();
            block_rows.sort_unstable();
            listed.push((last, block_rows, component.iter().map(|&i| unknown[i]).collect()));
        }
        self.blocks.clear();
        self.entries.clear();
        for (s, rows, unknown) in listed {
            let step = &self.steps[s];
            let explicit = !matches!(step.work, Work::Implicit(_));
            for k in 0..step.states {
                let last = k + 1 == step.states;
                let words = if step.states > 1 {
                    format!("{}, {}", step.words, if k == 0 { "characteristic equation" } else { "universal joint" })
                } else {
                    step.words.clone()
                };
                self.entries.push((s, k));
                let (rows, unknown) = if last { (rows.clone(), unknown.clone()) } else { (Vec::new(), Vec::new()) };
                self.blocks.push(Block { rows, unknown, explicit, words });
            }
        }
        self.states = vec![BlockState { branch: 0, pivot: 1.0 }; self.blocks.len()];
        Ok(())
    }
}

/// Make these nodes one component.
fn tie(needs: &mut [Vec<usize>], nodes: &[usize]) {
    for (i, &a) in nodes.iter().enumerate() {
        needs[a].push(nodes[(i + 1) % nodes.len()]);
    }
}
