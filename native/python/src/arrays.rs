//! Borrows numpy arrays as slices; what does not fit is named with its shape and dtype.

use std::fmt::Write;

use meniscus_core::balls::Balls;
use meniscus_core::error::{Error, Result};
use meniscus_core::field::Field;
use meniscus_core::kernel::Kernel;
use numpy::{
    Element, PyArrayDescrMethods, PyReadonlyArrayDyn, PyReadwriteArrayDyn, PyUntypedArray, PyUntypedArrayMethods, dtype,
};
use pyo3::prelude::*;

use crate::run::python_error;

/// A C-contiguous array (N, C), or (N,) where C is 1, borrowed for as long as this lives.
pub struct Rows<'py, T: Element, const C: usize>(PyReadonlyArrayDyn<'py, T>);

impl<'py, T: Element, const C: usize> Rows<'py, T, C> {
    /// Borrows the argument `name`.
    ///
    /// # Errors
    /// ValueError that says what was expected: type, dtype, shape or contiguity.
    pub fn borrow(name: &str, argument: &Bound<'py, PyAny>) -> PyResult<Self> {
        let columns = if C == 1 { vec![None] } else { vec![None, Some(C)] };
        check::<T>(name, argument, &columns)?;
        aligned(name, argument).map(Self)
    }

    /// The rows.
    pub fn rows(&self) -> &[[T; C]] {
        self.numbers().as_chunks().0
    }

    /// All numbers, row after row.
    pub fn numbers(&self) -> &[T] {
        // `borrow` has seen that it is contiguous and aligned.
        self.0.as_slice().unwrap_or_default()
    }
}

/// A fluid as Python gives it: positions float32 (N, 3), radii and weights float32 (N,), borrowed; the coefficients of the
/// kernel, the constant first, and the isovalue.
pub struct FluidArrays<'py> {
    positions: Rows<'py, f32, 3>,
    radii: Rows<'py, f32, 1>,
    weights: Rows<'py, f32, 1>,
    kernel: Vec<f64>,
    isovalue: f64,
}

impl<'py> FluidArrays<'py> {
    /// Borrows the arguments.
    ///
    /// # Errors
    /// ValueError that says what was expected.
    pub fn borrow([positions, radii, weights]: [&Bound<'py, PyAny>; 3], kernel: Vec<f64>, isovalue: f64) -> PyResult<Self> {
        Ok(Self {
            positions: Rows::borrow("positions", positions)?,
            radii: Rows::borrow("radii", radii)?,
            weights: Rows::borrow("weights", weights)?,
            kernel,
            isovalue,
        })
    }

    /// The same without Python, for other threads.
    pub fn plain(&self) -> Fluid<'_> {
        Fluid {
            positions: self.positions.rows(),
            radii: self.radii.numbers(),
            weights: self.weights.numbers(),
            kernel: &self.kernel,
            isovalue: self.isovalue,
        }
    }
}

/// What [`FluidArrays`] holds.
pub struct Fluid<'a> {
    positions: &'a [[f32; 3]],
    radii: &'a [f32],
    weights: &'a [f32],
    kernel: &'a [f64],
    isovalue: f64,
}

impl<'a> Fluid<'a> {
    /// The balls and their field.
    ///
    /// # Errors
    /// `InvalidInput` where they are unusable.
    pub fn checked(&self) -> Result<(Balls<'a>, Field)> {
        let field = Field::new(Kernel::new(self.kernel)?, self.isovalue)?;
        Ok((Balls::new(self.positions, self.radii, self.weights)?, field))
    }
}

/// A C-contiguous image (height, width, C), or (height, width) where C is 1, borrowed to be read.
pub struct ReadPixels<'py, T: Element, const C: usize>(PyReadonlyArrayDyn<'py, T>);

impl<'py, T: Element, const C: usize> ReadPixels<'py, T, C> {
    /// Borrows the argument `name`, an image of `width` x `height`.
    ///
    /// # Errors
    /// ValueError that says what was expected: type, dtype, shape, contiguity or alignment.
    pub fn borrow(name: &str, argument: &Bound<'py, PyAny>, [width, height]: [usize; 2]) -> PyResult<Self> {
        let shape = [Some(height), Some(width), Some(C)];
        check::<T>(name, argument, if C == 1 { &shape[..2] } else { &shape })?;
        aligned(name, argument).map(Self)
    }

