//! LDR-FLIP: how different two images look when shown in turn on one screen, 0 (equal) to 1.
//!
//! Andersson, Nilsson, Akenine-Möller, Oskarsson, Åström and Fairchild 2020, "FLIP: A Difference Evaluator for Alternating Images"
//! (constants in the names of its symbols), with the separated filters of its authors' later note. Checked against flip-evaluator 1.7.

use glam::{Mat3, Vec3, Vec4};
use rayon::prelude::*;
use std::f32::consts::PI;

/// Pixels per degree of the paper's viewer: 0.7 m before a screen 0.7 m wide with 3840 pixels.
const PIXELS_PER_DEGREE: f32 = 3840.0 * PI / 180.0;

/// Exponent on colour differences.
const Q_C: f32 = 0.7;
/// Share of the largest colour difference at which compression starts, and the value it is mapped to.
const P_C: f32 = 0.4;
const P_T: f32 = 0.95;
/// Width of the feature detectors in degrees.
const W: f32 = 0.082;
/// Exponent on feature differences.
const Q_F: f32 = 0.5;

/// Contrast sensitivity as Gaussians in frequency (table 1 of the paper): a and b for the achromatic, the red-green and, twice, the
/// blue-yellow channel.
const CSF_A: Vec4 = Vec4::new(1.0, 1.0, 34.1, 13.5);
const CSF_B: Vec4 = Vec4::new(0.0047, 0.0053, 0.04, 0.025);

/// The FLIP error of every pixel of `test`; both images hold `width` × `height` exposed linear colours, which are clamped to [0, 1].
pub fn flip(reference: &[Vec3], test: &[Vec3], width: usize, height: usize) -> Vec<f32> {
    if width == 0 || height == 0 {
        return Vec::new();
    }
    let [reference, test] = [reference, test].map(|image| Perceived::new(image, width, height));
    let largest = hyab(hunt_lab(Vec3::Y), hunt_lab(Vec3::Z)).powf(Q_C);
    let pixels = reference
        .colour
        .iter()
        .zip(&test.colour)
        .zip(reference.features.iter().zip(&test.features));
    pixels
        .map(|((&c_r, &c_t), (f_r, f_t))| {
            let colour = compressed(hyab(c_r, c_t).powf(Q_C), largest);
            let feature = (f_r.edge - f_t.edge)
                .abs()
                .max((f_r.point - f_t.point).abs());
            let feature = (feature / 2f32.sqrt()).powf(Q_F);
            colour.powf(1.0 - feature)
        })
        .collect()
}

/// An image as a viewer takes it in.
struct Perceived {
    /// Hunt-adjusted CIE Lab after the eye's blur.
    colour: Vec<Vec3>,
    features: Vec<Features>,
}

/// How strongly a pixel looks like an edge or a point.
#[derive(Clone, Copy)]
struct Features {
    edge: f32,
    point: f32,
}

impl Perceived {
    fn new(image: &[Vec3], width: usize, height: usize) -> Self {
        let opponent: Vec<Vec3> = image
            .iter()
            .map(|&c| ycxcz_from_rgb(c.clamp(Vec3::ZERO, Vec3::ONE)))
            .collect();
        let grey: Vec<f32> = opponent.iter().map(|c| (c.x + 16.0) / 116.0).collect();
        let blurred = blur(&opponent, width, height);
        let rgb_from_xyz = xyz_from_rgb().inverse();
        let shown = |c: Vec3| (rgb_from_xyz * xyz_from_ycxcz(c)).clamp(Vec3::ZERO, Vec3::ONE);
        let colour = blurred.iter().map(|&c| hunt_lab(shown(c))).collect();
        Self {
            colour,
            features: features(&grey, width, height),
        }
    }
}

/// The difference after compression of its upper part: [0, `P_C`] of the largest one is stretched to [0, `P_T`].
fn compressed(difference: f32, largest: f32) -> f32 {
    let limit = P_C * largest;
    if difference < limit {
        P_T / limit * difference
    } else {
        P_T + (difference - limit) / (largest - limit) * (1.0 - P_T)
    }
}

