//! `tyndall info`: what a scene, a volume file, an image or a cache file holds.

use crate::args::InfoArgs;
use crate::error::CliError;
use crate::output;
use serde::Serialize;
use tyndall_render::CacheInfo;
use tyndall_render::image_file::read_image;
use tyndall_render::info::{ImageInfo, LightInfo, SceneInfo, VolumeInfo};
use tyndall_scene::LoadOptions;
use tyndall_scene::volume_file::{self, DEFAULT_MEMORY};

/// Lights listed one by one in the text; scenes can have thousands.
const LIGHTS_SHOWN: usize = 24;

pub(super) fn run(args: &InfoArgs) -> Result<(), CliError> {
    let ending = args
        .file
        .extension()
        .unwrap_or_default()
        .to_string_lossy()
        .to_ascii_lowercase();
    if CacheInfo::is_cache(&args.file) {
        return show(args, &CacheInfo::of(&args.file)?, cache_text);
    }
    match ending.as_str() {
        "ron" | "glb" | "gltf" => {
            let options = LoadOptions {
                bare_gltf: true,
                ..args.source.load_options()
            };
            show(
                args,
                &SceneInfo::of(&tyndall_scene::load(&args.file, &options)?),
                scene_text,
            )
        }
        "exr" | "png" | "hdr" | "jpg" | "jpeg" => {
            show(args, &ImageInfo::of(&read_image(&args.file)?), image_text)
        }
        "vdb" | "nvdb" | "vol" => {
            let limit = args.source.max_grid_memory.unwrap_or(DEFAULT_MEMORY);
            show(
                args,
                &VolumeInfo::of(&volume_file::inspect(&args.file, limit)?),
                volume_text,
            )
        }
        _ => Err(CliError::UnknownKind {
            path: args.file.display().to_string(),
        }),
    }
}

/// Prints what was found out, as JSON or as text.
fn show<T: Serialize>(
    args: &InfoArgs,
    info: &T,
    text: impl Fn(&T) -> String,
) -> Result<(), CliError> {
    if args.json {
        output::print_json(info)
    } else {
        output::print(&text(info))
    }
}

fn scene_text(scene: &SceneInfo) -> String {
    let mut lines = vec![
        format!("film       {} × {} pixels", scene.film[0], scene.film[1]),
        format!(
            "camera     at {} m, looking along {}, vfov {:.2}°",
            triple(scene.eye),
            triple(scene.forward),
            scene.vfov_degrees
        ),
    ];
    lines.extend(scene.camera_path.as_ref().map(|path| {
        let [first, last] = path.frames;
        format!(
            "path       frames {first} to {last}, {:.1} m",
            path.length_m
        )
    }));
    lines.extend([
        match scene.bounds_m {
            Some([min, max]) => format!("bounds     {} to {} m", triple(min), triple(max)),
            None => "bounds     none".to_owned(),
        },
        format!(
            "surfaces   {} triangles, {} materials, {} textures",
            scene.triangles, scene.materials, scene.textures
        ),
        format!(
            "memory     {:.1} MiB meshes, {:.1} MiB textures, {:.1} MiB search tree",
            scene.mesh_mib, scene.texture_mib, scene.search_tree_mib
        ),
        format!("lights     {}", scene.lights.len()),
    ]);
    lines.extend(scene.lights.iter().take(LIGHTS_SHOWN).map(light_line));
    if scene.lights.len() > LIGHTS_SHOWN {
        lines.push(format!(
            "  and {} more (--json lists all)",
            scene.lights.len() - LIGHTS_SHOWN
        ));
    }
    lines.push(format!("media      {}", scene.media.len()));
    for medium in &scene.media {
        let path = |p: Option<f32>| p.map_or("∞".to_owned(), |p| format!("{p:.4}"));
        lines.push(format!(
            "  {}  in {}, density {}, phase {}",
            medium.name, medium.region, medium.density, medium.phase
        ));
        if let Some(grid) = &medium.grid {
            lines.push(format!(
                "    grid of {} voxels, density up to {}, {:.1} MiB",
                cells(grid.size_voxels),
                grid.max_density,
                grid.memory_mib
            ));
        }
        lines.push(format!(
            "    mean free path ({}) m, σt {} /m, albedo {}, emission {} W/(m³ sr)",
            medium.mean_free_path_m.map(path).join(", "),
            triple(medium.sigma_t_per_m),
            triple(medium.albedo),
            triple(medium.emission_w_m3_sr),
        ));
    }
    lines.extend(
        scene
            .warnings
            .iter()
            .map(|warning| format!("warning: {warning}")),
    );
    lines.join("\n")
}

