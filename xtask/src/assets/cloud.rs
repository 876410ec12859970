//! A cloud in the afternoon sun.

use super::Asset;
use super::volume::{noise, smooth, vol};
use glam::Vec3;

const RON: &str = r#"// A cloud, 420 m wide, under sun and sky; its density is from voxels.
Scene(
    camera: LookAt(eye: (60.0, 20.0, 640.0), target: (0.0, 112.0, 0.0), vfov: 27.0),
    film: Film(width: 640, height: 400),
    lights: [
        Directional(direction: (-0.8, -0.55, 0.2), irradiance: (8.5, 7.4, 5.8)),
        Sky(radiance: (0.13, 0.22, 0.42)),
    ],
    media: [
        Medium(
            name: "cloud",
            density: Grid(file: "cloud.vol"),
            sigma_t: (0.09, 0.09, 0.09),
            albedo: (0.995, 0.995, 0.995),
        ),
    ],
)
"#;

/// Voxels, 5.25 m apart, and the box they fill.
const CELLS: [i32; 3] = [80, 44, 60];
const BOX: [Vec3; 2] = [
    Vec3::new(-210.0, 0.0, -157.5),
    Vec3::new(210.0, 231.0, 157.5),
];
/// Height of the flat base.
const BASE: f32 = 26.0;
/// Domes that the cloud is heaped up from: centres and radii in metres.
const DOMES: [([f32; 3], f32); 8] = [
    ([-10.0, 80.0, 0.0], 88.0),
    ([28.0, 132.0, 8.0], 66.0),
    ([-70.0, 92.0, 15.0], 62.0),
    ([95.0, 70.0, -10.0], 68.0),
    ([-125.0, 52.0, -5.0], 50.0),
    ([150.0, 48.0, 5.0], 42.0),
    ([-35.0, 128.0, -30.0], 52.0),
    ([45.0, 60.0, 65.0], 58.0),
];

pub(super) fn asset() -> Asset {
    Asset {
        name: "cloud",
        ron: RON.to_owned(),
        gltf: None,
        variants: Vec::new(),
        volume: Some(vol(CELLS, BOX, density)),
    }
}

fn density(p: Vec3) -> f32 {
    let domes = DOMES.iter();
    let heap = domes.map(|&(center, radius)| 1.0 - p.distance(center.into()) / radius);
    let heap = heap.fold(f32::NEG_INFINITY, f32::max);
    let billows = 1.15 * (noise(p / 46.0) - 0.5);
    let [low, high] = BOX;
    let inside = (p - low).min(high - p).min_element();
    smooth((heap + billows) / 0.22) * smooth((p.y - BASE) / 24.0) * smooth(inside / 20.0)
}
