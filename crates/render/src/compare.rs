//! How far an image is from a reference: the numbers of `tyndall compare`.
//!
//! A reference that is itself noisy comes as two independent halves; products of the differences to either one then have no bias from
//! its noise.

use crate::error::RenderError;
use crate::flip::flip;
use crate::image::Image;
use crate::relative::{median_5x5, weighted, weights};
use glam::Vec3;
use serde::Serialize;

/// Differences between image A and reference B, over all channels of a layer.
///
/// Values that are not finite in any of the images are counted and left out of every other number. Numbers that a black reference
/// leaves undefined are infinite or NaN, and null in JSON.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Comparison {
    /// Square root of the mean squared difference.
    pub rmse: f64,
    /// `rmse` over the mean of B.
    pub rel_rmse: f64,
    /// Mean of (A − B)² w, with w = 1/(B² + 0.01 mean(B)²); of (A − B)(A − B2) w with w from the 5 × 5 median of (B + B2)/2 where there
    /// are two halves, which noise can make negative.
    pub rel_mse: f64,
    /// Square root of `rel_mse`, 0 where that is negative.
    pub error: f64,
    /// mean(A − B) over mean(B).
    pub bias: f64,
    /// Mean LDR-FLIP at 67 pixels per degree.
    pub flip: f64,
    /// Number of values that are NaN in at least one image.
    pub nan: u64,
    /// Number of values that are infinite in at least one image and NaN in none.
    pub inf: u64,
}

/// Compares the layer `layer` of `a` with that of the reference `b`, or of the mean of its independent halves `b` and `b2`.
///
/// `exposure` (stops) brightens both images before FLIP and touches nothing else. Errors: a missing layer, different sizes.
pub fn compare(
    a: &Image,
    b: &Image,
    b2: Option<&Image>,
    layer: &str,
    exposure: f32,
) -> Result<Comparison, RenderError> {
    let a_layer = layer_of(a, "A", layer)?;
    let b_layer = layer_of(b, "B", layer)?;
    let b2_layer = b2.map(|b2| layer_of(b2, "B2", layer)).transpose()?;
    let size = |image: &Image, layer: &[&[f32]]| [image.width, image.height, layer.len()];
    let size_a = size(a, &a_layer);
    let others = [
        Some(("B", size(b, &b_layer))),
        b2.zip(b2_layer.as_deref()).map(|(i, l)| ("B2", size(i, l))),
    ];
    for (image, size_b) in others.into_iter().flatten() {
        if size_a != size_b {
            return Err(RenderError::Size {
                image,
                a: size_a,
                b: size_b,
            });
        }
    }
    let pairs = Pairs::new(&a_layer, &b_layer, b2_layer.as_deref());
    Ok(pairs.compare(a.width, a.height, b2.is_some(), exposure))
}

fn layer_of<'a>(
    image: &'a Image,
    role: &'static str,
    layer: &str,
) -> Result<Vec<&'a [f32]>, RenderError> {
    image.layer(layer).ok_or_else(|| RenderError::MissingLayer {
        image: role,
        layer: layer.to_owned(),
        found: image
            .channels
            .keys()
            .map(String::as_str)
            .collect::<Vec<_>>()
            .join(", "),
    })
}

/// The images' values channel by channel; those that are not finite are replaced by 0 in all images and do not count.
struct Pairs {
    a: Vec<Vec<f32>>,
    /// The reference's halves; the same values twice where there is one.
    halves: [Vec<Vec<f32>>; 2],
    /// The reference: the mean of its halves.
    r: Vec<Vec<f32>>,
    counted: f64,
    nan: u64,
    inf: u64,
}

