//! Choice of one among many with given weights, in constant time.

/// Indices in proportion to weights.
///
/// Each of n slots holds its own index and one alias, and a threshold between the two (Walker 1974; built after Vose
/// 1991, "A Linear Algorithm for Generating Random Numbers with a Given Distribution").
#[derive(Clone, Debug)]
pub struct AliasTable {
    slots: Vec<Slot>,
}

#[derive(Clone, Copy, Debug)]
struct Slot {
    /// Share of the slot that its own index keeps.
    threshold: f32,
    alias: u32,
    /// Probability of the slot's own index in the whole table.
    probability: f32,
}

impl AliasTable {
    /// Indices in proportion to `weights`; `None` where none is positive or one is negative or not finite.
    pub fn new(weights: &[f32]) -> Option<Self> {
        // f64: the shares that are passed on are differences.
        let total: f64 = weights.iter().map(|&w| f64::from(w)).sum();
        if total <= 0.0 || weights.iter().any(|w| !w.is_finite() || *w < 0.0) {
            return None;
        }
        u32::try_from(weights.len()).ok()?;
        let mut share: Vec<f64> = weights
            .iter()
            .map(|&w| f64::from(w) / total * weights.len() as f64)
            .collect();
        let mut slots: Vec<Slot> = (0..)
            .zip(weights)
            .map(|(i, &w)| Slot {
                threshold: 1.0,
                alias: i,
                probability: (f64::from(w) / total) as f32,
            })
            .collect();
        let (mut small, mut large): (Vec<usize>, Vec<usize>) =
            (0..share.len()).partition(|&i| share[i] < 1.0);
        while let (Some(poor), Some(&rich)) = (small.pop(), large.last()) {
            slots[poor].threshold = share[poor] as f32;
            slots[poor].alias = rich as u32;
            share[rich] -= 1.0 - share[poor];
            if share[rich] < 1.0 {
                large.pop();
                small.push(rich);
            }
        }
        // What is left over holds a whole slot, but for rounding; one of weight 0 must not be chosen for that.
        let heaviest = (0..weights.len()).max_by(|&i, &j| weights[i].total_cmp(&weights[j]))?;
        for slot in &mut slots {
            if slot.probability == 0.0 && slot.threshold == 1.0 {
                slot.threshold = 0.0;
                slot.alias = heaviest as u32;
            }
        }
        Some(Self { slots })
    }

    /// An index and its probability.
    pub fn sample(&self, u: f32) -> (usize, f32) {
        // f64: the fraction of u·n has 24 bits less those of n.
        let scaled = f64::from(u) * self.slots.len() as f64;
        let i = (scaled as usize).min(self.slots.len() - 1);
        let slot = self.slots[i];
        let chosen = if scaled - (i as f64) < f64::from(slot.threshold) {
            i
        } else {
            slot.alias as usize
        };
        (chosen, self.slots[chosen].probability)
    }

    /// Probability of index `i`; 0 for indices that are not in the table.
    pub fn probability(&self, i: usize) -> f32 {
        self.slots.get(i).map_or(0.0, |slot| slot.probability)
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "tests")]
mod tests {
    use super::*;
    use crate::testing::{Distances, assert_conforms};

    fn check(seed: u64, weights: &[f32]) {
        let table = AliasTable::new(weights).unwrap();
        // Index i as the middle of [i, i + 1); the density there is its probability.
        assert_conforms(
            &Distances::even(0.0, weights.len() as f32, weights.len()),
            seed,
            |u| {
                let (i, probability) = table.sample(u[0]);
                Some((i as f32 + 0.5, probability))
            },
            |x| table.probability(x as usize),
        );
    }

    #[test]
    fn indices_are_drawn_in_proportion_to_their_weights() {
        check(51, &[1.0]);
        check(52, &[0.0, 0.0, 2.0, 0.0]);
        check(53, &[3.0, 0.0, 1e-3, 7.0, 7.0, 0.5]);
        let many: Vec<f32> = (0..1000).map(|i| (i % 37) as f32 + 0.1).collect();
        check(54, &many);
    }

    #[test]
    fn an_index_without_weight_is_never_drawn() {
        let weights: Vec<f32> = (0..1000)
            .map(|i| if i % 3 == 0 { 0.1 } else { 0.0 })
            .collect();
        let table = AliasTable::new(&weights).unwrap();
        for i in 0..100_000 {
            let (chosen, probability) = table.sample(i as f32 / 100_000.0);
            assert!(weights[chosen] > 0.0 && probability > 0.0);
        }
        assert_eq!(table.probability(1000), 0.0);
    }

    #[test]
    fn weights_that_choose_nothing_are_refused() {
        for weights in [
            &[][..],
            &[0.0],
            &[1.0, -1.0],
            &[1.0, f32::NAN],
            &[f32::INFINITY],
        ] {
            assert!(AliasTable::new(weights).is_none());
        }
    }
}
