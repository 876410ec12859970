//! The table of image layers: what an image can hold besides its colour.
//!
//! A new layer is one line in [`LAYERS`]; the film, the image files and `--layers` follow from it.

use crate::error::RenderError;
use crate::film::Pixel;
use glam::Vec3;
use serde::{Deserialize, Serialize};
use std::str::FromStr;

/// One image layer.
#[derive(Debug)]
pub struct Layer {
    /// Its name on the command line.
    pub name: &'static str,
    /// Its channels in an EXR file.
    pub channels: &'static [&'static str],
    /// When an image holds it without being asked.
    pub presence: Presence,
    /// What it shows, in one line with its unit.
    pub about: &'static str,
    /// Where its values come from.
    pub source: Source,
}

/// When an image holds a layer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Presence {
    /// Always, unless `--layers` leaves it out.
    Default,
    /// Where media emit, unless `--layers` leaves it out.
    WhereMediaEmit,
    /// Only when `--layers` names it.
    Asked,
}

/// Where a layer's values come from.
#[derive(Clone, Copy, Debug)]
pub enum Source {
    /// The sum of all [`Source::PartOfBeauty`] layers.
    Beauty,
    /// The mean over a pixel's samples, and a summand of the image itself.
    PartOfBeauty(fn(&Pixel) -> Vec3),
    /// The mean over a pixel's samples of something beside the image; single-channel layers take the first component.
    Mean(fn(&Pixel) -> Vec3),
    /// The number of samples taken.
    SampleCount,
    /// The cache records seen through the pixel.
    Records,
}

const RGB: [&str; 3] = ["R", "G", "B"];

/// All layers, in the order in which they are listed and shown.
pub static LAYERS: &[Layer] = &[
    Layer {
        name: "beauty",
        channels: &RGB,
        presence: Presence::Default,
        about: "the image: surface + single + multiple + emission, W/(m² sr)",
        source: Source::Beauty,
    },
    Layer {
        name: "surface",
        channels: &["surface.R", "surface.G", "surface.B"],
        presence: Presence::Default,
        about: "light from the first surface or the environment, attenuated by the media, W/(m² sr)",
        source: Source::PartOfBeauty(|p| p.surface),
    },
    Layer {
        name: "single",
        channels: &["single.R", "single.G", "single.B"],
        presence: Presence::Default,
        about: "light from emitters, scattered once, by the medium, towards the eye, W/(m² sr)",
        source: Source::PartOfBeauty(|p| p.single),
    },
    Layer {
        name: "multiple",
        channels: &["multiple.R", "multiple.G", "multiple.B"],
        presence: Presence::Default,
        about: "all other light that the medium scatters towards the eye, W/(m² sr)",
        source: Source::PartOfBeauty(|p| p.multiple),
    },
    Layer {
        name: "emission",
        channels: &["emission.R", "emission.G", "emission.B"],
        presence: Presence::WhereMediaEmit,
        about: "light emitted by media, seen directly, W/(m² sr)",
        source: Source::PartOfBeauty(|p| p.emission),
    },
    Layer {
        name: "transmittance",
        channels: &["transmittance.R", "transmittance.G", "transmittance.B"],
        presence: Presence::Asked,
        about: "share of the first surface's light that the media let through, 0 to 1",
        source: Source::Mean(|p| p.transmittance),
    },
    Layer {
        name: "depth",
        channels: &["Z"],
        presence: Presence::Asked,
        about: "distance to the first surface, m; 0 where there is none",
        source: Source::Mean(|p| Vec3::splat(p.depth)),
    },
    Layer {
        name: "records",
        channels: &["records"],
        presence: Presence::Asked,
        about: "cache records seen through the pixel, number",
        source: Source::Records,
    },
    Layer {
        name: "radius",
        channels: &["radius"],
        presence: Presence::Asked,
        about: "mean radius of the cache records seen through the pixel, m; 0 where there are none",
        source: Source::Records,
    },
    Layer {
        name: "lookups",
        channels: &["lookups"],
        presence: Presence::Asked,
        about: "questions put to the caches for a camera sample, mean number",
        source: Source::Mean(|p| Vec3::splat(p.lookups)),
    },
    Layer {
        name: "samples",
        channels: &["samples"],
        presence: Presence::Asked,
        about: "samples taken in the pixel",
        source: Source::SampleCount,
    },
];

