//! Materials in the light of a scene, and what follows from where a surface lies, for Python.

use meniscus_core::placing::{self, Motion, Places, Surface};
use meniscus_core::shading::{self, Light, LightKind, Material, Points, Scene};
use meniscus_core::simd::Path;
use meniscus_core::tile_caster::View;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::arrays::{Pixels, ReadPixels, Rows};
use crate::run::{python_error, run};

/// camera_from_world, eye, window, is_perspective, width, height, clip: as `TileCaster` takes them by name.
pub type ViewArguments = ([[f64; 3]; 3], [f64; 3], [f64; 4], bool, usize, usize, [f64; 2]);
/// metallic, roughness, transmission, ior, emission, color, absorption.
pub type MaterialArguments = (f32, f32, f32, f32, [f32; 3], [f32; 3], [f32; 3]);
/// kind (SUN, POINT, SPOT or AREA), position, direction, power, area, cone, radius, size, right, is_round, casts_shadow.
pub type LightArguments = (String, [f32; 3], [f32; 3], [f32; 3], f32, [f32; 2], f32, [f32; 2], [f32; 3], bool, bool);

/// Lays the light of a surface over what is behind it, in all pixels that have a material.
///
/// rgba (height, width, 4): premultiplied, what is behind, then what is seen. depth (height, width), normal (height, width, 3)
/// in world space, color (height, width, 3): float32. material (height, width) int32: index, negative where nothing is shaded.
/// contrast (height, width) float32: factor of the light, or None. Lights are in view space, z to the eye. behind: the one
/// colour of all that is behind, whatever rgba holds, or None.
#[pyfunction]
#[pyo3(signature = (rgba, depth, normal, color, material, contrast, view, materials, lights, world, behind=None,
                    threads=0, watch=None))]
#[expect(clippy::too_many_arguments, reason = "Python passes them by name")]
pub fn shade_image(
    python: Python<'_>,
    rgba: &Bound<'_, PyAny>,
    depth: &Bound<'_, PyAny>,
    normal: &Bound<'_, PyAny>,
    color: &Bound<'_, PyAny>,
    material: &Bound<'_, PyAny>,
    contrast: Option<&Bound<'_, PyAny>>,
    view: ViewArguments,
    materials: Vec<MaterialArguments>,
    lights: Vec<LightArguments>,
    world: [f32; 3],
    behind: Option<[f32; 4]>,
    threads: usize,
    watch: Option<&Bound<'_, PyAny>>,
) -> PyResult<()> {
    let view = view_of(view);
    let size = [view.width, view.height];
    let mut rgba = Pixels::<f32, 4>::borrow("rgba", rgba, size)?;
    let (depth, normal) =
        (ReadPixels::<f32, 1>::borrow("depth", depth, size)?, ReadPixels::<f32, 3>::borrow("normal", normal, size)?);
    let color = ReadPixels::<f32, 3>::borrow("color", color, size)?;
    let material = ReadPixels::<i32, 1>::borrow("material", material, size)?;
    let contrast = contrast.map(|contrast| ReadPixels::<f32, 1>::borrow("contrast", contrast, size)).transpose()?;
    let (materials, lights) = (materials_of(materials), lights_of(lights)?);
    let scene = Scene::new(&materials, &lights, world).map_err(python_error)?;
    let image = shading::Image {
        depth: depth.numbers(),
        normal: normal.rows(),
        color: color.rows(),
        material: material.numbers(),
        contrast: contrast.as_ref().map_or(&[], |contrast| contrast.numbers()),
        rgba: rgba.numbers().map_err(python_error)?.as_chunks_mut().0,
        behind,
    };
    let path = Path::chosen().map_err(python_error)?;
    run(python, threads, watch, |job| shading::shade_image(path, &view, &scene, image, job))
}