impl Pairs {
    fn new(a: &[&[f32]], b: &[&[f32]], b2: Option<&[&[f32]]>) -> Self {
        let own = |layer: &[&[f32]]| layer.iter().map(|c| c.to_vec()).collect::<Vec<_>>();
        let mut pairs = Self {
            a: own(a),
            halves: [own(b), own(b2.unwrap_or(b))],
            r: own(b),
            counted: 0.0,
            nan: 0,
            inf: 0,
        };
        let [b, b2] = &mut pairs.halves;
        let channels = pairs.a.iter_mut().zip(b).zip(b2).zip(&mut pairs.r);
        for (((a, b), b2), r) in channels {
            for (((a, b), b2), r) in a.iter_mut().zip(b).zip(b2).zip(r) {
                let values = [*a, *b, *b2];
                if values.iter().all(|v| v.is_finite()) {
                    *r = 0.5 * *b + 0.5 * *b2;
                    pairs.counted += 1.0;
                } else {
                    let nan = values.iter().any(|v| v.is_nan());
                    pairs.nan += u64::from(nan);
                    pairs.inf += u64::from(!nan);
                    (*a, *b, *b2, *r) = (0.0, 0.0, 0.0, 0.0);
                }
            }
        }
        pairs
    }

    fn compare(&self, width: usize, height: usize, two_halves: bool, exposure: f32) -> Comparison {
        let smooth: Vec<Vec<f32>> = if two_halves {
            self.r
                .iter()
                .map(|channel| median_5x5(channel, width, height))
                .collect()
        } else {
            self.r.clone()
        };
        // Values that do not count are 0 here: they neither add to the sum nor to the number.
        let reference: f64 = self.r.iter().flatten().map(|&r| f64::from(r)).sum();
        let weights = weights(&smooth, reference / self.counted.max(1.0));
        let (mut squares, mut relative, mut difference) = (0.0, 0.0, 0.0);
        for (c, a) in self.a.iter().enumerate() {
            let halves = self.halves[0][c].iter().zip(&self.halves[1][c]);
            for (((&a, (&b, &b2)), &r), &w) in a.iter().zip(halves).zip(&self.r[c]).zip(&weights[c])
            {
                let product = (f64::from(a) - f64::from(b)) * (f64::from(a) - f64::from(b2));
                squares += product;
                relative += weighted(product, w);
                difference += f64::from(a) - f64::from(r);
            }
        }
        // Without a single value to compare, 0/0 stays NaN: no number is known.
        let root = |x: f64| if x.is_nan() { x } else { x.max(0.0).sqrt() };
        let rmse = root(squares / self.counted);
        let rel_mse = relative / self.counted;
        Comparison {
            rmse,
            rel_rmse: rmse / (reference / self.counted),
            rel_mse,
            error: root(rel_mse),
            bias: difference / reference,
            flip: self.flip(width, height, exposure),
            nan: self.nan,
            inf: self.inf,
        }
    }

