//! EXR: 32-bit float, one part, one window in the frame.
//!
//! Layers are groups of channels with dotted names, which every reader understands; metadata are one string attribute, since several
//! would be written in a random order.

use super::WriteOptions;
use crate::image::Image;
use exr::prelude::{
    AnyChannel, AnyChannels, AttributeValue, Encoding, FlatSamples, ImageAttributes, IntegerBounds,
    Layer, LayerAttributes, MetaData, ReadChannels, ReadLayers, Text, Vec2, WritableImage,
};
use std::io::{Cursor, Seek, Write};

/// Values that [`read`] is ready to hold: 2³⁰, or 4 GiB.
const MAX_VALUES: u64 = 1 << 30;

/// Writes all channels of `image`.
pub(super) fn write(
    file: impl Write + Seek,
    image: &Image,
    options: &WriteOptions,
) -> Result<(), String> {
    let channels = image
        .channels
        .iter()
        .map(|(name, values)| AnyChannel::new(name.as_str(), FlatSamples::F32(values.clone())))
        .collect();
    let place = |p: [usize; 2]| Vec2(p[0] as i32, p[1] as i32);
    let mut layer_attributes = LayerAttributes {
        layer_position: place(image.origin),
        software_name: Some(Text::from(concat!("tyndall ", env!("CARGO_PKG_VERSION")))),
        ..LayerAttributes::default()
    };
    if let Some(metadata) = &options.metadata {
        // Attributes are Latin-1; RON reads the escapes back.
        let plain: String = metadata
            .chars()
            .map(|c| {
                if c.is_ascii() {
                    c.to_string()
                } else {
                    c.escape_unicode().to_string()
                }
            })
            .collect();
        layer_attributes.other.insert(
            Text::from("tyndall"),
            AttributeValue::Text(Text::from(plain.as_str())),
        );
    }
    let size = Vec2(image.width, image.height);
    let layer = Layer::new(
        size,
        layer_attributes,
        Encoding::SMALL_LOSSLESS,
        AnyChannels::sort(channels),
    );
    let frame = IntegerBounds::new(Vec2(0, 0), Vec2(image.frame[0], image.frame[1]));
    let image = exr::prelude::Image::empty(ImageAttributes::new(frame)).with_layer(layer);
    image.write().to_buffered(file).map_err(|e| e.to_string())
}

/// Whether a file starts as EXR files do.
pub(super) fn is_exr(bytes: &[u8]) -> bool {
    bytes.starts_with(&[0x76, 0x2f, 0x31, 0x01])
}

/// Reads all channels; those of a named part get its name in front. All parts must have one size.
pub(super) fn read(bytes: &[u8]) -> Result<Image, String> {
    let header =
        MetaData::read_from_buffered(Cursor::new(bytes), false).map_err(|e| e.to_string())?;
    let values = |h: &exr::meta::header::Header| {
        let pixels = (h.layer_size.0 as u64).saturating_mul(h.layer_size.1 as u64);
        pixels.saturating_mul(h.channels.list.len() as u64)
    };
    let total = header
        .headers
        .iter()
        .map(values)
        .fold(0, u64::saturating_add);
    if total > MAX_VALUES {
        return Err(format!(
            "it says that it holds {total} values, more than the {MAX_VALUES} that are read"
        ));
    }
    let file = exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .all_layers()
        .all_attributes()
        .from_buffered(Cursor::new(bytes))
        .map_err(|e| e.to_string())?;

    let first = file.layer_data.first().ok_or("it holds no part")?;
    let frame = file.attributes.display_window;
    let mut image = Image::new(first.size.0, first.size.1);
    image.frame = [frame.size.0, frame.size.1];
    // A window that starts left of its frame has no place in ours; it keeps the frame's corner.
    let offset = |p: i32, corner: i32| usize::try_from(p.saturating_sub(corner)).unwrap_or(0);
    let position = first.attributes.layer_position;
    image.origin = [
        offset(position.0, frame.position.0),
        offset(position.1, frame.position.1),
    ];
    for layer in &file.layer_data {
        if layer.size != first.size {
            return Err("its parts have different sizes".to_owned());
        }
        for channel in &layer.channel_data.list {
            let name = match &layer.attributes.layer_name {
                Some(part) if file.layer_data.len() > 1 => format!("{part}.{}", channel.name),
                _ => channel.name.to_string(),
            };
            if channel.sampling != Vec2(1, 1) {
                return Err(format!("its channel {name} has fewer values than pixels"));
            }
            image
                .channels
                .insert(name, channel.sample_data.values_as_f32().collect());
        }
    }
    Ok(image)
}