/// The radiance of points, without what is behind them.
///
/// radiance (N, 3): to be written. positions, point_normals, to_eyes, point_colors (N, 3) float32; point_materials (N,) int32. Lights are in the space
/// of the points.
#[pyfunction]
#[pyo3(signature = (radiance, positions, point_normals, to_eyes, point_colors, point_materials, materials, lights, world, threads=0, watch=None))]
#[expect(clippy::too_many_arguments, reason = "Python passes them by name")]
pub fn shade_points(
    python: Python<'_>,
    radiance: &Bound<'_, PyAny>,
    positions: &Bound<'_, PyAny>,
    point_normals: &Bound<'_, PyAny>,
    to_eyes: &Bound<'_, PyAny>,
    point_colors: &Bound<'_, PyAny>,
    point_materials: &Bound<'_, PyAny>,
    materials: Vec<MaterialArguments>,
    lights: Vec<LightArguments>,
    world: [f32; 3],
    threads: usize,
    watch: Option<&Bound<'_, PyAny>>,
) -> PyResult<()> {
    let (position, normal) =
        (Rows::<f32, 3>::borrow("positions", positions)?, Rows::<f32, 3>::borrow("point_normals", point_normals)?);
    let (to_eye, color) = (Rows::<f32, 3>::borrow("to_eyes", to_eyes)?, Rows::<f32, 3>::borrow("point_colors", point_colors)?);
    let material = Rows::<i32, 1>::borrow("point_materials", point_materials)?;
    let mut radiance = Pixels::<f32, 1>::borrow("radiance", radiance, [3, material.numbers().len()])?;
    let (materials, lights) = (materials_of(materials), lights_of(lights)?);
    let scene = Scene::new(&materials, &lights, world).map_err(python_error)?;
    let points = Points {
        position: position.rows(),
        normal: normal.rows(),
        to_eye: to_eye.rows(),
        color: color.rows(),
        material: material.numbers(),
    };
    let radiance = radiance.numbers().map_err(python_error)?.as_chunks_mut().0;
    let path = Path::chosen().map_err(python_error)?;
    run(python, threads, watch, |job| shading::shade_points(path, &scene, points, radiance, job))
}

/// Fills what follows from where the surface of an image lies; what is None is left out.
///
/// depth (height, width), normal (height, width, 3) and velocity (height, width, 3) or None: float32, world space. to_previous,
/// to_following (height, width, 3) or None: float32, the ways to the places one frame before and one after, beside those of the
/// velocity. position (height, width, 3), facing (height, width), vector (height, width, 4), speed (height, width): float32, to
/// be written.
#[pyfunction]
#[pyo3(signature = (depth, normal, velocity, to_previous, to_following, position, facing, vector, speed, *, background, view,
                    previous, following, seconds, threads=0, watch=None))]
#[expect(clippy::too_many_arguments, reason = "Python passes them by name")]
pub fn place<'py>(
    python: Python<'py>,
    depth: &Bound<'py, PyAny>,
    normal: &Bound<'py, PyAny>,
    velocity: Option<&Bound<'py, PyAny>>,
    to_previous: Option<&Bound<'py, PyAny>>,
    to_following: Option<&Bound<'py, PyAny>>,
    position: Option<&Bound<'_, PyAny>>,
    facing: Option<&Bound<'_, PyAny>>,
    vector: Option<&Bound<'_, PyAny>>,
    speed: Option<&Bound<'_, PyAny>>,
    background: f32,
    view: ViewArguments,
    previous: ViewArguments,
    following: ViewArguments,
    seconds: f64,
    threads: usize,
    watch: Option<&Bound<'_, PyAny>>,
) -> PyResult<()> {
    let (view, previous, following) = (view_of(view), view_of(previous), view_of(following));
    let size = [view.width, view.height];
    let (depth, normal) =
        (ReadPixels::<f32, 1>::borrow("depth", depth, size)?, ReadPixels::<f32, 3>::borrow("normal", normal, size)?);
    let motion_image = |name: &str, image: Option<&Bound<'py, PyAny>>| {
        image.map(|image| ReadPixels::<f32, 3>::borrow(name, image, size)).transpose()
    };
    let velocity = motion_image("velocity", velocity)?;
    let ways = [motion_image("to_previous", to_previous)?, motion_image("to_following", to_following)?];
    let mut position = position.map(|image| Pixels::<f32, 3>::borrow("position", image, size)).transpose()?;
    let mut facing = facing.map(|image| Pixels::<f32, 1>::borrow("facing", image, size)).transpose()?;
    let mut vector = vector.map(|image| Pixels::<f32, 4>::borrow("vector", image, size)).transpose()?;
    let mut speed = speed.map(|image| Pixels::<f32, 1>::borrow("speed", image, size)).transpose()?;
    let surface = Surface {
        depth: depth.numbers(),
        background,
        normal: normal.rows(),
        velocity: velocity.as_ref().map_or(&[], |velocity| velocity.rows()),
        ways: ways.each_ref().map(|way| way.as_ref().map_or(&[][..], |way| way.rows())),
    };
    let places = Places {
        position: written(&mut position)?.as_chunks_mut().0,
        facing: written(&mut facing)?,
        vector: written(&mut vector)?.as_chunks_mut().0,
        speed: written(&mut speed)?,
    };
    let motion = Motion { previous: &previous, following: &following, seconds };
    let path = Path::chosen().map_err(python_error)?;
    run(python, threads, watch, |job| placing::place(path, &view, surface, motion, places, job))
}

