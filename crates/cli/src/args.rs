//! The command line as clap reads it. What it means is said in the help texts here, and nowhere else.

use crate::value;
use clap::builder::PossibleValue;
use clap::{Args, Parser, Subcommand, ValueEnum};
use std::ops::Range;
use std::path::PathBuf;
use std::time::Duration;
use tyndall_render::layers::LayerSet;
use tyndall_render::options::{Crop, Depth, Integrator, Method, MultipleFrom, SingleFrom};
use tyndall_render::probe::Derivatives;
use tyndall_scene::Fog;

/// Clean images of fog, smoke and haze by volumetric radiance caching.
#[derive(Debug, Parser)]
#[command(name = "tyndall", version)]
pub(crate) struct Cli {
    #[command(subcommand)]
    pub(crate) command: Command,
}

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Make an image of a scene.
    Render(Box<RenderArgs>),
    /// Measure scattered light at one point of a scene.
    Probe(ProbeArgs),
    /// Tell how far an image is from a reference.
    Compare(CompareArgs),
    /// Tell what a scene, a volume file, an image or a cache file holds.
    Info(InfoArgs),
    /// Run the built-in exact benchmarks on this machine.
    Verify(VerifyArgs),
}

#[derive(Args, Debug)]
pub(crate) struct RenderArgs {
    /// Scene file (.ron), or a glTF file (.glb, .gltf) together with --fog.
    pub(crate) scene: PathBuf,
    /// Image to write: .exr (float, linear, all layers) or .png (exposed, sRGB); may be given several times. With --frames, #### stands
    /// for the frame's number.
    /// Without it, an EXR file named after the scene is written to the current folder.
    #[arg(short, long, value_name = "OUT")]
    pub(crate) output: Vec<PathBuf>,
    /// How light is computed.
    #[arg(long, value_enum, default_value_t)]
    pub(crate) integrator: IntegratorArg,
    /// Where multiple scattering comes from: records, the coarse field that they end in, or whichever does.
    #[arg(long, value_enum, default_value_t)]
    pub(crate) multiple: MultipleArg,
    /// Where single scattering of light from skies comes from: samples, records, or whichever is cheaper.
    #[arg(long, value_enum, default_value_t)]
    pub(crate) single: SingleArg,
    /// What kind of records radiance caching uses; tyndall where not given.
    #[arg(long, value_enum)]
    pub(crate) method: Option<MethodArg>,
    /// Target error of the image, such as 0.03; samples per pixel and cache tolerance follow from it.
    #[arg(long, value_name = "E", value_parser = value::finite, allow_negative_numbers = true)]
    pub(crate) error: Option<f32>,
    /// Fix the samples per pixel instead.
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    pub(crate) spp: Option<u32>,
    /// Width of the frame in pixels; alone, it keeps the scene's proportions.
    #[arg(long, value_name = "W", allow_negative_numbers = true)]
    pub(crate) width: Option<u32>,
    /// Height of the frame in pixels; alone, it keeps the scene's proportions.
    #[arg(long, value_name = "H", allow_negative_numbers = true)]
    pub(crate) height: Option<u32>,
    /// Render only this part of the frame, in pixels from its upper left corner.
    #[arg(long, value_name = "X,Y,W,H", value_parser = value::crop, allow_hyphen_values = true)]
    pub(crate) crop: Option<Crop>,
    /// Most scattering events between light and eye, or none for no limit.
    #[arg(long, value_name = "N|none", value_parser = value::depth, allow_hyphen_values = true)]
    pub(crate) max_depth: Option<Depth>,
    /// Chooses the random numbers; equal seeds give equal images.
    #[arg(
        long,
        value_name = "N",
        default_value_t = 0,
        allow_negative_numbers = true
    )]
    pub(crate) seed: u64,
    /// Number of threads; the image does not depend on it.
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    pub(crate) threads: Option<usize>,
    /// Stop after so many seconds with the best image so far.
    #[arg(long, value_name = "S", value_parser = value::seconds, allow_hyphen_values = true)]
    pub(crate) time_limit: Option<Duration>,
    #[command(flatten)]
    pub(crate) source: SourceArgs,
    /// Layers to write: beauty, surface, single, multiple, emission, transmittance, depth, records, radius, lookups, samples.
    #[arg(long, value_name = "LIST", value_parser = value::layers)]
    pub(crate) layers: Option<LayerSet>,
    /// Render these frames of a moving camera, as in 0..48 (without the last) or 0..=47; one filling serves them all.
    #[arg(long, value_name = "A..B", value_parser = value::frames, allow_hyphen_values = true)]
    pub(crate) frames: Option<Range<u32>>,
    /// Start from the records kept in this file.
    #[arg(long, value_name = "F")]
    pub(crate) cache_in: Option<PathBuf>,
    /// Keep the records in this file.
    #[arg(long, value_name = "F")]
    pub(crate) cache_out: Option<PathBuf>,
    /// Go on from the checkpoint that an interrupted render of the same image left beside it, if there is one: the pixels are those of a
    /// render without a break.
    #[arg(long, conflicts_with = "fill_only")]
    pub(crate) resume: bool,
    /// Seconds between checkpoints; they are kept as OUT.checkpoint until the images are finished.
    #[arg(long, value_name = "S", default_value = "60", value_parser = value::seconds, allow_hyphen_values = true)]
    pub(crate) checkpoint_interval: Duration,
    /// Compute and keep the records, and make no image.
    #[arg(long, requires = "cache_out", conflicts_with_all = ["output", "stats"])]
    pub(crate) fill_only: bool,
    /// Write times, counts and the estimated error as JSON.
    #[arg(long, value_name = "F.json")]
    pub(crate) stats: Option<PathBuf>,
    /// Say nothing but warnings and errors.
    #[arg(long)]
    pub(crate) quiet: bool,
}

