//! One primitive of a mesh: its vertices and triangles in the mesh's own space, read and checked.

use super::accessor::{Accessors, Expected};
use super::container::unsupported;
use super::error::GltfError;
use super::materials::Materials;
use super::tally::Tally;
use crate::error::Warning;
use ::gltf::json::accessor::{Accessor, Type};
use ::gltf::json::mesh::{Mode, Primitive, Semantic};
use ::gltf::json::validation::Checked;
use ::gltf::json::{Index, Root};
use glam::{Vec2, Vec3, Vec4};

/// Vertices and triangles of a primitive. Every index lies within `positions`.
#[derive(Debug)]
pub(super) struct Vertices {
    pub(super) positions: Vec<Vec3>,
    /// One per vertex; zero where the file's is unusable or missing.
    pub(super) normals: Vec<Vec3>,
    /// One per vertex, or empty where no texture reads them.
    pub(super) uvs: [Vec<Vec2>; 2],
    /// One per vertex, or empty.
    pub(super) colors: Vec<Vec4>,
    pub(super) triangles: Vec<[u32; 3]>,
    pub(super) material: u32,
    /// How many of the file's normals are unusable.
    pub(super) n_bad_normals: usize,
}

/// Reads a primitive; `None` for one without triangles.
pub(super) fn read(
    json: &Root,
    accessors: Accessors<'_>,
    materials: &mut Materials<'_>,
    primitive: &Primitive,
    pointer: &str,
    tally: &mut Tally,
    warnings: &mut Vec<Warning>,
) -> Result<Option<Vertices>, GltfError> {
    let Checked::Valid(mode) = primitive.mode else {
        return Err(GltfError::value(
            format!("{pointer}/mode"),
            "an unknown number",
            "allowed are 0 to 6",
        ));
    };
    if !matches!(
        mode,
        Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan
    ) {
        tally.note("primitives of points or lines are left out", pointer);
        return Ok(None);
    }
    let attribute = |semantic| primitive.attributes.get(&Checked::Valid(semantic)).copied();
    let Some(position) = attribute(Semantic::Positions) else {
        tally.note("primitives without POSITION are left out", pointer);
        return Ok(None);
    };
    refuse_draco(json, primitive, position, pointer)?;
    let at = |name: &str| format!("{pointer}/attributes/{name}");
    let attribute_at = at("POSITION");
    let expected = Expected {
        types: &[Type::Vec3],
        plain_integers: true,
        count: None,
    };
    let positions = accessors.floats::<3>(position, &attribute_at, expected, 0.0)?;
    let positions: Vec<_> = positions.into_iter().map(Vec3::from).collect();
    if let Some(element) = positions.iter().position(|p| !p.is_finite()) {
        return Err(GltfError::value(
            format!("/accessors/{}", position.value()),
            format!("element {element}, {},", positions[element]),
            "positions must be finite",
        ));
    }
    let n = positions.len();
    let expected = Expected {
        count: Some((n, "one element per vertex")),
        ..expected
    };
    let mut n_bad_normals = 0;
    let normals = match attribute(Semantic::Normals) {
        Some(normal) => accessors
            .floats::<3>(normal, &at("NORMAL"), expected, 0.0)?
            .into_iter()
            .map(|v| {
                let unit = Vec3::from(v).try_normalize();
                n_bad_normals += usize::from(unit.is_none());
                unit.unwrap_or(Vec3::ZERO)
            })
            .collect(),
        None => vec![Vec3::ZERO; n],
    };
    let index = primitive.material.map(|material| material.value());
    let material = materials.place(index, &format!("{pointer}/material"), warnings)?;
    let uv_set = |set: usize, tally: &mut Tally| -> Result<Vec<Vec2>, GltfError> {
        let name = format!("TEXCOORD_{set}");
        let used = materials.at(material).is_some_and(|m| m.reads_uv(set));
        let Some(uv) = attribute(Semantic::TexCoords(set as u32)).filter(|_| used) else {
            return Ok(Vec::new());
        };
        let expected = Expected {
            types: &[Type::Vec2],
            ..expected
        };
        let values = accessors.floats::<2>(uv, &at(&name), expected, 0.0)?;
        Ok(values
            .into_iter()
            .map(|v| {
                finite_or(Vec2::from(v), Vec2::is_finite, Vec2::ZERO, || {
                    tally.note(
                        "texture coordinates that are not finite are read as 0",
                        &at(&name),
                    );
                })
            })
            .collect())
    };
    let uvs = [uv_set(0, tally)?, uv_set(1, tally)?];
    let colors = match attribute(Semantic::Colors(0)) {
        Some(color) => {
            let expected = Expected {
                types: &[Type::Vec3, Type::Vec4],
                plain_integers: false,
                ..expected
            };
            let values = accessors.floats::<4>(color, &at("COLOR_0"), expected, 1.0)?;
            values
                .into_iter()
                .map(|v| {
                    finite_or(Vec4::from(v), Vec4::is_finite, Vec4::ONE, || {
                        tally.note(
                            "vertex colours that are not finite are read as white",
                            &at("COLOR_0"),
                        );
                    })
                })
                .map(|c| c.clamp(Vec4::ZERO, Vec4::ONE))
                .collect()
        }
        None => Vec::new(),
    };
    let triangles = triangles(accessors, primitive, mode, n, pointer)?;
    Ok(Some(Vertices {
        positions,
        normals,
        uvs,
        colors,
        triangles,
        material,
        n_bad_normals,
    }))
}

