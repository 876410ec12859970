//! The file itself: JSON or GLB, its version and the extensions it cannot do without.
//!
//! Both are looked at before the whole is parsed, because their absence explains all errors that would follow.

use super::error::GltfError;
use ::gltf::json::Root;
use serde::Deserialize;
use serde_json::Value;

/// Extensions that are understood, and so may be required.
const SUPPORTED: [&str; 5] = [
    "KHR_lights_punctual",
    "KHR_materials_emissive_strength",
    "KHR_materials_specular",
    "KHR_mesh_quantization",
    "KHR_texture_transform",
];

/// A parsed file: the JSON tree, in which no index has been checked, and the binary chunk of a GLB.
#[derive(Debug)]
pub(super) struct Document<'a> {
    pub(super) json: Root,
    pub(super) binary: Option<&'a [u8]>,
    /// Extensions that are used but not understood.
    pub(super) ignored_extensions: Vec<String>,
}

/// The little that must be known first; types are not checked here.
#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Peek {
    #[serde(default)]
    asset: Value,
    #[serde(default)]
    extensions_required: Value,
}

/// Parses the bytes of a `.gltf` or `.glb` file.
///
/// # Errors
/// For a damaged container, another version of glTF, a required extension that is not supported, and JSON that does
/// not follow the schema.
pub(super) fn parse(bytes: &[u8]) -> Result<Document<'_>, GltfError> {
    let (text, binary) = if bytes.starts_with(b"glTF") {
        split_glb(bytes)?
    } else {
        (bytes, None)
    };
    let text = text.strip_prefix(b"\xef\xbb\xbf").unwrap_or(text);
    let peek: Peek = serde_json::from_slice(text).map_err(GltfError::Json)?;
    check_version(&peek.asset)?;
    check_required(&peek.extensions_required)?;
    let json = Root::from_slice(text).map_err(GltfError::Json)?;
    let ignored_extensions = json
        .extensions_used
        .iter()
        .filter(|name| !SUPPORTED.contains(&name.as_str()))
        .cloned()
        .collect();
    Ok(Document {
        json,
        binary,
        ignored_extensions,
    })
}

fn check_version(asset: &Value) -> Result<(), GltfError> {
    let found = match &asset["version"] {
        // Schema errors are better told by the parser.
        Value::Null if !asset.is_null() => return Ok(()),
        Value::Null => "without a version".into(),
        Value::String(version) => version.clone(),
        other => other.to_string(),
    };
    let needs_more = matches!(&asset["minVersion"], Value::String(min) if min != "2.0");
    if found.split('.').next() == Some("2") && !needs_more {
        return Ok(());
    }
    let found = match &asset["minVersion"] {
        Value::String(min) if needs_more => min.clone(),
        _ => found,
    };
    Err(GltfError::Version { found })
}

fn check_required(required: &Value) -> Result<(), GltfError> {
    let names = required.as_array().map_or(&[][..], Vec::as_slice);
    for (i, name) in names.iter().enumerate() {
        let name = name.as_str().unwrap_or_default();
        if !SUPPORTED.contains(&name) {
            return Err(unsupported(name, format!("/extensionsRequired/{i}")));
        }
    }
    Ok(())
}

/// The error for an extension without which the file cannot be shown.
pub(super) fn unsupported(extension: &str, pointer: String) -> GltfError {
    let mend = match extension {
        "KHR_draco_mesh_compression" => "export the meshes without Draco compression",
        "EXT_meshopt_compression" | "KHR_meshopt_compression" => {
            "export the meshes without meshopt compression"
        }
        "KHR_texture_basisu" => "export the textures as PNG or JPEG instead of KTX2",
        "EXT_texture_webp" => "export the textures as PNG or JPEG instead of WebP",
        "EXT_texture_avif" => "export the textures as PNG or JPEG instead of AVIF",
        _ => "export the file without it",
    };
    GltfError::RequiredExtension {
        extension: extension.into(),
        mend,
        pointer,
    }
}