    fn flip(&self, width: usize, height: usize, exposure: f32) -> f64 {
        let scale = exposure.exp2();
        let colours = |layer: &[Vec<f32>]| -> Vec<Vec3> {
            let channel = |c: usize| layer.get(c).or(layer.first()).into_iter().flatten();
            let zipped = channel(0).zip(channel(1)).zip(channel(2));
            zipped
                .map(|((&r, &g), &b)| Vec3::new(r, g, b) * scale)
                .collect()
        };
        let map = flip(&colours(&self.r), &colours(&self.a), width, height);
        map.iter().map(|&e| f64::from(e)).sum::<f64>() / map.len() as f64
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "tests")]
    use super::*;
    use tyndall_math::{Key, Purpose, Sampler};

    fn image(width: usize, height: usize, value: impl Fn(usize, usize) -> f32) -> Image {
        let mut image = Image::new(width, height);
        for (c, name) in ["R", "G", "B"].into_iter().enumerate() {
            image.channels.insert(
                name.to_owned(),
                (0..width * height).map(|i| value(i, c)).collect(),
            );
        }
        image
    }

    #[test]
    fn an_image_equals_itself() {
        let x = image(9, 5, |i, c| (i * 3 + c) as f32);
        let zero = Comparison {
            rmse: 0.0,
            rel_rmse: 0.0,
            rel_mse: 0.0,
            error: 0.0,
            bias: 0.0,
            flip: 0.0,
            nan: 0,
            inf: 0,
        };
        assert_eq!(compare(&x, &x, None, "beauty", 0.0).unwrap(), zero);
    }

    #[test]
    fn the_numbers_follow_their_formulas() {
        let b = image(4, 4, |_, _| 2.0);
        let a = image(4, 4, |i, _| if i % 2 == 0 { 2.5 } else { 1.75 });
        let n = compare(&a, &b, None, "beauty", 0.0).unwrap();
        let mse = (0.25 + 0.0625) / 2.0;
        let close = |x: f64, y: f64| assert!((x - y).abs() < 1e-12, "{x} {y}");
        close(n.rmse, f64::sqrt(mse));
        close(n.rel_rmse, f64::sqrt(mse) / 2.0);
        close(n.rel_mse, mse / (4.0 * 1.01));
        close(n.error, n.rel_mse.sqrt());
        close(n.bias, 0.125 / 2.0);
    }

    #[test]
    fn the_bright_half_of_noise_does_not_count_with_two_references() {
        // A is the truth; B and B2 are it plus independent uniform noise of variance 0.5²/3. One noisy reference reports that noise, two
        // report 0 up to σ²/√n = 0.0833/√49152 = 3.8·10⁻⁴ in the mean product; five such (false alarms 6·10⁻⁷) over a weight of 1/1.01.
        let noise = |half: u64| {
            image(128, 128, |i, c| {
                let key = Key {
                    seed: 11,
                    purpose: Purpose::Pixel,
                    index: (i * 3 + c) as u64 * 2 + half,
                };
                0.5 + Sampler::new(key, 0).next_1d()
            })
        };
        let truth = image(128, 128, |_, _| 1.0);
        let (b, b2) = (noise(0), noise(1));
        let one = compare(&truth, &b, None, "beauty", 0.0).unwrap();
        let two = compare(&truth, &b, Some(&b2), "beauty", 0.0).unwrap();
        assert!(one.rmse > 0.28 && one.rmse < 0.30, "{one:?}");
        assert!(two.rel_mse.abs() < 5.0 * 3.8e-4, "{two:?}");
    }

    #[test]
    fn values_that_are_not_finite_are_counted_and_left_out() {
        let b = image(4, 4, |i, _| if i == 0 { f32::NAN } else { 1.0 });
        let a = image(4, 4, |i, _| if i < 2 { f32::INFINITY } else { 1.0 });
        let n = compare(&a, &b, None, "beauty", 0.0).unwrap();
        assert_eq!((n.nan, n.inf, n.rmse, n.flip), (3, 3, 0.0, 0.0));
    }

    #[test]
    fn a_black_reference_is_no_panic() {
        let black = image(3, 3, |_, _| 0.0);
        let grey = image(3, 3, |_, _| 0.5);
        assert_eq!(
            compare(&black, &black, None, "beauty", 0.0).unwrap().error,
            0.0
        );
        assert_eq!(
            compare(&grey, &black, None, "beauty", 0.0).unwrap().error,
            f64::INFINITY
        );
    }

    #[test]
    fn sizes_and_layers_must_fit() {
        let (a, b) = (image(4, 4, |_, _| 1.0), image(4, 5, |_, _| 1.0));
        let message = compare(&a, &b, None, "beauty", 0.0)
            .unwrap_err()
            .to_string();
        assert!(
            message.contains("4 × 4") && message.contains("4 × 5"),
            "{message}"
        );
        let message = compare(&a, &a, Some(&b), "beauty", 0.0)
            .unwrap_err()
            .to_string();
        assert!(message.contains("B2"), "{message}");
        let message = compare(&a, &a, None, "multiple", 0.0)
            .unwrap_err()
            .to_string();
        assert!(
            message.contains("`multiple`") && message.contains("B, G, R"),
            "{message}"
        );
    }

    #[test]
    fn exposure_touches_flip_alone() {
        let (a, b) = (image(8, 8, |_, _| 0.02), image(8, 8, |_, _| 0.01));
        let dark = compare(&a, &b, None, "beauty", 0.0).unwrap();
        let bright = compare(&a, &b, None, "beauty", 4.0).unwrap();
        assert!(bright.flip > dark.flip);
        assert_eq!(
            Comparison {
                flip: 0.0,
                ..bright
            },
            Comparison { flip: 0.0, ..dark }
        );
    }
}
