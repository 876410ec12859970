//! Spreads small radii to the neighbours: Rᵢ ← minⱼ (Rⱼ + slope · |xᵢ − xⱼ|).
//!
//! A tree over the records' positions, whose nodes know their smallest radius, answers that minimum by branch and bound:
//! a node cannot help if its smallest radius plus the slope times its distance is no better than what is known already.

use crate::grid::Ball;
use glam::{DVec3, Vec3};
use std::ops::Range;

/// Radii less than this part above the bound are left as they are, or rounding would never come to rest.
const TOLERANCE: f64 = 1e-6;

/// Balls in a leaf of the tree.
const LEAF: usize = 8;

/// The clamped radii, in the order of `balls`.
pub(crate) fn clamp(balls: &[Ball], slope: f32) -> Vec<f32> {
    let mut radii: Vec<f32> = balls.iter().map(|ball| ball.radius).collect();
    if balls.is_empty() {
        return radii;
    }
    let slope = f64::from(slope);
    let mut tree = Tree::new(balls);
    // Distances obey the triangle inequality, so the first round finds the answer but for rounding. Rounding may give a
    // later round something to do, but each radius only falls, by at least `TOLERANCE`, and never below its bound.
    loop {
        tree.set_radii(&radii);
        let mut changed = false;
        // In the tree's order, so that neighbours walk over the same nodes while these are at hand.
        for &index in &tree.order {
            let radius = &mut radii[index as usize];
            let keep = f64::from(*radius) * (1.0 - TOLERANCE);
            let centre = balls[index as usize].centre.as_dvec3();
            let bound = tree.least_bound(0, centre, slope, keep);
            if bound < keep {
                *radius = bound as f32;
                changed = true;
            }
        }
        if !changed {
            return radii;
        }
    }
}

/// A node over a range of the tree's points. The left child follows its parent; a leaf has no right child.
struct Node {
    points: Range<usize>,
    low: Vec3,
    high: Vec3,
    least_radius: f32,
    right: Option<usize>,
}

/// Positions and radii, sorted into boxes of halved counts.
struct Tree {
    nodes: Vec<Node>,
    centres: Vec<Vec3>,
    radii: Vec<f32>,
    /// Index of the ball at each of the tree's points.
    order: Vec<u32>,
}

impl Tree {
    /// A tree over one ball or more.
    fn new(balls: &[Ball]) -> Self {
        let mut order: Vec<u32> = (0..balls.len() as u32).collect();
        let mut nodes = Vec::new();
        split(balls, &mut order, 0, &mut nodes);
        Self {
            nodes,
            centres: (order.iter())
                .map(|&index| balls[index as usize].centre)
                .collect(),
            radii: vec![0.0; balls.len()],
            order,
        }
    }

    fn set_radii(&mut self, radii: &[f32]) {
        for (radius, &index) in self.radii.iter_mut().zip(&self.order) {
            *radius = radii[index as usize];
        }
        for index in (0..self.nodes.len()).rev() {
            let node = &self.nodes[index];
            let least = match node.right {
                Some(right) => {
                    (self.nodes[index + 1].least_radius).min(self.nodes[right].least_radius)
                }
                None => {
                    (self.radii[node.points.clone()].iter()).fold(f32::INFINITY, |a, &b| a.min(b))
                }
            };
            self.nodes[index].least_radius = least;
        }
    }

    /// The smaller of `best` and minⱼ (Rⱼ + slope · |p − xⱼ|) below the node; in f64, so that only its result rounds.
    fn least_bound(&self, node_index: usize, p: DVec3, slope: f64, mut best: f64) -> f64 {
        let node = &self.nodes[node_index];
        let Some(right) = node.right else {
            for point in node.points.clone() {
                let distance = self.centres[point].as_dvec3().distance(p);
                best = best.min(f64::from(self.radii[point]) + slope * distance);
            }
            return best;
        };
        let left = node_index + 1;
        let mut children = [left, right].map(|child| (self.lower_bound(child, p, slope), child));
        if children[1].0 < children[0].0 {
            children.swap(0, 1);
        }
        for (lower_bound, child) in children {
            if lower_bound < best {
                best = self.least_bound(child, p, slope, best);
            }
        }
        best
    }

    fn lower_bound(&self, node_index: usize, p: DVec3, slope: f64) -> f64 {
        let node = &self.nodes[node_index];
        let nearest = p.clamp(node.low.as_dvec3(), node.high.as_dvec3());
        f64::from(node.least_radius) + slope * nearest.distance(p)
    }
}

/// Sorts `order`, whose first entry is the tree's point `first`, into a subtree; appends its nodes, root first.
fn split(balls: &[Ball], order: &mut [u32], first: usize, nodes: &mut Vec<Node>) {
    let centre = |index: u32| balls[index as usize].centre;
    let (low, high) = (order.iter()).fold((Vec3::MAX, Vec3::MIN), |(low, high), &index| {
        (low.min(centre(index)), high.max(centre(index)))
    });
    let node_index = nodes.len();
    nodes.push(Node {
        points: first..first + order.len(),
        low,
        high,
        least_radius: 0.0,
        right: None,
    });
    if order.len() <= LEAF {
        return;
    }
    let axis = (high.as_dvec3() - low.as_dvec3()).max_position();
    let middle = order.len() / 2;
    order.select_nth_unstable_by(middle, |&a, &b| {
        let along = |index| centre(index)[axis];
        along(a).total_cmp(&along(b)).then(a.cmp(&b))
    });
    let (left, right) = order.split_at_mut(middle);
    split(balls, left, first, nodes);
    nodes[node_index].right = Some(nodes.len());
    split(balls, right, first + middle, nodes);
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Balls that repeat, cluster and differ in radius by six powers of ten.
    fn balls(n: usize) -> Vec<Ball> {
        let ball = |i: usize| {
            let part = |k: usize| ((i * k) % 101) as f32 / 101.0;
            Ball {
                centre: Vec3::new(part(37), part(53), part(71)).powf(3.0),
                radius: 10_f32.powf(6.0 * part(29) - 4.0),
            }
        };
        (0..n).map(ball).collect()
    }

    #[test]
    fn branch_and_bound_finds_the_minimum_over_all_pairs() {
        let balls = balls(300);
        for slope in [0.0, 1e-3, 0.5, 1.0, 30.0] {
            let found = clamp(&balls, slope);
            for (ball, found) in balls.iter().zip(found) {
                let bound = |other: &Ball| {
                    let distance = other.centre.as_dvec3().distance(ball.centre.as_dvec3());
                    f64::from(other.radius) + f64::from(slope) * distance
                };
                let expected = balls.iter().map(bound).fold(f64::INFINITY, f64::min);
                // `TOLERANCE`, once for a radius left alone and once for one lowered after rounding, and f32 rounding.
                let error = f64::from(found) / expected - 1.0;
                assert!(error.abs() < 3e-6, "slope {slope}: {found}, {expected}");
            }
        }
    }

    #[test]
    fn no_balls_are_no_radii() {
        assert!(clamp(&[], 1.0).is_empty());
    }
}
