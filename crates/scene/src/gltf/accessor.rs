//! Accessors: typed arrays in a file's bytes, with every length checked before anything is read or allocated.
//!
//! Interleaved, sparse, normalised and absent (all zero) data are read alike.

use super::buffers::{Buffers, View};
use super::error::{GltfError, get};
use ::gltf::json::accessor::{Accessor, ComponentType, Type, sparse};
use ::gltf::json::validation::Checked;
use ::gltf::json::{Index, Root};

/// Largest number of elements of an accessor that no bytes stand behind.
const MAX_ZEROS: u64 = 1 << 24;

/// Reads accessors.
#[derive(Clone, Copy, Debug)]
pub(super) struct Accessors<'a> {
    json: &'a Root,
    buffers: &'a Buffers<'a>,
}

/// What an attribute's accessor must look like.
#[derive(Clone, Copy, Debug)]
pub(super) struct Expected<'a> {
    /// Allowed types, each with the number of components.
    pub(super) types: &'a [Type],
    /// Whether integers may stand for numbers outside [−1, 1], as `KHR_mesh_quantization` allows.
    pub(super) plain_integers: bool,
    /// The number of elements, where it is known, and why that many, as in "one element per vertex".
    pub(super) count: Option<(usize, &'static str)>,
}

/// An accessor whose shape is known to be sound.
struct Checks<'a> {
    accessor: &'a Accessor,
    pointer: String,
    component: ComponentType,
    type_: Type,
    count: usize,
}

impl<'a> Accessors<'a> {
    pub(super) fn new(json: &'a Root, buffers: &'a Buffers<'a>) -> Self {
        Self { json, buffers }
    }

    /// Vectors of floats; a type with fewer than `N` components fills up with `fill`.
    pub(super) fn floats<const N: usize>(
        &self,
        index: Index<Accessor>,
        pointer: &str,
        expected: Expected<'_>,
        fill: f32,
    ) -> Result<Vec<[f32; N]>, GltfError> {
        let checks = self.check(index, pointer)?;
        let at = &checks.pointer;
        if !expected.types.contains(&checks.type_) {
            return Err(GltfError::value(
                format!("{at}/type"),
                format!("{:?}", checks.type_),
                format!("the use at {pointer} allows {:?}", expected.types),
            ));
        }
        if let Some((count, reason)) = expected.count.filter(|(count, _)| *count != checks.count) {
            return Err(GltfError::value(
                format!("{at}/count"),
                checks.count,
                format!("the use at {pointer} needs {reason}, {count}"),
            ));
        }
        let normalized = checks.accessor.normalized;
        let allowed = match checks.component {
            ComponentType::F32 => true,
            ComponentType::U32 => false,
            _ => normalized || expected.plain_integers,
        };
        if !allowed {
            return Err(GltfError::value(
                format!("{at}/componentType"),
                checks.component.as_gl_enum(),
                format!(
                    "the use at {pointer} allows 5126 (float) and normalized integers of 8 and 16 bits"
                ),
            ));
        }
        let component = checks.component;
        let size = component.size();
        let n_components = checks.type_.multiplicity();
        self.elements(&checks, |bytes| {
            let mut value = [fill; N];
            for (v, b) in value
                .iter_mut()
                .zip(bytes.chunks_exact(size))
                .take(n_components)
            {
                *v = number(component, normalized, b);
            }
            value
        })
    }

    /// Vertex indices.
    pub(super) fn indices(
        &self,
        index: Index<Accessor>,
        pointer: &str,
    ) -> Result<Vec<u32>, GltfError> {
        let checks = self.check(index, pointer)?;
        let at = &checks.pointer;
        if checks.type_ != Type::Scalar {
            return Err(GltfError::value(
                format!("{at}/type"),
                format!("{:?}", checks.type_),
                format!("the use at {pointer} as indices allows Scalar"),
            ));
        }
        let component = checks.component;
        if !matches!(
            component,
            ComponentType::U8 | ComponentType::U16 | ComponentType::U32
        ) {
            return Err(GltfError::value(
                format!("{at}/componentType"),
                component.as_gl_enum(),
                format!(
                    "the use at {pointer} as indices allows 5121, 5123 and 5125 (unsigned integers)"
                ),
            ));
        }
        self.elements(&checks, |bytes| unsigned(component, bytes))
    }

