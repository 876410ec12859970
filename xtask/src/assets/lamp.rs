//! A lamp in fog without bounds and without geometry.

use super::Asset;

const RON: &str = r#"// A lamp in fog that fills all space: its glow is scattered light alone.
Scene(
    camera: LookAt(eye: (0.0, 0.0, 6.0), target: (0.0, 0.0, 0.0), vfov: 60.0),
    film: Film(width: 512, height: 384),
    lights: [
        Point(position: (0.0, 0.0, 0.0), intensity: (20.0, 15.0, 8.0)),
    ],
    media: [
        Medium(
            name: "fog",
            sigma_t: (0.4, 0.4, 0.4),
            albedo: (0.9, 0.9, 0.9),
        ),
    ],
)
"#;

pub(super) fn asset() -> Asset {
    Asset {
        name: "lamp",
        ron: RON.to_owned(),
        gltf: None,
        variants: Vec::new(),
        volume: None,
    }
}
