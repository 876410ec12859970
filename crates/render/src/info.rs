//! What a scene, a volume file or an image holds, as numbers for `tyndall info`.
//!
//! Plain data with units in the field names; the command line prints or serialises it.

use crate::image::Image;
use glam::Vec3;
use serde::Serialize;
use tyndall_media::grid::Grid;
use tyndall_media::{Density, Medium, PhaseFunction, Region};
use tyndall_scene::lights::{FlatEmitter, Light};
use tyndall_scene::volume_file::{GridSummary, VoxelSummary};
use tyndall_scene::{CameraMotion, Scene};

/// What a scene holds.
#[derive(Clone, Debug, Serialize)]
pub struct SceneInfo {
    /// Width and height of the image in pixels.
    pub film: [u32; 2],
    /// Where the camera stands, m; where it moves, at frame 0.
    pub eye: [f32; 3],
    /// Unit direction in which it looks.
    pub forward: [f32; 3],
    /// Its vertical field of view, degrees.
    pub vfov_degrees: f32,
    /// How the camera moves; null where it stands still.
    pub camera_path: Option<CameraPathInfo>,
    /// Smallest and largest coordinates of surfaces and bounded media, m; null where there are none.
    pub bounds_m: Option<[[f32; 3]; 2]>,
    /// Number of triangles.
    pub triangles: usize,
    /// Number of materials.
    pub materials: usize,
    /// Number of textures.
    pub textures: usize,
    /// The lights, emissive surfaces among them.
    pub lights: Vec<LightInfo>,
    /// The media.
    pub media: Vec<MediumInfo>,
    /// Memory of meshes, MiB.
    pub mesh_mib: f64,
    /// Memory of textures, MiB.
    pub texture_mib: f64,
    /// Memory of the search tree over the triangles, MiB.
    pub search_tree_mib: f64,
    /// What was repaired, ignored or will look odd.
    pub warnings: Vec<String>,
}

/// The way of a camera that moves.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CameraPathInfo {
    /// The first and the last frame.
    pub frames: [u32; 2],
    /// How far the eye goes, m.
    pub length_m: f64,
}

/// One light; a field that has no meaning for its kind is left out of the JSON.
#[derive(Clone, Debug, Default, Serialize)]
pub struct LightInfo {
    /// Its kind, in the words of the scene file.
    pub kind: &'static str,
    /// Where it is, m; the centre of an emissive surface.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub position_m: Option<[f32; 3]>,
    /// Radiant power, W per channel; light from infinitely far away counts what enters the sphere around the scene.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub power_w: Option<[f32; 3]>,
    /// Radiant intensity in its strongest direction, W/sr per channel.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub intensity_w_sr: Option<[f32; 3]>,
    /// Irradiance perpendicular to its direction, W/m² per channel.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub irradiance_w_m2: Option<[f32; 3]>,
    /// Mean radiance, W/(m² sr) per channel.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub radiance_w_m2_sr: Option<[f32; 3]>,
    /// Area of one side, m².
    #[serde(skip_serializing_if = "Option::is_none")]
    pub area_m2: Option<f32>,
}

/// One medium.
#[derive(Clone, Debug, Serialize)]
pub struct MediumInfo {
    /// Its name.
    pub name: String,
    /// Where it is, as the scene file writes it.
    pub region: String,
    /// How its density varies, as the scene file writes it.
    pub density: String,
    /// The grid of its density; null where that is none.
    pub grid: Option<MediumGridInfo>,
    /// Its phase function, as the scene file writes it.
    pub phase: String,
    /// Extinction at density 1, 1/m per channel.
    pub sigma_t_per_m: [f32; 3],
    /// Scattering at density 1, 1/m per channel.
    pub sigma_s_per_m: [f32; 3],
    /// Single-scattering albedo per channel.
    pub albedo: [f32; 3],
    /// Mean distance between collisions where the medium is densest, m per channel; null where there are none.
    pub mean_free_path_m: [Option<f32>; 3],
    /// Emission at density 1, W/(m³ sr) per channel.
    pub emission_w_m3_sr: [f32; 3],
}

