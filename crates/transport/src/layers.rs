//! Sorts what a camera path finds into the image's layers.
//!
//! The first event decides: a surface, a medium that scattered light once, or a medium that scattered light that had been
//! scattered before.

use crate::path::{Source, Vertex, Visitor};
use glam::Vec3;

/// Radiance of one camera sample, by layer; W/(m² sr).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Layers {
    /// Emission and reflection of the first surface, or the environment where none is hit, attenuated by media.
    pub surface: Vec3,
    /// Light from emitters that a medium scattered once, towards the eye.
    pub single: Vec3,
    /// All other light that a medium scatters towards the eye.
    pub multiple: Vec3,
    /// Emission of media seen directly.
    pub emission: Vec3,
}

impl Layers {
    /// Sum of all layers.
    pub fn beauty(&self) -> Vec3 {
        self.surface + self.single + self.multiple + self.emission
    }
}

/// A [`Visitor`] that fills [`Layers`] along one camera path.
#[derive(Clone, Copy, Debug, Default)]
pub struct LayerVisitor {
    /// What has been found so far.
    pub layers: Layers,
    first_is_surface: bool,
    events: u32,
}

impl Visitor for LayerVisitor {
    fn vertex(&mut self, vertex: Vertex<'_, '_>) {
        if self.events == 0 {
            self.first_is_surface = matches!(vertex, Vertex::Surface(..));
        }
        self.events += 1;
    }

    fn light(&mut self, value: Vec3, last: Option<Vertex<'_, '_>>, source: Source) {
        let layer = match (self.events, last, source) {
            (0, None, _) => &mut self.layers.surface,
            (0, Some(_), Source::Medium) => &mut self.layers.emission,
            (0, Some(_), _) => &mut self.layers.single,
            _ if self.first_is_surface => &mut self.layers.surface,
            (1, None, _) => &mut self.layers.single,
            _ => &mut self.layers.multiple,
        };
        *layer += value;
    }
}
