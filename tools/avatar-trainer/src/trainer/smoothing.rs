//! Derivatives by the mesh, spread over its surface.
//!
//! Pictures pull at single vertices, and Adam gives each its own stride: the mesh would crumple. Spread over neighbours, derivatives move
//! patches of cloth (as Nicolet, Jacobson and Jakob, "Large Steps in Inverse Rendering of Geometry", 2021, precondition theirs).

use avatar_gradient::Parameters;
use rayon::prelude::*;
use spmm3::Template;

/// Each pass mixes a vertex with its neighbours' mean; so many reach about three edges far.
const PASSES: usize = 10;

/// Which vertices share an edge.
#[derive(Debug)]
pub(super) struct Smoother {
    /// Neighbours of vertex v: `near[starts[v]..starts[v + 1]]`.
    starts: Vec<usize>,
    near: Vec<u32>,
    memory: Vec<f32>,
}

impl Smoother {
    pub(super) fn new(template: &Template) -> Self {
        let count = template.vertices().len();
        let mut edges: Vec<(u32, u32)> = (template.faces().iter())
            .flat_map(|[a, b, c]| [(*a, *b), (*b, *c), (*c, *a)])
            .flat_map(|(a, b)| [(a, b), (b, a)])
            .collect();
        edges.sort_unstable();
        edges.dedup();
        let mut starts = vec![0; count + 1];
        for (a, _) in &edges {
            starts[*a as usize + 1] += 1;
        }
        for v in 0..count {
            starts[v + 1] += starts[v];
        }
        Self {
            starts,
            near: edges.into_iter().map(|(_, b)| b).collect(),
            memory: vec![0.0; count],
        }
    }

    /// Spreads the derivatives by F_mesh's mean offsets and by its fields. In one step a field's are those by the mean times how much of the field the
    /// pose has, so that only the mean's are spread.
    pub(super) fn spread(&mut self, gradients: &mut Parameters) {
        let mean = &gradients.mesh_mean;
        let square = dot(mean, mean);
        let columns = mean.len();
        if square <= 0.0 || columns == 0 {
            return;
        }
        let codes: Vec<f64> = (gradients.mesh_fields)
            .par_chunks_exact(columns)
            .map(|field| dot(field, mean) / square)
            .collect();
        let vertices = columns / 3;
        for plane in gradients.mesh_mean.chunks_exact_mut(vertices) {
            for _ in 0..PASSES {
                self.pass(plane);
            }
        }
        let mean = &gradients.mesh_mean;
        let fields = gradients.mesh_fields.par_chunks_exact_mut(columns);
        fields.zip(codes).for_each(|(field, code)| {
            #[expect(clippy::cast_possible_truncation, reason = "derivatives")]
            let code = code as f32;
            for (number, mean) in field.iter_mut().zip(mean) {
                *number = code * mean;
            }
        });
    }

    fn pass(&mut self, plane: &mut [f32]) {
        self.memory.copy_from_slice(plane);
        let before = &self.memory;
        for (v, number) in plane.iter_mut().enumerate() {
            let near = &self.near[self.starts[v]..self.starts[v + 1]];
            if near.is_empty() {
                continue;
            }
            let sum: f32 = near.iter().map(|other| before[*other as usize]).sum();
            #[expect(clippy::cast_precision_loss, reason = "a vertex has few edges")]
            let mean = sum / near.len() as f32;
            *number = 0.5 * (*number + mean);
        }
    }
}

fn dot(a: &[f32], b: &[f32]) -> f64 {
    let products = a.iter().zip(b).map(|(a, b)| f64::from(*a) * f64::from(*b));
    products.sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use synthetic_person::Puppet;

    #[test]
    fn a_pull_at_one_vertex_becomes_one_at_its_patch_and_fields_follow() {
        let template = Puppet::small().template;
        let vertices = template.vertices().len();
        let mut gradients = Parameters {
            mesh_mean: vec![0.0; 3 * vertices],
            mesh_fields: vec![0.0; 2 * 3 * vertices],
            ..Parameters::default()
        };
        let at = vertices / 2;
        gradients.mesh_mean[at] = 8.0;
        gradients.mesh_fields[3 * vertices + at] = -4.0;
        Smoother::new(&template).spread(&mut gradients);
        let mean = &gradients.mesh_mean;
        assert!(mean[at] < 4.0, "spread");
        assert!(
            mean[..vertices].iter().filter(|x| **x > 0.0).count() > 10,
            "to its neighbours"
        );
        assert!(mean[vertices..].iter().all(|x| *x == 0.0), "along its axis");
        let (first, second) = gradients.mesh_fields.split_at(3 * vertices);
        assert!(
            first.iter().all(|x| *x == 0.0),
            "a field the pose has none of"
        );
        for (field, mean) in second.iter().zip(mean) {
            assert!((field + 0.5 * mean).abs() < 1e-6, "half as much, away");
        }
    }
}
