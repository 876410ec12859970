//! A walk through the hall of `assets/`: all frames share one filling of the cache, and become one animated PNG.
//!
//! `cargo run --release -p tyndall-render --example walk_through -- docs/walk_through.png 192 24` makes the documentation's; without arguments
//! it is small and quick.

#![allow(clippy::print_stdout, reason = "an example shows what it does")]

use png::{BitDepth, ColorType, Encoder, SrgbRenderingIntent};
use std::fs::File;
use std::io::BufWriter;
use std::path::PathBuf;
use tyndall_render::Renderer;
use tyndall_render::options::RenderOptions;
use tyndall_scene::{LoadOptions, load_str};

/// Frames per second of the animation.
const FPS: u16 = 12;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let assets = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../assets/hall"));
    let mut arguments = std::env::args().skip(1);
    let default = std::env::temp_dir().join("tyndall_walk_through.png");
    let out = arguments.next().map_or(default, PathBuf::from);
    let width: u32 = arguments.next().map_or(Ok(32), |text| text.parse())?;
    let frames: u32 = arguments.next().map_or(Ok(4), |text| text.parse())?;

    // The scene as it is shipped, seen by a camera that walks down its side.
    let still = std::fs::read_to_string(assets.join("hall.ron"))?;
    let view = "LookAt(eye: (-1.3, 1.7, 9.4), target: (1.1, 2.5, 0.0), vfov: 60.0)";
    let last = frames.max(2) - 1;
    let walk = format!(
        "Path([
            Key(frame: 0, eye: (-1.3, 1.7, 9.4), target: (1.1, 2.5, 0.0), vfov: 60),
            Key(frame: {}, eye: (-0.6, 1.7, 5.0), target: (2.5, 2.4, -1.0), vfov: 60),
            Key(frame: {last}, eye: (1.2, 1.8, 1.0), target: (-1.5, 2.2, -8.0), vfov: 60),
        ])",
        0.5 * last as f32
    );
    let scene = load_str(
        &still.replace(view, &walk),
        &assets,
        &LoadOptions::default(),
    )?;
    let options = RenderOptions {
        width: Some(width),
        error: Some(0.1),
        ..RenderOptions::default()
    };

    let cameras = (0..frames)
        .map(|frame| scene.camera_at(frame as f32))
        .collect::<Result<Vec<_>, _>>()?;
    let mut renderer = Renderer::new(&scene, &options, &())?;
    renderer.fill(&cameras);

    let [width, height] = options.frame([scene.film.width, scene.film.height]);
    let mut encoder = Encoder::new(BufWriter::new(File::create(&out)?), width, height);
    encoder.set_color(ColorType::Rgb);
    encoder.set_depth(BitDepth::Eight);
    encoder.set_source_srgb(SrgbRenderingIntent::RelativeColorimetric);
    encoder.set_animated(frames, 0)?;
    encoder.set_frame_delay(1, FPS)?;
    let mut writer = encoder.write_header()?;
    for (number, camera) in (0..).zip(&cameras) {
        let outcome = renderer.render(camera, number)?;
        let picture = outcome.image.srgb(scene.settings.exposure);
        writer.write_image_data(&picture.ok_or("an image has colours")?)?;
        println!(
            "frame {number}: filled in {:.1} s, rendered in {:.1} s",
            outcome.stats.fill_s, outcome.stats.render_s
        );
    }
    writer.finish()?;
    println!("wrote {}", out.display());
    Ok(())
}
