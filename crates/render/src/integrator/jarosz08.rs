//! The caches of `--method jarosz08`: single scattering of all lights, multiple scattering, and irradiance on surfaces.
//!
//! What records are stands in [`fill::jarosz08`](super::fill::jarosz08); placement, lookups and film are those of the default method.

use super::fill::jarosz08::{Irradiance, Volume};
use super::prepare::Prepared;
use super::{Run, Way};
use crate::options::Method;

impl Run<'_> {
    pub(super) fn is_jarosz08(&self) -> bool {
        self.options.method == Some(Method::Jarosz08)
    }

    /// Fills the caches that the scene needs.
    pub(super) fn jarosz08(&self, way: Way) -> Prepared {
        if !self.is_lit() {
            return Prepared::default();
        }
        let (scene, frame, seed, error) = (self.scene, self.frame, self.options.seed, self.error);
        let max_depth = self.max_depth;
        let reaches = |events| max_depth.is_none_or(|max| max >= events);
        let has_single = self.scatters() && reaches(1);
        let single = has_single.then(|| self.fill(Volume::single(scene, frame, seed, error)));
        let multiple = (way == Way::Records)
            .then(|| self.fill(Volume::multiple(scene, frame, max_depth, seed, error)));
        let has_surfaces = !scene.geometry.is_empty() && reaches(2);
        let surface = has_surfaces.then(|| {
            self.fill(Irradiance {
                scene,
                frame,
                max_depth,
                seed,
                error,
            })
        });
        let unknown = [
            ("single", single.is_some()),
            ("multiple", multiple.is_some()),
            ("surface", surface.is_some()),
        ];
        let filled = unknown.into_iter().filter(|(_, filled)| *filled);
        Prepared {
            shares: filled.map(|(layer, _)| (layer, None)).collect(),
            single,
            multiple,
            surface,
            ..Prepared::default()
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "tests")]
    use crate::options::{Integrator, Method, RenderOptions};
    use crate::render;
    use std::path::Path;
    use tyndall_math::stats::Welford;
    use tyndall_scene::LoadOptions;

    /// A lamp beside a ball of fog, from which the camera sees that it shines once and more often.
    const BALL: &str = "Scene(
        camera: LookAt(eye: (0.0, 0.0, 3.0), target: (0.0, 0.0, 0.0), vfov: 45.0),
        film: Film(width: 12, height: 12),
        lights: [Point(position: (0.0, 1.5, 0.0), intensity: (1.0, 1.0, 1.0))],
        media: [Medium(region: Sphere(center: (0.0, 0.0, 0.0), radius: 1.0), sigma_t: (1.0, 1.0, 1.0), albedo: (0.9, 0.9, 0.9))],
    )";

    /// Means of layers over the image, one for each of a few seeds.
    fn means(integrator: Integrator, method: Option<Method>) -> [Welford; 2] {
        let scene = tyndall_scene::load_str(BALL, Path::new("."), &LoadOptions::default()).unwrap();
        let mut means = [Welford::new(); 2];
        for seed in 0..6 {
            let options = RenderOptions {
                integrator,
                method,
                error: Some(0.1),
                spp: Some(16),
                seed,
                ..RenderOptions::default()
            };
            let outcome = render(&scene, &options, &()).unwrap();
            for (mean, layer) in means.iter_mut().zip(["single.R", "multiple.R"]) {
                let values = &outcome.image.channels[layer];
                mean.push(f64::from(values.iter().sum::<f32>()) / values.len() as f64);
            }
        }
        means
    }

    #[test]
    fn records_as_published_and_paths_agree_on_a_ball_of_fog() {
        let published = means(Integrator::Cache, Some(Method::Jarosz08));
        let paths = means(Integrator::Path, None);
        for (a, b) in published.iter().zip(&paths) {
            let error = a.standard_error().hypot(b.standard_error());
            // Four standard errors beside a bias of 2 %. The seeds are fixed: new ones would fail by chance in fewer than 1 of 100 runs.
            assert!(
                (a.mean() - b.mean()).abs() < 4.0 * error + 0.02 * b.mean(),
                "{} against {} ± {error}",
                a.mean(),
                b.mean()
            );
        }
    }

    #[test]
    fn anisotropic_media_are_refused_with_a_way_out() {
        let text = BALL.replace("albedo:", "phase: HenyeyGreenstein(g: 0.5), albedo:");
        let scene =
            tyndall_scene::load_str(&text, Path::new("."), &LoadOptions::default()).unwrap();
        let options = RenderOptions {
            method: Some(Method::Jarosz08),
            ..RenderOptions::default()
        };
        let message = render(&scene, &options, &()).unwrap_err().to_string();
        assert!(message.contains("leave the option out"), "{message}");
    }
}
