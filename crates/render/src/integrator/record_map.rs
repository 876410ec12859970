//! The layers that show records: how many are seen through each pixel, and how large they are.

use super::view::View;
use crate::image::Image;
use crate::options::Crop;
use tyndall_cache::Cache;
use tyndall_math::Ray;
use tyndall_scene::Triangles;
use tyndall_transport::world::Geometry;

/// Records are seen where surfaces hide no more than this share of the way to them: those on surfaces lie a rounding behind these.
const HIDDEN: f32 = 1e-3;

/// Number and radii of the records seen through each pixel of a part of the frame.
pub(super) struct RecordMap<'g> {
    geometry: &'g Triangles,
    view: View,
    crop: Crop,
    counts: Vec<f32>,
    /// Sums of radii in metres.
    radii: Vec<f32>,
}

impl<'g> RecordMap<'g> {
    pub(super) fn new(geometry: &'g Triangles, view: View, crop: Crop) -> Self {
        let n = crop.width as usize * crop.height as usize;
        Self {
            geometry,
            view,
            crop,
            counts: vec![0.0; n],
            radii: vec![0.0; n],
        }
    }

    /// Adds the records of a cache, where there is one; those out of sight are left out.
    pub(super) fn add<T: Clone>(&mut self, cache: Option<&Cache<3, T>>) {
        for record in cache.into_iter().flat_map(Cache::records) {
            let pixel = self.view.pixel(record.position);
            let index = pixel.and_then(|pixel| self.crop.index(pixel));
            let way = record.position - self.view.eye();
            let distance = way.length();
            let ray = Ray::new(self.view.eye(), way / distance);
            if let Some(i) = index
                && !self.geometry.occluded(&ray, (1.0 - HIDDEN) * distance)
            {
                self.counts[i] += 1.0;
                self.radii[i] += record.radius;
            }
        }
    }

    /// Fills the layers that the image has.
    pub(super) fn show(self, image: &mut Image) {
        if let Some(layer) = image.channels.get_mut("radius") {
            let means = self.radii.iter().zip(&self.counts);
            *layer = means.map(|(sum, n)| sum / n.max(1.0)).collect();
        }
        if let Some(layer) = image.channels.get_mut("records") {
            *layer = self.counts;
        }
    }
}
