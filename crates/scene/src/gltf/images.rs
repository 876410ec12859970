//! Images of a glTF file, decoded when a material first needs them and only once.
//!
//! An image that cannot be used is drawn white with a warning; a path that leaves the scene's folder is an error.

use super::buffers::{Buffers, read_uri};
use super::error::GltfError;
use crate::error::Warning;
use crate::paths::{PathError, shortened};
use crate::texture::Texture;
use ::gltf::json::Root;
use std::collections::BTreeMap;
use std::io::Cursor;

/// Decoded images.
pub(super) struct Images<'a> {
    json: &'a Root,
    buffers: &'a Buffers<'a>,
    /// Place in `textures` of each image that was asked for.
    decoded: BTreeMap<usize, Option<u32>>,
    textures: Vec<Texture>,
}

impl<'a> Images<'a> {
    pub(super) fn new(json: &'a Root, buffers: &'a Buffers<'a>) -> Self {
        Self {
            json,
            buffers,
            decoded: BTreeMap::new(),
            textures: Vec::new(),
        }
    }

    pub(super) fn into_textures(self) -> Vec<Texture> {
        self.textures
    }

    /// Place of image `index` among the decoded textures; `None`, after a warning, where it cannot be used.
    pub(super) fn texture(
        &mut self,
        index: usize,
        warnings: &mut Vec<Warning>,
    ) -> Result<Option<u32>, GltfError> {
        if let Some(&known) = self.decoded.get(&index) {
            return Ok(known);
        }
        let place = match self.decode(index) {
            Ok(texture) => {
                let place = self.textures.len() as u32;
                self.textures.push(texture);
                Some(place)
            }
            Err(Failure::Unusable(problem)) => {
                warnings.push(Warning::TextureMissing {
                    texture: self.name(index),
                    problem,
                });
                None
            }
            Err(Failure::Refused(error)) => return Err(error),
        };
        self.decoded.insert(index, place);
        Ok(place)
    }

    /// The image's name or file name, or its number.
    fn name(&self, index: usize) -> String {
        let image = self.json.images.get(index);
        let uri = |uri: &String| (!uri.starts_with("data:")).then(|| shortened(uri));
        image
            .and_then(|image| image.uri.as_ref().and_then(uri).or(image.name.clone()))
            .unwrap_or_else(|| format!("images/{index}"))
    }

    fn decode(&self, index: usize) -> Result<Texture, Failure> {
        let unusable = |problem: &str| Failure::Unusable(problem.into());
        let image = self
            .json
            .images
            .get(index)
            .ok_or_else(|| unusable("the file has no such image"))?;
        let pointer = format!("/images/{index}");
        let owned;
        let bytes = match (&image.uri, image.buffer_view) {
            (Some(uri), _) => {
                owned = read_uri(uri, self.buffers.folder(), || format!("{pointer}/uri"))?;
                &owned
            }
            (None, Some(view)) => {
                self.buffers
                    .view(view, &format!("{pointer}/bufferView"))?
                    .bytes
            }
            (None, None) => return Err(unusable("it has neither uri nor bufferView")),
        };
        let decoded = image::ImageReader::new(Cursor::new(bytes))
            .with_guessed_format()
            .map_err(|error| Failure::Unusable(error.to_string()))?
            .decode()
            .map_err(|error| Failure::Unusable(error.to_string()))?
            .into_rgba8();
        let (width, height) = decoded.dimensions();
        let texels = decoded.into_raw();
        let texels = texels.as_chunks::<4>().0.to_vec();
        Texture::new(width, height, texels).ok_or_else(|| unusable("it has no texels"))
    }
}

/// Why an image is not there.
enum Failure {
    /// White stands in for it.
    Unusable(String),
    /// The file asks for what it must not have.
    Refused(GltfError),
}

impl From<GltfError> for Failure {
    fn from(error: GltfError) -> Self {
        match error {
            GltfError::File {
                source: PathError::Scheme { .. } | PathError::Outside { .. },
                ..
            } => Failure::Refused(error),
            other => Failure::Unusable(other.to_string()),
        }
    }
}
