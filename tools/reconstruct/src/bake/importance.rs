//! The order of importance: which Gaussians a slow device may leave out at the least cost to the picture.
//!
//! Greedy thinning, as Garland and Heckbert (1997) decimate meshes, but by clusters: every Gaussian is its own cluster at
//! first; each step removes the one whose cluster another takes over at the least cost: how far the cluster's colours
//! and places then are from the Gaussian that replaces them. So even cloth is thinned evenly and first, while
//! brows, lips and seams stay. The weights were chosen by pictures (`examples/importance.rs` of the command). The growth
//! of the kept ones is not decided here ([`spmm3::Importance::level`]).

use glam::{Vec3, Vec3A};
use spmm3::{
    BoundGaussians, GaussianSet, Importance, PersonError, PlanarVertices, SH_C0, Template,
};
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// The nearest Gaussians, which may take over a removed one's place at first; later also those of the ones it took over.
const NEIGHBOURS: usize = 10;

/// Weights of what the eye notices more.
#[derive(Debug, Clone, Copy)]
pub struct Weights {
    /// Exponent of a Gaussian's area in its weight: 1 values equal areas equally, 0 equal numbers, so that what the bake
    /// made fine on purpose (the face) stays finer.
    pub area: f64,
    /// Cost of a place one spacing away, relative to a colour wrong by all of one channel (squared both).
    pub place: f64,
    /// Cost of a normal turned by a right angle, in the same terms.
    pub normal: f64,
}

impl Default for Weights {
    fn default() -> Self {
        Self {
            area: 0.3,
            place: 0.0001,
            normal: 0.02,
        }
    }
}

/// The order of importance of `gaussians`, the same for the same input whatever the number of threads.
///
/// # Errors
/// If the Gaussians are not bound to `template`.
pub fn importance(
    template: &Template,
    gaussians: &BoundGaussians,
    weights: Weights,
) -> Result<Importance, PersonError> {
    let planes: Vec<f32> = (0..3)
        .flat_map(|axis| template.vertices().iter().map(move |v| v[axis]))
        .collect();
    let posed = PlanarVertices::new(&planes, template.vertices().len())?;
    let mut set = GaussianSet::zeroed(gaussians.len());
    gaussians.pose(posed, None, Vec3::ZERO, &mut set)?;
    let (order, heirs) = Thinning::new(&set, weights).run();
    Importance::new(order, Some(heirs), set.len())
}

/// A Gaussian's data for the thinning.
struct Point {
    place: [f64; 3],
    colour: [f64; 3],
    normal: [f64; 3],
}

/// Weighted moments of the points of one cluster, enough to tell their squared distance to any point.
#[derive(Clone, Default)]
struct Moments {
    weight: f64,
    /// Colour, then normal.
    first: [f64; 6],
    second: f64,
    place_weight: f64,
    place_first: [f64; 3],
    place_second: f64,
}

impl Moments {
    fn of(point: &Point, weight: f64, spacing: f64, weights: &Weights) -> Self {
        let features = point.features(weights);
        let place_weight = weight * weights.place / (spacing * spacing);
        Self {
            weight,
            first: features.map(|f| f * weight),
            second: weight * dot(&features, &features),
            place_weight,
            place_first: point.place.map(|x| x * place_weight),
            place_second: place_weight * dot(&point.place, &point.place),
        }
    }

    fn add(&mut self, other: &Self) {
        self.weight += other.weight;
        self.second += other.second;
        self.place_weight += other.place_weight;
        self.place_second += other.place_second;
        for (a, b) in self.first.iter_mut().zip(other.first) {
            *a += b;
        }
        for (a, b) in self.place_first.iter_mut().zip(other.place_first) {
            *a += b;
        }
    }

    /// Summed weighted squared distance of the cluster to a point that replaces it.
    fn cost(&self, point: &Point, weights: &Weights) -> f64 {
        let features = point.features(weights);
        self.second - 2.0 * dot(&self.first, &features)
            + self.weight * dot(&features, &features)
            + self.place_second
            - 2.0 * dot(&self.place_first, &point.place)
            + self.place_weight * dot(&point.place, &point.place)
    }
}

