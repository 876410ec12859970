//! What can be wrong with a glTF file, each with the place in the file as a JSON pointer.

use crate::paths::PathError;

/// Why a glTF file cannot be used. `pointer` is a JSON pointer such as `/accessors/3/count`.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum GltfError {
    /// The file is of another version of glTF.
    #[error(
        "this is glTF {found}, and glTF 2.0 is needed; convert the file, for example by importing it into Blender and exporting it again (at /asset)"
    )]
    Version {
        /// The version that the file states.
        found: String,
    },

    /// The file cannot be shown rightly without something that is missing here.
    #[error("the file requires {extension}, which is not supported; {mend} (at {pointer})")]
    RequiredExtension {
        /// Name of the extension.
        extension: String,
        /// What would help.
        mend: &'static str,
        /// Where it is required.
        pointer: String,
    },

    /// The binary container is damaged.
    #[error("the GLB container is damaged: {problem} (at byte {offset})")]
    Container {
        /// What is wrong.
        problem: String,
        /// Where, from the start of the file.
        offset: usize,
    },

    /// The text is not JSON, or not glTF.
    #[error("the file is not valid glTF: {0}")]
    Json(serde_json::Error),

    /// An index names something that is not there.
    #[error("index {found} is out of range: the file has {n} {what} (at {pointer})")]
    Index {
        /// Where the index stands.
        pointer: String,
        /// Its value.
        found: usize,
        /// How many there are.
        n: usize,
        /// Of what.
        what: &'static str,
    },

    /// A stretch of bytes leaves what holds it.
    #[error(
        "{needed} bytes from byte {offset} on are needed, and {container} holds {available} (at {pointer})"
    )]
    Bytes {
        /// What states the stretch.
        pointer: String,
        /// First byte.
        offset: u64,
        /// Number of bytes; saturates.
        needed: u64,
        /// What should hold them.
        container: &'static str,
        /// How many it holds.
        available: u64,
    },

    /// A value is outside what is allowed.
    #[error("{found} is not allowed here; {allowed} (at {pointer})")]
    Value {
        /// Where it stands.
        pointer: String,
        /// The value.
        found: String,
        /// What is allowed.
        allowed: String,
    },

    /// A file or data URI that the file names cannot be used.
    #[error("{source} (at {pointer})")]
    File {
        /// Where it is named.
        pointer: String,
        /// Why not.
        source: PathError,
    },

    /// The transform of a node cannot be used.
    #[error("node \"{node}\" {problem} (at {pointer})")]
    Node {
        /// Name of the node, or its number.
        node: String,
        /// What is wrong and what is allowed.
        problem: &'static str,
        /// Where.
        pointer: String,
    },

    /// There is nothing to show.
    #[error(
        "{problem}; a glTF file needs a scene: export it again with one, or add \"scenes\": [{{\"nodes\": [0]}}] (at {pointer})"
    )]
    NoScene {
        /// What is missing.
        problem: String,
        /// Where.
        pointer: &'static str,
    },

    /// The file asks for more than can be held.
    #[error("the scene has {found} {what}, and at most {limit} can be held (at {pointer})")]
    TooMany {
        /// Where.
        pointer: String,
        /// How many.
        found: u64,
        /// Of what.
        what: &'static str,
        /// The limit.
        limit: u64,
    },
}

impl GltfError {
    /// A value at `pointer` that is not allowed.
    pub(super) fn value(
        pointer: impl Into<String>,
        found: impl ToString,
        allowed: impl Into<String>,
    ) -> Self {
        Self::Value {
            pointer: pointer.into(),
            found: found.to_string(),
            allowed: allowed.into(),
        }
    }
}

/// `list[index]`, or an error that says how long the list is.
pub(super) fn get<'a, T>(
    list: &'a [T],
    index: usize,
    what: &'static str,
    pointer: impl FnOnce() -> String,
) -> Result<&'a T, GltfError> {
    list.get(index).ok_or_else(|| GltfError::Index {
        pointer: pointer(),
        found: index,
        n: list.len(),
        what,
    })
}
