//! numpy's arrays: fields of a request that came from Python, and arrays for an answer.
//!
//! A field of shape s is one state; an array with one dimension before s is rows of states.
//! Arrays of float64, aligned and contiguous in C's order, are read where they lie, one state with
//! any strides is; others are converted.

use std::ops::Range;

use numpy::{
    BorrowError, Element, PyArray1, PyArrayDyn, PyArrayMethods, PyReadonlyArrayDyn,
    PyReadwriteArrayDyn, PyUntypedArray, PyUntypedArrayMethods,
};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::intern;
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::{PyList, PyTuple};
use sarrus_client::Field;
use sarrus_proto::Slot;

use super::batch::is_cut_off;

/// How many dimensions a field of one state has: numbers alone have none.
fn dimensions(slot: &Slot) -> usize {
    use Field::*;
    match slot.field {
        Residual | Iterations | CondKd | CondGu | SigmaMin | CondMy | Projection | Margin | Dt
        | Gain => 0,
        JacobianTree | JacobianIndependent | JacobianActuator | DjacobianDy => 3,
        _ => 1 + usize::from(slot.is_matrix()),
    }
}

/// The shape of a field of one state: frames come before their rows.
pub(super) fn shape(slot: &Slot) -> Vec<usize> {
    let Slot { rows, columns, .. } = *slot;
    match dimensions(slot) {
        0 => vec![],
        1 => vec![rows],
        2 => vec![rows, columns],
        _ => vec![rows / 6, 6, columns],
    }
}

/// A field of a request.
pub(super) struct Given<'py> {
    array: PyReadonlyArrayDyn<'py, f64>,
    /// How many states; `None` for one that is no row.
    pub(super) rows: Option<usize>,
    name: &'static str,
}

impl<'py> Given<'py> {
    /// A field from a Python object.
    pub(super) fn new(object: &Bound<'py, PyAny>, slot: &Slot) -> PyResult<Given<'py>> {
        let name = slot.field.name();
        let readable = |array: &Bound<'py, PyArrayDyn<f64>>| match array.try_readonly() {
            Ok(array) => Ok(array),
            Err(_) if is_cut_off() => Ok(copy_of(array)?.try_readonly()?),
            Err(_) => {
                let words = format!("`{name}` is being written by a batch under way");
                Err(PyValueError::new_err(words))
            }
        };
        let array = match object.cast::<PyArrayDyn<f64>>() {
            Ok(array) if array.is_c_contiguous() && array.is_aligned() => readable(array)?,
            _ => readable(&converted(object, name)?)?,
        };
        refuse_masked(object, name)?;
        let rows = match array.shape() {
            [n] if slot.columns == 1 && *n == slot.rows => None,
            found => rows(found, &shape(slot), name)?,
        };
        Ok(Given { array, rows, name })
    }

    /// Its numbers, state after state.
    pub(super) fn numbers(&self) -> PyResult<&[f64]> {
        Ok(self.array.as_slice()?)
    }
}

/// Appends the numbers of one state, where an array of float64 has just these; false where it has
/// not, or may have a mask, as subclasses do. They are copied under Python's lock, which costs less
/// than to claim the array.
pub(super) fn copied(object: &Bound<'_, PyAny>, slot: &Slot, input: &mut Vec<f64>) -> bool {
    let Ok(array) = object.cast_exact::<PyArray1<f64>>() else { return false };
    if slot.columns != 1 || array.len() != slot.rows || !array.is_aligned() {
        return false;
    }
    input.extend((0..slot.rows).map_while(|k| array.get_owned(k)));
    true
}

/// How many rows an array of this shape has, where one state has another.
fn rows(found: &[usize], expected: &[usize], name: &str) -> PyResult<Option<usize>> {
    if found == expected {
        return Ok(None);
    }
    match found.split_first() {
        Some((rows, rest)) if rest == expected => Ok(Some(*rows)),
        _ => Err(PyValueError::new_err(format!(
            "`{name}` has the shape {}, expected {} for one state or {} for rows of states",
            tuple(found, ""),
            tuple(expected, ""),
            tuple(expected, "n")
        ))),
    }
}

/// A shape as Python writes it.
fn tuple(shape: &[usize], first: &str) -> String {
    let mut sizes: Vec<String> = shape.iter().map(ToString::to_string).collect();
    if !first.is_empty() {
        sizes.insert(0, first.to_owned());
    }
    let end = if sizes.len() == 1 { "," } else { "" };
    format!("({}{end})", sizes.join(", "))
}

