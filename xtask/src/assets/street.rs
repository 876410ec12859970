//! A foggy street at night, 120 m long: houses on both sides, forty lamps, and a car with its lights on.

use super::Asset;
use super::gltf::{Content, Document};
use super::mesh::{Mesh, ring};
use glam::{Quat, Vec3};

const RON: &str = r#"// A long street at night in fog: 40 lamps, and a car with headlights and tail lights.
Scene(
    gltf: "street.gltf",
    camera: LookAt(eye: (-2.5, 2.1, 6.5), target: (0.2, 2.2, -12.0), vfov: 48.0),
    film: Film(width: 640, height: 480),
    lights: [
        Sky(radiance: (0.004, 0.006, 0.011)),
    ],
    media: [
        Medium(
            name: "fog",
            region: Box(min: (-25.0, -0.5, -140.0), max: (25.0, 14.0, 20.0)),
            sigma_t: (0.03, 0.03, 0.03),
            albedo: (0.95, 0.95, 0.95),
        ),
    ],
)
"#;

/// Half width of the roadway and distance of the house fronts from its middle, in metres.
const CURB: f32 = 4.0;
const FRONT: f32 = 7.5;

/// Width, height of the eaves and depth of the houses, repeated along the street.
const HOUSES: [[f32; 3]; 5] = [
    [9.0, 6.2, 8.0],
    [7.5, 7.6, 9.0],
    [11.0, 5.4, 8.5],
    [8.5, 8.2, 9.5],
    [10.0, 6.8, 8.0],
];

pub(super) fn asset() -> Asset {
    let mut document = Document::default();
    ground(&mut document);
    houses(&mut document);
    lamps(&mut document);
    car(&mut document);
    Asset {
        name: "street",
        ron: RON,
        gltf: Some(document),
    }
}

fn ground(document: &mut Document) {
    let asphalt = document.lambertian("asphalt", [0.10, 0.10, 0.105]);
    let paving = document.lambertian("paving", [0.28, 0.27, 0.25]);
    let mut road = Mesh::default();
    road.cuboid([-24.0, -0.4, -130.0], [24.0, 0.0, 15.0]);
    document.part("road", &road, asphalt);
    let mut pavement = Mesh::default();
    for x in [-FRONT, CURB] {
        pavement.cuboid([x, 0.0, -125.0], [x + FRONT - CURB, 0.14, 14.0]);
    }
    document.part("pavement", &pavement, paving);
}

fn houses(document: &mut Document) {
    let plaster = document.lambertian("plaster", [0.55, 0.50, 0.42]);
    let brick = document.lambertian("brick", [0.36, 0.17, 0.12]);
    let tiles = document.lambertian("tiles", [0.20, 0.10, 0.08]);
    let glass = document.lambertian("dark glass", [0.03, 0.035, 0.04]);
    let [mut fronts, mut others, mut roofs, mut panes] = [(); 4].map(|()| Mesh::default());
    for side in [-1.0, 1.0] {
        let mut z = 12.0;
        for house in 0..13 {
            let [width, eaves, depth] =
                HOUSES[(house + if side > 0.0 { 2 } else { 0 }) % HOUSES.len()];
            let span = |near: f32, far: f32| {
                [
                    f32::min(side * near, side * far),
                    f32::max(side * near, side * far),
                ]
            };
            let x = span(FRONT, FRONT + depth);
            let walls = if house % 2 == 0 {
                &mut fronts
            } else {
                &mut others
            };
            walls.cuboid([x[0], 0.0, z - width], [x[1], eaves, z]);

            let ridge = Vec3::new((x[0] + x[1]) / 2.0, eaves + 0.42 * depth, z);
            let gable = [
                Vec3::new(x[0] - 0.4, eaves, z),
                Vec3::new(x[1] + 0.4, eaves, z),
                ridge,
            ];
            roofs.prism(&gable.map(|p| p - Vec3::Z * width), Vec3::Z * width);

            let pane = span(FRONT - 0.03, FRONT + 0.1);
            for (floor, sill) in [1.1, 4.0]
                .into_iter()
                .enumerate()
                .filter(|(_, sill)| sill + 2.0 < eaves)
            {
                for i in 0..3 {
                    let middle = z - width * (i as f32 + 0.5) / 3.0;
                    let (half, foot) = if (floor, i) == (0, 1) {
                        (0.5, 0.14)
                    } else {
                        (0.45, sill)
                    };
                    panes.cuboid(
                        [pane[0], foot, middle - half],
                        [pane[1], sill + 1.3, middle + half],
                    );
                }
            }
            z -= width + 0.6 * (house % 3) as f32;
        }
    }
    document.part("plaster houses", &fronts, plaster);
    document.part("brick houses", &others, brick);
    document.part("roofs", &roofs, tiles);
    document.part("windows and doors", &panes, glass);
}

