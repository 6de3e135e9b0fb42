//! The interface to Python: plain data in, arrays out. No mechanics here.

mod analyses;
mod arrays;
mod balance;
mod calls;
mod ending;
mod ensemble;
mod events;
mod failure;
mod functions;
mod identification;
mod inverse;
mod maps;
mod model;
mod motion;
mod outputs;
mod partition;
mod poses;
mod program;
mod run;
mod segments;
mod state;
mod stepper;
mod summary;
mod tangent;
mod tapes;
mod toml;
mod user_system;
mod waiting;

use numpy::PyArrayMethods;
use pyo3::prelude::*;
use pyo3::types::PyTuple;

/// Setting up a run asks for some hundred small pieces of memory and gives them back.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

/// Version of the core.
#[pyfunction]
fn version() -> &'static str {
    env!("CARGO_PKG_VERSION")
}

#[pymodule]
fn _core(m: &Bound<'_, PyModule>) -> PyResult<()> {
    #[cfg(feature = "compiled")]
    <dyn partita_math::program::Compiler>::install(&partita_compiled::NATIVE);
    ending::register(m)?;
    // finds what it needs of NumPy, which cannot be imported any more when the interpreter ends
    numpy::PyArray1::<f64>::zeros(m.py(), 0, false).try_readwrite()?;
    m.add_class::<model::Model>()?;
    m.add_class::<inverse::Inverse>()?;
    m.add_class::<inverse::Actuated>()?;
    m.add_class::<user_system::System>()?;
    m.add_class::<motion::Motion>()?;
    m.add_class::<run::Account>()?;
    m.add_class::<run::Options>()?;
    m.add_class::<stepper::Stepper>()?;
    m.add_function(wrap_pyfunction!(tapes::tapes, m)?)?;
    m.add_function(wrap_pyfunction!(maps::singularities, m)?)?;
    m.add_function(wrap_pyfunction!(maps::measures, m)?)?;
    m.add_function(wrap_pyfunction!(identification::least_squares, m)?)?;
    m.add_function(wrap_pyfunction!(partition::measure, m)?)?;
    m.add_function(wrap_pyfunction!(partition::choose, m)?)?;
    m.add_function(wrap_pyfunction!(partition::geometry, m)?)?;
    m.add_function(wrap_pyfunction!(toml::parse_toml, m)?)?;
    m.add_function(wrap_pyfunction!(toml::toml_line, m)?)?;
    m.add_function(wrap_pyfunction!(balance::reaction_findings, m)?)?;
    m.add_function(wrap_pyfunction!(balance::energy_findings, m)?)?;
    m.add_function(wrap_pyfunction!(balance::energy_floor, m)?)?;
    m.add_function(wrap_pyfunction!(arrays::increasing, m)?)?;
    m.add_function(wrap_pyfunction!(version, m)?)?;
    let methods: Vec<&str> = partita_integrate::method::all().map(|method| method.name()).collect();
    let selections = partita_system::partition::Selection::ALL.map(|rule| rule.name());
    m.add("METHODS", PyTuple::new(m.py(), methods)?)?;
    m.add("FORMULATIONS", PyTuple::new(m.py(), partita_system::formulation::registry::NAMES)?)?;
    m.add("SELECTIONS", PyTuple::new(m.py(), selections)?)?;
    Ok(())
}
