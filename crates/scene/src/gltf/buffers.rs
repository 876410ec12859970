//! Bytes that a glTF file refers to: the GLB's chunk, data URIs and files beside it.
//!
//! A buffer is read when something first needs it, so that a broken one that nothing uses does no harm.

use super::error::{GltfError, get};
use crate::paths::{Folder, shortened};
use ::gltf::json::{Root, buffer};
use base64::Engine as _;
use base64::engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig};
use std::cell::OnceCell;

/// Base64 with or without padding at its end.
const BASE64: GeneralPurpose = GeneralPurpose::new(
    &base64::alphabet::STANDARD,
    GeneralPurposeConfig::new().with_decode_padding_mode(DecodePaddingMode::Indifferent),
);

/// All buffers of a file.
#[derive(Debug)]
pub(super) struct Buffers<'a> {
    json: &'a Root,
    binary: Option<&'a [u8]>,
    folder: &'a Folder,
    loaded: Vec<OnceCell<Vec<u8>>>,
}

/// The bytes of one buffer view.
#[derive(Clone, Copy, Debug)]
pub(super) struct View<'a> {
    pub(super) bytes: &'a [u8],
    /// Distance between elements in bytes, where the view states one.
    pub(super) stride: Option<usize>,
}

impl<'a> Buffers<'a> {
    /// The folder in which files are looked for.
    pub(super) fn folder(&self) -> &Folder {
        self.folder
    }

    pub(super) fn new(json: &'a Root, binary: Option<&'a [u8]>, folder: &'a Folder) -> Self {
        Self {
            json,
            binary,
            folder,
            loaded: json.buffers.iter().map(|_| OnceCell::new()).collect(),
        }
    }

    /// The buffer view `index`, which `pointer` names.
    pub(super) fn view(
        &self,
        index: ::gltf::json::Index<buffer::View>,
        pointer: &str,
    ) -> Result<View<'_>, GltfError> {
        let views = &self.json.buffer_views;
        let view = get(views, index.value(), "buffer views", || pointer.into())?;
        let at = format!("/bufferViews/{}", index.value());
        let bytes = self.buffer(view.buffer.value(), &format!("{at}/buffer"))?;
        let offset = view.byte_offset.unwrap_or_default().0;
        let bytes = slice(bytes, offset, view.byte_length.0, "the buffer", &at)?;
        let stride = view.byte_stride.map(|stride| stride.0);
        Ok(View { bytes, stride })
    }

    fn buffer(&self, index: usize, pointer: &str) -> Result<&[u8], GltfError> {
        let cell = get(&self.loaded, index, "buffers", || pointer.into())?;
        let buffer = get(&self.json.buffers, index, "buffers", || pointer.into())?;
        let at = format!("/buffers/{index}");
        let bytes = match (&buffer.uri, self.binary, cell.get()) {
            (None, Some(binary), _) if index == 0 => binary,
            (None, ..) => {
                return Err(GltfError::value(
                    at,
                    "a buffer without uri",
                    "only the first buffer of a GLB file with a binary chunk may have none",
                ));
            }
            (_, _, Some(bytes)) => bytes,
            (Some(uri), _, None) => {
                let bytes = read_uri(uri, self.folder, || format!("{at}/uri"))?;
                cell.get_or_init(|| bytes)
            }
        };
        slice(bytes, 0, buffer.byte_length.0, "what was read", &at)
    }
}

/// `length` bytes from `offset` on, with checked arithmetic.
fn slice<'b>(
    bytes: &'b [u8],
    offset: u64,
    length: u64,
    container: &'static str,
    pointer: &str,
) -> Result<&'b [u8], GltfError> {
    usize::try_from(offset)
        .ok()
        .zip(usize::try_from(length).ok())
        .and_then(|(offset, length)| bytes.get(offset..offset.checked_add(length)?))
        .ok_or_else(|| GltfError::Bytes {
            pointer: pointer.into(),
            offset,
            needed: length,
            container,
            available: bytes.len() as u64,
        })
}

/// The bytes of a data URI or of a file.
pub(super) fn read_uri(
    uri: &str,
    folder: &Folder,
    pointer: impl Fn() -> String,
) -> Result<Vec<u8>, GltfError> {
    if let Some(data) = uri.strip_prefix("data:") {
        return decode_data_uri(data).ok_or_else(|| {
            GltfError::value(
                pointer(),
                format!("\"{}\"", shortened(uri)),
                "a data URI is data:<media type>;base64,<base64>",
            )
        });
    }
    let file_error = |source| GltfError::File {
        pointer: pointer(),
        source,
    };
    let path = folder.locate_uri(uri).map_err(file_error)?;
    std::fs::read(&path).map_err(|source| {
        file_error(crate::paths::PathError::Read {
            name: uri.into(),
            path,
            source,
        })
    })
}

/// What follows `data:` (RFC 2397); the media type is not looked at, since the bytes tell.
fn decode_data_uri(data: &str) -> Option<Vec<u8>> {
    let (media_type, body) = data.split_once(',')?;
    if media_type.ends_with(";base64") {
        BASE64.decode(body).ok()
    } else {
        Some(percent_encoding::percent_decode_str(body).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn data_uris_decode_with_and_without_padding_and_percent_encoded() {
        for (data, expected) in [
            ("application/octet-stream;base64,AQID", Some(vec![1, 2, 3])),
            (";base64,AQ==", Some(vec![1])),
            (";base64,AQ", Some(vec![1])),
            (",a%01", Some(vec![b'a', 1])),
            (";base64,", Some(Vec::new())),
            (";base64,A?==", None),
            (";base64", None),
        ] {
            assert_eq!(decode_data_uri(data), expected, "{data}");
        }
    }

    #[test]
    fn slices_never_leave_the_bytes() {
        let check = |offset, length| slice(&[0; 8], offset, length, "the buffer", "/x").is_ok();
        assert!(check(0, 8) && check(8, 0) && check(3, 5));
        assert!(!check(0, 9) && !check(9, 0) && !check(u64::MAX, 2) && !check(2, u64::MAX));
    }
}