/// How a scene is read.
#[derive(Args, Debug)]
pub(crate) struct SourceArgs {
    /// Add fog in the scene's bounding box grown by 1 %: extinction per metre, albedo (0.95), asymmetry (0).
    #[arg(long, value_name = "SIGMA_T[,ALBEDO[,G]]", value_parser = value::fog, allow_hyphen_values = true)]
    pub(crate) fog: Option<Fog>,
    /// Let scene files name files outside their folder.
    #[arg(long)]
    pub(crate) allow_external: bool,
    /// Most memory that one density grid may take, in GiB; 8 where not given.
    #[arg(long, value_name = "GIB", value_parser = value::gibibytes, allow_negative_numbers = true)]
    pub(crate) max_grid_memory: Option<u64>,
}

#[derive(Args, Debug)]
pub(crate) struct ProbeArgs {
    /// Scene file (.ron), or a glTF file (.glb, .gltf) together with --fog.
    pub(crate) scene: PathBuf,
    /// The point, in metres.
    #[arg(long, value_name = "X,Y,Z", value_parser = value::vector, allow_hyphen_values = true)]
    pub(crate) at: [f32; 3],
    /// The direction in which the scattered light leaves, towards the eye.
    #[arg(long, value_name = "X,Y,Z", value_parser = value::vector, allow_hyphen_values = true)]
    pub(crate) dir: Option<[f32; 3]>,
    /// Number of gather directions, or of paths with --integrator path.
    #[arg(
        long,
        value_name = "N",
        default_value_t = 4096,
        allow_negative_numbers = true
    )]
    pub(crate) samples: u32,
    /// How light is computed.
    #[arg(long, value_enum, default_value_t)]
    pub(crate) integrator: IntegratorArg,
    /// Whether gradients know of moving silhouettes; those of --integrator path always do.
    #[arg(long, value_enum, default_value_t)]
    pub(crate) derivatives: DerivativesArg,
    #[command(flatten)]
    pub(crate) source: SourceArgs,
    /// Print JSON.
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Args, Debug)]
pub(crate) struct CompareArgs {
    /// The image to judge.
    pub(crate) a: PathBuf,
    /// The reference.
    pub(crate) b: PathBuf,
    /// An independent second half of a noisy reference.
    pub(crate) b2: Option<PathBuf>,
    /// Stops by which both images are brightened before FLIP.
    #[arg(long, value_name = "E", default_value_t = 0.0, value_parser = value::stops, allow_negative_numbers = true)]
    pub(crate) exposure: f32,
    /// The layer to compare.
    #[arg(long, value_name = "NAME", default_value = "beauty")]
    pub(crate) layer: String,
    /// Print JSON.
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Args, Debug)]
pub(crate) struct InfoArgs {
    /// Scene (.ron, .glb, .gltf), volume (.vdb, .vol), image (.exr, .png, .hdr, .jpg) or cache file.
    pub(crate) file: PathBuf,
    #[command(flatten)]
    pub(crate) source: SourceArgs,
    /// Print JSON.
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Args, Debug)]
pub(crate) struct VerifyArgs {
    /// Take about 20 seconds instead of two minutes.
    #[arg(long)]
    pub(crate) quick: bool,
    /// Print JSON.
    #[arg(long)]
    pub(crate) json: bool,
}

