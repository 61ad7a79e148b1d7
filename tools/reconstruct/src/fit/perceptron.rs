//! A perceptron with two hidden SiLU layers, trained by Adam on a few hundred samples in seconds.
//!
//! Matrices are column-major `[outputs, inputs]`, which is the graph's row-major `[inputs, outputs]` in memory. Samples are
//! columns. One thread: the sums' order, and so the weights, do not depend on the machine's load.

use super::linear;
use nalgebra::DMatrix;

/// How to train.
#[derive(Debug, Clone, Copy)]
pub struct Training {
    /// Passes over all samples.
    pub epochs: usize,
    /// Samples a step looks at.
    pub batch: usize,
    /// First learning rate; falls to nothing along a cosine.
    pub rate: f32,
    /// Weight decay per step, relative to the learning rate (`AdamW`).
    pub decay: f32,
    /// Ridge strength of the closed-form last layer.
    pub ridge: f64,
}

/// in -> hidden -> hidden -> out, SiLU between.
#[derive(Debug, Clone)]
pub struct Perceptron {
    /// Weights `[outputs, inputs]` of the three layers.
    pub weights: [DMatrix<f32>; 3],
    /// Biases `[outputs, 1]`.
    pub biases: [DMatrix<f32>; 3],
}

/// x * sigmoid(x).
#[must_use]
pub fn silu(x: f32) -> f32 {
    x / (1.0 + (-x).exp())
}

fn silu_slope(x: f32) -> f32 {
    let gate = 1.0 / (1.0 + (-x).exp());
    gate * (1.0 + x * (1.0 - gate))
}

impl Perceptron {
    /// Random weights: each unit of the first layer looks at a few inputs of `groups` (joints) only, so that what a
    /// unit learns of one limb does not change with another.
    #[must_use]
    pub fn random(
        inputs: usize,
        hidden: usize,
        outputs: usize,
        groups: &[Vec<usize>],
        rng: &mut fastrand::Rng,
    ) -> Self {
        let mut first = DMatrix::zeros(hidden, inputs);
        for unit in 0..hidden {
            for _ in 0..rng.usize(1..4).min(groups.len()) {
                let group = &groups[rng.usize(0..groups.len())];
                for input in group {
                    first[(unit, *input)] = (rng.f32() - 0.5) * 3.0;
                }
            }
        }
        let spread = (6.0 / hidden as f32).sqrt();
        let second = DMatrix::from_fn(hidden, hidden, |_, _| (rng.f32() - 0.5) * 2.0 * spread);
        let bias =
            |rng: &mut fastrand::Rng| DMatrix::from_fn(hidden, 1, |_, _| (rng.f32() - 0.5) * 1.5);
        let (b1, b2) = (bias(rng), bias(rng));
        Self {
            weights: [first, second, DMatrix::zeros(outputs, hidden)],
            biases: [b1, b2, DMatrix::zeros(outputs, 1)],
        }
    }

    /// Outputs of the second hidden layer, `[hidden, samples]`.
    #[must_use]
    pub fn features(&self, inputs: &DMatrix<f32>) -> DMatrix<f32> {
        let first = affine(&self.weights[0], inputs, &self.biases[0]).map(silu);
        affine(&self.weights[1], &first, &self.biases[1]).map(silu)
    }

    /// Minimises the mean squared error to `targets` `[outputs, samples]`, each output in the unit that its errors are
    /// measured in, then solves the last layer in closed form.
    pub fn train(
        &mut self,
        inputs: &DMatrix<f32>,
        targets: &DMatrix<f32>,
        how: Training,
        rng: &mut fastrand::Rng,
        mut done: impl FnMut(),
    ) {
        self.solve_last(inputs, targets, how.ridge);
        let mut adam: Vec<Adam> = self
            .weights
            .iter()
            .chain(&self.biases)
            .map(|w| Adam::new(w.shape()))
            .collect();
        let samples = inputs.ncols();
        let mut order: Vec<usize> = (0..samples).collect();
        let steps = how.epochs * samples.div_ceil(how.batch);
        let mut step = 0usize;
        for _ in 0..how.epochs {
            rng.shuffle(&mut order);
            for batch in order.chunks(how.batch) {
                step += 1;
                let progress = step as f32 / steps.max(1) as f32;
                let rate = how.rate * 0.5 * (1.0 + (std::f32::consts::PI * progress).cos());
                let gradients = self.gradients(
                    &inputs.select_columns(batch),
                    &targets.select_columns(batch),
                );
                let parameters = self.weights.iter_mut().chain(&mut self.biases);
                for (k, ((parameter, gradient), adam)) in
                    parameters.zip(gradients).zip(&mut adam).enumerate()
                {
                    let decay = if k < 3 { how.decay } else { 0.0 };
                    adam.step(parameter, &gradient, rate, decay, step);
                }
            }
            done();
        }
        self.solve_last(inputs, targets, how.ridge);
    }

    /// Ridge regression of the last layer on the second layer's features.
    pub fn solve_last(&mut self, inputs: &DMatrix<f32>, targets: &DMatrix<f32>, lambda: f64) {
        let features = self.features(inputs);
        let (hidden, samples) = features.shape();
        let design = DMatrix::from_fn(samples, hidden + 1, |n, k| {
            if k < hidden {
                f64::from(features[(k, n)])
            } else {
                1.0
            }
        });
        let solved = linear::ridge(
            &design,
            &targets.transpose().cast::<f64>(),
            lambda,
            Some(hidden),
        );
        let solved = solved.transpose().cast::<f32>();
        self.weights[2] = solved.columns(0, hidden).into_owned();
        self.biases[2] = solved.columns(hidden, 1).into_owned();
    }

