//! Light beyond the first surface, for Python.

use meniscus_core::fitted_bvh::Node;
use meniscus_core::memory;
use meniscus_core::simd::Path;
use meniscus_core::tracing::{self, Fluid, Image, Meshes, Scene, Settings, World};
use numpy::{IntoPyArray, PyArray1, PyArray2, PyArray3, PyArrayMethods, PyUntypedArrayMethods};
use pyo3::prelude::*;

use crate::arrays::{Pixels, ReadPixels, Rows};
use crate::fitted_bvh::FittedBvh;
use crate::run::{python_error, run};
use crate::shading::{LightArguments, MaterialArguments, ViewArguments, lights_of, materials_of, view_of};

/// Numbers of a node in an array.
const NODE_NUMBERS: usize = 8;

/// Tree, radii, colours, materials.
type FluidArguments<'py> = (Bound<'py, FittedBvh>, Bound<'py, PyAny>, Option<Bound<'py, PyAny>>, Option<Bound<'py, PyAny>>);
/// Tree, normals, materials.
type MeshArguments<'py> = (Bound<'py, Triangles>, Bound<'py, PyAny>, Bound<'py, PyAny>);
/// Colour, image, and the rows of the rotation into its space.
type WorldArguments<'py> = ([f32; 3], Option<Bound<'py, WorldImage>>, [[f64; 3]; 3]);
/// Reflections, refractions, shadows, occlusion rays, their distance, samples.
type TracingArguments = (u32, u32, bool, u32, f64, u32);
type TreeArrays<'py> = (Bound<'py, PyArray2<f32>>, Bound<'py, PyArray1<u32>>);

/// A tree over triangles.
///
/// vertices float32 (V, 3), world space; triangles int32 (T, 3): the numbers of their corners.
#[pyclass(frozen)]
pub struct Triangles {
    triangles: tracing::Triangles,
}

#[pymethods]
impl Triangles {
    #[new]
    #[pyo3(signature = (vertices, triangles, *, threads=0, watch=None))]
    fn new(
        python: Python<'_>,
        vertices: &Bound<'_, PyAny>,
        triangles: &Bound<'_, PyAny>,
        threads: usize,
        watch: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let vertices = Rows::<f32, 3>::borrow("vertices", vertices)?;
        let triangles = Rows::<i32, 3>::borrow("triangles", triangles)?;
        let (vertices, triangles) = (vertices.rows(), triangles.rows());
        let build = |job: &_| tracing::Triangles::build(vertices, triangles, job);
        Ok(Self { triangles: run(python, threads, watch, build)? })
    }

    /// The tree for a GPU: nodes float32 (M, 8) as those of the fitted BVH, ids uint32 (K,) of the triangles of its leaves.
    fn arrays<'py>(&self, python: Python<'py>) -> PyResult<TreeArrays<'py>> {
        let nodes = self.triangles.nodes();
        let mut numbers = memory::with_capacity(nodes.len()).map_err(python_error)?;
        numbers.extend(nodes.iter().map(Node::numbers));
        let numbers = numbers.into_flattened().into_pyarray(python).reshape([nodes.len(), NODE_NUMBERS])?;
        Ok((numbers, PyArray1::from_slice(python, self.triangles.ids())))
    }
}

/// An equirectangular image of the world: pixels float32 (H, W, 3), row 0 at the bottom.
#[pyclass(frozen)]
pub struct WorldImage {
    image: tracing::WorldImage,
}

#[pymethods]
impl WorldImage {
    #[new]
    fn new(python: Python<'_>, pixels: &Bound<'_, PyAny>) -> PyResult<Self> {
        let size = pixels.cast::<numpy::PyUntypedArray>().ok().filter(|array| array.ndim() == 3);
        let [height, width] = size.map_or([0, 0], |array| [array.shape()[0], array.shape()[1]]);
        let pixels = ReadPixels::<f32, 3>::borrow("pixels", pixels, [width, height])?;
        let mut copy = memory::with_capacity(width * height).map_err(python_error)?;
        copy.extend_from_slice(pixels.rows());
        Ok(Self { image: run(python, 1, None, |_| tracing::WorldImage::new(copy, width, height))? })
    }

    /// The light that matt surfaces have, by their normals: float32 (h, w, 3), an image of the same kind.
    fn irradiance<'py>(&self, python: Python<'py>) -> PyResult<Bound<'py, PyArray3<f32>>> {
        let (pixels, width, height) = self.image.irradiance();
        PyArray1::from_slice(python, pixels.as_flattened()).reshape([height, width, 3])
    }
}

/// Fills an image with what is seen of the world.
///
/// rgba (height, width, 4) float32, opaque. distant: as for `trace_image`.
#[pyfunction]
#[pyo3(signature = (rgba, view, *, distant, threads=0, watch=None))]
pub fn show_world<'py>(
    python: Python<'py>,
    rgba: &Bound<'py, PyAny>,
    view: ViewArguments,
    distant: WorldArguments<'py>,
    threads: usize,
    watch: Option<&Bound<'py, PyAny>>,
) -> PyResult<()> {
    let view = view_of(view);
    let mut rgba = Pixels::<f32, 4>::borrow("rgba", rgba, [view.width, view.height])?;
    let (color, image, turn) = &distant;
    let world = World { color: *color, image: image.as_ref().map(|image| (&image.get().image, *turn)) };
    let rgba = rgba.numbers().map_err(python_error)?.as_chunks_mut().0;
    run(python, threads, watch, |job| tracing::show_world(&view, &world, rgba, job))
}

