//! Every form of the contract's scene file is read, with the defaults it promises.

#![allow(clippy::unwrap_used, reason = "a failing test panics")]

use std::path::Path;
use tyndall_scene::scene_file::lights::Light;
use tyndall_scene::scene_file::media::{Density, PhaseFunction, Region};
use tyndall_scene::scene_file::{Camera, SceneFile, parse};

fn read(text: &str) -> SceneFile {
    parse(text.as_bytes(), Path::new("scene.ron")).unwrap_or_else(|error| panic!("{text}\n{error}"))
}

/// The example of the contract, with numbers for its dots.
const EXAMPLE: &str = r#"
Scene(
    gltf: "cornell.glb",                 // path relative to this file; left out for a scene of media and lights alone
    camera: LookAt(eye: (0.0, 1.0, 3.9), target: (0.0, 1.0, 0.0), up: (0.0, 1.0, 0.0), vfov: 39.3),
                                         // or Gltf("name"); left out: the file's first camera
    film: Film(width: 1024, height: 768),
    lights: [                            // added to the glTF's own
        Point(position: (0.0, 1.9, 0.0), intensity: (8.0, 8.0, 8.0)),
        Spot(position: (1.0, 2.0, 3.0), direction: (0.0, -2.0, 0.0), intensity: (4.0, 5.0, 6.0), inner_cone: 10.0, outer_cone: 20.0),  // half-angles
        Directional(direction: (0.0, -1.0, 0.0), irradiance: (1.0, 2.0, 3.0)),          // the direction in which light travels
        Sky(radiance: (0.1, 0.2, 0.3)),                                    // constant environment
        Environment(file: "sky.exr", scale: 1.0, rotation: 0.0),   // equirectangular, centre towards -Z, u grows towards +X,
    ],                                                             // rotation counter-clockwise seen from above
    media: [                             // overlapping media add up: coefficients sum, phase functions mix by σs
        Medium(
            name: "fog",
            region: Everywhere,          // or Box(min: (…), max: (…)), Sphere(center: (…), radius: …)
            density: Constant(1.0),      // or Height(base: 0.0, scale_height: 2.0): exp(-(y-base)/scale_height), clamped to 1 below base
                                         // or Grid(file: "smoke.vdb", grid: "density", scale: 1.0, transform: [16 numbers, column-major])
            sigma_t: (0.5, 0.5, 0.5),    // extinction per metre at density 1
            albedo: (0.9, 0.9, 0.9),     // single-scattering albedo σs/σt, each in [0, 1]
            phase: Isotropic,            // or HenyeyGreenstein(g: 0.7), Rayleigh, Mixture([(0.8, HenyeyGreenstein(g: 0.8)), (0.2, Isotropic)])
            emission: (0.0, 0.0, 0.0),   // radiance per metre at density 1
        ),
    ],
    render: Render(error: 0.03, max_depth: None, exposure: 0.0),
)
"#;

#[test]
fn the_contracts_example_is_read() {
    let scene = read(EXAMPLE);
    assert_eq!(scene.gltf.as_deref(), Some("cornell.glb"));
    assert!(matches!(scene.camera, Some(Camera::LookAt(_))));
    assert_eq!((scene.film.size.width, scene.film.size.height), (1024, 768));
    assert_eq!(scene.lights.len(), 5);
    let Light::Spot(spot) = &scene.lights[1] else {
        panic!("{:?}", scene.lights[1]);
    };
    assert_eq!(spot.0.direction.0.to_array(), [0.0, -1.0, 0.0]);
    assert_eq!(spot.0.intensity.0.to_array(), [4.0, 5.0, 6.0]);
    assert_eq!(spot.0.outer_cone.get(), 20.0);
    let medium = &scene.media[0];
    assert_eq!(medium.name.as_deref(), Some("fog"));
    assert_eq!(medium.sigma_t.0.to_array(), [0.5; 3]);
    assert_eq!(medium.albedo.0.to_array(), [0.9; 3]);
    assert_eq!(scene.render.error.get(), 0.03);
}