/// The JSON chunk of a GLB file and its binary chunk, which may be missing. Chunks of other kinds are passed over.
fn split_glb(bytes: &[u8]) -> Result<(&[u8], Option<&[u8]>), GltfError> {
    const HEADER: usize = 12;
    let damaged = |problem: String, offset| GltfError::Container { problem, offset };
    let word = |at: usize| {
        bytes
            .get(at..at.saturating_add(4))
            .and_then(|b| b.try_into().ok())
            .map(u32::from_le_bytes)
            .ok_or_else(|| damaged("the file ends within a header".into(), at))
    };
    let version = word(4)?;
    if version != 2 {
        return Err(GltfError::Version {
            found: format!("{version}.0"),
        });
    }
    let length = word(8)? as usize;
    if length < HEADER || length > bytes.len() {
        let problem = format!(
            "its length is stated as {length} bytes, and the file holds {}",
            bytes.len()
        );
        return Err(damaged(problem, 8));
    }
    let (mut json, mut binary) = (None, None);
    let mut at = HEADER;
    while at < length {
        let chunk_length = word(at)? as usize;
        let kind = word(at.saturating_add(4))?;
        let start = at.saturating_add(8);
        let end = start.saturating_add(chunk_length);
        let Some(chunk) = bytes[..length].get(start..end) else {
            let problem =
                format!("a chunk of {chunk_length} bytes leaves the file's {length} bytes");
            return Err(damaged(problem, at));
        };
        match (&kind.to_le_bytes(), at) {
            (b"JSON", HEADER) => json = Some(chunk),
            (b"JSON", _) => return Err(damaged("there are two JSON chunks".into(), at)),
            (b"BIN\0", _) if binary.is_some() => {
                return Err(damaged("there are two binary chunks".into(), at));
            }
            (b"BIN\0", _) => binary = Some(chunk),
            _ => {}
        }
        at = end;
    }
    let json = json.ok_or_else(|| damaged("its first chunk is not JSON".into(), HEADER))?;
    Ok((json, binary))
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a failing test panics")]
mod tests {
    use super::*;

    const MINIMAL: &str = r#"{"asset":{"version":"2.0"}}"#;

    fn glb(chunks: &[(&[u8; 4], &[u8])]) -> Vec<u8> {
        let mut body = Vec::new();
        for (kind, data) in chunks {
            body.extend((data.len() as u32).to_le_bytes());
            body.extend(*kind);
            body.extend(*data);
        }
        let mut file = b"glTF\x02\0\0\0".to_vec();
        file.extend((body.len() as u32 + 12).to_le_bytes());
        file.extend(body);
        file
    }

    fn message(bytes: &[u8]) -> String {
        parse(bytes).map_or_else(|e| e.to_string(), |_| "fine".into())
    }

    #[test]
    fn a_glb_gives_its_json_and_its_binary_chunk() {
        let file = glb(&[(b"JSON", MINIMAL.as_bytes()), (b"BIN\0", &[1, 2, 3, 4])]);
        let document = parse(&file).unwrap();
        assert_eq!(document.binary, Some(&[1, 2, 3, 4][..]));
        let without = glb(&[(b"JSON", MINIMAL.as_bytes())]);
        assert_eq!(parse(&without).unwrap().binary, None);
    }

    #[test]
    fn damaged_containers_say_where() {
        let json = (b"JSON", MINIMAL.as_bytes());
        let mut zero_length = glb(&[json]);
        zero_length[8..12].fill(0);
        let mut long_chunk = glb(&[json]);
        long_chunk[12..16].fill(0xff);
        for (bytes, part) in [
            (zero_length, "its length is stated as 0 bytes"),
            (long_chunk, "a chunk of 4294967295 bytes leaves"),
            (glb(&[json, json]), "two JSON chunks"),
            (
                glb(&[json, (b"BIN\0", &[]), (b"BIN\0", &[])]),
                "two binary chunks",
            ),
            (glb(&[(b"BIN\0", &[])]), "first chunk is not JSON"),
            (glb(&[]), "first chunk is not JSON"),
            (b"glTF".to_vec(), "ends within a header (at byte 4)"),
            (b"glTF\x01\0\0\0".to_vec(), "this is glTF 1.0"),
        ] {
            let found = message(&bytes);
            assert!(found.contains(part), "{found}");
        }
    }

    #[test]
    fn every_truncation_of_a_glb_is_an_error() {
        let file = glb(&[(b"JSON", MINIMAL.as_bytes()), (b"BIN\0", &[0; 8])]);
        for n in 0..file.len() {
            assert_ne!(message(&file[..n]), "fine", "{n} bytes");
        }
    }

    #[test]
    fn version_and_required_extensions_are_judged_before_anything_else() {
        for (json, part) in [
            (r#"{"asset":{"version":"1.0"},"accessors":{}}"#, "glTF 1.0"),
            (r#"{"asset":{"version":1.0},"accessors":{}}"#, "glTF 1.0"),
            (
                r#"{"asset":{"version":"2.0","minVersion":"2.1"}}"#,
                "glTF 2.1",
            ),
            (r#"{"accessors":{}}"#, "glTF without a version"),
            (
                r#"{"asset":{"version":"2.0"},"extensionsRequired":["KHR_lights_punctual","KHR_draco_mesh_compression"],"accessors":3}"#,
                "requires KHR_draco_mesh_compression, which is not supported; export the meshes without Draco compression (at /extensionsRequired/1)",
            ),
            (
                r#"{"asset":{"version":"2.0"},"extensionsRequired":["MADE_UP"]}"#,
                "requires MADE_UP",
            ),
            (
                r#"{"asset":{"version":"2.0"},"accessors":3}"#,
                "invalid type: integer `3`",
            ),
            (r#"{"asset":{"version":"2.0"}"#, "line 1 column 26"),
            (MINIMAL, "fine"),
            ("\u{feff}{\"asset\":{\"version\":\"2.1\"}}", "fine"),
        ] {
            let found = message(json.as_bytes());
            assert!(found.contains(part), "{found}");
        }
    }

    #[test]
    fn deep_nesting_is_an_error() {
        assert!(message("[".repeat(100_000).as_bytes()).contains("recursion limit"));
    }
}