/// City-block distance in lightness plus Euclidean distance in chroma.
fn hyab(a: Vec3, b: Vec3) -> f32 {
    let d = a - b;
    d.x.abs() + d.y.hypot(d.z)
}

/// CIE Lab with chroma scaled by lightness (Hunt effect).
fn hunt_lab(rgb: Vec3) -> Vec3 {
    const DELTA: f32 = 6.0 / 29.0;
    let xyz = relative_xyz(rgb);
    let [x, y, z] = xyz.to_array().map(|t| {
        if t > DELTA.powi(3) {
            t.cbrt()
        } else {
            t / (3.0 * DELTA * DELTA) + 4.0 / 29.0
        }
    });
    let lightness = 116.0 * y - 16.0;
    let hunt = 0.01 * lightness;
    Vec3::new(lightness, hunt * 500.0 * (x - y), hunt * 200.0 * (y - z))
}

/// The linearised CIE Lab of Flynn and others, in which blurs are linear.
fn ycxcz_from_rgb(rgb: Vec3) -> Vec3 {
    let xyz = relative_xyz(rgb);
    Vec3::new(
        116.0 * xyz.y - 16.0,
        500.0 * (xyz.x - xyz.y),
        200.0 * (xyz.y - xyz.z),
    )
}

fn xyz_from_ycxcz(c: Vec3) -> Vec3 {
    let y = (c.x + 16.0) / 116.0;
    Vec3::new(y + c.y / 500.0, y, y - c.z / 200.0) * white()
}

/// XYZ over that of the white point.
fn relative_xyz(rgb: Vec3) -> Vec3 {
    xyz_from_rgb() * rgb / white()
}

/// XYZ of linear sRGB, from the primaries (0.64, 0.33), (0.30, 0.60), (0.15, 0.06) and the white (0.3127, 0.3290) as exact fractions.
fn xyz_from_rgb() -> Mat3 {
    Mat3::from_cols(
        Vec3::new(
            10_135_552.0 / 24_577_794.0,
            2_613_072.0 / 12_288_897.0,
            1_425_312.0 / 73_733_382.0,
        ),
        Vec3::new(
            8_788_810.0 / 24_577_794.0,
            8_788_810.0 / 12_288_897.0,
            8_788_810.0 / 73_733_382.0,
        ),
        Vec3::new(
            4_435_075.0 / 24_577_794.0,
            887_015.0 / 12_288_897.0,
            70_074_185.0 / 73_733_382.0,
        ),
    )
}

fn white() -> Vec3 {
    xyz_from_rgb() * Vec3::ONE
}

/// Filters the opponent channels by the eye's contrast sensitivity.
///
/// Each is a Gaussian a √(π/b) exp(−π²r²/b), r in degrees; the blue-yellow one is the sum of two, blurred side by side in `z` and `w`.
fn blur(image: &[Vec3], width: usize, height: usize) -> Vec<Vec3> {
    let radius =
        (3.0 * (CSF_B.max_element() / (2.0 * PI * PI)).sqrt() * PIXELS_PER_DEGREE).ceil() as isize;
    let gauss = |k: isize| {
        let r = k as f32 / PIXELS_PER_DEGREE;
        (-PI * PI * r * r / CSF_B).exp()
    };
    let sum: Vec4 = (-radius..=radius).map(gauss).sum();
    let kernel: Vec<Vec4> = (-radius..=radius).map(|k| gauss(k) / sum).collect();
    let amplitude = CSF_A * (Vec4::splat(PI) / CSF_B).map(f32::sqrt) * sum * sum;
    let share = amplitude.z / (amplitude.z + amplitude.w);

    let image: Vec<Vec4> = image
        .iter()
        .map(|c| Vec4::new(c.x, c.y, c.z, c.z))
        .collect();
    let rows = along_rows(
        &image,
        width,
        |total: &mut Vec4, k, c| *total += kernel[k] * c,
        kernel.len(),
    );
    let both = along_columns(
        &rows,
        width,
        height,
        |total: &mut Vec4, k, c| *total += kernel[k] * c,
        kernel.len(),
    );
    both.iter()
        .map(|c| Vec3::new(c.x, c.y, share * c.z + (1.0 - share) * c.w))
        .collect()
}

