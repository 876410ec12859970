//! Which files a scene may name: those in its own folder, unless the user allows more.
//!
//! A scene file or glTF from somewhere else must not make the renderer read a password file or open a connection.

use percent_encoding::percent_decode_str;
use std::cell::RefCell;
use std::path::{Component, Path, PathBuf};

/// Where names in a file start from, and the folder that they may not leave.
#[derive(Clone, Debug)]
pub struct Folder {
    base: PathBuf,
    root: PathBuf,
    allow_external: bool,
    /// The files found so far.
    found: RefCell<Vec<PathBuf>>,
}

/// Why a file that a scene names cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PathError {
    /// The name is an address.
    #[error(
        "\"{name}\" is an address ({scheme}:), and only files are read; store the file beside the scene and name it by a relative path"
    )]
    Scheme {
        /// The name as written.
        name: String,
        /// What stands before the colon.
        scheme: String,
    },
    /// The name leads outside.
    #[error(
        "\"{name}\" refers outside the scene's folder {}; move the file there or use --allow-external",
        root.display()
    )]
    Outside {
        /// The name as written.
        name: String,
        /// The folder that may not be left.
        root: PathBuf,
    },
    /// Percent-encoding gives bytes that are not text.
    #[error("\"{name}\" is not percent-encoded UTF-8")]
    Encoding {
        /// The name as written.
        name: String,
    },
    /// There is no such file, or it may not be read.
    #[error("cannot read \"{name}\": {source} ({})", path.display())]
    Read {
        /// The name as written.
        name: String,
        /// Where it was looked for.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// The name is that of a folder or a device.
    #[error("\"{name}\" is not a file ({})", path.display())]
    NotAFile {
        /// The name as written.
        name: String,
        /// Where it leads.
        path: PathBuf,
    },
}

impl Folder {
    /// Names relative to the folder that holds `file`, and confined to it unless `allow_external`.
    ///
    /// # Errors
    /// Where that folder does not exist.
    pub fn of(file: &Path, allow_external: bool) -> std::io::Result<Self> {
        let parent = match file.parent() {
            Some(parent) if parent != Path::new("") => parent,
            _ => Path::new("."),
        };
        let base = parent.canonicalize()?;
        let root = base.clone();
        Ok(Self {
            base,
            root,
            allow_external,
            found: RefCell::default(),
        })
    }

    /// The same, confined to the wider folder `root` (that of the scene file which names this file).
    ///
    /// # Errors
    /// Where `root` does not exist.
    pub fn confined_to(self, root: &Path) -> std::io::Result<Self> {
        Ok(Self {
            root: root.canonicalize()?,
            ..self
        })
    }

    /// The folder that names may not leave.
    pub fn root(&self) -> &Path {
        &self.root
    }

    /// The files found so far, as they are to be read.
    pub fn into_found(self) -> Vec<PathBuf> {
        self.found.into_inner()
    }

    /// The existing file that a percent-encoded relative URI means.
    ///
    /// # Errors
    /// As [`Folder::locate`], and where the decoded bytes are not text.
    pub fn locate_uri(&self, uri: &str) -> Result<PathBuf, PathError> {
        let decoded = percent_decode_str(uri).decode_utf8();
        match decoded {
            // The scheme is looked for before decoding too: "a%3Ab" is a file's name.
            Ok(name) => {
                refuse_scheme(uri)?;
                self.find(uri, &name)
            }
            Err(_) => Err(PathError::Encoding { name: uri.into() }),
        }
    }

    /// The existing file that `name` means, with symbolic links resolved.
    ///
    /// # Errors
    /// Where the name is an address, leads out of the folder, or is not that of an existing file.
    pub fn locate(&self, name: &str) -> Result<PathBuf, PathError> {
        refuse_scheme(name)?;
        self.find(name, name)
    }

    fn find(&self, written: &str, name: &str) -> Result<PathBuf, PathError> {
        let outside = || PathError::Outside {
            name: written.into(),
            root: self.root.clone(),
        };
        // Checked before the file system is asked, so that nobody learns what exists outside.
        let path = self.base.join(name);
        if !self.allow_external && !without_dots(&path).starts_with(&self.root) {
            return Err(outside());
        }
        let read = |source| PathError::Read {
            name: written.into(),
            path: path.clone(),
            source,
        };
        let real = path.canonicalize().map_err(read)?;
        if !self.allow_external && !real.starts_with(&self.root) {
            return Err(outside());
        }
        if !real.metadata().map_err(read)?.is_file() {
            return Err(PathError::NotAFile {
                name: written.into(),
                path: real,
            });
        }
        self.found.borrow_mut().push(real.clone());
        Ok(real)
    }
}