/// How many rows all fields have; `None` where they are one state.
pub(super) fn common_rows(given: &[Given<'_>]) -> PyResult<Option<usize>> {
    let Some(first) = given.first() else { return Ok(None) };
    let words = |given: &Given<'_>| match given.rows {
        None => "is one state".to_owned(),
        Some(rows) => format!("has {rows} rows"),
    };
    match given.iter().find(|other| other.rows != first.rows) {
        None => Ok(first.rows),
        Some(other) => Err(PyValueError::new_err(format!(
            "`{}` {} and `{}` {}; give equally many rows of each, or one state",
            first.name,
            words(first),
            other.name,
            words(other)
        ))),
    }
}

/// Anything that numpy reads as real numbers, as an array of float64.
fn converted<'py>(object: &Bound<'py, PyAny>, name: &str) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
    static AS_ARRAY: PyOnceLock<Py<PyAny>> = PyOnceLock::new();
    static REQUIRE: PyOnceLock<Py<PyAny>> = PyOnceLock::new();
    let py = object.py();
    let array = AS_ARRAY.import(py, "numpy", "asarray")?.call1((object,))?;
    let dtype = array.getattr(intern!(py, "dtype"))?;
    let kind: String = dtype.getattr(intern!(py, "kind"))?.extract()?;
    if !matches!(kind.as_str(), "f" | "i" | "u") {
        return Err(PyTypeError::new_err(format!(
            "`{name}` holds {dtype}, expected real numbers (float64 is read without a copy)"
        )));
    }
    let array = REQUIRE.import(py, "numpy", "require")?.call1((array, "float64", "CA"))?;
    Ok(array.cast_into::<PyArrayDyn<f64>>()?)
}

/// Refuses arrays with a masked element, within lists and tuples as well: the number below a mask
/// has no meaning. For objects that numpy has read already.
#[pyfunction]
pub(crate) fn refuse_masked(object: &Bound<'_, PyAny>, name: &str) -> PyResult<()> {
    static IS_MASKED: PyOnceLock<Py<PyAny>> = PyOnceLock::new();
    let py = object.py();
    if object.is_exact_instance_of::<PyUntypedArray>() {
        return Ok(());
    }
    if let Ok(list) = object.cast::<PyList>() {
        return list.iter().try_for_each(|item| refuse_masked(&item, name));
    }
    if let Ok(tuple) = object.cast::<PyTuple>() {
        return tuple.iter().try_for_each(|item| refuse_masked(&item, name));
    }
    let subclass = object.is_instance_of::<PyUntypedArray>();
    if subclass && IS_MASKED.import(py, "numpy.ma", "is_masked")?.call1((object,))?.is_truthy()? {
        return Err(PyValueError::new_err(format!(
            "`{name}` has masked elements, expected numbers for all; leave out the states that \
             have them, or fill them (`numpy.ma.filled`)"
        )));
    }
    Ok(())
}

/// An array for a field of an answer: the caller's, or a new one.
pub(super) fn wanted<'py>(
    py: Python<'py>,
    slot: &Slot,
    rows: Option<usize>,
    out: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
    let shape: Vec<usize> = rows.into_iter().chain(shape(slot)).collect();
    let Some(out) = out else {
        return match rows {
            None => Ok(PyArrayDyn::zeros(py, shape, false)),
            // the number of rows of the caller
            Some(_) => Ok(zeros::<f64>(py, &shape)?.cast_into()?),
        };
    };
    let name = slot.field.name();
    let array = out.cast::<PyArrayDyn<f64>>().map_err(|_| {
        PyTypeError::new_err(format!("`out` for `{name}` must be an array of float64"))
    })?;
    refuse_masked(out, "out")?;
    if array.shape() != shape.as_slice() {
        return Err(PyValueError::new_err(format!(
            "`out` for `{name}` has the shape {}, expected {}",
            tuple(array.shape(), ""),
            tuple(&shape, "")
        )));
    }
    if !array.is_c_contiguous() || !array.is_aligned() {
        return Err(PyValueError::new_err(format!(
            "`out` for `{name}` must be contiguous in C's order, such as `numpy.empty` makes it"
        )));
    }
    Ok(array.clone())
}

/// A new array of zeros, allocated by numpy: a size beyond the memory is a `MemoryError`.
pub(super) fn zeros<'py, T: Element>(
    py: Python<'py>,
    shape: &[usize],
) -> PyResult<Bound<'py, PyAny>> {
    static ZEROS: PyOnceLock<Py<PyAny>> = PyOnceLock::new();
    let shape = PyTuple::new(py, shape)?;
    ZEROS.import(py, "numpy", "zeros")?.call1((shape, numpy::dtype::<T>(py)))
}