    /// The pixels, row after row.
    pub fn rows(&self) -> &[[T; C]] {
        self.numbers().as_chunks().0
    }

    /// All numbers, row after row.
    pub fn numbers(&self) -> &[T] {
        // `borrow` has seen that it is contiguous and aligned.
        self.0.as_slice().unwrap_or_default()
    }
}

fn aligned<'py, T: Element>(name: &str, argument: &Bound<'py, PyAny>) -> PyResult<PyReadonlyArrayDyn<'py, T>> {
    let array: PyReadonlyArrayDyn<'py, T> = argument.extract()?;
    if array.as_slice().is_err() {
        return Err(python_error(Error::InvalidInput(format!("the numbers of {name} must be aligned in memory"))));
    }
    Ok(array)
}

/// A C-contiguous image (height, width, C), or (height, width) where C is 1, borrowed to be written.
pub struct Pixels<'py, T: Element, const C: usize>(PyReadwriteArrayDyn<'py, T>);

impl<'py, T: Element, const C: usize> Pixels<'py, T, C> {
    /// Borrows the argument `name`, an image of `width` x `height`.
    ///
    /// # Errors
    /// ValueError that says what was expected: type, dtype, shape, contiguity, or that it may be written.
    pub fn borrow(name: &str, argument: &Bound<'py, PyAny>, [width, height]: [usize; 2]) -> PyResult<Self> {
        let shape = [Some(height), Some(width), Some(C)];
        check::<T>(name, argument, if C == 1 { &shape[..2] } else { &shape })?;
        let borrowed: PyResult<PyReadwriteArrayDyn<'py, T>> = argument.extract();
        borrowed
            .map(Self)
            .map_err(|_| python_error(Error::InvalidInput(format!("{name} must be an array that may be written"))))
    }

    /// All numbers, row after row.
    ///
    /// # Errors
    /// `InvalidInput` where the array is not contiguous and aligned.
    pub fn numbers(&mut self) -> Result<&mut [T]> {
        self.0.as_slice_mut().map_err(|_| Error::InvalidInput("an image must be C-contiguous and aligned".into()))
    }
}

/// Fails where an argument is no C-contiguous array of this type and shape; None stands for any length.
fn check<T: Element>(name: &str, argument: &Bound<'_, PyAny>, shape: &[Option<usize>]) -> PyResult<()> {
    let wanted = dtype::<T>(argument.py());
    let fail = |found: String| {
        let text = shape_text(shape);
        let sentence = format!("{name} must be a C-contiguous {wanted} array of the shape {text}, not {found}");
        Err(python_error(Error::InvalidInput(sentence)))
    };
    let Ok(array) = argument.cast::<PyUntypedArray>() else {
        return fail(format!("a {}", argument.get_type().name()?));
    };
    let fits = array.ndim() == shape.len()
        && array.shape().iter().zip(shape).all(|(found, wanted)| wanted.is_none_or(|w| w == *found));
    if !fits {
        return fail(format!("of the shape {}", shape_text(&array.shape().iter().copied().map(Some).collect::<Vec<_>>())));
    }
    if !array.dtype().is_equiv_to(&wanted) {
        return fail(format!("of {}", array.dtype()));
    }
    if !array.is_c_contiguous() {
        return fail(format!("with the strides {:?}", array.strides()));
    }
    Ok(())
}

/// As Python writes it, N for any length.
fn shape_text(shape: &[Option<usize>]) -> String {
    let mut text = String::from("(");
    for (place, length) in shape.iter().enumerate() {
        let separator = if place > 0 { " " } else { "" };
        let end = if place + 1 < shape.len() || shape.len() == 1 { "," } else { "" };
        // Writing to a string cannot fail.
        let _ = match length {
            Some(length) => write!(text, "{separator}{length}{end}"),
            None => write!(text, "{separator}N{end}"),
        };
    }
    text + ")"
}

/// Fails where an argument has another number of rows than there are balls.
pub fn check_rows(name: &str, rows: usize, expected: usize) -> Result<()> {
    if rows == expected {
        return Ok(());
    }
    Err(Error::InvalidInput(format!("{name} must have {expected} rows, one for each ball, not {rows}")))
}