/// The grid of a medium's density.
#[derive(Clone, Debug, Serialize)]
pub struct MediumGridInfo {
    /// Edges of the box around all that is not background, in voxels.
    pub size_voxels: [u64; 3],
    /// Largest density.
    pub max_density: f32,
    /// Smallest and largest coordinates of all that is not zero, m; null where it has no bounds.
    pub bounds_m: Option<[[f32; 3]; 2]>,
    /// Memory of its voxels, MiB; media may share them.
    pub memory_mib: f64,
}

impl MediumGridInfo {
    fn of(grid: &Grid) -> Self {
        Self {
            size_voxels: grid.size(),
            max_density: grid.max(),
            bounds_m: grid
                .bounds()
                .filter(|bounds| !bounds.is_empty())
                .map(|bounds| [bounds.min.to_array(), bounds.max.to_array()]),
            memory_mib: grid.voxels().bytes() as f64 / f64::from(1 << 20),
        }
    }
}

/// What a volume file holds.
#[derive(Clone, Debug, Serialize)]
pub struct VolumeInfo {
    /// Its grids.
    pub grids: Vec<GridInfo>,
}

/// One grid of a volume file.
#[derive(Clone, Debug, Serialize)]
pub struct GridInfo {
    /// Its name.
    pub name: String,
    /// The type of its values.
    pub value_type: String,
    /// What it is for, in the words of the file.
    pub class: String,
    /// Its voxels; left out where they cannot be read as a density.
    #[serde(flatten)]
    pub voxels: Option<VoxelInfo>,
    /// Why they cannot be read; null where they can.
    pub problem: Option<String>,
}

/// The voxels of a grid.
#[derive(Clone, Debug, Serialize)]
pub struct VoxelInfo {
    /// Edges of the box around active voxels, in voxels.
    pub size_voxels: [u64; 3],
    /// Smallest index coordinates of active voxels.
    pub first_voxel: [i32; 3],
    /// Number of active voxels.
    pub active_voxels: u64,
    /// Smallest value of active voxels.
    pub min: f32,
    /// Mean value of active voxels.
    pub mean: f64,
    /// Largest value of active voxels.
    pub max: f32,
    /// Value of all that is not stored.
    pub background: f32,
    /// Number of negative voxels, which a density takes as 0.
    pub negative_voxels: u64,
    /// Edges of a voxel, m.
    pub voxel_edges_m: [f64; 3],
    /// The first three rows of the matrix that takes index coordinates to metres.
    pub world_from_index: [[f64; 4]; 3],
    /// Memory taken, MiB.
    pub memory_mib: f64,
}

impl VolumeInfo {
    /// Describes the grids of a file.
    pub fn of(grids: &[GridSummary]) -> Self {
        Self {
            grids: grids.iter().map(GridInfo::of).collect(),
        }
    }
}

impl GridInfo {
    fn of(grid: &GridSummary) -> Self {
        Self {
            name: grid.name.clone(),
            value_type: grid.value_type.clone(),
            class: grid.class.clone(),
            voxels: grid.voxels.as_ref().ok().map(VoxelInfo::of),
            problem: grid.voxels.as_ref().err().map(ToString::to_string),
        }
    }
}

impl VoxelInfo {
    fn of(voxels: &VoxelSummary) -> Self {
        let (m, t) = (
            voxels.world_from_index.matrix3,
            voxels.world_from_index.translation,
        );
        Self {
            size_voxels: voxels.size,
            first_voxel: voxels.first,
            active_voxels: voxels.active,
            min: voxels.min,
            mean: voxels.mean,
            max: voxels.max,
            background: voxels.background,
            negative_voxels: voxels.negative,
            voxel_edges_m: [m.x_axis, m.y_axis, m.z_axis].map(|axis| axis.length()),
            world_from_index: [0, 1, 2].map(|i| m.row(i).extend(t[i]).to_array()),
            memory_mib: voxels.bytes as f64 / f64::from(1 << 20),
        }
    }
}