    fn check(&self, index: Index<Accessor>, pointer: &str) -> Result<Checks<'a>, GltfError> {
        let accessors = &self.json.accessors;
        let accessor = get(accessors, index.value(), "accessors", || pointer.into())?;
        let at = format!("/accessors/{}", index.value());
        let Checked::Valid(component) = accessor.component_type else {
            return Err(GltfError::value(
                format!("{at}/componentType"),
                "an unknown number",
                "allowed are 5120, 5121, 5122, 5123, 5125 and 5126",
            ));
        };
        let Checked::Valid(type_) = accessor.type_ else {
            return Err(GltfError::value(
                format!("{at}/type"),
                "an unknown name",
                "allowed are SCALAR, VEC2, VEC3, VEC4, MAT2, MAT3 and MAT4",
            ));
        };
        let count = usize::try_from(accessor.count.0)
            .ok()
            .filter(|_| accessor.buffer_view.is_some() || accessor.count.0 <= MAX_ZEROS)
            .ok_or_else(|| GltfError::TooMany {
                pointer: format!("{at}/count"),
                found: accessor.count.0,
                what: "elements without a buffer view",
                limit: MAX_ZEROS,
            })?;
        Ok(Checks {
            accessor,
            pointer: at,
            component: component.0,
            type_,
            count,
        })
    }

    /// All elements: those in the buffer view, or zero bytes without one, then the sparse replacements.
    fn elements<T: Clone>(
        &self,
        checks: &Checks<'_>,
        decode: impl Fn(&[u8]) -> T,
    ) -> Result<Vec<T>, GltfError> {
        let Checks {
            accessor,
            pointer,
            count,
            ..
        } = checks;
        let size = checks.component.size() * checks.type_.multiplicity();
        let mut values = match accessor.buffer_view {
            Some(index) => {
                let view = self.buffers.view(index, &format!("{pointer}/bufferView"))?;
                let offset = accessor.byte_offset.unwrap_or_default().0;
                strided(view, offset, *count, size, pointer)?
                    .map(&decode)
                    .collect()
            }
            None => vec![decode(&vec![0; size]); *count],
        };
        if let Some(sparse) = &accessor.sparse {
            self.replace(sparse, &mut values, size, pointer, decode)?;
        }
        Ok(values)
    }

    fn replace<T>(
        &self,
        sparse: &sparse::Sparse,
        values: &mut [T],
        size: usize,
        pointer: &str,
        decode: impl Fn(&[u8]) -> T,
    ) -> Result<(), GltfError> {
        let at = format!("{pointer}/sparse");
        let count = usize::try_from(sparse.count.0)
            .ok()
            .filter(|&count| count <= values.len())
            .ok_or_else(|| {
                GltfError::value(
                    format!("{at}/count"),
                    sparse.count.0,
                    format!("at most the accessor's count {}", values.len()),
                )
            })?;
        let indices_at = format!("{at}/indices");
        let Checked::Valid(component) = sparse.indices.component_type else {
            return Err(GltfError::value(
                format!("{indices_at}/componentType"),
                "an unknown number",
                "allowed are 5121, 5123 and 5125",
            ));
        };
        let component = component.0;
        let view = self.buffers.view(
            sparse.indices.buffer_view,
            &format!("{indices_at}/bufferView"),
        )?;
        let offset = sparse.indices.byte_offset.0;
        let indices = strided(view, offset, count, component.size(), &indices_at)?;
        let values_at = format!("{at}/values");
        let view = self.buffers.view(
            sparse.values.buffer_view,
            &format!("{values_at}/bufferView"),
        )?;
        let offset = sparse.values.byte_offset.0;
        let replacements = strided(view, offset, count, size, &values_at)?;
        for (index, replacement) in indices.zip(replacements) {
            let found = unsigned(component, index) as usize;
            let n = values.len();
            *values.get_mut(found).ok_or_else(|| GltfError::Index {
                pointer: indices_at.clone(),
                found,
                n,
                what: "elements in this accessor",
            })? = decode(replacement);
        }
        Ok(())
    }
}

