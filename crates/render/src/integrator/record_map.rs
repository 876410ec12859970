//! The layers that show records: how many were asked for through each pixel, and how large they are.

use super::fill::Filled;
use crate::image::Image;
use crate::options::Crop;

/// Number and radii of the records asked for through each pixel of a part of the frame.
pub(super) struct RecordMap {
    crop: Crop,
    counts: Vec<f32>,
    /// Sums of radii in metres.
    radii: Vec<f32>,
}

impl RecordMap {
    pub(super) fn new(crop: Crop) -> Self {
        let n = crop.width as usize * crop.height as usize;
        Self {
            crop,
            counts: vec![0.0; n],
            radii: vec![0.0; n],
        }
    }

    /// Adds the records of a cache, where there is one; those asked for from outside the part are left out.
    pub(super) fn add<'f, T: Clone + 'f>(&mut self, filled: Option<&'f Filled<T>>) {
        let Crop {
            x: left,
            y: top,
            width,
            height,
        } = self.crop;
        let records = |filled: &'f Filled<T>| filled.pixels.iter().zip(filled.cache.records());
        for (&[x, y], record) in filled.into_iter().flat_map(records) {
            if x >= left && y >= top && x - left < width && y - top < height {
                let i = (y - top) as usize * width as usize + (x - left) as usize;
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
