//! Python's exceptions for the errors of the library.

use datasets::read::ReadError;
use datasets::write::WriteError;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use schlieren::input::InputError;
use schlieren::output::OutputError;
use schlieren::render::RenderError;
use schlieren::solids::SolidsError;
use std::error::Error;
use std::io;

/// The message of an error and of all that caused it.
fn whole(error: &dyn Error) -> String {
    let mut text = error.to_string();
    let mut cause = error.source();
    while let Some(inner) = cause {
        let inner_text = inner.to_string();
        if !text.contains(&inner_text) {
            text = format!("{text}: {inner_text}");
        }
        cause = inner.source();
    }
    text
}

/// `ValueError`, or `OSError` with its kind when the system refused a file.
fn by_cause(error: &dyn Error, io: Option<&io::Error>) -> PyErr {
    match io {
        Some(io) => PyErr::from(io::Error::new(io.kind(), whole(error))),
        None => PyValueError::new_err(whole(error)),
    }
}

fn io_of_read(error: &ReadError) -> Option<&io::Error> {
    match error {
        ReadError::Io { source, .. } => Some(source),
        _ => None,
    }
}

pub(crate) fn of_input(error: &InputError) -> PyErr {
    let io = match error {
        InputError::Read(e) => io_of_read(e),
        _ => None,
    };
    by_cause(error, io)
}

pub(crate) fn of_render(error: &RenderError) -> PyErr {
    let io = match error {
        RenderError::Input(InputError::Read(e)) | RenderError::Solids(SolidsError::Read(e)) => {
            io_of_read(e)
        }
        _ => None,
    };
    by_cause(error, io)
}

pub(crate) fn of_output(error: &OutputError) -> PyErr {
    use datasets::image_io::ImageError;
    let io = match error {
        OutputError::Io { source, .. } | OutputError::Image(ImageError::Io { source, .. }) => {
            Some(source)
        }
        _ => None,
    };
    by_cause(error, io)
}

pub(crate) fn of_write(error: &WriteError) -> PyErr {
    let io = match error {
        WriteError::Io { source, .. } => Some(source),
        _ => None,
    };
    by_cause(error, io)
}

/// `ValueError` for any other error.
pub(crate) fn of(error: &dyn Error) -> PyErr {
    by_cause(error, None)
}
