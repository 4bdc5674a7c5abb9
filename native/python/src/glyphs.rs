//! Spheres and ellipsoids as a camera sees them, for Python.

use meniscus_core::glyphs::{self, Extents, Glyphs, Image, View};
use meniscus_core::simd::Path;
use pyo3::prelude::*;

use crate::arrays::{Pixels, Rows};
use crate::run::{python_error, run};

/// How far glyphs reach, as Python gives it.
enum ExtentArray<'py> {
    Radii(Rows<'py, f32, 1>),
    Axes(Rows<'py, f32, 9>),
}

impl<'py> ExtentArray<'py> {
    fn borrow(argument: &Bound<'py, PyAny>) -> PyResult<Self> {
        let axes = Rows::borrow("extents", argument).map(Self::Axes);
        axes.or_else(|_| Rows::borrow("extents", argument).map(Self::Radii))
    }

    fn plain(&self) -> Extents<'_> {
        match self {
            Self::Radii(radii) => Extents::Spheres(radii.numbers()),
            Self::Axes(axes) => Extents::Ellipsoids(axes.rows()),
        }
    }
}

/// Writes what a camera sees of spheres or ellipsoids, each with a surface of its own.
///
/// centers (G, 3) float32, world space. extents float32: (G,) radii of spheres, or (G, 9) the three semi-axes of ellipsoids,
/// world space, at right angles. names (G,) int32: what stands for each. The camera is that of `TileCaster`. depth
/// (height, width) float32: planar, background where there is nothing; normal (height, width, 3) float32: unit, world space,
/// out of the glyph; name (height, width) int32: that of the glyph that is seen, -1 where there is none. attributes: pairs of
/// (G, 3) float32, a row for each glyph, and its image (height, width, 3) float32, 0 where there is nothing.
#[pyfunction]
#[pyo3(signature = (centers, extents, names, depth, normal, name, *, background, camera_from_world, eye, window,
                    is_perspective, width, height, clip, attributes=vec![], threads=0, watch=None))]
#[expect(clippy::too_many_arguments, reason = "Python passes them by name")]
pub fn cast_glyphs(
    python: Python<'_>,
    centers: &Bound<'_, PyAny>,
    extents: &Bound<'_, PyAny>,
    names: &Bound<'_, PyAny>,
    depth: &Bound<'_, PyAny>,
    normal: &Bound<'_, PyAny>,
    name: &Bound<'_, PyAny>,
    background: f32,
    camera_from_world: [[f64; 3]; 3],
    eye: [f64; 3],
    window: [f64; 4],
    is_perspective: bool,
    width: usize,
    height: usize,
    clip: [f64; 2],
    attributes: Vec<(Bound<'_, PyAny>, Bound<'_, PyAny>)>,
    threads: usize,
    watch: Option<&Bound<'_, PyAny>>,
) -> PyResult<()> {
    let view = View { camera_from_world, eye, window, is_perspective, width, height, clip };
    let (centers, extents) = (Rows::borrow("centers", centers)?, ExtentArray::borrow(extents)?);
    let names = Rows::<i32, 1>::borrow("names", names)?;
    let size = [width, height];
    let mut depth = Pixels::<f32, 1>::borrow("depth", depth, size)?;
    let mut normal = Pixels::<f32, 3>::borrow("normal", normal, size)?;
    let mut name = Pixels::<i32, 1>::borrow("name", name, size)?;
    let mut planes = Vec::new();
    for (source, target) in &attributes {
        planes.push((Rows::<f32, 3>::borrow("attributes", source)?, Pixels::<f32, 3>::borrow("attributes", target, size)?));
    }
    let mut picked = Vec::new();
    for (source, target) in &mut planes {
        picked.push((source.rows(), target.numbers().map_err(python_error)?.as_chunks_mut().0));
    }
    let mut image = Image {
        depth: depth.numbers().map_err(python_error)?,
        glyph: name.numbers().map_err(python_error)?,
        normal: normal.numbers().map_err(python_error)?.as_chunks_mut().0,
        background,
    };
    let path = Path::chosen().map_err(python_error)?;
    let (centers, extents, names) = (centers.rows(), extents.plain(), names.numbers());
    run(python, threads, watch, |job| {
        glyphs::cast(path, &Glyphs::new(centers, extents)?, &view, &mut image, job)?;
        for (source, target) in picked {
            glyphs::pick(image.glyph, source, target)?;
        }
        glyphs::rename(image.glyph, names)
    })
}
