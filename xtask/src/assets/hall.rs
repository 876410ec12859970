//! A hall of columns, 20 m long: the sun falls through the arched windows of one side and draws shafts into thin fog.

use super::Asset;
use super::gltf::Document;
use super::mesh::Mesh;
use glam::Vec3;
use std::f32::consts::PI;

const RON: &str = r#"// A hall of columns with sun through its windows, 20 m long, in thin fog.
Scene(
    gltf: "hall.gltf",
    camera: LookAt(eye: (-1.3, 1.7, 9.4), target: (1.1, 2.5, 0.0), vfov: 60.0),
    film: Film(width: 640, height: 480),
    lights: [
        Directional(direction: (-0.8, -0.5, 0.25), irradiance: (24.0, 21.0, 16.0)),
        Sky(radiance: (0.6, 0.8, 1.1)),
    ],
    media: [
        Medium(
            name: "fog",
            region: Box(min: (-5.3, -0.3, -10.3), max: (5.3, 6.8, 10.3)),
            sigma_t: (0.06, 0.06, 0.06),
            albedo: (0.95, 0.95, 0.95),
        ),
    ],
    render: Render(exposure: 0.5),
)
"#;

/// Inner half width, height and half length of the hall, and the thickness of its walls, in metres.
const HALF_WIDTH: f32 = 5.0;
const HEIGHT: f32 = 6.5;
const HALF_LENGTH: f32 = 10.0;
const WALL: f32 = 0.6;

/// Windows: distance between their centres, half width, height of the sill, of the arch's foot, and of the lintel.
const BAY: f32 = 3.2;
const HALF_WINDOW: f32 = 0.7;
const SILL: f32 = 1.6;
const ARCH: f32 = 4.2;
const LINTEL: f32 = 5.0;

pub(super) fn asset() -> Asset {
    let mut document = Document::default();
    let stone = document.lambertian("stone", [0.66, 0.61, 0.53]);
    let slate = document.lambertian("slate", [0.32, 0.30, 0.28]);
    let oak = document.lambertian("oak", [0.32, 0.21, 0.12]);
    let cloth = document.lambertian("cloth", [0.48, 0.06, 0.05]);

    document.part("walls", &walls(), stone);
    document.part("window wall", &window_wall(), stone);
    document.part("columns", &columns(), stone);
    document.part("beams", &beams(), oak);

    let outer = [HALF_WIDTH + WALL, HALF_LENGTH + WALL];
    let mut floor = Mesh::default();
    floor.cuboid([-outer[0], -WALL, -outer[1]], [outer[0], 0.0, outer[1]]);
    document.part("floor", &floor, slate);
    let mut carpet = Mesh::default();
    carpet.cuboid([-0.9, 0.0, -9.0], [0.9, 0.02, 9.0]);
    document.part("carpet", &carpet, cloth);
    Asset {
        name: "hall",
        ron: RON.to_owned(),
        gltf: Some(document),
        variants: Vec::new(),
        volume: None,
    }
}

/// Ceiling and the three walls without windows.
fn walls() -> Mesh {
    let (x, z) = (HALF_WIDTH, HALF_LENGTH);
    let mut mesh = Mesh::default();
    mesh.cuboid(
        [-x - WALL, HEIGHT, -z - WALL],
        [x + WALL, HEIGHT + WALL, z + WALL],
    );
    mesh.cuboid([-x - WALL, 0.0, -z - WALL], [-x, HEIGHT, z + WALL]);
    for end in [-z - WALL, z] {
        mesh.cuboid([-x, 0.0, end], [x + WALL, HEIGHT, end + WALL]);
    }
    mesh
}

/// The wall on the side of +X with six arched windows.
fn window_wall() -> Mesh {
    let (x, z) = (HALF_WIDTH, HALF_LENGTH);
    let mut mesh = Mesh::default();
    mesh.cuboid([x, 0.0, -z], [x + WALL, SILL, z]);
    mesh.cuboid([x, LINTEL, -z], [x + WALL, HEIGHT, z]);
    let mut pier_begin = -z;
    for window in 0..6 {
        let center = (window as f32 - 2.5) * BAY;
        mesh.cuboid(
            [x, SILL, pier_begin],
            [x + WALL, LINTEL, center - HALF_WINDOW],
        );
        pier_begin = center + HALF_WINDOW;
        arch(&mut mesh, center);
    }
    mesh.cuboid([x, SILL, pier_begin], [x + WALL, LINTEL, z]);
    mesh
}

/// The stones between the half circle over a window and its lintel.
fn arch(mesh: &mut Mesh, center: f32) {
    const STONES: usize = 6;
    let curve = |i: usize| {
        let angle = PI * i as f32 / STONES as f32;
        Vec3::new(
            HALF_WIDTH,
            ARCH + HALF_WINDOW * angle.sin(),
            center - HALF_WINDOW * angle.cos(),
        )
    };
    let above = |p: Vec3| Vec3::new(p.x, LINTEL, p.z);
    for stone in 0..STONES {
        let (a, b) = (curve(stone), curve(stone + 1));
        mesh.prism(&[a, above(a), above(b), b], Vec3::X * WALL);
    }
}

/// Where the columns stand: two rows between the windows.
fn column_feet() -> impl Iterator<Item = Vec3> {
    let row = |x| (0..5).map(move |i| Vec3::new(x, 0.0, (i as f32 - 2.0) * BAY));
    row(-2.7).chain(row(2.7))
}

fn columns() -> Mesh {
    let mut mesh = Mesh::default();
    for foot in column_feet() {
        let block = |mesh: &mut Mesh, half: f32, y: [f32; 2]| {
            mesh.cuboid(
                foot + Vec3::new(-half, y[0], -half),
                foot + Vec3::new(half, y[1], half),
            );
        };
        block(&mut mesh, 0.42, [0.0, 0.3]);
        mesh.shaft(foot, 0.3, 5.2, 24);
        block(&mut mesh, 0.42, [5.1, 5.4]);
    }
    mesh
}

/// One beam along each row of columns, and one across the hall over each pair.
fn beams() -> Mesh {
    let mut mesh = Mesh::default();
    for foot in column_feet().step_by(5) {
        mesh.cuboid(
            [foot.x - 0.25, 5.4, -HALF_LENGTH],
            [foot.x + 0.25, 5.9, HALF_LENGTH],
        );
    }
    for foot in column_feet().take(5) {
        mesh.cuboid(
            [-HALF_WIDTH, 5.9, foot.z - 0.2],
            [HALF_WIDTH, HEIGHT, foot.z + 0.2],
        );
    }
    mesh
}