/// `count` elements of `size` bytes, after it is known that the view holds them all.
fn strided<'b>(
    view: View<'b>,
    offset: u64,
    count: usize,
    size: usize,
    pointer: &str,
) -> Result<impl Iterator<Item = &'b [u8]>, GltfError> {
    let stride = view.stride.unwrap_or(size);
    if stride < size {
        return Err(GltfError::value(
            pointer,
            format!("a byteStride of {stride}"),
            format!("elements of {size} bytes need at least that"),
        ));
    }
    let needed = match count {
        0 => Some(0),
        _ => stride
            .checked_mul(count - 1)
            .and_then(|n| n.checked_add(size)),
    };
    let bytes = usize::try_from(offset)
        .ok()
        .zip(needed)
        .and_then(|(offset, needed)| view.bytes.get(offset..offset.checked_add(needed)?))
        .ok_or_else(|| GltfError::Bytes {
            pointer: pointer.into(),
            offset,
            needed: needed.map_or(u64::MAX, |n| n as u64),
            container: "the buffer view",
            available: view.bytes.len() as u64,
        })?;
    Ok(bytes.chunks(stride).map(move |chunk| &chunk[..size]))
}

/// A component as a number; normalised integers as glTF 2.0, section 3.11 says.
fn number(component: ComponentType, normalized: bool, bytes: &[u8]) -> f32 {
    let (value, full) = match (component, bytes) {
        (ComponentType::I8, &[a]) => (f32::from(i8::from_le_bytes([a])), 127.0),
        (ComponentType::U8, &[a]) => (f32::from(a), 255.0),
        (ComponentType::I16, &[a, b]) => (f32::from(i16::from_le_bytes([a, b])), 32_767.0),
        (ComponentType::U16, &[a, b]) => (f32::from(u16::from_le_bytes([a, b])), 65_535.0),
        (ComponentType::F32, &[a, b, c, d]) => return f32::from_le_bytes([a, b, c, d]),
        _ => return unsigned(component, bytes) as f32,
    };
    if normalized {
        (value / full).max(-1.0)
    } else {
        value
    }
}

/// A component as an unsigned integer, little-endian.
fn unsigned(component: ComponentType, bytes: &[u8]) -> u32 {
    bytes
        .iter()
        .take(component.size())
        .rev()
        .fold(0, |value, &byte| (value << 8) | u32::from(byte))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn normalised_integers_reach_exactly_one() {
        for (component, bytes, normalized, expected) in [
            (ComponentType::U8, &[255][..], true, 1.0),
            (ComponentType::U16, &[255, 255], true, 1.0),
            (ComponentType::I8, &[127], true, 1.0),
            (ComponentType::I8, &[128], true, -1.0),
            (ComponentType::I16, &[0, 128], true, -1.0),
            (ComponentType::I16, &[0, 128], false, -32_768.0),
            (ComponentType::F32, &[0, 0, 192, 63], false, 1.5),
        ] {
            assert_eq!(
                number(component, normalized, bytes),
                expected,
                "{component:?}"
            );
        }
    }

    #[test]
    fn elements_beyond_the_view_are_refused_whatever_the_arithmetic() {
        let bytes = [7; 24];
        let check = |stride, offset, count| {
            strided(
                View {
                    bytes: &bytes,
                    stride,
                },
                offset,
                count,
                8,
                "/accessors/0",
            )
            .map(|elements| elements.count())
            .ok()
        };
        assert_eq!(check(None, 0, 3), Some(3));
        assert_eq!(check(Some(16), 0, 2), Some(2));
        assert_eq!(check(Some(12), 4, 2), Some(2));
        assert_eq!(check(None, 24, 0), Some(0));
        for (stride, offset, count) in [
            (None, 0, 4),
            (None, 17, 1),
            (Some(16), 1, 2),
            (Some(4), 0, 1),
            (Some(0), 0, usize::MAX),
            (None, u64::MAX, 1),
            (None, 0, usize::MAX),
            (Some(usize::MAX), 0, 3),
        ] {
            assert_eq!(
                check(stride, offset, count),
                None,
                "{stride:?} {offset} {count}"
            );
        }
    }
}
