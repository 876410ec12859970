//! Where a growing function is zero: Newton's method, kept in a shrinking bracket.

/// The place between `low` and `high` where `f`, which grows and tells value and slope, is zero, from a first `guess` there.
///
/// Ends when a step is no longer than `tolerance` at the place it leaves, or after `most` steps. A step that would leave the bracket
/// halves it instead.
#[inline]
pub(crate) fn root(
    [mut low, mut high]: [f64; 2],
    guess: f64,
    most: usize,
    tolerance: impl Fn(f64) -> f64,
    f: impl Fn(f64) -> [f64; 2],
) -> f64 {
    let mut x = guess;
    for _ in 0..most {
        let [value, slope] = f(x);
        if value > 0.0 {
            high = x;
        } else {
            low = x;
        }
        let next = within(low, high, x - value / slope);
        if (next - x).abs() <= tolerance(x) {
            return next;
        }
        x = next;
    }
    x
}

/// `x`, or the middle of a bracket that it lies outside of.
#[inline]
pub(crate) fn within(low: f64, high: f64, x: f64) -> f64 {
    if x > low && x < high {
        x
    } else {
        0.5 * (low + high)
    }
}