/// Twenty lamps on each side, 6 m apart; the post is built around its light.
fn lamps(document: &mut Document) {
    const BULB: f32 = 5.0;
    let iron = document.lambertian("iron", [0.06, 0.07, 0.07]);
    let mut post = Mesh::default();
    post.cuboid([0.95, -BULB, -0.05], [1.05, 0.35, 0.05]);
    post.cuboid([-0.15, 0.25, -0.04], [0.95, 0.33, 0.04]);
    post.cuboid([-0.25, 0.15, -0.15], [0.25, 0.25, 0.15]);
    let content = Content {
        mesh: Some(document.mesh("lamp post", &[(&post, iron)])),
        light: Some(document.point_light("street lamp", 24.0, [1.0, 0.68, 0.36])),
    };
    for i in 0..20 {
        for (side, x, turn) in [
            ("left", -CURB + 0.7, std::f32::consts::PI),
            ("right", CURB - 0.7, 0.0),
        ] {
            let place = Vec3::new(x, BULB, 3.0 - 6.0 * i as f32);
            document.node(
                &format!("lamp {side} {i}"),
                content,
                place,
                Quat::from_rotation_y(turn),
            );
        }
    }
}

/// A car in the right lane that drives away from the camera.
fn car(document: &mut Document) {
    let paint = document.glossy("car paint", [0.05, 0.12, 0.28], 0.0, 0.4);
    let rubber = document.lambertian("rubber", [0.03, 0.03, 0.03]);
    let red = document.emitter("tail light", [1.0, 0.04, 0.02], 12.0);
    let place = Vec3::new(2.0, 0.0, -7.0);

    let mut body = Mesh::default();
    body.cuboid([-0.88, 0.3, -2.1], [0.88, 0.85, 2.1]);
    let roof_line = [(0.85, 1.9), (0.85, -1.0), (1.42, -0.3), (1.42, 1.3)];
    body.prism(
        &roof_line.map(|(y, z)| Vec3::new(-0.8, y, z)),
        Vec3::X * 1.6,
    );
    let mut wheels = Mesh::default();
    for (x, z) in [(-0.92, -1.35), (-0.92, 1.35), (0.7, -1.35), (0.7, 1.35)] {
        let hub = Vec3::new(x, 0.33, z);
        wheels.prism(
            &ring(hub, Vec3::Y * 0.33, Vec3::Z * 0.33, 12),
            Vec3::X * 0.22,
        );
    }
    let mut tail_lights = Mesh::default();
    for x in [-0.8, 0.5] {
        let corner = |x: f32, y: f32| Vec3::new(x, y, 2.11);
        tail_lights.polygon(&[
            corner(x, 0.6),
            corner(x + 0.3, 0.6),
            corner(x + 0.3, 0.74),
            corner(x, 0.74),
        ]);
    }
    let mesh = Some(document.mesh(
        "car",
        &[(&body, paint), (&wheels, rubber), (&tail_lights, red)],
    ));
    document.node("car", Content { mesh, light: None }, place, Quat::IDENTITY);

    let headlight = document.spot_light("headlight", 2500.0, [1.0, 0.95, 0.85], [0.15, 0.32]);
    for x in [-0.6, 0.6] {
        let content = Content {
            mesh: None,
            light: Some(headlight),
        };
        document.node(
            "headlight",
            content,
            place + Vec3::new(x, 0.65, -2.15),
            Quat::from_rotation_x(-0.02),
        );
    }
}