    /// Outputs, `[outputs, samples]`.
    #[must_use]
    pub fn run(&self, inputs: &DMatrix<f32>) -> DMatrix<f32> {
        affine(&self.weights[2], &self.features(inputs), &self.biases[2])
    }

    fn gradients(&self, inputs: &DMatrix<f32>, targets: &DMatrix<f32>) -> [DMatrix<f32>; 6] {
        let z1 = affine(&self.weights[0], inputs, &self.biases[0]);
        let h1 = z1.map(silu);
        let z2 = affine(&self.weights[1], &h1, &self.biases[1]);
        let h2 = z2.map(silu);
        let mut d3 = affine(&self.weights[2], &h2, &self.biases[2]) - targets;
        d3 /= inputs.ncols() as f32;
        let d2 = (self.weights[2].transpose() * &d3).zip_map(&z2, |d, z| d * silu_slope(z));
        let d1 = (self.weights[1].transpose() * &d2).zip_map(&z1, |d, z| d * silu_slope(z));
        let sum =
            |d: &DMatrix<f32>| DMatrix::from_column_slice(d.nrows(), 1, d.column_sum().as_slice());
        [
            &d1 * inputs.transpose(),
            &d2 * h1.transpose(),
            &d3 * h2.transpose(),
            sum(&d1),
            sum(&d2),
            sum(&d3),
        ]
    }
}

fn affine(weights: &DMatrix<f32>, inputs: &DMatrix<f32>, bias: &DMatrix<f32>) -> DMatrix<f32> {
    let mut out = weights * inputs;
    for mut column in out.column_iter_mut() {
        column += bias.column(0);
    }
    out
}

/// Adam's running moments of one parameter matrix (Kingma and Ba 2015).
struct Adam {
    first: DMatrix<f32>,
    second: DMatrix<f32>,
}

impl Adam {
    fn new((rows, columns): (usize, usize)) -> Self {
        Self {
            first: DMatrix::zeros(rows, columns),
            second: DMatrix::zeros(rows, columns),
        }
    }

    fn step(
        &mut self,
        parameter: &mut DMatrix<f32>,
        gradient: &DMatrix<f32>,
        rate: f32,
        decay: f32,
        step: usize,
    ) {
        const KEEP: (f32, f32) = (0.9, 0.99);
        let count = i32::try_from(step).unwrap_or(i32::MAX);
        let (fix1, fix2) = (1.0 - KEEP.0.powi(count), 1.0 - KEEP.1.powi(count));
        let moments = self.first.iter_mut().zip(self.second.iter_mut());
        for ((p, g), (m, v)) in parameter.iter_mut().zip(gradient.iter()).zip(moments) {
            *m = KEEP.0 * *m + (1.0 - KEEP.0) * g;
            *v = KEEP.1 * *v + (1.0 - KEEP.1) * g * g;
            *p -= rate * ((*m / fix1) / ((*v / fix2).sqrt() + 1e-8) + decay * *p);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn toy() -> (Perceptron, DMatrix<f32>, DMatrix<f32>) {
        let mut rng = fastrand::Rng::with_seed(5);
        let inputs = DMatrix::from_fn(4, 80, |_, _| rng.f32() * 2.0 - 1.0);
        let targets = DMatrix::from_fn(2, 80, |k, n| {
            if k == 0 {
                inputs[(0, n)] * inputs[(1, n)]
            } else {
                inputs[(2, n)].sin()
            }
        });
        let groups: Vec<Vec<usize>> = (0..4).map(|k| vec![k]).collect();
        (
            Perceptron::random(4, 16, 2, &groups, &mut rng),
            inputs,
            targets,
        )
    }

    #[test]
    fn gradients_are_finite_differences() {
        let (mut net, inputs, targets) = toy();
        net.solve_last(&inputs, &targets, 1e-3);
        let loss = |net: &Perceptron| {
            let error = (net.run(&inputs) - &targets).cast::<f64>();
            error.norm_squared() / 2.0 / 80.0
        };
        let gradients = net.gradients(&inputs, &targets);
        for (layer, gradient) in gradients.iter().take(3).enumerate() {
            for at in [(0, 0), (1, 2)] {
                let (mut up, mut down) = (net.clone(), net.clone());
                up.weights[layer][at] += 1e-2;
                down.weights[layer][at] -= 1e-2;
                let slope = (loss(&up) - loss(&down)) / 2e-2;
                let analytic = f64::from(gradient[at]);
                assert!(
                    (slope - analytic).abs() < 1e-3 + 0.02 * slope.abs(),
                    "{slope} against {analytic}"
                );
            }
        }
    }

    #[test]
    fn training_learns_a_product_of_inputs() {
        let (mut net, inputs, targets) = toy();
        let how = Training {
            epochs: 200,
            batch: 20,
            rate: 5e-3,
            decay: 0.0,
            ridge: 1e-6,
        };
        net.train(
            &inputs,
            &targets,
            how,
            &mut fastrand::Rng::with_seed(1),
            || {},
        );
        let error = (net.run(&inputs) - &targets).norm() / targets.norm();
        assert!(error < 0.05, "relative error {error}");
    }
}
