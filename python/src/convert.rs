//! Conversion of Python values to TOML, and back.

use pyo3::IntoPyObjectExt;
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyDict, PyFloat, PyInt, PyList, PyString, PyTuple};
use toml::{Table, Value};

use crate::errors::{Failure, Kind};

/// Largest nesting of tables that is accepted; no station has a deeper one.
const DEPTH_MAX: usize = 16;

/// A Python value as TOML; `None` stands for a key to remove. `key` is its name in errors.
fn value(key: &str, from: &Bound<'_, PyAny>, depth: usize) -> PyResult<Option<Value>> {
    if depth > DEPTH_MAX {
        return Err(Failure::new(Kind::Input, format!("`{key}` is nested too deeply")).into());
    }
    // In Python a bool is an int, too, so bools are tested first.
    if from.is_none() {
        Ok(None)
    } else if from.is_instance_of::<PyBool>() {
        Ok(Some(Value::Boolean(from.extract()?)))
    } else if from.is_instance_of::<PyInt>() {
        let whole =
            from.extract().map_err(|_| Failure::new(Kind::Input, format!("`{key}` is {from}, beyond 64 bits")))?;
        Ok(Some(Value::Integer(whole)))
    } else if from.is_instance_of::<PyFloat>() {
        Ok(Some(Value::Float(from.extract()?)))
    } else if from.is_instance_of::<PyString>() {
        Ok(Some(Value::String(from.extract()?)))
    } else if let Ok(dict) = from.cast::<PyDict>() {
        let mut table = Table::new();
        merge_at(&mut table, dict, key, depth + 1)?;
        Ok(Some(Value::Table(table)))
    } else if from.is_instance_of::<PyList>() || from.is_instance_of::<PyTuple>() {
        let mut array = Vec::new();
        for element in from.try_iter()? {
            let found = value(key, &element?, depth + 1)?;
            array.push(found.ok_or_else(|| Failure::new(Kind::Input, format!("`{key}` holds None")))?);
        }
        Ok(Some(Value::Array(array)))
    } else {
        let kind = from.get_type().name()?;
        let accepted = "a number, a bool, a str, a list or a dict";
        Err(Failure::new(Kind::Input, format!("`{key}` is of the type {kind}; a setting is {accepted}")).into())
    }
}

/// Overwrites `table` with the contents of `with`. Tables are merged; `None` removes a key.
pub(crate) fn merge(table: &mut Table, with: &Bound<'_, PyDict>) -> PyResult<()> {
    merge_at(table, with, "", 0)
}

fn merge_at(table: &mut Table, with: &Bound<'_, PyDict>, prefix: &str, depth: usize) -> PyResult<()> {
    for (key, given) in with {
        let Ok(key) = key.extract::<String>() else {
            return Err(Failure::new(Kind::Input, format!("the key {key} is no str")).into());
        };
        let name = if prefix.is_empty() { key.clone() } else { format!("{prefix}.{key}") };
        if let (Some(Value::Table(inner)), Ok(dict)) = (table.get_mut(&key), given.cast::<PyDict>()) {
            merge_at(inner, dict, &name, depth + 1)?;
            continue;
        }
        match value(&name, &given, depth)? {
            Some(value) => table.insert(key, value),
            None => table.remove(&key),
        };
    }
    Ok(())
}

/// A TOML value as a Python one.
pub(crate) fn to_python<'py>(py: Python<'py>, value: &Value) -> PyResult<Bound<'py, PyAny>> {
    match value {
        Value::String(text) => text.into_bound_py_any(py),
        Value::Integer(whole) => whole.into_bound_py_any(py),
        Value::Float(number) => number.into_bound_py_any(py),
        Value::Boolean(on) => on.into_bound_py_any(py),
        Value::Datetime(date) => date.to_string().into_bound_py_any(py),
        Value::Array(values) => {
            let values = values.iter().map(|value| to_python(py, value)).collect::<PyResult<Vec<_>>>()?;
            values.into_bound_py_any(py)
        }
        Value::Table(table) => {
            let dict = PyDict::new(py);
            for (key, value) in table {
                dict.set_item(key, to_python(py, value)?)?;
            }
            Ok(dict.into_any())
        }
    }
}