impl SceneInfo {
    /// Describes `scene`.
    pub fn of(scene: &Scene) -> Self {
        let surfaces = scene.geometry.surfaces();
        let mesh = &surfaces.mesh;
        let mesh_bytes = size_of_val(mesh.positions.as_slice())
            + size_of_val(mesh.normals.as_slice())
            + mesh
                .uvs
                .iter()
                .map(|set| size_of_val(set.as_slice()))
                .sum::<usize>()
            + size_of_val(mesh.colors.as_slice())
            + size_of_val(mesh.indices.as_slice())
            + size_of_val(mesh.materials.as_slice());
        let mib = |bytes: usize| bytes as f64 / f64::from(1 << 20);
        let bounds = (!scene.bounds.is_empty()).then_some(scene.bounds);
        let radius = bounds.map(|b| 0.5 * b.diagonal());
        Self {
            film: [scene.film.width, scene.film.height],
            eye: scene.camera.eye().to_array(),
            forward: scene.camera.forward().to_array(),
            vfov_degrees: scene.camera.yfov().to_degrees(),
            camera_path: scene.motion.as_ref().map(CameraPathInfo::of),
            bounds_m: bounds.map(|b| [b.min.to_array(), b.max.to_array()]),
            triangles: scene.geometry.len(),
            materials: surfaces.materials.len(),
            textures: surfaces.textures.len(),
            lights: scene
                .lights
                .list()
                .iter()
                .map(|light| LightInfo::of(light, radius))
                .collect(),
            media: scene.media.list().iter().map(MediumInfo::of).collect(),
            mesh_mib: mib(mesh_bytes),
            texture_mib: mib(surfaces.textures.iter().map(|t| t.bytes()).sum()),
            search_tree_mib: mib(scene.geometry.bytes()),
            warnings: scene.warnings.iter().map(ToString::to_string).collect(),
        }
    }
}

impl CameraPathInfo {
    /// Describes `motion`.
    fn of(motion: &CameraMotion) -> Self {
        let (first, last) = motion.frames().into_inner();
        Self {
            frames: [first, last],
            length_m: motion.length(),
        }
    }
}

impl LightInfo {
    /// Describes `light` in a scene whose bounding sphere has `radius` metres.
    fn of(light: &Light, radius: Option<f32>) -> Self {
        let array = |v: Vec3| Some(v.to_array());
        let far = |info: Self| Self {
            power_w: radius.map(|r| light.power(r).to_array()),
            ..info
        };
        let kind = light.kind();
        match light {
            Light::Point(l) => Self {
                kind,
                position_m: array(l.position()),
                power_w: array(l.power()),
                intensity_w_sr: array(l.intensity()),
                ..Self::default()
            },
            Light::Spot(l) => Self {
                kind,
                position_m: array(l.position()),
                power_w: array(l.power()),
                intensity_w_sr: array(l.intensity()),
                ..Self::default()
            },
            Light::Triangle(l) => Self::of_surface(kind, l.flat()),
            Light::Quad(l) => Self::of_surface(kind, l.flat()),
            Light::Directional(l) => far(Self {
                kind,
                irradiance_w_m2: array(l.irradiance()),
                ..Self::default()
            }),
            Light::Sky(l) => far(Self {
                kind,
                radiance_w_m2_sr: array(l.radiance()),
                ..Self::default()
            }),
            Light::Environment(l) => {
                let mean = l.fluence() / (4.0 * std::f32::consts::PI);
                far(Self {
                    kind,
                    radiance_w_m2_sr: array(mean),
                    ..Self::default()
                })
            }
        }
    }

    fn of_surface(kind: &'static str, flat: &FlatEmitter) -> Self {
        let radiance = flat.emission().mean();
        Self {
            kind,
            position_m: Some(flat.center().to_array()),
            power_w: Some(flat.power().to_array()),
            intensity_w_sr: Some((radiance * flat.area()).to_array()),
            radiance_w_m2_sr: Some(radiance.to_array()),
            area_m2: Some(flat.area()),
            ..Self::default()
        }
    }
}

