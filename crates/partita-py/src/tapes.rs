//! The equations of a mechanism as tapes, for tools that replay them.

use crate::arrays::vector;
use crate::failure::{self, guarded};
use crate::model::Model;
use crate::run::read_asked;
use crate::stepper::{with_inputs, Input};
use numpy::{PyArray1, PyArray2, PyReadonlyArray1, ToPyArray};
use partita_math::scalar::{Lookup, PlainTape};
use partita_model::carried::Observable;
use partita_model::motion_programs::Varied;
use partita_model::tapes::{Channel, NamedRecording};
use partita_system::prelude::*;
use partita_system::reduction::Reduction;
use partita_system::start;
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// Breaks and rows of a table.
type PlainTable<'py> = (Bound<'py, PyArray1<f64>>, Bound<'py, PyArray2<f64>>);

/// Codes, operands, constants, outputs, parts, tables.
type Plain<'py> = (
    Bound<'py, PyArray1<u8>>,
    Bound<'py, PyArray2<u32>>,
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray1<u32>>,
    Vec<(&'static str, usize)>,
    Vec<PlainTable<'py>>,
);

/// The tapes by name, the independent velocities, names of operations.
type Tapes<'py> = (Bound<'py, PyDict>, Vec<usize>, Vec<&'static str>);

fn plain<'py>(py: Python<'py>, made: &NamedRecording) -> PyResult<Plain<'py>> {
    let tape = made.recording.tape();
    let operands: Vec<Vec<u32>> = tape.operands.iter().map(|x| x.to_vec()).collect();
    let operands = PyArray2::from_vec2(py, &operands)?;
    let (codes, constants) = (tape.codes.to_pyarray(py), tape.constants.to_pyarray(py));
    let table = |x: &Lookup| {
        let (breaks, rows) = x.table();
        let rows: Vec<Vec<f64>> = rows.iter().map(|x| x.to_vec()).collect();
        Ok::<_, PyErr>((breaks.to_pyarray(py), PyArray2::from_vec2(py, &rows)?))
    };
    let tables = tape.tables.iter().map(table).collect::<PyResult<Vec<_>>>()?;
    Ok((codes, operands, constants, tape.outputs.to_pyarray(py), made.parts.clone(), tables))
}

/// The equations as tapes in the coordinates chosen at the closed position q, or in those named: "motion", "closed" and
/// "residual", each (codes, operands, constants, outputs, names and sizes of the parts of its outputs, tables); also the
/// independent velocities, and names of operations. Inputs: force and component, or a drive; their first numbers, as for a
/// stepper; and how many numbers of each are inputs. What is observed beside, as JSON.
#[pyfunction]
#[pyo3(signature = (model, t, q, inputs, first, counts, parameters, independent, observed))]
pub(crate) fn tapes<'py>(
    py: Python<'py>,
    model: &Bound<'py, Model>,
    t: f64,
    q: PyReadonlyArray1<'py, f64>,
    inputs: Vec<Input>,
    first: Vec<f64>,
    counts: Vec<usize>,
    parameters: Vec<Varied>,
    independent: Option<Vec<usize>>,
    observed: &str,
) -> PyResult<Tapes<'py>> {
    guarded(py, || {
        let model = model.get().inner();
        let q = vector(&q, model.size().nq, "q")?;
        let (own, _) = with_inputs(py, model, &inputs, &first)?;
        let each = inputs.iter().zip(&counts);
        let channels: Vec<Channel> =
            each.map(|((_, c), n)| c.map_or(Channel::Course(*n), |_| Channel::Effort)).collect();
        let system = |e| failure::system(py, e);
        let rank = start::analyse(&own, t, &q).map_err(system)?.rank;
        let mut r = Reduction::new(&own, rank);
        start::choose_partition(&mut r, t, &q, None, independent.as_deref()).map_err(system)?;
        let observed: Vec<Observable> = read_asked(py, observed)?;
        let made = own.tapes(&r, &channels, &parameters, &observed).map_err(|e| failure::description(py, &e))?;
        let found = PyDict::new(py);
        for (name, tape) in [("motion", &made.motion), ("closed", &made.closed), ("residual", &made.residual)] {
            found.set_item(name, plain(py, tape)?)?;
        }
        Ok((found, r.choice().independent.to_vec(), PlainTape::OPERATIONS.to_vec()))
    })
}
