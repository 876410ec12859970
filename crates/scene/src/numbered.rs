//! Names of files for the frames of a sequence: `out.####.exr` is `out.0007.exr` for frame 7.

use std::path::{Path, PathBuf};

/// The place in a file's name where its number stands: the last run of `#`, as bytes.
fn place(name: &str) -> Option<std::ops::Range<usize>> {
    let end = name.rfind('#')? + 1;
    let n = name[..end].bytes().rev().take_while(|&b| b == b'#').count();
    Some(end - n..end)
}

/// Whether the file's name has a place for a number.
pub fn has_place(path: &Path) -> bool {
    let name = path.file_name().unwrap_or_default();
    place(&name.to_string_lossy()).is_some()
}

/// The name for frame `number`, with at least as many digits as there are `#`; the name itself where there are none.
pub fn numbered(path: &Path, number: u32) -> PathBuf {
    let Some(name) = path.file_name().and_then(|name| name.to_str()) else {
        return path.to_owned();
    };
    let Some(place) = place(name) else {
        return path.to_owned();
    };
    let digits = format!("{number:0width$}", width = place.len());
    let name = [&name[..place.start], &digits, &name[place.end..]].concat();
    path.with_file_name(name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_stand_where_the_last_hashes_are() {
        let name = |path: &str, number| numbered(Path::new(path), number);
        assert_eq!(name("a/out.####.exr", 7), Path::new("a/out.0007.exr"));
        assert_eq!(name("#1_##.png", 123), Path::new("#1_123.png"));
        assert_eq!(name("a##/ü#.exr", 4), Path::new("a##/ü4.exr"));
        assert_eq!(name("a##/still.exr", 4), Path::new("a##/still.exr"));
        assert!(has_place(Path::new("#.exr")) && !has_place(Path::new("a#/b.exr")));
    }
}
