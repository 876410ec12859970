//! Keyed random numbers: what a sample draws depends on its key alone, never on a thread or on what was drawn before it.
//!
//! A [`Sampler`] yields Owen-scrambled Sobol points (Burley 2020, padded in sets of four dimensions) while a path is
//! young, and an independent stream once it is long and stratification has nothing left to give.

use rand_pcg::{Pcg32, rand_core::Rng};

/// What random numbers are for; two purposes never share numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum Purpose {
    /// Camera samples of the image.
    Pixel = 1,
    /// Gather rays of a cache record.
    Record = 2,
    /// Choice of the points at which records are placed.
    Placement = 3,
    /// Evaluations held out to check the image.
    Validation = 4,
    /// Probes at a point, asked for by a user.
    Probe = 5,
    /// Walks that fill a coarse field of light.
    Field = 6,
    /// Camera samples that tell what an image is made of before it is made.
    Pilot = 7,
}

/// Names a family of samples: `seed` of the run, what it is for, and which pixel, record or probe.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Key {
    /// Seed of the whole run; every value is as good as another.
    pub seed: u64,
    /// What the numbers are for.
    pub purpose: Purpose,
    /// Pixel, record or probe index.
    pub index: u64,
}

impl Key {
    /// A well-mixed 64-bit name of this key and `salt`.
    pub fn hash(&self, salt: u64) -> u64 {
        let mut h = mix(self.seed ^ 0x9e37_79b9_7f4a_7c15);
        h = mix(h ^ (self.purpose as u64).wrapping_mul(0xd1b5_4a32_d192_ed03));
        h = mix(h ^ self.index);
        mix(h ^ salt)
    }
}

/// The finaliser of `SplitMix64` (Steele, Lea and Flood 2014): a bijection that mixes all bits.
fn mix(mut z: u64) -> u64 {
    z = z.wrapping_add(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// Sets of four Sobol dimensions before the sampler turns to independent numbers.
const SOBOL_SETS: u32 = 24;

/// Random numbers in [0, 1) for one sample of one [`Key`].
#[derive(Clone, Debug)]
pub struct Sampler {
    seed: u64,
    sample: u32,
    set: u32,
    buffer: [f32; 4],
    used: usize,
    stream: Pcg32,
}

impl Sampler {
    /// The numbers of sample number `sample` of `key`; samples 0 … n−1 of one key are stratified against each other.
    pub fn new(key: Key, sample: u64) -> Self {
        // A Sobol sequence of the library ends at 2^16 samples; a longer run goes on with a fresh scramble.
        let block = sample >> 16;
        let seed = key.hash(block.wrapping_mul(2));
        Self {
            seed,
            sample: (sample & 0xffff) as u32,
            set: 0,
            buffer: [0.0; 4],
            used: 4,
            stream: Pcg32::new(key.hash(sample.wrapping_mul(2) | 1), seed | 1),
        }
    }

    /// The numbers of the same sample for another part of its work: stratified alike, independent of this sampler's own.
    pub fn branch(&self, part: u64) -> Self {
        let seed = mix(self.seed ^ mix(part));
        let mut stream = self.stream.clone();
        Self {
            seed,
            sample: self.sample,
            set: 0,
            buffer: [0.0; 4],
            used: 4,
            stream: Pcg32::new(u64::from(stream.next_u32()) | (seed << 32), seed | 1),
        }
    }

    /// Starts a fresh set of four dimensions, so that what a path draws at a vertex does not shift what it draws at the next.
    pub fn start_set(&mut self, set: u32) {
        self.set = set;
        self.used = 4;
    }

    /// The next number in [0, 1).
    pub fn next_1d(&mut self) -> f32 {
        if self.set >= SOBOL_SETS && self.used >= 4 {
            // 24 random bits: every value is representable and below 1.
            return (self.stream.next_u32() >> 8) as f32 * (1.0 / 16_777_216.0);
        }
        if self.used >= 4 {
            // Padding (Burley 2020, section 4): the same four dimensions, a new seed for each set.
            let seed = mix(self.seed ^ u64::from(self.set)) as u32;
            self.buffer = sobol_burley::sample_4d(self.sample, 0, seed);
            self.set += 1;
            self.used = 0;
        }
        let u = self.buffer[self.used];
        self.used += 1;
        u
    }

    /// The next two numbers, stratified as a pair.
    pub fn next_2d(&mut self) -> [f32; 2] {
        if self.used == 3 {
            // A pair must not straddle two sets: it would lose its stratification.
            self.used = 4;
        }
        [self.next_1d(), self.next_1d()]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const KEY: Key = Key {
        seed: 7,
        purpose: Purpose::Pixel,
        index: 3,
    };

    #[test]
    fn equal_keys_draw_equal_numbers_and_other_keys_do_not() {
        let draw = |key: Key, sample| {
            let mut s = Sampler::new(key, sample);
            (0..200).map(|_| s.next_1d()).collect::<Vec<_>>()
        };
        assert_eq!(draw(KEY, 5), draw(KEY, 5));
        assert_ne!(draw(KEY, 5), draw(KEY, 6));
        assert_ne!(draw(KEY, 5), draw(Key { index: 4, ..KEY }, 5));
        assert_ne!(draw(KEY, 5), draw(KEY, 5 + 65_536));
    }

    #[test]
    fn branches_of_a_sample_draw_numbers_of_their_own() {
        let sampler = Sampler::new(KEY, 9);
        let draw = |mut s: Sampler| (0..200).map(|_| s.next_1d()).collect::<Vec<_>>();
        assert_ne!(draw(sampler.clone()), draw(sampler.branch(1)));
        assert_ne!(draw(sampler.branch(1)), draw(sampler.branch(2)));
        assert_eq!(draw(sampler.branch(1)), draw(sampler.branch(1)));
    }

    #[test]
    fn numbers_stay_in_the_unit_interval_past_the_end_of_the_sobol_sequence() {
        for sample in [0, 1, 65_535, 65_536, 1 << 40] {
            let mut s = Sampler::new(KEY, sample);
            assert!((0..500).all(|_| (0.0..1.0).contains(&s.next_1d())));
        }
    }

    #[test]
    fn the_first_pair_of_256_samples_has_one_point_in_each_of_256_squares() {
        let mut seen = [false; 256];
        for i in 0..256 {
            let [u, v] = Sampler::new(KEY, i).next_2d();
            seen[(u * 16.0) as usize * 16 + (v * 16.0) as usize] = true;
        }
        assert!(seen.iter().all(|&s| s));
    }
}
