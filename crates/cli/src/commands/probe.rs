//! `tyndall probe`: scattered light at one point of a scene.

use crate::args::ProbeArgs;
use crate::error::CliError;
use crate::output;
use std::fmt::LowerExp;
use tyndall_render::probe::{Part, Probe, ProbeOptions, probe};

pub(super) fn run(args: &ProbeArgs) -> Result<(), CliError> {
    let options = ProbeOptions {
        at: args.at.into(),
        towards: args.dir.map(Into::into),
        samples: args.samples,
        integrator: args.integrator.0,
        derivatives: args.derivatives.into(),
        seed: 0,
    };
    let scene = tyndall_scene::load(&args.scene, &args.source.load_options())?;
    output::warn(&scene.warnings);
    let found = probe(&scene, &options)?;
    if args.json {
        output::print_json(&found)
    } else {
        output::print(&text(&found))
    }
}

fn text(found: &Probe) -> String {
    let mut lines = Vec::new();
    for (name, part) in [("single", &found.single), ("multiple", &found.multiple)] {
        lines.extend(part_lines(name, part));
    }
    lines.push(format!("σt       {} /m", triple(found.sigma_t)));
    lines.push(format!("σs       {} /m", triple(found.sigma_s)));
    lines.join("\n")
}

fn part_lines(name: &str, part: &Part) -> Vec<String> {
    let mut lines = vec![format!(
        "{name:<8} {} ± {} W/(m² sr)",
        triple(part.value),
        triple(part.stderr)
    )];
    let channels = ["red", "green", "blue"];
    for (c, channel) in channels.iter().enumerate() {
        lines.push(format!(
            "  gradient of {channel:<6} {} ± {} /m",
            triple(part.gradient[c]),
            triple(part.gradient_stderr[c])
        ));
    }
    let hessians = part.hessian.iter().flatten();
    let errors = part.hessian_stderr.iter().flatten();
    for (channel, (hessian, error)) in channels.iter().zip(hessians.zip(errors)) {
        let [hessian, error] = [hessian, error].map(|rows| rows.map(triple).join(" "));
        lines.push(format!("  Hessian of {channel:<7} {hessian} ± {error} /m²"));
    }
    lines
}

fn triple<T: LowerExp>(v: [T; 3]) -> String {
    format!("({:.5e}, {:.5e}, {:.5e})", v[0], v[1], v[2])
}