#[test]
fn the_example_with_dos_line_ends_and_a_byte_order_mark_is_the_same() {
    let dos = format!("\u{feff}{}", EXAMPLE.replace('\n', "\r\n"));
    assert_eq!(read(&dos), read(EXAMPLE));
}

#[test]
fn what_is_left_out_has_the_contracts_default() {
    let shown = read(
        r#"Scene(
            film: Film(width: 1024, height: 768, fps: 24.0), lights: [], media: [],
            render: Render(error: 0.03, max_depth: None, exposure: 0.0),
        )"#,
    );
    for bare in [
        "Scene()",
        "()",
        "Scene(film: Film(), render: Render())",
        "(film: (height: 768))",
    ] {
        assert_eq!(read(bare), shown, "{bare}");
    }
    let medium = |fields: &str| {
        let text =
            format!("Scene(media: [Medium(sigma_t: (1, 1, 1), albedo: (0, 0, 0), {fields})])");
        read(&text).media.remove(0)
    };
    let mut defaults = medium("");
    assert_eq!(
        medium("region: Everywhere, density: Constant(1.0), phase: Isotropic, emission: (0, 0, 0)"),
        defaults
    );
    defaults.density = medium("density: Height(base: 0.0, scale_height: 2.0)").density;
    assert_eq!(medium("density: Height()"), defaults);
    defaults.density =
        medium(r#"density: Grid(file: "a.vdb", scale: 1.0, grid: None, transform: None)"#).density;
    assert_eq!(medium(r#"density: Grid(file: "a.vdb")"#), defaults);
    let environment = |fields| {
        read(&format!(
            "Scene(lights: [Environment(file: \"a.exr\"{fields})])"
        ))
    };
    assert_eq!(environment(""), environment(", scale: 1.0, rotation: 0.0"));
    let camera = |up| {
        read(&format!(
            "Scene(camera: LookAt(eye: (0, 0, 1), target: (0, 0, 0), vfov: 40{up}))"
        ))
    };
    assert_eq!(camera(""), camera(", up: (0, 1, 0)"));
}

#[test]
fn a_camera_path_is_a_list_of_keys() {
    let path = |keys: &str| read(&format!("Scene(camera: Path([{keys}]))")).camera;
    let full = "Key(frame: 0.0, eye: (0.0, 1.0, 4.0), target: (0.0, 1.0, 0.0), up: (0.0, 1.0, 0.0), vfov: 50.0),
        Key(frame: 47.0, eye: (2.0, 1.0, 4.0), target: (0.0, 1.0, 0.0), up: (0.0, 1.0, 0.0), vfov: 40.0),";
    let Some(Camera::Path(read)) = path(full) else {
        panic!("not a path");
    };
    assert_eq!(read.0.span(), [0.0, 47.0]);
    let bare = "(frame: 0, eye: (0, 1, 4), target: (0, 1, 0), vfov: 50), (frame: 47, eye: (2, 1, 4), target: (0, 1, 0), vfov: 40)";
    assert_eq!(path(bare), path(full));
    assert!(path("Key(frame: 2.5, eye: (0, 1, 4), target: (0, 1, 0), vfov: 50)").is_some());
}

#[test]
fn options_are_read_with_and_without_some() {
    for (with, without) in [
        (r#"gltf: Some("a.glb")"#, r#"gltf: "a.glb""#),
        (r#"gltf: None"#, ""),
        (r#"camera: Some(Gltf("a"))"#, r#"camera: Gltf("a")"#),
        (
            "camera: Some(LookAt(eye: (0, 0, 1), target: (0, 0, 0), vfov: 40))",
            "camera: LookAt(eye: (0, 0, 1), target: (0, 0, 0), vfov: 40)",
        ),
        (
            "camera: Some(Path([Key(frame: 0, eye: (0, 0, 1), target: (0, 0, 0), vfov: 40)]))",
            "camera: Path([Key(frame: 0, eye: (0, 0, 1), target: (0, 0, 0), vfov: 40)])",
        ),
        ("camera: None", ""),
        (
            "render: Render(max_depth: Some(3))",
            "render: Render(max_depth: 3)",
        ),
        (
            r#"media: [Medium(name: Some("m"), sigma_t: (1, 1, 1), albedo: (0, 0, 0))]"#,
            r#"media: [Medium(name: "m", sigma_t: (1, 1, 1), albedo: (0, 0, 0))]"#,
        ),
        (
            r#"media: [Medium(sigma_t: (1, 1, 1), albedo: (0, 0, 0), density: Grid(file: "f", grid: Some("g"),
                transform: Some([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 2, 3, 4, 1])))]"#,
            r#"media: [Medium(sigma_t: (1, 1, 1), albedo: (0, 0, 0), density: Grid(file: "f", grid: "g",
                transform: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 2, 3, 4, 1]))]"#,
        ),
    ] {
        assert_eq!(
            read(&format!("Scene({with})")),
            read(&format!("Scene({without})")),
            "{with}"
        );
    }
}