/// `value` where it is finite, otherwise `instead` and a note.
fn finite_or<T: Copy>(value: T, is_finite: fn(T) -> bool, instead: T, note: impl FnOnce()) -> T {
    if is_finite(value) {
        return value;
    }
    note();
    instead
}

/// Fails for a primitive whose data are only there in compressed form, although the file does not say that it must be read.
fn refuse_draco(
    json: &Root,
    primitive: &Primitive,
    position: Index<Accessor>,
    pointer: &str,
) -> Result<(), GltfError> {
    const DRACO: &str = "KHR_draco_mesh_compression";
    let compressed = primitive
        .extensions
        .as_ref()
        .is_some_and(|extensions| extensions.others.contains_key(DRACO));
    let no_bytes = json
        .accessors
        .get(position.value())
        .is_some_and(|accessor| accessor.buffer_view.is_none() && accessor.sparse.is_none());
    match compressed && no_bytes {
        true => Err(unsupported(DRACO, format!("{pointer}/extensions/{DRACO}"))),
        false => Ok(()),
    }
}

/// Triangles of a primitive with `n` vertices, in glTF's winding order (glTF 2.0, section 3.7.2.1).
fn triangles(
    accessors: Accessors<'_>,
    primitive: &Primitive,
    mode: Mode,
    n: usize,
    pointer: &str,
) -> Result<Vec<[u32; 3]>, GltfError> {
    let (indices, at) = match primitive.indices {
        Some(index) => {
            let indices = accessors.indices(index, &format!("{pointer}/indices"))?;
            (indices, format!("/accessors/{}", index.value()))
        }
        None => ((0..n as u32).collect(), pointer.into()),
    };
    if let Some(element) = indices.iter().position(|&i| i as usize >= n) {
        return Err(GltfError::Index {
            pointer: format!("{at}, element {element}"),
            found: indices[element] as usize,
            n,
            what: "vertices in this primitive",
        });
    }
    if mode == Mode::Triangles && indices.len() % 3 != 0 {
        return Err(GltfError::value(
            format!("{at}/count"),
            indices.len(),
            "triangles need a multiple of 3",
        ));
    }
    Ok(match mode {
        Mode::TriangleStrip => indices
            .windows(3)
            .enumerate()
            .map(|(i, w)| {
                if i % 2 == 0 {
                    [w[0], w[1], w[2]]
                } else {
                    [w[0], w[2], w[1]]
                }
            })
            .collect(),
        Mode::TriangleFan => indices
            .get(1..)
            .unwrap_or_default()
            .windows(2)
            .map(|w| [w[0], w[1], indices[0]])
            .collect(),
        _ => indices.as_chunks::<3>().0.to_vec(),
    })
}
