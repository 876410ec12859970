//! Puts a scene together from what the scene file says and the glTF file holds.
//!
//! Whatever refers to another file, or can be judged only beside other things, is checked here; errors name the field.

use crate::camera::Camera;
use crate::digest;
use crate::error::{SceneError, Warning};
use crate::film::FilmSize;
use crate::gltf::{self, AnimatedCamera, GltfCamera, GltfScene, PunctualLight};
use crate::grids::GridFiles;
use crate::lights::{EnvironmentLight, Light, LightSet, SkyLight, read_environment};
use crate::load::{Fog, LoadOptions};
use crate::motion::CameraMotion;
use crate::numbered::{has_place, numbered};
use crate::paths::{Folder, PathError};
use crate::scene::{RenderSettings, Scene};
use crate::scene_file::{self, Place, SceneFile, numbers};
use crate::triangles::{Surfaces, Triangles};
use glam::Vec3;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use tyndall_math::{Aabb, Ray};
use tyndall_media::{Density, Media, Medium, MediumParams, PhaseFunction, Region};

/// A scene being put together.
pub(crate) struct Assembly<'a> {
    /// The scene file's text, empty for a bare glTF file.
    pub(crate) text: &'a str,
    /// The scene file, or the bare glTF file.
    pub(crate) path: &'a Path,
    pub(crate) options: &'a LoadOptions,
    /// What there was to warn of so far.
    pub(crate) warnings: Vec<Warning>,
    /// The files read so far.
    pub(crate) files: Vec<PathBuf>,
    /// Whether other frames have other volume files.
    pub(crate) is_sequence: bool,
}

