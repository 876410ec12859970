//! Light sources: what shines, where samples towards it go, and how much it could bring.
//!
//! [`LightSet`] gives a scene's lights to the integrators of `tyndall-transport`. A new kind of light is a file here and a
//! line in [`Light`].

mod directional;
mod emission;
mod emitters;
mod environment;
mod environment_file;
mod flat;
mod point;
mod quad;
mod sky;
mod spot;
mod triangle;

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "tests")]
mod conformance;

pub use directional::DirectionalLight;
pub use emission::Emission;
pub use environment::{EnvironmentImage, EnvironmentLight};
pub use environment_file::{EnvironmentError, read_environment};
pub use flat::FlatEmitter;
pub use point::PointLight;
pub use quad::QuadLight;
pub use sky::SkyLight;
pub use spot::SpotLight;
pub use triangle::TriangleLight;

use crate::gltf::punctual::PunctualLight;
use crate::triangles::Surfaces;
use glam::{DVec3, Vec3};
use std::collections::HashMap;
use std::f32::consts::PI;
use std::sync::Arc;
use tyndall_math::{Jet, Ray};
use tyndall_transport::importance::bounded;
use tyndall_transport::light_tree::{LightBounds, LightTree};
use tyndall_transport::{LightSample, Lights};

/// One light.
#[derive(Clone, Debug)]
pub enum Light {
    /// A lamp without extent.
    Point(PointLight),
    /// A lamp without extent that shines into a cone.
    Spot(SpotLight),
    /// Parallel light from infinitely far away.
    Directional(DirectionalLight),
    /// An emitting triangle of a mesh.
    Triangle(TriangleLight),
    /// Two emitting triangles that form a rectangle.
    Quad(QuadLight),
    /// Light of one colour from all directions.
    Sky(SkyLight),
    /// Light from all directions, by an image.
    Environment(EnvironmentLight),
}

/// Calls the same method of whatever light it is.
macro_rules! each {
    ($light:expr, $inner:ident => $call:expr) => {
        match $light {
            Light::Point($inner) => $call,
            Light::Spot($inner) => $call,
            Light::Directional($inner) => $call,
            Light::Triangle($inner) => $call,
            Light::Quad($inner) => $call,
            Light::Sky($inner) => $call,
            Light::Environment($inner) => $call,
        }
    };
}

impl Light {
    /// What kind of light it is, in the words of the scene file.
    pub fn kind(&self) -> &'static str {
        match self {
            Light::Point(_) => "point",
            Light::Spot(_) => "spot",
            Light::Directional(_) => "directional",
            Light::Triangle(_) | Light::Quad(_) => "emissive surface",
            Light::Sky(_) => "sky",
            Light::Environment(_) => "environment",
        }
    }

    /// Radiant power in W per channel; light from infinitely far away counts what falls on a disc of `scene_radius` metres.
    pub fn power(&self, scene_radius: f32) -> Vec3 {
        let disc = PI * scene_radius * scene_radius;
        match self {
            Light::Point(light) => light.power(),
            Light::Spot(light) => light.power(),
            Light::Directional(light) => light.irradiance() * disc,
            Light::Triangle(light) => light.flat().power(),
            Light::Quad(light) => light.flat().power(),
            Light::Sky(light) => light.fluence() * disc,
            Light::Environment(light) => light.fluence() * disc,
        }
    }

    /// Whether the light sends out nothing at all.
    pub fn is_dark(&self) -> bool {
        // A radius of 1 m: any that is not 0 will do.
        self.power(1.0).max_element() <= 0.0
    }

    fn importance(&self, p: Vec3, normal: Option<Vec3>) -> f32 {
        each!(self, light => light.importance(p, normal))
    }

    fn importance_along(&self, ray: &Ray, t_max: f32) -> f32 {
        each!(self, light => light.importance_along(ray, t_max))
    }

    fn pivot(&self) -> Option<Vec3> {
        match self {
            Light::Point(light) => Some(light.position()),
            Light::Spot(light) => Some(light.position()),
            Light::Triangle(light) => Some(light.flat().center()),
            Light::Quad(light) => Some(light.flat().center()),
            Light::Directional(_) | Light::Sky(_) | Light::Environment(_) => None,
        }
    }

    /// Where it is and which way it shines; `None` where it is infinitely far away.
    fn bounds(&self) -> Option<LightBounds> {
        match self {
            Light::Point(light) => Some(light.bounds()),
            Light::Spot(light) => Some(light.bounds()),
            Light::Triangle(light) => Some(light.flat().bounds()),
            Light::Quad(light) => Some(light.flat().bounds()),
            Light::Directional(_) | Light::Sky(_) | Light::Environment(_) => None,
        }
    }

    fn sample(&self, p: Vec3, u: [f32; 2]) -> Option<LightSample> {
        each!(self, light => light.sample(p, u))
    }

    fn pdf(&self, p: Vec3, w_i: Vec3) -> f32 {
        match self {
            Light::Triangle(light) => light.pdf(p, w_i),
            Light::Quad(light) => light.pdf(p, w_i),
            Light::Sky(light) => light.pdf(),
            Light::Environment(light) => light.pdf(w_i),
            Light::Point(_) | Light::Spot(_) | Light::Directional(_) => 0.0,
        }
    }
}

