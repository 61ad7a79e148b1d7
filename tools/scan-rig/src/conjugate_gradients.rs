//! Preconditioned conjugate gradients for a vector at every vertex of a mesh.

use glam::DVec3;

/// When it is enough.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Enough {
    /// The residual that may be left, as a share of the right side; both as the preconditioner measures them.
    pub(crate) left: f64,
    /// Steps that are taken at most.
    pub(crate) steps: usize,
}

/// Solves A x = `right`, from the guess that `x` holds; returns the steps taken. A is symmetric and positive definite: `product` writes A
/// times its first argument into its second, and `inverse` is about A's inverse at one vertex alone, applied to a vector. The same
/// arguments give the same result.
pub(crate) fn solve(
    right: &[DVec3],
    x: &mut [DVec3],
    mut product: impl FnMut(&[DVec3], &mut [DVec3]),
    inverse: impl Fn(usize, DVec3) -> DVec3,
    enough: Enough,
) -> usize {
    let scaled = |field: &[DVec3]| -> Vec<DVec3> {
        (field.iter().enumerate())
            .map(|(at, value)| inverse(at, *value))
            .collect()
    };
    let mut image = vec![DVec3::ZERO; right.len()];
    product(x, &mut image);
    let mut residual: Vec<DVec3> = right.iter().zip(&image).map(|(r, i)| *r - *i).collect();
    let mut preconditioned = scaled(&residual);
    let mut direction = preconditioned.clone();
    let mut size = dot(&residual, &preconditioned);
    let goal = dot(right, &scaled(right)) * enough.left * enough.left;
    for step in 0..enough.steps {
        if size <= goal.max(f64::MIN_POSITIVE) {
            return step;
        }
        product(&direction, &mut image);
        let along = size / dot(&direction, &image).max(f64::MIN_POSITIVE);
        for at in 0..x.len() {
            x[at] += along * direction[at];
            residual[at] -= along * image[at];
            preconditioned[at] = inverse(at, residual[at]);
        }
        let next = dot(&residual, &preconditioned);
        let turn = next / size;
        size = next;
        for (direction, preconditioned) in direction.iter_mut().zip(&preconditioned) {
            *direction = *preconditioned + turn * *direction;
        }
    }
    enough.steps
}

fn dot(a: &[DVec3], b: &[DVec3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a.dot(*b)).sum()
}