/// Strength of edges and points: norms of the first and second derivatives of a Gaussian over `grey`, positive and negative weights
/// each normalised to sum 1.
fn features(grey: &[f32], width: usize, height: usize) -> Vec<Features> {
    let sigma = 0.5 * W * PIXELS_PER_DEGREE;
    let radius = (3.0 * sigma).ceil() as isize;
    let weights = |f: &dyn Fn(f32, f32) -> f32| -> Vec<f32> {
        let raw: Vec<f32> = (-radius..=radius)
            .map(|k| k as f32)
            .map(|k| f(k, (-k * k / (2.0 * sigma * sigma)).exp()))
            .collect();
        let positive: f32 = raw.iter().filter(|&&w| w > 0.0).sum();
        let negative: f32 = -raw.iter().filter(|&&w| w < 0.0).sum::<f32>();
        raw.iter()
            .map(|w| w / if *w > 0.0 { positive } else { negative })
            .collect()
    };
    let gauss: Vec<f32> = {
        let raw: Vec<f32> = (-radius..=radius)
            .map(|k| (-((k * k) as f32) / (2.0 * sigma * sigma)).exp())
            .collect();
        let sum: f32 = raw.iter().sum();
        raw.iter().map(|w| w / sum).collect()
    };
    let edge = weights(&|k, g| -k * g);
    let point = weights(&|k, g| (k * k / (sigma * sigma) - 1.0) * g);

    // Along rows: edge, point and plain weights. Along columns those are completed to both edge and both point derivatives.
    let row_step =
        |t: &mut Vec3, k: usize, c: f32| *t += Vec3::new(edge[k], point[k], gauss[k]) * c;
    let rows = along_rows(grey, width, row_step, gauss.len());
    let column_step = |t: &mut Vec4, k: usize, c: Vec3| {
        *t += Vec4::new(
            gauss[k] * c.x,
            edge[k] * c.z,
            gauss[k] * c.y,
            point[k] * c.z,
        );
    };
    let both = along_columns(&rows, width, height, column_step, gauss.len());
    both.iter()
        .map(|d| Features {
            edge: d.x.hypot(d.y),
            point: d.z.hypot(d.w),
        })
        .collect()
}

/// Gathers `step(total, k, value)` over `n` (odd) neighbours k in a row; border values are repeated outwards.
fn along_rows<T, U>(
    image: &[T],
    width: usize,
    step: impl Fn(&mut U, usize, T) + Sync,
    n: usize,
) -> Vec<U>
where
    T: Copy + Sync,
    U: Copy + Default + Send,
{
    let mut out = vec![U::default(); image.len()];
    out.par_chunks_mut(width)
        .zip(image.par_chunks(width))
        .for_each(|(out, row)| {
            for (x, total) in out.iter_mut().enumerate() {
                for k in 0..n {
                    step(total, k, row[neighbour(x, k, n, width)]);
                }
            }
        });
    out
}

/// As [`along_rows`], over the neighbours in a column.
fn along_columns<T, U>(
    image: &[T],
    width: usize,
    height: usize,
    step: impl Fn(&mut U, usize, T) + Sync,
    n: usize,
) -> Vec<U>
where
    T: Copy + Sync,
    U: Copy + Default + Send,
{
    let mut out = vec![U::default(); image.len()];
    out.par_chunks_mut(width).enumerate().for_each(|(y, out)| {
        for k in 0..n {
            let first = neighbour(y, k, n, height) * width;
            for (total, &value) in out.iter_mut().zip(&image[first..first + width]) {
                step(total, k, value);
            }
        }
    });
    out
}