/// An array of an answer that is to be written.
pub(super) struct Target<'a, 'py> {
    array: &'a Bound<'py, PyArrayDyn<f64>>,
    /// The array written instead, if a fork has left a claim on the original that is never
    /// released.
    copy: Option<Bound<'py, PyArrayDyn<f64>>>,
    name: &'static str,
}

impl<'a, 'py> Target<'a, 'py> {
    /// The array, which may be the caller's.
    pub(super) fn new(
        array: &'a Bound<'py, PyArrayDyn<f64>>,
        name: &'static str,
    ) -> PyResult<Target<'a, 'py>> {
        let claimed = || matches!(array.try_readwrite(), Err(BorrowError::AlreadyBorrowed));
        let copy = (is_cut_off() && claimed()).then(|| copy_of(array)).transpose()?;
        Ok(Target { array, copy, name })
    }

    /// Borrows the array exclusively.
    pub(super) fn claim(&self) -> PyResult<PyReadwriteArrayDyn<'py, f64>> {
        self.copy.as_ref().unwrap_or(self.array).try_readwrite().map_err(|_| {
            PyValueError::new_err(format!(
                "`out` for `{}` cannot be written: it is read-only, or shares memory with an input",
                self.name
            ))
        })
    }

    /// Has it in the array, after the claim was given back.
    pub(super) fn finish(&self) -> PyResult<()> {
        static COPY_TO: PyOnceLock<Py<PyAny>> = PyOnceLock::new();
        let Some(copy) = &self.copy else { return Ok(()) };
        COPY_TO.import(copy.py(), "numpy", "copyto")?.call1((self.array, copy)).map(drop)
    }
}

/// A copy, by numpy.
fn copy_of<'py>(array: &Bound<'py, PyArrayDyn<f64>>) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
    let copy = array.call_method1(intern!(array.py(), "copy"), ("C",))?;
    Ok(copy.cast_into()?)
}

/// Refuses output arrays that share memory with other arrays, including views of different objects:
/// threads read and write them without Python's lock.
pub(super) fn refuse_shared(
    read: &[(&[f64], usize)],
    want: &[(&mut [f64], usize)],
) -> PyResult<()> {
    let written: Vec<_> = want.iter().map(|(numbers, _)| numbers.as_ptr_range()).collect();
    let others = read.iter().map(|(numbers, _)| numbers.as_ptr_range());
    let all: Vec<_> = written.iter().cloned().chain(others).collect();
    let shares = |(k, a): (usize, &_)| all[k + 1..].iter().any(|b| meet(a, b));
    if written.iter().enumerate().any(shares) {
        return Err(PyValueError::new_err("`out` shares memory with an input or another output"));
    }
    Ok(())
}

/// Refuses output arrays of one state that share memory: they are written one after the other.
pub(super) fn refuse_shared_outputs(out: &[Option<Bound<'_, PyAny>>]) -> PyResult<()> {
    let arrays = out.iter().flatten().filter_map(|out| out.cast::<PyArrayDyn<f64>>().ok());
    let ranges: Vec<_> = arrays
        .map(|array| {
            let start = array.data().cast_const();
            start..start.wrapping_add(array.len())
        })
        .collect();
    let shares = |(k, a): (usize, &Range<_>)| ranges[k + 1..].iter().any(|b| meet(a, b));
    if ranges.iter().enumerate().any(shares) {
        return Err(PyValueError::new_err("`out` shares memory with another output"));
    }
    Ok(())
}

fn meet(a: &Range<*const f64>, b: &Range<*const f64>) -> bool {
    a.start < b.end && b.start < a.end
}

/// A field of one state: a number, or an array of the caller's or a new one.
pub(super) fn of_state<'py>(
    py: Python<'py>,
    slot: &Slot,
    numbers: &[f64],
    out: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    match (dimensions(slot), numbers, out) {
        (0, [number], None) => return Ok(number.into_pyobject(py)?.into_any()),
        (1, _, None) => return Ok(PyArray1::from_slice(py, numbers).into_any()),
        _ => {}
    }
    let array = wanted(py, slot, None, out)?;
    let target = Target::new(&array, slot.field.name())?;
    target.claim()?.as_slice_mut()?.copy_from_slice(numbers);
    target.finish()?;
    Ok(array.into_any())
}