/// An [`Integrator`] on the command line.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct IntegratorArg(pub(crate) Integrator);

impl ValueEnum for IntegratorArg {
    fn value_variants<'a>() -> &'a [Self] {
        const ALL: [IntegratorArg; Integrator::ALL.len()] = {
            let mut all = [IntegratorArg(Integrator::Cache); Integrator::ALL.len()];
            let mut i = 0;
            while i < all.len() {
                all[i] = IntegratorArg(Integrator::ALL[i]);
                i += 1;
            }
            all
        };
        &ALL
    }

    fn to_possible_value(&self) -> Option<PossibleValue> {
        Some(PossibleValue::new(self.0.name()).help(self.0.about()))
    }
}

/// [`Method`] on the command line.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum MethodArg {
    /// this project's
    Tyndall,
    /// as published in 2008: all scattered light from records, made from whole paths; for comparisons, in isotropic media
    Jarosz08,
}

impl From<MethodArg> for Method {
    fn from(arg: MethodArg) -> Self {
        match arg {
            MethodArg::Tyndall => Method::Tyndall,
            MethodArg::Jarosz08 => Method::Jarosz08,
        }
    }
}

/// [`Derivatives`] on the command line.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(crate) enum DerivativesArg {
    /// what hides behind an edge appears and vanishes when the point moves
    #[default]
    Aware,
    /// visibility is taken as constant, as in the papers of 2008
    Blind,
}

impl From<DerivativesArg> for Derivatives {
    fn from(arg: DerivativesArg) -> Self {
        match arg {
            DerivativesArg::Aware => Derivatives::Aware,
            DerivativesArg::Blind => Derivatives::Blind,
        }
    }
}

/// [`MultipleFrom`] on the command line.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(crate) enum MultipleArg {
    /// the coarse field where it is good enough, else records
    #[default]
    Auto,
    /// interpolated records
    Records,
    /// the coarse field, however good it is
    Field,
}

impl From<MultipleArg> for MultipleFrom {
    fn from(arg: MultipleArg) -> Self {
        match arg {
            MultipleArg::Auto => MultipleFrom::Auto,
            MultipleArg::Records => MultipleFrom::Records,
            MultipleArg::Field => MultipleFrom::Field,
        }
    }
}

/// [`SingleFrom`] on the command line.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(crate) enum SingleArg {
    /// records for light from skies where there is enough of it, samples for all other light
    #[default]
    Auto,
    /// samples of the lights
    Direct,
    /// records for light from skies, samples for all other light
    Cache,
}

impl From<SingleArg> for SingleFrom {
    fn from(arg: SingleArg) -> Self {
        match arg {
            SingleArg::Auto => SingleFrom::Auto,
            SingleArg::Direct => SingleFrom::Direct,
            SingleArg::Cache => SingleFrom::Cache,
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "tests")]
    use super::*;
    use clap::CommandFactory;
    use tyndall_render::layers::LAYERS;

    fn parse(line: &str) -> Result<Command, clap::Error> {
        Cli::try_parse_from(line.split_whitespace()).map(|cli| cli.command)
    }