/// Traces the light of an image.
///
/// rgba (height, width, 4) float32: premultiplied, what is behind, then what is seen. depth (height, width), normal
/// (height, width, 3) in world space, color (height, width, 3): float32. material (height, width) int32: index, negative where
/// nothing is traced; ball (height, width) int32: the ball that counts most, negative where a mesh is seen. contrast (height,
/// width) float32: factor of the light, or None.
///
/// fluid: the tree, radii float32 (N,), colours float32 (N, 3) or None, materials int32 (N,) or None. meshes: the tree, normals
/// float32 (T, 9), materials int32 (T,). distant, the world: colour, image or None, and the rows of the rotation into its space. tracing:
/// reflections, refractions, shadows, occlusion rays, their distance, samples. number: how many were made of this view before.
#[pyfunction]
#[pyo3(signature = (rgba, depth, normal, color, material, ball, contrast, view, *, fluid, meshes, materials, lights, distant,
                    tracing, number=0, is_film_clear=false, threads=0, watch=None))]
#[expect(clippy::too_many_arguments, reason = "Python passes them by name")]
pub fn trace_image<'py>(
    python: Python<'py>,
    rgba: &Bound<'py, PyAny>,
    depth: &Bound<'py, PyAny>,
    normal: &Bound<'py, PyAny>,
    color: &Bound<'py, PyAny>,
    material: &Bound<'py, PyAny>,
    ball: &Bound<'py, PyAny>,
    contrast: Option<&Bound<'py, PyAny>>,
    view: ViewArguments,
    fluid: FluidArguments<'py>,
    meshes: MeshArguments<'py>,
    materials: Vec<MaterialArguments>,
    lights: Vec<LightArguments>,
    distant: WorldArguments<'py>,
    tracing: TracingArguments,
    number: u32,
    is_film_clear: bool,
    threads: usize,
    watch: Option<&Bound<'py, PyAny>>,
) -> PyResult<()> {
    let view = view_of(view);
    let size = [view.width, view.height];
    let mut rgba = Pixels::<f32, 4>::borrow("rgba", rgba, size)?;
    let (depth, normal) =
        (ReadPixels::<f32, 1>::borrow("depth", depth, size)?, ReadPixels::<f32, 3>::borrow("normal", normal, size)?);
    let color = ReadPixels::<f32, 3>::borrow("color", color, size)?;
    let (material, ball) =
        (ReadPixels::<i32, 1>::borrow("material", material, size)?, ReadPixels::<i32, 1>::borrow("ball", ball, size)?);
    let contrast = contrast.map(|contrast| ReadPixels::<f32, 1>::borrow("contrast", contrast, size)).transpose()?;
    let radii = Rows::<f32, 1>::borrow("radii", &fluid.1)?;
    let colors = fluid.2.as_ref().map(|colors| Rows::<f32, 3>::borrow("ball_colors", colors)).transpose()?;
    let ball_materials = fluid.3.as_ref().map(|of| Rows::<i32, 1>::borrow("ball_materials", of)).transpose()?;
    let mesh_normals = Rows::<f32, 9>::borrow("mesh_normals", &meshes.1)?;
    let mesh_materials = Rows::<i32, 1>::borrow("mesh_materials", &meshes.2)?;
    let (materials, lights) = (materials_of(materials), lights_of(lights)?);
    let (color_of_world, world_image, turn) = &distant;
    let scene = Scene {
        fluid: Fluid {
            bvh: &fluid.0.get().bvh,
            radii: radii.numbers(),
            colors: colors.as_ref().map_or(&[], |colors| colors.rows()),
            materials: ball_materials.as_ref().map_or(&[], |of| of.numbers()),
        },
        meshes: Meshes {
            triangles: &meshes.0.get().triangles,
            normals: mesh_normals.rows(),
            materials: mesh_materials.numbers(),
        },
        materials: &materials,
        lights: &lights,
        world: World { color: *color_of_world, image: world_image.as_ref().map(|image| (&image.get().image, *turn)) },
    };
    let (reflections, refractions, shadows, occlusion_rays, occlusion_distance, samples) = tracing;
    let settings = Settings {
        reflections,
        refractions,
        shadows,
        occlusion_rays,
        occlusion_distance,
        samples,
        image: number,
        is_film_clear,
    };
    let image = Image {
        depth: depth.numbers(),
        normal: normal.rows(),
        color: color.rows(),
        material: material.numbers(),
        ball: ball.numbers(),
        contrast: contrast.as_ref().map_or(&[], |contrast| contrast.numbers()),
        rgba: rgba.numbers().map_err(python_error)?.as_chunks_mut().0,
    };
    let path = Path::chosen().map_err(python_error)?;
    run(python, threads, watch, |job| tracing::trace_image(path, &view, &scene, &settings, image, job))
}