impl Point {
    fn features(&self, weights: &Weights) -> [f64; 6] {
        let ([r, g, b], [x, y, z]) = (self.colour, self.normal);
        let n = (weights.normal * 0.5).sqrt();
        [r, g, b, x * n, y * n, z * n]
    }
}

fn dot<const N: usize>(a: &[f64; N], b: &[f64; N]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

struct Thinning {
    weights: Weights,
    points: Vec<Point>,
    moments: Vec<Moments>,
    neighbours: Vec<Vec<u32>>,
    /// What it costs at present to leave out each, as [`sortable`] has it, and the neighbour that takes over: other entries of the queue
    /// are void.
    best: Vec<(u64, u32)>,
    gone: Vec<bool>,
    queue: BinaryHeap<Reverse<(u64, u32, u32)>>,
}

impl Thinning {
    fn new(set: &GaussianSet, weights: Weights) -> Self {
        let count = set.len();
        let mut areas = Vec::with_capacity(count);
        let mut points = Vec::with_capacity(count);
        for i in 0..count {
            let scales = set.log_scales[i].exp();
            let thin = scales.min_position();
            areas.push(f64::from(scales.element_product() / scales[thin]));
            let axis = [Vec3::X, Vec3::Y, Vec3::Z][thin];
            let colour = set.colours[i] * SH_C0 + 0.5;
            points.push(Point {
                place: set.positions[i].to_array().map(f64::from),
                colour: colour.to_array().map(f64::from),
                normal: (set.rotations[i] * axis).to_array().map(f64::from),
            });
        }
        let mean = areas.iter().sum::<f64>() / count.max(1) as f64;
        let moments = (0..count)
            .map(|i| {
                let opacity = 1.0 / (1.0 + f64::from(-set.opacity_logits[i]).exp());
                let weight = opacity * (areas[i] / mean).powf(weights.area);
                Moments::of(&points[i], weight, areas[i].sqrt(), &weights)
            })
            .collect();
        let places: Vec<Vec3A> = set.positions.iter().map(|p| Vec3A::from(*p)).collect();
        Self {
            weights,
            neighbours: mutual_neighbours(&places),
            points,
            moments,
            best: vec![(0, 0); count],
            gone: vec![false; count],
            queue: BinaryHeap::with_capacity(4 * count),
        }
    }

    /// Gaussians from the most important to the least, and each one's heir (itself for the last).
    fn run(mut self) -> (Vec<u32>, Vec<u32>) {
        let count = self.points.len();
        let mut heirs: Vec<u32> = (0u32..).take(count).collect();
        for i in (0u32..).take(count) {
            self.enqueue(i);
        }
        let mut order = Vec::with_capacity(count);
        while let Some(Reverse((cost, i, heir))) = self.queue.pop() {
            let at = i as usize;
            if self.gone[at] || self.best[at] != (cost, heir) {
                continue;
            }
            self.gone[at] = true;
            order.push(i);
            heirs[at] = heir;
            let orphans = std::mem::take(&mut self.neighbours[at]);
            if heir == i {
                continue;
            }
            let moments = std::mem::take(&mut self.moments[at]);
            self.moments[heir as usize].add(&moments);
            for orphan in orphans {
                if self.gone[orphan as usize] {
                    continue;
                }
                if orphan != heir {
                    link(&mut self.neighbours, orphan, heir);
                }
                let near = &mut self.neighbours[orphan as usize];
                if let Some(place) = near.iter().position(|n| *n == i) {
                    near.swap_remove(place);
                }
                if orphan == heir || self.best[orphan as usize].1 == i {
                    self.enqueue(orphan);
                } else {
                    // Its cluster is what it was, and all that is new around it is the heir.
                    self.offer(orphan, heir);
                }
            }
        }
        order.reverse();
        (order, heirs)
    }

    /// Queues what it costs to leave out `i`, by the neighbour that takes over its place best.
    fn enqueue(&mut self, i: u32) {
        let at = i as usize;
        let now = self.moments[at].cost(&self.points[at], &self.weights);
        let best = (self.neighbours[at].iter())
            .map(|heir| (self.takeover(at, *heir, now), *heir))
            .min();
        // It has no neighbour: leaving it out leaves a hole.
        self.queued(i, best.unwrap_or((sortable(f64::MAX), i)));
    }

    /// Queues `i` anew if this neighbour takes over its place better than the one that was found.
    fn offer(&mut self, i: u32, heir: u32) {
        let at = i as usize;
        let now = self.moments[at].cost(&self.points[at], &self.weights);
        let offered = (self.takeover(at, heir, now), heir);
        if offered < self.best[at] {
            self.queued(i, offered);
        }
    }

    /// What it costs that `heir` takes over the cluster at `at`, whose present cost is `now`.
    fn takeover(&self, at: usize, heir: u32, now: f64) -> u64 {
        let cost = self.moments[at].cost(&self.points[heir as usize], &self.weights);
        sortable(cost - now)
    }

    fn queued(&mut self, i: u32, best: (u64, u32)) {
        self.best[i as usize] = best;
        self.queue.push(Reverse((best.0, i, best.1)));
    }
}

fn link(neighbours: &mut [Vec<u32>], a: u32, b: u32) {
    for (a, b) in [(a, b), (b, a)] {
        let list = &mut neighbours[a as usize];
        if !list.contains(&b) {
            list.push(b);
        }
    }
}

/// Orders as the number does; costs that rounding made negative count as zero.
fn sortable(cost: f64) -> u64 {
    cost.max(0.0).to_bits()
}

/// Each point's nearest, and those it is among the nearest of.
fn mutual_neighbours(places: &[Vec3A]) -> Vec<Vec<u32>> {
    use rayon::prelude::*;
    let grid = Grid::new(places);
    let nearest: Vec<Vec<u32>> = places
        .par_iter()
        .enumerate()
        .map(|(i, _)| grid.nearest(places, i))
        .collect();
    let mut all = vec![Vec::new(); places.len()];
    for (i, near) in (0u32..).zip(&nearest) {
        for other in near {
            link(&mut all, i, *other);
        }
    }
    all
}

/// Points by cells of a regular grid, sorted by cell.
struct Grid {
    cell: f32,
    /// Cell of each point and its index, ascending.
    sorted: Vec<([i32; 3], u32)>,
}

impl Grid {
    fn new(places: &[Vec3A]) -> Self {
        let low = places.iter().copied().fold(Vec3A::INFINITY, Vec3A::min);
        let high = places.iter().copied().fold(Vec3A::NEG_INFINITY, Vec3A::max);
        let size = (high - low).max(Vec3A::splat(1e-6));
        let surface = size.x * size.y + size.y * size.z + size.z * size.x;
        let cell = (surface * 8.0 / places.len().max(1) as f32)
            .sqrt()
            .max(1e-6);
        let mut sorted: Vec<([i32; 3], u32)> = places
            .iter()
            .zip(0u32..)
            .map(|(p, i)| (Self::cell_of(*p, cell), i))
            .collect();
        sorted.sort_unstable();
        Self { cell, sorted }
    }

    fn cell_of(place: Vec3A, cell: f32) -> [i32; 3] {
        #[allow(clippy::cast_possible_truncation, reason = "a person is small")]
        let index = |x: f32| (x / cell).floor() as i32;
        [index(place.x), index(place.y), index(place.z)]
    }

    fn nearest(&self, places: &[Vec3A], i: usize) -> Vec<u32> {
        let place = places[i];
        let centre = Self::cell_of(place, self.cell);
        let mut found: Vec<(f32, u32)> = Vec::new();
        for reach in [1, 2, 4] {
            found.clear();
            for x in centre[0] - reach..=centre[0] + reach {
                for y in centre[1] - reach..=centre[1] + reach {
                    let from = [x, y, centre[2] - reach];
                    let to = [x, y, centre[2] + reach];
                    let start = self.sorted.partition_point(|(c, _)| *c < from);
                    let row = self.sorted[start..].iter().take_while(|(c, _)| *c <= to);
                    found.extend(
                        row.filter(|(_, j)| *j as usize != i)
                            .map(|(_, j)| (place.distance_squared(places[*j as usize]), *j)),
                    );
                }
            }
            if found.len() >= NEIGHBOURS {
                break;
            }
        }
        found.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        found.truncate(NEIGHBOURS);
        found.into_iter().map(|(_, j)| j).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Quat;

    /// A flat cloth of 40 x 40 Gaussians of one colour, with a dark dot in every fourth row and column of its middle.
    fn cloth() -> (GaussianSet, Vec<u32>) {
        let mut set = GaussianSet::zeroed(1600);
        let mut dots = Vec::new();
        for i in 0u32..1600 {
            let (x, y, at) = (i % 40, i / 40, i as usize);
            set.positions[at] = Vec3::new(x as f32, y as f32, 0.0) * 0.01;
            set.rotations[at] = Quat::IDENTITY;
            set.log_scales[at] = Vec3::new(0.0066, 0.0066, 0.001).map(f32::ln);
            set.opacity_logits[at] = 4.0;
            let dot = (12..28).contains(&x.min(y)) && x.max(y) < 28 && x % 4 == 0 && y % 4 == 0;
            set.colours[at] = Vec3::splat(if dot { -1.5 } else { 0.5 });
            dots.extend(dot.then_some(i));
        }
        (set, dots)
    }

    fn first(order: &[u32], share: f64) -> &[u32] {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a share of a count is one"
        )]
        let count = (order.len() as f64 * share) as usize;
        &order[..count]
    }

    #[test]
    fn even_cloth_goes_first_and_a_pattern_stays() {
        let (set, dots) = cloth();
        assert_eq!(dots.len(), 16, "the dots");
        let (order, _) = Thinning::new(&set, Weights::default()).run();
        let kept = first(&order, 0.35);
        for dot in dots {
            assert!(kept.contains(&dot), "the dot {dot} went");
        }
    }

    #[test]
    fn even_cloth_is_thinned_evenly() {
        let (set, _) = cloth();
        let (order, _) = Thinning::new(&set, Weights::default()).run();
        let kept = first(&order, 0.35);
        for place in &set.positions {
            let distances = kept
                .iter()
                .map(|k| set.positions[*k as usize].distance(*place));
            let nearest = distances.fold(f32::INFINITY, f32::min);
            assert!(
                nearest < 0.025,
                "a hole about {place}: {nearest} m to the nearest kept"
            );
        }
    }

    #[test]
    fn every_gaussian_is_listed_once_and_its_heir_is_more_important() {
        let (mut set, _) = cloth();
        // Two in one place, and one far from all others.
        set.positions[7] = set.positions[8];
        set.positions[9] = Vec3::splat(5.0);
        let (order, heirs) = Thinning::new(&set, Weights::default()).run();
        let mut rank = vec![usize::MAX; set.len()];
        for (k, i) in order.iter().enumerate() {
            rank[*i as usize] = k;
        }
        assert!(rank.iter().all(|r| *r < set.len()), "a permutation");
        for (i, heir) in heirs.iter().enumerate() {
            let is_last = *heir as usize == i;
            assert!(is_last || rank[*heir as usize] < rank[i], "{i} to {heir}");
        }
    }

    #[test]
    fn nearest_neighbours_are_those_of_a_search_through_all() {
        let mut random = fastrand::Rng::with_seed(5);
        let places: Vec<Vec3A> = (0..600)
            .map(|_| {
                Vec3A::new(
                    random.f32(),
                    random.f32() * 0.6,
                    (random.f32() * 9.0).floor() * 0.01,
                )
            })
            .collect();
        let grid = Grid::new(&places);
        let mut missed = 0;
        for i in 0..places.len() {
            let mut all: Vec<(f32, u32)> = (0u32..600)
                .filter(|j| *j as usize != i)
                .map(|j| (places[i].distance_squared(places[j as usize]), j))
                .collect();
            all.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
            let found = grid.nearest(&places, i);
            missed += all
                .iter()
                .take(NEIGHBOURS)
                .filter(|(_, j)| !found.contains(j))
                .count();
        }
        // The search stops at the cells that hold enough: one beyond may be a little nearer.
        assert!(missed < 60, "{missed} of 6000 are not among the nearest");
    }
}