impl From<&PunctualLight> for Light {
    fn from(light: &PunctualLight) -> Self {
        match *light {
            PunctualLight::Point {
                position,
                intensity,
            } => Light::Point(PointLight::new(position, intensity)),
            PunctualLight::Spot {
                position,
                direction,
                intensity,
                inner_cone,
                outer_cone,
            } => Light::Spot(SpotLight::new(
                position, direction, intensity, inner_cone, outer_cone,
            )),
            PunctualLight::Directional {
                direction,
                irradiance,
            } => Light::Directional(DirectionalLight::new(direction, irradiance)),
        }
    }
}

/// All lights of a scene.
#[derive(Clone, Debug, Default)]
pub struct LightSet {
    lights: Vec<Light>,
    environment: Vec<usize>,
    point_positions: Vec<Vec3>,
    tree: Option<LightTree>,
}

/// So many lights are looked at one by one: a tree would take as long (measured 2026-11-22).
const FEW: usize = 16;

impl LightSet {
    /// The given lights and those that the emissive triangles of `surfaces` are; dark ones are left out.
    ///
    /// Returned beside it: the light of each emitting triangle, which [`Triangles::new`](crate::triangles::Triangles::new)
    /// asks for.
    pub fn new(
        lights: impl IntoIterator<Item = Light>,
        surfaces: &Arc<Surfaces>,
    ) -> (Self, HashMap<u32, usize>) {
        let mut set = Self::default();
        for light in lights.into_iter().filter(|light| !light.is_dark()) {
            set.push(light);
        }
        let mut light_of_triangle = HashMap::new();
        for emitter in emitters::find(surfaces) {
            light_of_triangle.extend(emitter.triangles.iter().map(|&t| (t, set.lights.len())));
            set.push(emitter.light);
        }
        if set.lights.len() > FEW {
            let bounds: Vec<_> = set.lights.iter().map(Light::bounds).collect();
            set.tree = Some(LightTree::new(&bounds));
        }
        (set, light_of_triangle)
    }

    /// The lights, in the order of their indices.
    pub fn list(&self) -> &[Light] {
        &self.lights
    }

    /// Whether there are skies or environment images, and no part of them is much brighter than the rest.
    pub fn has_even_skies(&self) -> bool {
        let is_even = |&light: &usize| match &self.lights[light] {
            Light::Environment(light) => light.is_even(),
            _ => true,
        };
        !self.environment.is_empty() && self.environment.iter().all(is_even)
    }

    fn push(&mut self, light: Light) {
        match &light {
            Light::Point(point) => self.point_positions.push(point.position()),
            Light::Spot(spot) => self.point_positions.push(spot.position()),
            Light::Sky(_) | Light::Environment(_) => self.environment.push(self.lights.len()),
            Light::Directional(_) | Light::Triangle(_) | Light::Quad(_) => {}
        }
        self.lights.push(light);
    }
}

impl Lights for LightSet {
    fn count(&self) -> usize {
        self.lights.len()
    }

    fn importance(&self, light: usize, p: Vec3, normal: Option<Vec3>) -> f32 {
        bounded(self.lights[light].importance(p, normal))
    }

    fn importance_along(&self, light: usize, ray: &Ray, t_max: f32) -> f32 {
        bounded(self.lights[light].importance_along(ray, t_max))
    }

    fn pivot(&self, light: usize) -> Option<Vec3> {
        self.lights[light].pivot()
    }

    fn has_extent(&self, light: usize) -> bool {
        match &self.lights[light] {
            Light::Point(_) | Light::Spot(_) | Light::Directional(_) => false,
            Light::Triangle(_) | Light::Quad(_) | Light::Sky(_) | Light::Environment(_) => true,
        }
    }

    fn tree(&self) -> Option<&LightTree> {
        self.tree.as_ref()
    }

    fn sample(&self, light: usize, p: Vec3, u: [f32; 2]) -> Option<LightSample> {
        self.lights[light].sample(p, u)
    }

    fn pdf(&self, light: usize, p: Vec3, w_i: Vec3) -> f32 {
        self.lights[light].pdf(p, w_i)
    }

    fn environment(&self) -> &[usize] {
        &self.environment
    }

    fn environment_radiance(&self, light: usize, w_i: Vec3) -> Vec3 {
        match &self.lights[light] {
            Light::Sky(sky) => sky.radiance(),
            Light::Environment(environment) => environment.radiance(w_i),
            _ => Vec3::ZERO,
        }
    }

    fn ln_intensity(&self, light: usize, p: DVec3) -> Jet {
        match self.lights.get(light) {
            Some(Light::Spot(spot)) => spot.ln_falloff(p),
            _ => Jet::ZERO,
        }
    }

    fn distance_to_point_lights(&self, p: Vec3) -> f32 {
        self.point_positions
            .iter()
            .map(|lamp| lamp.distance_squared(p))
            .fold(f32::INFINITY, f32::min)
            .sqrt()
    }
}