fn light_line(light: &LightInfo) -> String {
    let parts = [
        light.position_m.map(|v| format!("at {} m", triple(v))),
        light.power_w.map(|v| format!("{} W", triple(v))),
        light.intensity_w_sr.map(|v| format!("{} W/sr", triple(v))),
        light.irradiance_w_m2.map(|v| format!("{} W/m²", triple(v))),
        light
            .radiance_w_m2_sr
            .map(|v| format!("{} W/(m² sr)", triple(v))),
        light.area_m2.map(|area| format!("{area:.4} m²")),
    ];
    let parts: Vec<String> = parts.into_iter().flatten().collect();
    format!("  {}  {}", light.kind, parts.join(", "))
}

fn volume_text(volume: &VolumeInfo) -> String {
    let mut lines = vec![format!("grids      {}", volume.grids.len())];
    for grid in &volume.grids {
        lines.push(format!(
            "  {}  {}, {}",
            grid.name, grid.value_type, grid.class
        ));
        if let Some(problem) = &grid.problem {
            lines.push(format!("    not readable as a density: {problem}"));
        }
        let Some(voxels) = &grid.voxels else {
            continue;
        };
        let [x, y, z] = voxels.first_voxel;
        lines.push(format!(
            "    size     {} voxels from ({x}, {y}, {z}), {} active",
            cells(voxels.size_voxels),
            voxels.active_voxels
        ));
        lines.push(format!(
            "    values   min {:?}  mean {:.6}  max {:?}  background {:?}  negative {}",
            voxels.min, voxels.mean, voxels.max, voxels.background, voxels.negative_voxels
        ));
        let row = |row: [f64; 4]| row.map(|n| format!("{n:.6}")).join(" ");
        let edges = voxels.voxel_edges_m.map(|n| format!("{n:.6}"));
        lines.push(format!("    voxels   {} m", edges.join(" × ")));
        lines.push(format!(
            "    place    [{}]",
            voxels.world_from_index.map(row).join("; ")
        ));
        lines.push(format!("    memory   {:.1} MiB", voxels.memory_mib));
    }
    lines.join("\n")
}

/// A size in cells.
fn cells(size: [u64; 3]) -> String {
    size.map(|n| n.to_string()).join(" × ")
}

fn image_text(image: &ImageInfo) -> String {
    let mut lines = vec![format!(
        "size       {} × {} pixels",
        image.size[0], image.size[1]
    )];
    if image.frame != image.size || image.origin != [0, 0] {
        let [x, y] = image.origin;
        lines.push(format!(
            "crop       starts at ({x}, {y}) of a frame of {} × {}",
            image.frame[0], image.frame[1]
        ));
    }
    let width = image
        .channels
        .iter()
        .map(|channel| channel.name.len())
        .max()
        .unwrap_or(0);
    for c in &image.channels {
        let number = |n: Option<f64>| n.map_or("-".to_owned(), |n| format!("{n:.6}"));
        let (min, mean, max) = (
            number(c.min.map(f64::from)),
            number(c.mean),
            number(c.max.map(f64::from)),
        );
        let name = &c.name;
        lines.push(format!(
            "{name:<width$}  min {min}  mean {mean}  max {max}  nan {}  inf {}",
            c.nan, c.inf
        ));
    }
    lines.join("\n")
}

fn cache_text(cache: &CacheInfo) -> String {
    let depth = cache.max_depth.map_or("none".to_owned(), |n| n.to_string());
    let mut lines = vec![
        format!(
            "cache      for an error of {:.2} %, max depth {depth}, method {}",
            100.0 * cache.error,
            cache.method
        ),
        format!("views      {}", cache.views),
        format!(
            "field      {} cells{}",
            cache.field_cells,
            if cache.reads_field {
                ", read for multiple scattering"
            } else {
                ""
            }
        ),
        format!("memory     {:.1} MiB", cache.mib),
    ];
    for (kind, records) in &cache.records {
        let radii = records
            .radius_m
            .map_or(String::new(), |[min, median, max]| {
                format!(", radii {min:.4} to {max:.4} m (median {median:.4})")
            });
        let noise = records.relative_noise.map_or(String::new(), |noise| {
            format!(", noise {:.2} % (median)", 100.0 * noise)
        });
        let error = records.error.map_or(String::new(), |error| {
            format!(", {:.2} % of the image's error", 100.0 * error)
        });
        lines.push(format!(
            "records    {} {kind}{radii}{noise}{error}",
            records.count
        ));
    }
    lines.join("\n")
}

fn triple(v: [f32; 3]) -> String {
    format!("({:.4}, {:.4}, {:.4})", v[0], v[1], v[2])
}
