//! What tells two scenes apart: a digest of everything that light depends on, and of nothing else.
//!
//! Camera, film and render settings have no part in it, so that what was computed for one view serves others.

use crate::error::SceneError;
use crate::load::LoadOptions;
use crate::scene::Scene;
use crate::scene_file::SceneFile;
use xxhash_rust::xxh3::Xxh3;

/// The scene file's own words on lights and media, and the fog that the user added.
pub(crate) fn definition(file: &SceneFile, options: &LoadOptions) -> String {
    // Debug text gives every number to the last bit. It may change with the compiler: then old digests differ, which is safe.
    format!(
        "{:?}",
        (&file.gltf_scene, &file.lights, &file.media, &options.fog)
    )
}

impl Scene {
    /// A digest (XXH3, 128 bits) of lights, media and every file that the scene was read from but the scene file, by their bytes.
    ///
    /// # Errors
    /// If one of the files can no longer be read.
    pub fn digest(&self) -> Result<u128, SceneError> {
        let mut hash = Xxh3::new();
        let mut add = |bytes: &[u8]| {
            hash.update(&(bytes.len() as u64).to_le_bytes());
            hash.update(bytes);
        };
        add(self.definition.as_bytes());
        for path in self.files.iter().skip(self.own_files) {
            let bytes = std::fs::read(path).map_err(|source| SceneError::Read {
                what: "file of the scene",
                source,
                path: path.clone(),
            })?;
            add(&bytes);
        }
        Ok(hash.digest128())
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "tests")]
    use crate::{Fog, LoadOptions, load_str};

    const SCENE: &str = "Scene(
        camera: LookAt(eye: (0, 0, 4), target: (0, 0, 0), vfov: 40),
        lights: [Environment(file: \"sky.hdr\")],
        media: [Medium(sigma_t: (0.5, 0.5, 0.5), albedo: (0.9, 0.9, 0.9))],
    )";

    /// An image of 1 × 1 pixels in the Radiance format.
    fn sky(exponent: u8) -> Vec<u8> {
        let mut bytes = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 1\n".to_vec();
        bytes.extend([128, 128, 128, exponent]);
        bytes
    }

    #[test]
    fn a_digest_knows_what_light_depends_on_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("sky.hdr");
        std::fs::write(&file, sky(129)).unwrap();
        let digest = |text: &str, options: &LoadOptions| {
            let scene = load_str(text, folder.path(), options).unwrap();
            scene.digest().unwrap()
        };
        let plain = LoadOptions::default();
        let first = digest(SCENE, &plain);
        assert_eq!(digest(SCENE, &plain), first);
        let other_view = SCENE.replace("(0, 0, 4)", "(1, 0, 4)");
        assert_eq!(digest(&other_view, &plain), first);
        let thinner = SCENE.replacen("0.5, 0.5, 0.5", "0.5, 0.5, 0.4999999", 1);
        assert_ne!(digest(&thinner, &plain), first);
        let foggy = LoadOptions {
            fog: Some(Fog::new(0.1)),
            ..LoadOptions::default()
        };
        let bounded = SCENE.replace(
            "sigma_t",
            "region: Sphere(center: (0, 0, 0), radius: 1), sigma_t",
        );
        assert_ne!(digest(&bounded, &foggy), digest(&bounded, &plain));
        std::fs::write(&file, sky(130)).unwrap();
        assert_ne!(
            digest(SCENE, &plain),
            first,
            "other bytes in the sky's file"
        );
    }
}