/// Refuses `scheme:rest`; one letter before the colon is a drive, which the path rules judge.
fn refuse_scheme(name: &str) -> Result<(), PathError> {
    let Some((scheme, _)) = name.split_once(':') else {
        return Ok(());
    };
    let is_scheme = scheme.len() > 1
        && scheme.starts_with(|c: char| c.is_ascii_alphabetic())
        && scheme
            .chars()
            .all(|c| c.is_ascii_alphanumeric() || matches!(c, '+' | '-' | '.'));
    if is_scheme {
        return Err(PathError::Scheme {
            name: shortened(name),
            scheme: scheme.into(),
        });
    }
    Ok(())
}

/// `path` with `.` and `..` taken out without asking the file system.
fn without_dots(path: &Path) -> PathBuf {
    let mut plain = PathBuf::new();
    for component in path.components() {
        match component {
            Component::CurDir => {}
            Component::ParentDir => {
                plain.pop();
            }
            other => plain.push(other),
        }
    }
    plain
}

/// The first characters of a name, for messages: an address can hold a whole file.
pub(crate) fn shortened(name: &str) -> String {
    const SHOWN: usize = 80;
    match name.char_indices().nth(SHOWN) {
        Some((end, _)) => format!("{}…", &name[..end]),
        None => name.into(),
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a failing test panics")]
mod tests {
    use super::*;
    use std::fs;

    /// A folder with `scene/in.png`, `scene/a b é.png`, `scene/sub/` and `out.png` beside `scene`.
    fn files() -> tempfile::TempDir {
        let dir = tempfile::tempdir().unwrap();
        fs::create_dir_all(dir.path().join("scene/sub")).unwrap();
        for name in ["scene/in.png", "scene/a b é.png", "out.png"] {
            fs::write(dir.path().join(name), name).unwrap();
        }
        dir
    }

    fn found(uri: &str, allow_external: bool) -> String {
        let dir = files();
        let folder = Folder::of(&dir.path().join("scene/x.gltf"), allow_external).unwrap();
        match folder.locate_uri(uri) {
            Ok(path) => fs::read_to_string(path).unwrap(),
            Err(PathError::Scheme { scheme, .. }) => format!("scheme {scheme}"),
            Err(PathError::Outside { .. }) => "outside".into(),
            Err(PathError::Encoding { .. }) => "encoding".into(),
            Err(PathError::Read { .. }) => "missing".into(),
            Err(PathError::NotAFile { .. }) => "not a file".into(),
        }
    }

    #[test]
    fn uris_find_files_inside_the_folder_only() {
        for (uri, expected) in [
            ("in.png", "scene/in.png"),
            ("./sub/../in.png", "scene/in.png"),
            ("a%20b%20%C3%A9.png", "scene/a b é.png"),
            ("a b é.png", "scene/a b é.png"),
            ("../out.png", "outside"),
            ("%2e%2e/out.png", "outside"),
            ("sub/../../out.png", "outside"),
            ("../../../../secret.png", "outside"),
            ("/etc/hostname", "outside"),
            ("nothing.png", "missing"),
            ("%ff.png", "encoding"),
            ("sub", "not a file"),
            ("", "not a file"),
            ("http://example.org/a.png", "scheme http"),
            ("file:///etc/hostname", "scheme file"),
        ] {
            assert_eq!(found(uri, false), expected, "{uri}");
        }
    }

    #[test]
    fn external_files_are_found_when_allowed_but_addresses_never() {
        assert_eq!(found("../out.png", true), "out.png");
        assert_eq!(found("http://example.org/a.png", true), "scheme http");
    }

    #[test]
    fn a_wider_root_allows_neighbours_of_a_subfolder() {
        let dir = files();
        let folder = Folder::of(&dir.path().join("scene/sub/x.gltf"), false)
            .unwrap()
            .confined_to(&dir.path().join("scene"))
            .unwrap();
        assert!(folder.locate("../in.png").is_ok());
        let outside = folder.locate("../../out.png");
        assert!(matches!(outside, Err(PathError::Outside { .. })));
    }

    #[cfg(unix)]
    #[test]
    fn symbolic_links_do_not_lead_out() {
        let dir = files();
        let scene = dir.path().join("scene");
        std::os::unix::fs::symlink(dir.path().join("out.png"), scene.join("link.png")).unwrap();
        let folder = |allow| Folder::of(&scene.join("x.gltf"), allow).unwrap();
        let refused = folder(false).locate("link.png");
        assert!(matches!(refused, Err(PathError::Outside { .. })));
        assert!(folder(true).locate("link.png").is_ok());
    }
}