/// Index of neighbour `k` of `n` around `i`, kept within `0..size`.
fn neighbour(i: usize, k: usize, n: usize, size: usize) -> usize {
    (i + k).saturating_sub(n / 2).min(size - 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    const WIDTH: usize = 61;
    const HEIGHT: usize = 47;

    /// An image of whole 255ths, which the reference implementation was given as linear colours too.
    fn image(value: impl Fn(usize, usize, usize) -> usize) -> Vec<Vec3> {
        let pixels = (0..WIDTH * HEIGHT)
            .map(|i| [0, 1, 2].map(|c| value(i % WIDTH, i / WIDTH, c) as f32 / 255.0));
        pixels.map(Vec3::from).collect()
    }

    fn ramp(x: usize, y: usize, c: usize) -> usize {
        (x * (3 + c) + y * (5 - c)) % 256
    }

    /// Mean, largest value and value at (20, 17) by `flip_evaluator.evaluate(reference, test, "LDR", inputsRGB=False)`, version 1.7.
    fn check(reference: &[Vec3], test: &[Vec3], mean: f32, largest: f32, at: f32) {
        let map = flip(reference, test, WIDTH, HEIGHT);
        let found = [
            map.iter().sum::<f32>() / map.len() as f32,
            map.iter().copied().fold(0.0, f32::max),
            map[17 * WIDTH + 20],
        ];
        for (found, expected) in found.into_iter().zip([mean, largest, at]) {
            // Both sum in f32, in different orders; the square root of small feature differences magnifies rounding.
            assert!((found - expected).abs() < 2e-5, "{found} {expected}");
        }
    }

    #[test]
    fn noise_over_ramps_agrees_with_the_reference_implementation() {
        let noisy = image(|x, y, c| (ramp(x, y, c) + (x * 7919 + y * 104_729 + c * 31) % 41) % 256);
        check(
            &image(ramp),
            &noisy,
            0.416_152_33,
            0.978_356_54,
            0.175_098_52,
        );
    }

    #[test]
    fn exchanged_colours_agree_with_the_reference_implementation() {
        let swapped = image(|x, y, c| ramp(x, y, 2 - c));
        check(
            &image(ramp),
            &swapped,
            0.409_779_73,
            0.969_111_6,
            0.095_350_735,
        );
    }

    #[test]
    fn a_shifted_edge_agrees_with_the_reference_implementation() {
        let edge = |at: usize| image(move |x, _, c| if x < at { 20 } else { [200, 120, 40][c] });
        check(
            &edge(30),
            &edge(31),
            0.057_605_16,
            0.514_253_5,
            0.003_196_118_4,
        );
    }

    #[test]
    fn bright_points_agree_with_the_reference_implementation() {
        let points = image(|x, y, _| {
            if (x, y) == (20, 17) || (x, y) == (0, 46) {
                255
            } else {
                30
            }
        });
        check(
            &image(|_, _, _| 30),
            &points,
            0.004_125_743,
            0.913_033_54,
            0.481_517_85,
        );
    }

    #[test]
    fn dark_patterns_agree_with_the_reference_implementation() {
        let dark = image(|x, y, c| (x + y + c) % 4);
        check(
            &dark,
            &image(|x, y, c| (x + 2 * y + c) % 5),
            0.086_801_32,
            0.140_971_02,
            0.079_883_434,
        );
    }

    #[test]
    fn the_largest_difference_is_one_and_none_is_zero() {
        let one = |channel: usize| image(move |_, _, c| if c == channel { 255 } else { 0 });
        check(&one(1), &one(2), 1.0, 1.0, 1.0);
        check(&image(ramp), &image(ramp), 0.0, 0.0, 0.0);
    }

    #[test]
    fn colours_beyond_the_screen_are_clamped() {
        let white = image(|_, _, _| 255);
        let brighter: Vec<Vec3> = white.iter().map(|c| *c * 7.0).collect();
        assert!(
            flip(&white, &brighter, WIDTH, HEIGHT)
                .iter()
                .all(|&e| e == 0.0)
        );
        assert!(flip(&[], &[], 0, 0).is_empty());
    }
}
