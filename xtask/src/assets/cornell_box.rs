//! The Cornell box with fog: the measured room of the Cornell Program of Computer Graphics (1984) in metres, turned so
//! that the camera looks along −Z. Extinction and albedo are those of the well-known foggy variant (0.5 + 1.0 per metre
//! on a room of 0.55 m, optical depth 0.8 across).

use super::Asset;
use super::gltf::Document;
use super::mesh::Mesh;
use glam::Vec3;

const RON: &str = r#"// The Cornell box, 0.55 m wide, filled with isotropic fog as far as the camera.
Scene(
    gltf: "cornell_box.gltf",
    camera: LookAt(eye: (0.0, 0.273, 0.8), target: (0.0, 0.273, 0.0), vfov: 39.3077),
    film: Film(width: 512, height: 512),
    media: [
        Medium(
            name: "fog",
            region: Box(min: (-0.4, -0.1, -0.7), max: (0.4, 0.65, 0.85)),
            sigma_t: (1.5, 1.5, 1.5),
            albedo: (0.6666667, 0.6666667, 0.6666667),
        ),
    ],
)
"#;

/// Height of the room and of the lamp's gap below the ceiling, in metres.
const HEIGHT: f32 = 0.5488;
const LAMP_GAP: f32 = 0.002;

/// Corners of floor and ceiling in the original plan, from front left over back left to front right; the room is not
/// quite rectangular.
const FLOOR: [(f32, f32); 4] = [(552.8, 0.0), (549.6, 559.2), (0.0, 559.2), (0.0, 0.0)];
const CEILING: [(f32, f32); 4] = [(556.0, 0.0), (556.0, 559.2), (0.0, 559.2), (0.0, 0.0)];

pub(super) fn asset() -> Asset {
    let mut document = Document::default();
    let white = document.lambertian("white", [0.73, 0.73, 0.73]);
    let red = document.lambertian("red", [0.63, 0.065, 0.05]);
    let green = document.lambertian("green", [0.14, 0.45, 0.091]);
    let lamp = document.emitter("lamp", [1.0, 0.76, 0.46], 130.0);

    let mut room = Mesh::default();
    room.polygon(&CEILING.map(|p| point(p, HEIGHT)));
    let mut floor = FLOOR.map(|p| point(p, 0.0));
    floor.reverse();
    room.polygon(&floor).polygon(&wall(1, 2));
    document.part("floor, ceiling and back", &room, white);
    for (name, [a, b], paint) in [("left wall", [0, 1], red), ("right wall", [2, 3], green)] {
        let mut side = Mesh::default();
        document.part(name, side.polygon(&wall(a, b)), paint);
    }

    let short = [(130.0, 65.0), (82.0, 225.0), (240.0, 272.0), (290.0, 114.0)];
    let tall = [
        (423.0, 247.0),
        (265.0, 296.0),
        (314.0, 456.0),
        (472.0, 406.0),
    ];
    let mut blocks = Mesh::default();
    for (plan, height) in [(short, 0.165), (tall, 0.33)] {
        blocks.prism(&plan.map(|p| point(p, 0.0)), Vec3::Y * height);
    }
    document.part("blocks", &blocks, white);

    let mut panel = Mesh::default();
    let outline = [
        (343.0, 227.0),
        (343.0, 332.0),
        (213.0, 332.0),
        (213.0, 227.0),
    ];
    panel.polygon(&outline.map(|p| point(p, HEIGHT - LAMP_GAP)));
    document.part("lamp", &panel, lamp);

    Asset {
        name: "cornell_box",
        ron: RON.to_owned(),
        gltf: Some(document),
        variants: vec![
            ("cornell_box_forward", scattering(0.7)),
            ("cornell_box_backward", scattering(-0.4)),
        ],
        volume: None,
    }
}

/// The scene with fog of mean cosine `g`.
fn scattering(g: f32) -> String {
    let albedo = "albedo: (0.6666667, 0.6666667, 0.6666667),\n";
    let phase = format!("{albedo}            phase: HenyeyGreenstein(g: {g}),\n");
    let kind = if g > 0.0 { "forward" } else { "backward" };
    RON.replace("isotropic fog", &format!("fog that scatters {kind}"))
        .replace(albedo, &phase)
}

/// A point of the original plan (x to the left, z away from the camera, millimetres) at height `y` in metres.
fn point((x, z): (f32, f32), y: f32) -> Vec3 {
    Vec3::new((278.0 - x) / 1000.0, y, 0.0 - z / 1000.0)
}

/// The wall between corners `a` and `b` of the plans, which lie left and right seen from inside.
fn wall(a: usize, b: usize) -> [Vec3; 4] {
    [
        point(FLOOR[a], 0.0),
        point(FLOOR[b], 0.0),
        point(CEILING[b], HEIGHT),
        point(CEILING[a], HEIGHT),
    ]
}
