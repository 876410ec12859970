//! A plume of smoke from a brazier, in a room lit by a spot light and a dim panel.

use super::Asset;
use super::gltf::Document;
use super::mesh::Mesh;
use super::volume::{noise, smooth, vol};
use glam::{Vec2, Vec3};

const RON: &str = r#"// Smoke that rises from a brazier into the light of a spot lamp; its density is from voxels.
Scene(
    gltf: "smoke.gltf",
    camera: LookAt(eye: (0.25, 1.15, 4.1), target: (0.0, 1.1, 0.0), vfov: 34.0),
    film: Film(width: 512, height: 512),
    lights: [
        Spot(position: (-1.4, 2.35, 1.1), direction: (1.25, -0.95, -1.1), intensity: (46.0, 37.0, 25.0), inner_cone: 12.0, outer_cone: 24.0),
    ],
    media: [
        Medium(
            name: "smoke",
            density: Grid(file: "smoke.vol"),
            sigma_t: (16.0, 16.0, 16.0),
            albedo: (0.9, 0.91, 0.93),
        ),
    ],
    render: Render(exposure: 0.5),
)
"#;

/// Voxels, 2.5 cm apart, and the box they fill.
const CELLS: [i32; 3] = [48, 80, 48];
const BOX: [Vec3; 2] = [Vec3::new(-0.6, 0.4, -0.6), Vec3::new(0.6, 2.4, 0.6)];
/// Radius of the plume at its foot, and by how much it widens per metre of height.
const FOOT: f32 = 0.1;
const WIDENS: f32 = 0.17;

pub(super) fn asset() -> Asset {
    let mut document = Document::default();
    let plaster = document.lambertian("plaster", [0.44, 0.47, 0.52]);
    let boards = document.lambertian("boards", [0.34, 0.22, 0.13]);
    let iron = document.lambertian("iron", [0.09, 0.085, 0.08]);
    let panel = document.emitter("panel", [0.45, 0.65, 1.0], 2.5);

    let corner = |x: f32, y: f32, z: f32| Vec3::new(1.7 * x, 2.7 * y, 1.6 * z);
    let [a, b, c, d] = [
        corner(-1.0, 0.0, 1.0),
        corner(1.0, 0.0, 1.0),
        corner(1.0, 0.0, -1.0),
        corner(-1.0, 0.0, -1.0),
    ];
    let up = Vec3::Y * 2.7;
    let mut walls = Mesh::default();
    walls.polygon(&[d, c, c + up, d + up]);
    walls.polygon(&[a, d, d + up, a + up]);
    walls.polygon(&[c, b, b + up, c + up]);
    walls.polygon(&[a + up, d + up, c + up, b + up]);
    document.part("walls", &walls, plaster);
    let mut floor = Mesh::default();
    document.part("floor", floor.polygon(&[a, b, c, d]), boards);

    let mut brazier = Mesh::default();
    brazier.shaft(Vec3::ZERO, 0.16, 0.36, 48);
    brazier.cuboid([-0.2, 0.0, -0.2], [0.2, 0.06, 0.2]);
    brazier.cuboid([-0.22, 0.36, -0.22], [0.22, 0.4, 0.22]);
    document.part("brazier", &brazier, iron);

    let mut lamp = Mesh::default();
    let below = |x: f32, z: f32| Vec3::new(x, 2.69, z);
    lamp.polygon(&[
        below(0.5, -0.9),
        below(1.5, -0.9),
        below(1.5, 0.6),
        below(0.5, 0.6),
    ]);
    document.part("panel", &lamp, panel);

    Asset {
        name: "smoke",
        ron: RON.to_owned(),
        gltf: Some(document),
        variants: Vec::new(),
        volume: Some(vol(CELLS, BOX, density)),
    }
}

/// The plume: it sways and frays the more the higher it has risen.
fn density(p: Vec3) -> f32 {
    let [low, high] = BOX;
    let height = p.y - low.y;
    let turn = |shift: f32| noise(Vec3::new(shift, 1.3 * height, 0.5)) - 0.5;
    let sway = Vec2::new(turn(3.0), turn(11.0)) * (0.1 + 0.3 * height);
    // Curls: places are moved by noise themselves.
    let curl = |shift: f32| noise(2.2 * p + Vec3::splat(shift)) - 0.5;
    let curled = p + Vec3::new(curl(20.0), curl(40.0), curl(60.0)) * (0.25 + 0.25 * height);
    let radius = FOOT + WIDENS * height;
    let off = Vec2::new(curled.x, curled.z).distance(sway) / radius;
    let frayed = 1.0 - off + 1.1 * (noise(curled * Vec3::new(7.0, 4.5, 7.0)) - 0.45);
    // Thin air around it, so that nothing is cut off at the faces of the box.
    let inside = (p - low).min(high - p).min_element();
    smooth(frayed / 0.9) * smooth(inside / 0.15) / (1.0 + 1.1 * height)
}
