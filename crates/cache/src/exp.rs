//! The exponential of four numbers at once, where a few units in the last place do not matter.

use glam::Vec4;
use std::f32::consts::LOG2_E;

/// 1.5 · 2²³: a sum with it is rounded to an integer, which its lowest bits then hold.
const ROUNDER: f32 = 12_582_912.0;

/// ln 2 as a sum, the first part with few enough digits for exact products (Cody and Waite 1980).
const LN_2: [f32; 2] = [0.693_359_4, -2.121_944_4e-4];

/// exp x for −104 ≤ x ≤ 90, to 3·10⁻⁷ relatively; beyond the largest number it is infinite.
///
/// x = k ln 2 + r with |r| ≤ ½ ln 2, and exp r by its Taylor series: the term left out is below r⁷/7! = 1.2·10⁻⁷.
#[inline]
pub(crate) fn exp(x: Vec4) -> Vec4 {
    let round = |x: Vec4| (x + ROUNDER) - ROUNDER;
    let k = round(x * LOG2_E);
    let r = x - k * LN_2[0] - k * LN_2[1];
    let mut series = Vec4::splat(1.0 / 720.0);
    for coefficient in [1.0 / 120.0, 1.0 / 24.0, 1.0 / 6.0, 0.5, 1.0, 1.0] {
        series = series * r + coefficient;
    }
    // In two steps: 2ᵏ alone may be out of range where the result is not.
    let half = round(0.5 * k);
    series * power_of_two(half) * power_of_two(k - half)
}

/// 2ᵏ for whole |k| < 127, from its bits.
#[inline]
fn power_of_two(k: Vec4) -> Vec4 {
    let bits = (k + ROUNDER).to_array().map(f32::to_bits);
    Vec4::from(bits.map(|bits| f32::from_bits(bits.wrapping_add(127) << 23)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn four_exponentials_agree_with_the_library() {
        for i in -104_000..=88_700 {
            let x = i as f32 * 1e-3;
            let expected = f64::from(x).exp();
            let [found, ..] = exp(Vec4::splat(x)).to_array().map(f64::from);
            // Below 1.2e-38 numbers are 1.4e-45 apart; two roundings there are off by as much.
            let error = (found - expected).abs();
            assert!(error <= 3e-7 * expected + 1.5e-45, "exp {x} = {found}");
        }
    }
}
