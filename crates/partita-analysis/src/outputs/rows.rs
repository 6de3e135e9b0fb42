//! Tables with one row per output, filled on all cores where that is faster.

use crate::error::AnalysisError;
use std::ops::Range;
use std::panic::resume_unwind;
use std::thread::{available_parallelism, scope};
use std::time::{Duration, Instant};

/// Below this expected duration a thread costs more than it saves.
const WORTH_A_THREAD: Duration = Duration::from_micros(200);
/// A row takes at least this. Unit: s. Reason: a tick of the clock.
const CLOCK_TICK: f64 = 1e-9;
/// Time between two checks for an interrupt by the user.
const PATIENCE: Duration = Duration::from_millis(50);

/// Called at intervals on the calling thread; returns whether to continue: [`AnalysisError::Stopped`] where not.
pub type Watch<'w, E = AnalysisError> = &'w mut dyn FnMut() -> Result<(), E>;

/// Some rows of several tables, to be filled.
pub struct Rows<'a> {
    parts: Vec<&'a mut [f64]>,
    widths: &'a [usize],
    first: usize,
}

impl Rows<'_> {
    /// Row `i` of a table.
    pub fn row(&mut self, table: usize, i: usize) -> &mut [f64] {
        let width = self.widths[table];
        &mut self.parts[table][(i - self.first) * width..][..width]
    }

    fn fill<S, E>(
        &mut self,
        rows: Range<usize>,
        s: &mut S,
        f: &impl Fn(usize, &mut S, &mut Self) -> Result<(), E>,
    ) -> Result<(), E> {
        for i in rows {
            f(i, s, self)?;
        }
        Ok(())
    }
}

/// All rows of tables.
pub fn whole<'a>(tables: &'a mut [Vec<f64>], widths: &'a [usize]) -> Rows<'a> {
    Rows { parts: tables.iter_mut().map(Vec::as_mut_slice).collect(), widths, first: 0 }
}

/// Split off the first rows of each table.
fn take<'a>(rest: &mut [&'a mut [f64]], widths: &'a [usize], rows: Range<usize>) -> Rows<'a> {
    let parts = rest
        .iter_mut()
        .zip(widths)
        .map(|(x, w)| {
            let (head, tail) = std::mem::take(x).split_at_mut(w * rows.len());
            *x = tail;
            head
        })
        .collect();
    Rows { parts, widths, first: rows.start }
}

/// Tables of `count` rows and the given widths, each row by `f` with a scratch of its thread.
///
/// Rows are computed `chunk` at a time, each chunk in order on one core: a row may depend on those before it in its chunk,
/// not on others, so the answer is the same on one core and on many. `usize::MAX`: all on this core, in order. The error is
/// that of the first row that fails.
///
/// # Errors
/// The errors of `f` and of `watch`.
pub fn tables<S: Send, E: Send>(
    count: usize,
    widths: &[usize],
    chunk: usize,
    scratch: impl Fn() -> S,
    f: impl Fn(usize, &mut S, &mut Rows) -> Result<(), E> + Sync,
    watch: Watch<E>,
) -> Result<Vec<Vec<f64>>, E> {
    tables_on((None, Duration::ZERO), count, widths, chunk, scratch, f, watch)
}