/// Gives each pixel the number of its ball.
///
/// ball (height, width) int32: index, negative for none; table (N,) float32: the number of each ball. image (height, width)
/// float32: to be written, background where there is no ball.
#[pyfunction]
#[pyo3(signature = (ball, table, image, *, background, width, height, threads=0, watch=None))]
#[expect(clippy::too_many_arguments, reason = "Python passes them by name")]
pub fn label(
    python: Python<'_>,
    ball: &Bound<'_, PyAny>,
    table: &Bound<'_, PyAny>,
    image: &Bound<'_, PyAny>,
    background: f32,
    width: usize,
    height: usize,
    threads: usize,
    watch: Option<&Bound<'_, PyAny>>,
) -> PyResult<()> {
    let ball = ReadPixels::<i32, 1>::borrow("ball", ball, [width, height])?;
    let table = Rows::<f32, 1>::borrow("table", table)?;
    let mut image = Pixels::<f32, 1>::borrow("image", image, [width, height])?;
    let (ball, table, image) = (ball.numbers(), table.numbers(), image.numbers().map_err(python_error)?);
    run(python, threads, watch, |job| placing::label(ball, table, background, image, job))
}

fn written<'a, const C: usize>(image: &'a mut Option<Pixels<'_, f32, C>>) -> PyResult<&'a mut [f32]> {
    match image {
        Some(image) => image.numbers().map_err(python_error),
        None => Ok(&mut []),
    }
}

/// A camera.
pub fn view_of((camera_from_world, eye, window, is_perspective, width, height, clip): ViewArguments) -> View {
    View { camera_from_world, eye, window, is_perspective, width, height, clip }
}

/// Materials.
pub fn materials_of(materials: Vec<MaterialArguments>) -> Vec<Material> {
    let material = |arguments: MaterialArguments| {
        let (metallic, roughness, transmission, ior, emission, color, absorption) = arguments;
        Material { metallic, roughness, transmission, ior, emission, color, absorption }
    };
    materials.into_iter().map(material).collect()
}

/// Lights.
///
/// # Errors
/// ValueError where there is no such kind.
pub fn lights_of(lights: Vec<LightArguments>) -> PyResult<Vec<Light>> {
    let light = |arguments: LightArguments| {
        let (kind, position, direction, power, area, cone, radius, size, right, is_round, casts_shadow) = arguments;
        let kind = match kind.as_str() {
            "SUN" => LightKind::Sun,
            "POINT" => LightKind::Point,
            "SPOT" => LightKind::Spot,
            "AREA" => LightKind::Area,
            _ => return Err(PyValueError::new_err(format!("there is no kind of light called '{kind}'"))),
        };
        Ok(Light { kind, position, direction, power, area, cone, radius, size, right, is_round, casts_shadow })
    };
    lights.into_iter().map(light).collect()
}