#[test]
fn every_region_density_and_phase_function_is_read() {
    let medium = |fields: &str| {
        let text =
            format!("Scene(media: [Medium(sigma_t: (1, 2, 3), albedo: (0, 0.5, 1), {fields})])");
        read(&text).media.remove(0)
    };
    let Region::Box(cube) = medium("region: Box(min: (-1, -2, -3), max: (1, 2, 3))").region else {
        panic!("not a box");
    };
    assert_eq!(cube.0.min.0.to_array(), [-1.0, -2.0, -3.0]);
    let Region::Sphere(ball) = medium("region: Sphere(center: (0, 1, 0), radius: 0.5)").region
    else {
        panic!("not a sphere");
    };
    assert_eq!(ball.radius.get(), 0.5);
    let Density::Constant(density) = medium("density: Constant(2)").density else {
        panic!("not constant");
    };
    assert_eq!(density.get(), 2.0);
    let grid = r#"density: Grid(file: "smoke.vdb", grid: "density", scale: 1.5,
        transform: [2, 0, 0, 0, 0, 2, 0, 0, 0, 0, 2, 0, 7, 8, 9, 1])"#;
    let Density::Grid(grid) = medium(grid).density else {
        panic!("not a grid");
    };
    assert_eq!(grid.grid.as_deref(), Some("density"));
    // Column by column: the last four numbers are the translation.
    let transform = grid.transform.unwrap().0;
    assert_eq!(transform.w_axis.to_array(), [7.0, 8.0, 9.0, 1.0]);
    assert_eq!(medium("phase: Rayleigh").phase, PhaseFunction::Rayleigh);
    let mixture = "phase: Mixture([(0.8, HenyeyGreenstein(g: 0.8)), (0.2, Isotropic)])";
    let PhaseFunction::Mixture(mixture) = medium(mixture).phase else {
        panic!("not a mixture");
    };
    assert_eq!(mixture.0[0].0.get(), 0.8);
    assert!(
        matches!(&mixture.0[0].1, PhaseFunction::HenyeyGreenstein(lobe) if lobe.g.get() == 0.8)
    );
    assert_eq!(mixture.0[1].1, PhaseFunction::Isotropic);
}

#[test]
fn whole_numbers_exponents_signs_and_underscores_are_numbers() {
    for (number, value) in [
        ("2", 2.0),
        ("2.", 2.0),
        ("+2.5", 2.5),
        ("-0.0", -0.0),
        ("1e-3", 1e-3),
        ("1_0.5", 10.5),
    ] {
        let scene = read(&format!("Scene(render: Render(exposure: {number}))"));
        assert_eq!(scene.render.exposure.get(), value, "{number}");
    }
}

#[test]
fn an_albedo_a_rounding_above_one_is_one() {
    let scene =
        read("Scene(media: [Medium(sigma_t: (1, 1, 1), albedo: (1.0000001, 1, 0.99999999))])");
    assert_eq!(scene.media[0].albedo.0.to_array(), [1.0; 3]);
}
