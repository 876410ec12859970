//! `tyndall compare`: how far an image is from a reference.

use crate::args::CompareArgs;
use crate::error::CliError;
use crate::output;
use tyndall_render::compare::{Comparison, compare};
use tyndall_render::image_file::read_image;

pub(super) fn run(args: &CompareArgs) -> Result<(), CliError> {
    let a = read_image(&args.a)?;
    let b = read_image(&args.b)?;
    let b2 = args.b2.as_deref().map(read_image).transpose()?;
    let comparison = compare(&a, &b, b2.as_ref(), &args.layer, args.exposure)?;
    if comparison.nan + comparison.inf > 0 {
        output::warn([format!(
            "{} values that are NaN and {} that are infinite were left out",
            comparison.nan, comparison.inf
        )]);
    }
    if !(comparison.error.is_finite() && comparison.bias.is_finite()) {
        output::warn([
            "relative numbers do not exist: the reference is black, or no value is finite in all images",
        ]);
    }
    if args.json {
        output::print_json(&comparison)
    } else {
        output::print(&table(&comparison))
    }
}

fn table(c: &Comparison) -> String {
    let numbers = [
        ("rmse", c.rmse),
        ("rel_rmse", c.rel_rmse),
        ("rel_mse", c.rel_mse),
        ("error", c.error),
        ("bias", c.bias),
        ("flip", c.flip),
    ];
    let mut lines: Vec<String> = numbers
        .iter()
        .map(|(name, n)| format!("{name:<9} {n:.6}"))
        .collect();
    lines.extend([("nan", c.nan), ("inf", c.inf)].map(|(name, n)| format!("{name:<9} {n}")));
    lines.join("\n")
}