    fn render(options: &str) -> RenderArgs {
        match parse(&format!("tyndall render scene.ron {options}")).unwrap() {
            Command::Render(args) => *args,
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn the_definition_is_consistent() {
        Cli::command().debug_assert();
    }

    #[test]
    fn every_option_of_the_contract_is_read() {
        let args = render(
            "-o a.exr -o b.png --integrator path --error 0.05 --spp 64 --width 320 --height 240 --crop 0,8,16,16 --max-depth 3 \
             --seed 18446744073709551615 --threads 2 --time-limit 1.5 --fog 0.1,0.9,-0.5 --layers beauty,depth --cache-in i \
             --cache-out o --stats s.json --quiet --allow-external",
        );
        assert_eq!(
            args.output,
            [PathBuf::from("a.exr"), PathBuf::from("b.png")]
        );
        assert_eq!(args.integrator.0, Integrator::Path);
        assert_eq!((args.error, args.spp), (Some(0.05), Some(64)));
        assert_eq!((args.width, args.height), (Some(320), Some(240)));
        assert_eq!(
            args.crop,
            Some(Crop {
                x: 0,
                y: 8,
                width: 16,
                height: 16
            })
        );
        assert_eq!(
            (args.max_depth, args.seed),
            (Some(Depth::Limit(3)), u64::MAX)
        );
        assert_eq!(
            (args.threads, args.time_limit),
            (Some(2), Some(Duration::from_millis(1500)))
        );
        assert_eq!(
            args.source.fog,
            Some(Fog {
                sigma_t: 0.1,
                albedo: 0.9,
                g: -0.5
            })
        );
        assert!(args.layers.unwrap().contains("depth"));
        assert_eq!(
            (args.cache_in, args.cache_out),
            (Some("i".into()), Some("o".into()))
        );
        assert_eq!(args.stats, Some("s.json".into()));
        assert!(args.quiet && args.source.allow_external);
    }

    #[test]
    fn the_defaults_are_those_of_the_contract() {
        let args = render("");
        assert_eq!(args.integrator.0, Integrator::Cache);
        assert!(args.output.is_empty() && args.source.fog.is_none() && args.layers.is_none());
        assert_eq!(
            (args.max_depth, render("--max-depth none").max_depth),
            (None, Some(Depth::Unlimited))
        );
        assert!(
            matches!(parse("tyndall probe s.ron --at -1,0,2").unwrap(), Command::Probe(a) if a.at[0] == -1.0 && a.samples == 4096)
        );
    }

    #[test]
    fn the_other_commands_are_read() {
        assert!(
            matches!(parse("tyndall compare a.exr b.exr b2.exr --exposure -1.5 --json").unwrap(), Command::Compare(a)
            if a.b2.is_some() && a.exposure == -1.5 && a.json && a.layer == "beauty")
        );
        assert!(
            matches!(parse("tyndall info scene.glb --json").unwrap(), Command::Info(a) if a.json)
        );
        assert!(
            matches!(parse("tyndall verify --quick --json").unwrap(), Command::Verify(a) if a.quick && a.json)
        );
        assert!(
            matches!(parse("tyndall probe s.ron --at 0,1,0 --dir 0,0,-1 --samples 64 --integrator path --json").unwrap(),
            Command::Probe(a) if a.dir == Some([0.0, 0.0, -1.0]) && a.integrator.0 == Integrator::Path)
        );
    }

    #[test]
    fn mistakes_name_the_option_and_end_with_status_2() {
        let lines = [
            ("render s.ron --crop 1,2,3", "--crop <X,Y,W,H>"),
            ("render s.ron --crop -1,0,2,2", "--crop <X,Y,W,H>"),
            (
                "render s.ron --integrator bdpt",
                "[possible values: cache, path]",
            ),
            (
                "render s.ron --method ward88",
                "[possible values: tyndall, jarosz08]",
            ),
            ("render s.ron --max-depth -1", "--max-depth <N|none>"),
            ("render s.ron --layers beauty,albedo", "`albedo`"),
            ("render s.ron --fog 0.1,2", "albedo must be from 0 to 1"),
            ("render s.ron --time-limit -3", "--time-limit <S>"),
            ("render s.ron --spp -1", "--spp <N>"),
            ("render s.ron --seed -1", "--seed <N>"),
            ("render", "<SCENE>"),
            ("compare a.exr", "<B>"),
            ("probe s.ron --at 1,2", "--at <X,Y,Z>"),
            ("melt s.ron", "melt"),
        ];
        for (line, expected) in lines {
            let error = parse(&format!("tyndall {line}")).unwrap_err();
            let text = error.to_string();
            assert!(text.contains(expected), "{line}: {text}");
            assert_eq!(error.exit_code(), 2, "{line}");
        }
    }

    #[test]
    fn the_help_names_every_layer() {
        let mut command = Cli::command();
        let help = command
            .find_subcommand_mut("render")
            .unwrap()
            .render_long_help()
            .to_string();
        assert!(
            LAYERS.iter().all(|layer| help.contains(layer.name)),
            "{help}"
        );
    }
}
