//! How each field of a scene file is written, for messages about one that is written otherwise.

/// The form of the field with this name, as in "a number"; `None` for names that no field has.
pub(super) fn form_of(field: &str) -> Option<&'static str> {
    let form = match field {
        "gltf" | "file" => "a path in double quotes, relative to the scene file",
        "name" | "grid" | "gltf_scene" => "a name in double quotes",
        "camera" => {
            "LookAt(eye: (x, y, z), target: (x, y, z), vfov: degrees), Path([Key(frame: number, …), …]) or Gltf(\"name\")"
        }
        "film" => "Film(width: pixels, height: pixels, fps: number)",
        "lights" => {
            "a bracketed list of lights: [Point(…), Spot(…), Directional(…), Sky(…), Environment(…)]"
        }
        "media" => "a bracketed list: [Medium(…), …]",
        "render" => "Render(error: number, max_depth: number or None, exposure: stops)",
        "eye" | "target" | "position" | "min" | "max" | "center" => {
            "a position: three numbers of metres in parentheses, (x, y, z)"
        }
        "up" | "direction" => "a direction: three numbers in parentheses, (x, y, z)",
        "intensity" | "irradiance" | "radiance" | "emission" | "sigma_t" | "albedo" => {
            "a linear RGB colour: three numbers in parentheses, (r, g, b)"
        }
        "vfov" | "inner_cone" | "outer_cone" | "rotation" => "a number of degrees",
        "fps" => "a number of frames per second",
        "frame" => "the number of a frame, from 0 on",
        "radius" | "base" | "scale_height" => "a number of metres",
        "scale" | "g" | "error" => "a number",
        "exposure" => "a number of stops",
        "width" | "height" => "a whole number of pixels",
        "max_depth" => "a whole number, or None",
        "region" => {
            "Everywhere, Box(min: (x, y, z), max: (x, y, z)) or Sphere(center: (x, y, z), radius: metres)"
        }
        "density" => {
            "Constant(number), Height(base: metres, scale_height: metres) or Grid(file: \"path\", …)"
        }
        "transform" => "16 numbers in square brackets, column by column",
        "phase" => {
            "Isotropic, HenyeyGreenstein(g: number), Rayleigh or Mixture([(weight, phase), …])"
        }
        _ => return None,
    };
    Some(form)
}

/// The name in `allowed` that `found` is most likely a misspelling of.
///
/// Near is a Levenshtein distance, with capitals alike, of at most a third of the length, rounded.
pub(super) fn nearest<'a>(found: &str, allowed: &[&'a str]) -> Option<&'a str> {
    let found = found.to_lowercase();
    let limit = ((found.chars().count() + 1) / 3).max(1);
    allowed
        .iter()
        .map(|name| (edit_distance(&found, &name.to_lowercase()), *name))
        .filter(|(distance, name)| *distance <= limit && *distance < name.len())
        .min_by_key(|(distance, _)| *distance)
        .map(|(_, name)| name)
}

/// Fewest insertions, deletions and replacements of characters that turn `a` into `b` (Levenshtein 1966).
fn edit_distance(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, x) in a.chars().enumerate() {
        let mut diagonal = i;
        row[0] = i + 1;
        for (j, y) in b.iter().enumerate() {
            let replaced = diagonal + usize::from(x != *y);
            diagonal = row[j + 1];
            row[j + 1] = replaced.min(row[j] + 1).min(diagonal + 1);
        }
    }
    row[b.len()]
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a failing test panics")]
mod tests {
    use super::*;
    use crate::scene_file::{Fault, parse};
    use std::path::Path;

    #[test]
    fn every_field_has_a_form() {
        for (owner, text) in [
            ("Scene", "Scene(?: 0)"),
            ("LookAt", "Scene(camera: LookAt(?: 0))"),
            ("Key", "Scene(camera: Path([Key(?: 0)]))"),
            ("Film", "Scene(film: Film(?: 0))"),
            ("Render", "Scene(render: Render(?: 0))"),
            ("Point", "Scene(lights: [Point(?: 0)])"),
            ("Spot", "Scene(lights: [Spot(?: 0)])"),
            ("Directional", "Scene(lights: [Directional(?: 0)])"),
            ("Sky", "Scene(lights: [Sky(?: 0)])"),
            ("Environment", "Scene(lights: [Environment(?: 0)])"),
            ("Medium", "Scene(media: [Medium(?: 0)])"),
            ("Box", "Scene(media: [Medium(region: Box(?: 0))])"),
            ("Sphere", "Scene(media: [Medium(region: Sphere(?: 0))])"),
            ("Height", "Scene(media: [Medium(density: Height(?: 0))])"),
            ("Grid", "Scene(media: [Medium(density: Grid(?: 0))])"),
            (
                "HenyeyGreenstein",
                "Scene(media: [Medium(phase: HenyeyGreenstein(?: 0))])",
            ),
        ] {
            let text = text.replace('?', "no_such_field");
            let error = parse(text.as_bytes(), Path::new("a.ron")).unwrap_err();
            let Fault::UnknownName { kind, allowed, .. } = error.fault else {
                panic!("{error}");
            };
            assert_eq!(kind, format!("a field of {owner}"));
            for field in allowed {
                assert!(form_of(field).is_some(), "{owner} {field}");
            }
        }
    }

    #[test]
    fn edit_distances_are_the_textbooks() {
        for (a, b, distance) in [
            ("", "", 0),
            ("abc", "", 3),
            ("kitten", "sitting", 3),
            ("saturday", "sunday", 3),
            ("é", "e", 1),
        ] {
            assert_eq!(edit_distance(a, b), distance, "{a} {b}");
            assert_eq!(edit_distance(b, a), distance, "{b} {a}");
        }
    }

    #[test]
    fn misspellings_find_their_name_and_strangers_none() {
        let allowed = ["sigma_t", "albedo", "phase", "g"];
        for (found, name) in [
            ("sigma_T", Some("sigma_t")),
            ("sigmat", Some("sigma_t")),
            ("sigma_s", Some("sigma_t")),
            ("Albdo", Some("albedo")),
            ("phsae", Some("phase")),
            ("temperature", None),
            ("x", None),
            ("", None),
        ] {
            assert_eq!(nearest(found, &allowed), name, "{found}");
        }
    }
}
