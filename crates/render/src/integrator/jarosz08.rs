//! The caches of `--method jarosz08`: single scattering of all lights, multiple scattering, and irradiance on surfaces.
//!
//! What records are stands in [`fill::jarosz08`](super::fill::jarosz08); placement, lookups and film are those of the default method.

use super::fill::Light;
use super::fill::jarosz08::{Irradiance, Volume};
use super::prepare::Prepared;
use super::view::View;
use super::{Run, Way, is_lit, scatters};
use crate::options::Method;

impl Run<'_> {
    pub(super) fn is_jarosz08(&self) -> bool {
        self.options.method == Some(Method::Jarosz08)
    }

    /// Fills the caches that the scene needs, which may be `known` for other views.
    pub(super) fn jarosz08(&self, views: &[View], known: Prepared) -> Prepared {
        if !is_lit(self.scene) {
            return Prepared::default();
        }
        let (scene, height) = (self.scene, self.frame[1]);
        let (seed, error, max_depth) = (self.options.seed, self.error, self.max_depth);
        let reaches = |events| max_depth.is_none_or(|max| max >= events);
        let mut prepared = Prepared::default();
        if scatters(scene) && reaches(1) {
            let kind = Volume::single(scene, height, seed, error);
            prepared.single = Some(self.fill(views, kind, known.single));
            prepared.shares.push((Light::Single, None));
        }
        if self.way == Way::Records {
            let kind = Volume::multiple(scene, height, max_depth, seed, error);
            prepared.multiple = Some(self.fill(views, kind, known.multiple));
            prepared.shares.push((Light::Multiple, None));
        }
        if !scene.geometry.is_empty() && reaches(2) {
            let kind = Irradiance {
                scene,
                height,
                max_depth,
                seed,
                error,
            };
            prepared.surface = Some(self.fill(views, kind, known.surface));
            prepared.shares.push((Light::Surface, None));
        }
        prepared.views = known.views;
        prepared
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