/// As `tables`, on this many cores at most, `None`: on all; a row is known to take at least this long.
///
/// # Errors
/// As `tables`.
pub fn tables_on<S: Send, E: Send>(
    (workers, least): (Option<usize>, Duration),
    count: usize,
    widths: &[usize],
    chunk: usize,
    scratch: impl Fn() -> S,
    f: impl Fn(usize, &mut S, &mut Rows) -> Result<(), E> + Sync,
    watch: Watch<E>,
) -> Result<Vec<Vec<f64>>, E> {
    let mut data: Vec<Vec<f64>> = widths.iter().map(|w| vec![0.0; w * count]).collect();
    let available = || available_parallelism().map_or(1, Into::into);
    let (cores, chunk) = match chunk {
        usize::MAX => (1, 1),
        _ if chunk < count => (workers.unwrap_or_else(available), chunk),
        // one chunk is one core's
        _ => (1, count.max(1)),
    };
    // threads that these rows are worth
    let worth = |a_row: Duration, rows: usize| {
        let wanted = a_row.as_secs_f64() * rows as f64 / WORTH_A_THREAD.as_secs_f64();
        cores.min(wanted as usize)
    };
    let mut scratches: Vec<S> = (0..worth(least, count).max(1)).map(|_| scratch()).collect();
    let mut rest: Vec<&mut [f64]> = data.iter_mut().map(Vec::as_mut_slice).collect();
    let (mut done, mut block) = (0, (chunk.max(8).next_multiple_of(chunk) * scratches.len()).min(count));
    while done < count {
        // a module of a page has no clock, and one core
        let began = (!cfg!(target_family = "wasm")).then(Instant::now);
        let chunks = block.div_ceil(chunk);
        let threads = scratches.len().min(chunks);
        let ends: Vec<usize> = (0..=threads).map(|i| done + (chunks * i / threads * chunk).min(block)).collect();
        let parts: Vec<Rows> = ends.windows(2).map(|e| take(&mut rest, widths, e[0]..e[1])).collect();
        let mut work = parts.into_iter().zip(ends.windows(2)).zip(&mut scratches);
        let own = work.next();
        let f = &f;
        scope(|threads| {
            let handles: Vec<_> =
                work.map(|((mut rows, e), s)| threads.spawn(move || rows.fill(e[0]..e[1], s, f))).collect();
            let mut result = own.map_or(Ok(()), |((mut rows, e), s)| rows.fill(e[0]..e[1], s, f));
            for handle in handles {
                let other = handle.join().unwrap_or_else(|panic| resume_unwind(panic));
                result = result.and(other);
            }
            result
        })?;
        done += block;
        watch()?;
        let elapsed = began.map_or(Duration::ZERO, |began| began.elapsed());
        let a_row = elapsed.mul_f64(threads as f64) / block as u32;
        while scratches.len() < worth(a_row, count - done) {
            scratches.push(scratch());
        }
        let patient = PATIENCE.as_secs_f64() * scratches.len() as f64 / a_row.as_secs_f64().max(CLOCK_TICK);
        block = (patient as usize).max(1).next_multiple_of(chunk).min(count - done);
    }
    Ok(data)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn squares(count: usize, chunk: usize) -> Vec<Vec<f64>> {
        let f = |i: usize, s: &mut usize, rows: &mut Rows| {
            *s = if chunk < usize::MAX && i % chunk == 0 { 0 } else { *s + 1 };
            rows.row(0, i)[0] = i as f64;
            if chunk < usize::MAX {
                assert_eq!(*s, i % chunk);
            }
            rows.row(1, i).copy_from_slice(&[(i * i) as f64, -(i as f64)]);
            std::thread::sleep(Duration::from_micros(30));
            Ok::<(), ()>(())
        };
        tables(count, &[1, 2], chunk, || 0, f, &mut || Ok(())).unwrap()
    }

    #[test]
    fn every_row_is_filled_once_on_one_core_and_on_many() {
        for count in [0, 1, 7, 8, 9, 300] {
            let found = squares(count, 1);
            for chunk in [3, 64, usize::MAX] {
                assert_eq!(found, squares(count, chunk));
            }
            assert_eq!(found[0], (0..count).map(|i| i as f64).collect::<Vec<_>>());
            assert_eq!(found[1].len(), 2 * count);
        }
    }

    #[test]
    fn the_first_failure_is_reported_and_a_wish_to_stop_heard() {
        let f = |i: usize, (): &mut (), _: &mut Rows| if i >= 20 { Err(i) } else { Ok(()) };
        assert_eq!(tables(200, &[1], 1, || (), f, &mut || Ok(())), Err(20));
        let stop = tables(200, &[1], 1, || (), |_, (): &mut (), _: &mut Rows| Ok(()), &mut || Err(7));
        assert_eq!(stop, Err(7));
    }
}