impl MediumInfo {
    fn of(medium: &Medium) -> Self {
        let densest = medium.density().max();
        let free_path =
            |sigma_t: f32| Some(1.0 / (sigma_t * densest)).filter(|path| path.is_finite());
        Self {
            name: medium.name().to_owned(),
            region: match medium.region() {
                Region::Everywhere => "Everywhere".to_owned(),
                Region::Box { min, max } => {
                    format!("Box(min: {}, max: {})", tuple(*min), tuple(*max))
                }
                Region::Sphere { center, radius } => {
                    format!("Sphere(center: {}, radius: {radius:?})", tuple(*center))
                }
            },
            density: match medium.density() {
                Density::Constant(density) => format!("Constant({density:?})"),
                Density::Height { base, scale_height } => {
                    format!("Height(base: {base:?}, scale_height: {scale_height:?})")
                }
                Density::Grid(grid) => format!("Grid(scale: {:?})", grid.scale()),
            },
            grid: match medium.density() {
                Density::Grid(grid) => Some(MediumGridInfo::of(grid)),
                Density::Constant(_) | Density::Height { .. } => None,
            },
            phase: written(medium.phase()),
            sigma_t_per_m: medium.sigma_t().to_array(),
            sigma_s_per_m: medium.sigma_s().to_array(),
            albedo: medium.albedo().to_array(),
            mean_free_path_m: medium.sigma_t().to_array().map(free_path),
            emission_w_m3_sr: medium.emission().to_array(),
        }
    }
}

/// A phase function as the scene file writes it; mixtures inside mixtures are taken apart.
fn written(phase: &PhaseFunction) -> String {
    match phase {
        PhaseFunction::Isotropic => "Isotropic".to_owned(),
        PhaseFunction::HenyeyGreenstein(lobe) => {
            format!("HenyeyGreenstein(g: {:?})", lobe.asymmetry().get())
        }
        PhaseFunction::Rayleigh => "Rayleigh".to_owned(),
        PhaseFunction::Mixture(mixture) => {
            let parts: Vec<_> = mixture
                .parts()
                .map(|(weight, phase)| format!("({weight:?}, {})", written(&phase)))
                .collect();
            format!("Mixture([{}])", parts.join(", "))
        }
    }
}

/// A vector as the scene file writes it.
fn tuple(v: Vec3) -> String {
    format!("({:?}, {:?}, {:?})", v.x, v.y, v.z)
}

/// What an image holds.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ImageInfo {
    /// Width and height in pixels.
    pub size: [usize; 2],
    /// Column and row of the frame at which it starts.
    pub origin: [usize; 2],
    /// Width and height of the frame of which it is a part.
    pub frame: [usize; 2],
    /// Its channels.
    pub channels: Vec<ChannelInfo>,
}

/// One channel of an image; smallest, largest and mean are of its finite values, null where it has none.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ChannelInfo {
    /// Its name in the file.
    pub name: String,
    /// Smallest value.
    pub min: Option<f32>,
    /// Mean value.
    pub mean: Option<f64>,
    /// Largest value.
    pub max: Option<f32>,
    /// Number of values that are NaN.
    pub nan: usize,
    /// Number of values that are infinite.
    pub inf: usize,
}

impl ImageInfo {
    /// Describes `image`.
    pub fn of(image: &Image) -> Self {
        Self {
            size: [image.width, image.height],
            origin: image.origin,
            frame: image.frame,
            channels: image
                .channels
                .iter()
                .map(|(name, values)| ChannelInfo::of(name, values))
                .collect(),
        }
    }
}

impl ChannelInfo {
    fn of(name: &str, values: &[f32]) -> Self {
        let finite = || values.iter().copied().filter(|v| v.is_finite());
        let n = finite().count();
        let sum: f64 = finite().map(f64::from).sum();
        Self {
            name: name.to_owned(),
            min: finite().reduce(f32::min),
            mean: (n > 0).then(|| sum / n as f64),
            max: finite().reduce(f32::max),
            nan: values.iter().filter(|v| v.is_nan()).count(),
            inf: values.iter().filter(|v| v.is_infinite()).count(),
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "tests")]
    use super::*;
    use std::path::Path;
    use tyndall_scene::{LoadOptions, load_str};