impl Assembly<'_> {
    /// The scene that `file` and `gltf` make.
    pub(crate) fn assemble(
        mut self,
        file: &SceneFile,
        gltf: GltfScene,
    ) -> Result<Scene, SceneError> {
        self.warnings.extend(gltf.warnings);
        self.files.extend(gltf.files);
        let film = self.film(file)?;
        let mut media = self.media(file)?;
        let lights = self.lights(file, &gltf.lights)?;
        let surfaces = Arc::new(Surfaces {
            mesh: gltf.mesh,
            materials: gltf.materials,
            textures: gltf.textures,
        });
        let (lights, light_of_triangle) = LightSet::new(lights, &surfaces);
        let geometry = Triangles::new(surfaces, light_of_triangle);
        let bounded = media.iter().filter_map(Medium::bounds);
        let mut bounds = bounded.fold(geometry.bounds(), Aabb::union);
        if let Some(fog) = &self.options.fog {
            let fog = self.fog_in(&bounds, fog)?;
            bounds = bounds.union(fog.region().bounds().unwrap_or(Aabb::EMPTY));
            media.push(fog);
        }
        let media = Media::new(media);
        let (camera, motion) = self.camera(file, &gltf.cameras, &bounds, film)?;
        self.warn_of_darkness(&lights, &media, camera.eye());
        Ok(Scene {
            camera,
            motion,
            film,
            settings: RenderSettings {
                error: file.render.error.get(),
                max_depth: file.render.max_depth.map(numbers::Depth::get),
                exposure: file.render.exposure.get(),
            },
            geometry,
            lights,
            media,
            bounds,
            definition: digest::definition(file, self.options),
            is_sequence: self.is_sequence,
            own_files: usize::from(!self.text.is_empty()),
            warnings: self.warnings,
            files: self.files,
        })
    }

    fn film(&self, file: &SceneFile) -> Result<FilmSize, SceneError> {
        let FilmSize { width, height } = file.film.size;
        let width = self.options.width.unwrap_or(width);
        let height = self.options.height.unwrap_or(height);
        FilmSize::new(width, height).map_err(|error| self.wrong(error))
    }

    /// The glTF that the scene file names, or nothing where it names none.
    pub(crate) fn read_gltf(&mut self, file: &SceneFile) -> Result<GltfScene, SceneError> {
        let Some(name) = &file.gltf else {
            return Ok(GltfScene::default());
        };
        let (path, root) = self.locate(name, "gltf")?;
        gltf::read(
            &path,
            &gltf::ReadOptions {
                allow_external: self.options.allow_external,
                root: Some(root),
                scene: file.gltf_scene.clone(),
                animated: match &file.camera {
                    None => AnimatedCamera::First,
                    Some(scene_file::Camera::Gltf(name)) => AnimatedCamera::Named(name.clone()),
                    Some(scene_file::Camera::LookAt(_) | scene_file::Camera::Path(_)) => {
                        AnimatedCamera::None
                    }
                },
            },
        )
    }

    /// The file that a field names, and the folder that it and what it names may not leave.
    fn locate(&self, name: &str, field: &str) -> Result<(PathBuf, PathBuf), SceneError> {
        let folder = Folder::of(self.path, self.options.allow_external).map_err(|source| {
            SceneError::Read {
                what: "scene's folder",
                source,
                path: self.path.into(),
            }
        })?;
        let path = folder
            .locate(name)
            .map_err(|error: PathError| self.wrong_field(field, error))?;
        Ok((path, folder.root().into()))
    }

    fn lights(
        &mut self,
        file: &SceneFile,
        of_gltf: &[PunctualLight],
    ) -> Result<Vec<Light>, SceneError> {
        let mut lights = Vec::new();
        for (i, light) in file.lights.iter().enumerate() {
            let light = self.light(light, &format!("lights[{i}]"))?;
            self.add_light(&mut lights, light, || format!("lights[{i}]"));
        }
        for (i, light) in of_gltf.iter().enumerate() {
            self.add_light(&mut lights, Light::from(light), || {
                format!("number {} of the glTF file", i + 1)
            });
        }
        Ok(lights)
    }

    fn add_light(&mut self, lights: &mut Vec<Light>, light: Light, name: impl FnOnce() -> String) {
        if light.is_dark() {
            let light = format!("the {} light {}", light.kind(), name());
            self.warnings.push(Warning::DarkLight { light });
        } else {
            lights.push(light);
        }
    }

    fn light(
        &mut self,
        light: &scene_file::lights::Light,
        field: &str,
    ) -> Result<Light, SceneError> {
        use scene_file::lights::Light as Written;
        match light {
            Written::Sky(sky) => Ok(Light::Sky(SkyLight::new(sky.radiance.0))),
            Written::Environment(environment) => {
                let field = format!("{field}.file");
                let (file, _) = self.locate(&environment.file, &field)?;
                let (image, count) =
                    read_environment(&file).map_err(|error| self.wrong_field(&field, error))?;
                self.files.push(file.clone());
                if count > 0 {
                    self.warnings.push(Warning::NegativeTexels { file, count });
                }
                let rotation = environment.rotation.get().to_radians();
                let scale = environment.scale.get();
                Ok(Light::Environment(EnvironmentLight::new(
                    image, scale, rotation,
                )))
            }
            Written::Point(point) => Ok(Light::from(&point.placed())),
            Written::Spot(spot) => Ok(Light::from(&spot.placed())),
            Written::Directional(directional) => Ok(Light::from(&directional.placed())),
        }
    }

    fn media(&mut self, file: &SceneFile) -> Result<Vec<Medium>, SceneError> {
        let mut grids = GridFiles::default();
        let media = file.media.iter().enumerate();
        media
            .map(|(i, medium)| self.medium(i, medium, &mut grids))
            .collect()
    }

    /// The density that the grid at `field` makes.
    fn grid(
        &mut self,
        grid: &scene_file::media::Grid,
        field: &str,
        grids: &mut GridFiles,
    ) -> Result<Density, SceneError> {
        let name = Path::new(&grid.file);
        self.is_sequence |= has_place(name);
        let name = numbered(name, self.options.frame.unwrap_or(0));
        let (file, _) = self.locate(&name.to_string_lossy(), &format!("{field}.file"))?;
        let limit = self.options.max_grid_bytes;
        let (grid, warning) = grids
            .grid(grid, &file, limit)
            .map_err(|error| self.wrong_field(field, error))?;
        if !self.files.contains(&file) {
            self.files.push(file);
        }
        self.warnings.extend(warning);
        Ok(Density::Grid(Arc::new(grid)))
    }

    fn medium(
        &mut self,
        index: usize,
        medium: &scene_file::media::Medium,
        grids: &mut GridFiles,
    ) -> Result<Medium, SceneError> {
        let field = format!("media[{index}]");
        let density = medium
            .density
            .placed(|grid| self.grid(grid, &format!("{field}.density"), grids))?;
        let name = medium
            .name
            .clone()
            .unwrap_or(format!("medium{}", index + 1));
        let params = MediumParams {
            name,
            region: medium.region.placed(),
            density,
            sigma_t: medium.sigma_t.0,
            albedo: medium.albedo.0,
            phase: medium
                .phase
                .placed()
                .map_err(|error| self.wrong_field(&format!("{field}.phase"), error))?,
            emission: medium.emission.0,
        };
        let medium = Medium::new(params).map_err(|error| self.wrong_field(&field, error))?;
        if medium.bounds().is_some_and(|bounds| bounds.is_empty()) && !medium.is_vacuum() {
            self.warnings.push(Warning::GridOutsideRegion {
                medium: medium.name().into(),
            });
        }
        Ok(medium)
    }

    /// Homogeneous fog in `bounds` grown by 1 %.
    fn fog_in(&self, bounds: &Aabb, fog: &Fog) -> Result<Medium, SceneError> {
        if bounds.is_empty() {
            return Err(self.wrong(
                "--fog fills the scene's bounding box, and this scene has neither surfaces nor bounded media; \
                 put a Medium with a region into a .ron scene file instead",
            ));
        }
        // Half of 1 % on either side; a flat side grows by that much of the diagonal, for fog needs a volume.
        let size = bounds.max - bounds.min;
        let flat = Vec3::splat(bounds.diagonal().max(f32::MIN_POSITIVE));
        let margin = 0.005 * Vec3::select(size.cmpgt(Vec3::ZERO), size, flat);
        let phase = PhaseFunction::henyey_greenstein(fog.g)
            .map_err(|error| self.wrong(format!("--fog: {error}")))?;
        Medium::new(MediumParams {
            name: "fog".into(),
            region: Region::Box {
                min: bounds.min - margin,
                max: bounds.max + margin,
            },
            phase: if fog.g == 0.0 {
                PhaseFunction::Isotropic
            } else {
                phase
            },
            ..MediumParams::new(Vec3::splat(fog.sigma_t), Vec3::splat(fog.albedo))
        })
        .map_err(|error| self.wrong(format!("--fog: {error}")))
    }

    /// The camera at frame 0, and how it moves if it does.
    fn camera(
        &self,
        file: &SceneFile,
        of_gltf: &[GltfCamera],
        bounds: &Aabb,
        film: FilmSize,
    ) -> Result<(Camera, Option<CameraMotion>), SceneError> {
        let chosen = match &file.camera {
            Some(scene_file::Camera::LookAt(look_at)) => return Ok((look_at.0, None)),
            Some(scene_file::Camera::Path(path)) => {
                return self.moving(CameraMotion::Path(path.0.clone()));
            }
            Some(scene_file::Camera::Gltf(name)) => Some(
                of_gltf
                    .iter()
                    .find(|camera| camera.is_called(name))
                    .ok_or_else(|| self.wrong_field("camera", no_such_camera(name, of_gltf)))?,
            ),
            None => of_gltf.first(),
        };
        if let Some(camera) = chosen
            && let Some(animation) = &camera.animation
        {
            return self.moving(CameraMotion::Animation {
                animation: animation.clone(),
                yfov: camera.yfov,
                fps: file.film.fps.get(),
            });
        }
        let still = match chosen {
            Some(camera) => Camera::placed(&camera.world_from_camera, camera.yfov)
                .map_err(|error| self.wrong(error)),
            None => {
                let aspect = film.width as f32 / film.height as f32;
                Camera::framing(bounds, aspect).ok_or_else(|| SceneError::NoCamera {
                    path: self.path.into(),
                })
            }
        }?;
        Ok((still, None))
    }

    /// A moving camera and its view at frame 0.
    fn moving(&self, motion: CameraMotion) -> Result<(Camera, Option<CameraMotion>), SceneError> {
        let start = motion.at(0.0);
        let camera = start.map_err(|error| self.wrong(error))?;
        Ok((camera, Some(motion)))
    }

    /// Warns of lights that cannot reach the scene and of scenes that nothing lights.
    fn warn_of_darkness(&mut self, lights: &LightSet, media: &Media, eye: Vec3) {
        for light in lights.list() {
            // Above all fog the way is straight up; parallel light has but one way.
            let towards = match light {
                Light::Directional(directional) => -directional.direction(),
                Light::Sky(_) | Light::Environment(_) => Vec3::Y,
                _ => continue,
            };
            let depth = media.optical_depth(&Ray::new(eye, towards), f32::INFINITY);
            let unbounded = media.list().iter().find(|medium| {
                matches!(medium.region(), Region::Everywhere) && !medium.is_vacuum()
            });
            if let Some(medium) = unbounded
                && depth.min_element() == f32::INFINITY
            {
                self.warnings.push(Warning::NothingArrives {
                    light: format!("the {} light", light.kind()),
                    medium: medium.name().into(),
                });
            }
        }
        if lights.list().is_empty() && !media.emits() {
            self.warnings.push(Warning::NoLights);
        }
    }

    fn place_of(&self, field: &str) -> Place {
        let (line, column) = scene_file::place_of(self.text, field);
        Place {
            path: self.path.into(),
            line,
            column,
        }
    }

    fn wrong_field(&self, field: &str, problem: impl ToString) -> SceneError {
        SceneError::Field {
            problem: problem.to_string(),
            field: field.into(),
            place: self.place_of(field),
        }
    }

    fn wrong(&self, problem: impl ToString) -> SceneError {
        SceneError::Whole {
            problem: problem.to_string(),
            path: self.path.into(),
        }
    }
}

/// Says which cameras there are instead of `name`.
fn no_such_camera(name: &str, cameras: &[GltfCamera]) -> String {
    let names: Vec<_> = cameras
        .iter()
        .filter_map(|camera| camera.node.as_ref().or(camera.name.as_ref()))
        .map(|name| format!("\"{name}\""))
        .collect();
    if cameras.is_empty() {
        format!(
            "there is no camera \"{name}\": the scene has no glTF file with cameras; use LookAt(…)"
        )
    } else {
        format!(
            "the glTF file has no camera \"{name}\"; its cameras are {}",
            names.join(", ")
        )
    }
}
