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
            phase: HenyeyGreenstein(g: 0.5),
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
        ron: RON.to_owned(),
        gltf: Some(document),
        variants: Vec::new(),
        volume: None,
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
    let mut rows = Rows::default();
    for side in [-1.0, 1.0] {
        let mut z = 12.0;
        for house in 0..13 {
            let [width, eaves, depth] =
                HOUSES[(house + usize::from(side > 0.0) * 2) % HOUSES.len()];
            rows.house(
                house % 2,
                [side * FRONT, side * (FRONT + depth)],
                [z - width, z],
                eaves,
            );
            z -= width + 0.6 * (house % 3) as f32;
        }
    }
    let plaster = document.lambertian("plaster", [0.55, 0.50, 0.42]);
    let brick = document.lambertian("brick", [0.36, 0.17, 0.12]);
    let tiles = document.lambertian("tiles", [0.20, 0.10, 0.08]);
    let glass = document.lambertian("dark glass", [0.03, 0.035, 0.04]);
    document.part("plaster houses", &rows.walls[0], plaster);
    document.part("brick houses", &rows.walls[1], brick);
    document.part("roofs", &rows.roofs, tiles);
    document.part("windows and doors", &rows.panes, glass);
}

/// The rows of houses, by material.
#[derive(Default)]
struct Rows {
    walls: [Mesh; 2],
    roofs: Mesh,
    panes: Mesh,
}

impl Rows {
    /// A house from front to back along `x` and from far to near along `z`, with its gables across the street.
    fn house(&mut self, style: usize, x: [f32; 2], z: [f32; 2], eaves: f32) {
        let [front, back] = x;
        let (left, right) = (front.min(back), front.max(back));
        self.walls[style].cuboid([left, 0.0, z[0]], [right, eaves, z[1]]);

        let ridge = Vec3::new((left + right) / 2.0, eaves + 0.42 * (right - left), z[0]);
        let gable = [
            Vec3::new(left - 0.4, eaves, z[0]),
            Vec3::new(right + 0.4, eaves, z[0]),
            ridge,
        ];
        self.roofs.prism(&gable, Vec3::Z * (z[1] - z[0]));

        for i in 0..3 {
            let middle = z[1] - (z[1] - z[0]) * (i as f32 + 0.5) / 3.0;
            // The middle one is a door; its threshold lies on the pavement.
            let (half, foot) = if i == 1 { (0.5, 0.14) } else { (0.45, 1.1) };
            self.pane(front, middle, half, [foot, 2.4]);
            if eaves > 6.0 {
                self.pane(front, middle, 0.45, [4.0, 5.3]);
            }
        }
    }

    /// Glass or a door, 3 cm before the front of a house.
    fn pane(&mut self, front: f32, middle: f32, half: f32, y: [f32; 2]) {
        let (outside, inside) = (front - 0.03 * front.signum(), front + 0.1 * front.signum());
        let min = [outside.min(inside), y[0], middle - half];
        self.panes
            .cuboid(min, [outside.max(inside), y[1], middle + half]);
    }
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