/// The names of all layers, for messages.
pub fn known_layers() -> String {
    let names: Vec<&str> = LAYERS.iter().map(|layer| layer.name).collect();
    names.join(", ")
}

/// The layers of one image, in the order of [`LAYERS`] and each once.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(try_from = "String", into = "String")]
pub struct LayerSet(Vec<&'static Layer>);

impl LayerSet {
    /// The layers an image holds when nobody chooses.
    pub fn usual(media_emit: bool) -> Self {
        Self::select(|layer| match layer.presence {
            Presence::Default => true,
            Presence::WhereMediaEmit => media_emit,
            Presence::Asked => false,
        })
    }

    /// The layers in table order.
    pub fn iter(&self) -> impl Iterator<Item = &'static Layer> {
        self.0.iter().copied()
    }

    /// Whether the set holds the layer called `name`.
    pub fn contains(&self, name: &str) -> bool {
        self.iter().any(|layer| layer.name == name)
    }

    fn select(wanted: impl Fn(&Layer) -> bool) -> Self {
        Self(LAYERS.iter().filter(|layer| wanted(layer)).collect())
    }
}

impl From<LayerSet> for String {
    /// The list that gives the set back.
    fn from(set: LayerSet) -> Self {
        let names: Vec<&str> = set.iter().map(|layer| layer.name).collect();
        names.join(",")
    }
}

impl TryFrom<String> for LayerSet {
    type Error = RenderError;

    fn try_from(list: String) -> Result<Self, RenderError> {
        list.parse()
    }
}

impl FromStr for LayerSet {
    type Err = RenderError;

    /// Reads a comma-separated list such as `beauty,depth`.
    fn from_str(list: &str) -> Result<Self, RenderError> {
        let names: Vec<&str> = list.split(',').map(str::trim).collect();
        for name in &names {
            if !LAYERS.iter().any(|layer| layer.name == *name) {
                return Err(RenderError::UnknownLayer {
                    name: (*name).to_owned(),
                });
            }
        }
        Ok(Self::select(|layer| names.contains(&layer.name)))
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "tests")]
    use super::*;
    use std::collections::BTreeSet;

    fn names(set: &LayerSet) -> Vec<&str> {
        set.iter().map(|layer| layer.name).collect()
    }

    #[test]
    fn layers_and_channels_have_different_names() {
        let names: BTreeSet<&str> = LAYERS.iter().map(|layer| layer.name).collect();
        let channels: BTreeSet<&str> = LAYERS
            .iter()
            .flat_map(|layer| layer.channels)
            .copied()
            .collect();
        assert_eq!(names.len(), LAYERS.len());
        assert_eq!(
            channels.len(),
            LAYERS
                .iter()
                .map(|layer| layer.channels.len())
                .sum::<usize>()
        );
    }

    #[test]
    fn emission_is_a_default_only_where_media_emit() {
        assert_eq!(
            names(&LayerSet::usual(false)),
            ["beauty", "surface", "single", "multiple"]
        );
        assert_eq!(
            names(&LayerSet::usual(true)),
            ["beauty", "surface", "single", "multiple", "emission"]
        );
    }

    #[test]
    fn a_list_is_sorted_and_each_layer_is_taken_once() {
        let set: LayerSet = "depth, beauty,depth".parse().unwrap();
        assert_eq!(names(&set), ["beauty", "depth"]);
    }

    #[test]
    fn an_unknown_layer_is_named_together_with_the_known_ones() {
        let message = "beauty,albedo".parse::<LayerSet>().unwrap_err().to_string();
        assert!(
            message.contains("`albedo`") && message.contains("transmittance"),
            "{message}"
        );
    }
}