    #[test]
    fn a_scene_tells_its_lights_in_watts_and_its_media_in_metres() {
        let ron = "Scene(
            camera: LookAt(eye: (0.0, 0.0, 5.0), target: (0.0, 0.0, 0.0), vfov: 40.0),
            lights: [Point(position: (0.0, 1.0, 0.0), intensity: (1.0, 2.0, 3.0)), Sky(radiance: (0.5, 0.5, 0.5))],
            media: [Medium(region: Sphere(center: (0.0, 0.0, 0.0), radius: 2.0), density: Constant(2.0),
                sigma_t: (0.25, 0.0, 1.0), albedo: (0.5, 0.5, 0.5), phase: HenyeyGreenstein(g: 0.5))],
        )";
        let info = SceneInfo::of(&load_str(ron, Path::new("."), &LoadOptions::default()).unwrap());
        assert_eq!(info.film, [1024, 768]);
        assert!((info.vfov_degrees - 40.0).abs() < 1e-4);
        assert_eq!((info.triangles, info.textures), (0, 0));
        assert_eq!(info.camera_path, None);
        let [point, sky] = info.lights.as_slice() else {
            panic!("{:?}", info.lights)
        };
        assert_eq!(
            (point.kind, point.intensity_w_sr),
            ("point", Some([1.0, 2.0, 3.0]))
        );
        let power = point.power_w.unwrap();
        assert!(
            (power[1] / (8.0 * std::f32::consts::PI) - 1.0).abs() < 1e-6,
            "4π I: {power:?}"
        );
        assert_eq!((sky.kind, sky.radiance_w_m2_sr), ("sky", Some([0.5; 3])));
        let fog = &info.media[0];
        assert_eq!(fog.mean_free_path_m, [Some(2.0), None, Some(0.5)]);
        assert_eq!(
            (fog.phase.as_str(), fog.density.as_str()),
            ("HenyeyGreenstein(g: 0.5)", "Constant(2.0)")
        );
        assert_eq!(fog.region, "Sphere(center: (0.0, 0.0, 0.0), radius: 2.0)");
    }

    #[test]
    fn a_camera_path_tells_its_frames_and_its_length() {
        let ron = "Scene(camera: Path([
            Key(frame: 0, eye: (0, 1, 5), target: (0, 1, 0), vfov: 40),
            Key(frame: 47, eye: (6, 1, -3), target: (6, 1, -9), vfov: 40)]))";
        let info = SceneInfo::of(&load_str(ron, Path::new("."), &LoadOptions::default()).unwrap());
        let path = info.camera_path.unwrap();
        assert_eq!((info.eye, path.frames), ([0.0, 1.0, 5.0], [0, 47]));
        // 6 m across and 8 m ahead; rounding of 4096 differences of f32 positions.
        assert!((path.length_m - 10.0).abs() < 1e-3, "{}", path.length_m);
    }

    #[test]
    fn phase_functions_read_as_the_scene_file_writes_them() {
        for text in [
            "Isotropic",
            "HenyeyGreenstein(g: -0.4)",
            "Rayleigh",
            "Mixture([(0.7, HenyeyGreenstein(g: 0.8)), (0.2, Rayleigh), (0.1, Isotropic)])",
        ] {
            let ron = format!(
                "Scene(camera: LookAt(eye: (0, 0, 5), target: (0, 0, 0), vfov: 40),
                    media: [Medium(sigma_t: (1, 1, 1), albedo: (1, 1, 1), phase: {text})])"
            );
            let scene = load_str(&ron, Path::new("."), &LoadOptions::default()).unwrap();
            assert_eq!(SceneInfo::of(&scene).media[0].phase, text);
        }
    }

    #[test]
    fn a_channel_tells_its_range_and_what_is_not_finite() {
        let info = ChannelInfo::of("R", &[1.0, f32::NAN, 3.0, f32::INFINITY]);
        let expected = ChannelInfo {
            name: "R".to_owned(),
            min: Some(1.0),
            mean: Some(2.0),
            max: Some(3.0),
            nan: 1,
            inf: 1,
        };
        assert_eq!(info, expected);
        assert_eq!(ChannelInfo::of("G", &[]).mean, None);
    }
}
