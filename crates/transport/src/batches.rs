//! Means with standard errors from the spread of independent batches.

use tyndall_math::Key;
use tyndall_math::stats::Welford;

/// Enough for a standard error good to an eighth, few enough that each is well stratified.
const BATCHES: usize = 32;

/// Deals `samples` samples out to batches and gives the spread of their means, number by number.
///
/// `mean_of` is given the key of a batch and how many samples it has, at least one, and tells their means. Samples of one key are
/// stratified, batches are independent: the mean of a [`Welford`] and its standard error are those of all samples.
pub fn in_batches<const N: usize>(
    samples: usize,
    key: Key,
    mut mean_of: impl FnMut(Key, usize) -> [f64; N],
) -> [Welford; N] {
    let batches = samples.clamp(1, BATCHES);
    let mut spread = [Welford::new(); N];
    for batch in 0..batches {
        let key = Key {
            index: (key.index << 8) | batch as u64,
            ..key
        };
        // Batches differ by at most one sample: samples are dealt out in turn.
        let n = (samples - batch).div_ceil(batches).max(1);
        for (spread, mean) in spread.iter_mut().zip(mean_of(key, n)) {
            spread.push(mean);
        }
    }
    spread
}

#[cfg(test)]
mod tests {
    use super::*;
    use tyndall_math::Purpose;

    #[test]
    fn all_samples_are_dealt_out_and_no_key_twice() {
        let key = Key {
            seed: 1,
            purpose: Purpose::Probe,
            index: 5,
        };
        for (samples, batches) in [(1, 1), (2, 2), (31, 31), (32, 32), (100, 32), (4096, 32)] {
            let (mut keys, mut dealt) = (Vec::new(), 0);
            let [spread] = in_batches(samples, key, |key, n| {
                keys.push(key.index);
                dealt += n;
                [n as f64]
            });
            keys.dedup();
            assert_eq!((keys.len(), dealt), (batches, samples));
            assert_eq!(spread.count(), batches as u64);
        }
    }
}
