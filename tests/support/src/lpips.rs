//! LPIPS networks as the `lpips` package exports them (Zhang et al., "The Unreasonable Effectiveness of Deep Features as a Perceptual Metric", 2018), with weights
//! of chance: the distance of two pictures' features.

use crate::network::Net;
use onnx_schema::Attribute;

/// A network's features so far.
struct Backbone<'n> {
    net: &'n mut Net,
    rng: fastrand::Rng,
    /// The picture's features at present, and how many they are.
    at: (String, i64),
    /// Those that are compared.
    compared: Vec<(String, i64)>,
}

fn window(side: i64, stride: i64, pad: i64) -> Vec<Attribute> {
    vec![
        Attribute::ints("kernel_shape", &[side; 2]),
        Attribute::ints("strides", &[stride; 2]),
        Attribute::ints("pads", &[pad; 4]),
    ]
}

impl<'n> Backbone<'n> {
    /// Of `picture`, scaled as the networks were trained. Two of the same seed have the same weights.
    fn new(net: &'n mut Net, picture: &str, seed: u64) -> Self {
        let shift = net.floats(&[1, 3, 1, 1], &[-0.030, -0.088, -0.188]);
        let scale = net.floats(&[1, 3, 1, 1], &[0.458, 0.448, 0.450]);
        let shifted = net.node("Sub", &[picture, &shift], &[]);
        let at = net.node("Div", &[&shifted, &scale], &[]);
        Self {
            net,
            rng: fastrand::Rng::with_seed(seed),
            at: (at, 3),
            compared: Vec::new(),
        }
    }

    /// A convolution of `from` and a rectifier.
    fn features(&mut self, from: &(String, i64), outer: i64, moves: [i64; 3]) -> (String, i64) {
        let (picture, inner) = from;
        let [side, stride, pad] = moves;
        #[expect(clippy::cast_precision_loss, reason = "a few thousand")]
        let scale = (6.0 / (inner * side * side) as f32).sqrt();
        let weights = [outer, *inner, side, side];
        let weights = self.net.weights(&weights, scale, &mut self.rng);
        let bias = self.net.weights(&[outer], 0.1, &mut self.rng);
        let moves = window(side, stride, pad);
        let sums = self.net.node("Conv", &[picture, &weights, &bias], &moves);
        (self.net.node("Relu", &[&sums], &[]), outer)
    }

    fn conv(&mut self, outer: i64, moves: [i64; 3]) {
        let from = self.at.clone();
        self.at = self.features(&from, outer, moves);
    }

    fn pool(&mut self, side: i64, ceil: i64) {
        let mut settings = window(side, 2, 0);
        settings.push(Attribute::int("ceil_mode", ceil));
        self.at.0 = self.net.node("MaxPool", &[&self.at.0], &settings);
    }

    /// SqueezeNet's module: few channels, then two convolutions of them side by side.
    fn fire(&mut self, few: i64, each: i64) {
        self.conv(few, [1, 1, 0]);
        let few = self.at.clone();
        let parts = [[1, 1, 0], [3, 1, 1]].map(|moves| self.features(&few, each, moves).0);
        let [one, three] = &parts;
        let joined = self
            .net
            .node("Concat", &[one, three], &[Attribute::int("axis", 1)]);
        self.at = (joined, 2 * each);
    }

    fn compare(&mut self) {
        self.compared.push(self.at.clone());
    }
}

/// The distance of two pictures' features, weighed by chance.
fn distance(net: &mut Net, [a, b]: [&[(String, i64)]; 2], seed: u64) {
    let mut rng = fastrand::Rng::with_seed(seed);
    let mut total: Option<String> = None;
    for ((a, channels), (b, _)) in a.iter().zip(b) {
        let mut unit = |features: &str| {
            let two = net.floats(&[], &[2.0]);
            let squares = net.node("Pow", &[features, &two], &[]);
            let sum = net.reduce("ReduceSum", &squares, &[1], true);
            let norm = net.node("Sqrt", &[&sum], &[]);
            let little = net.floats(&[], &[1e-10]);
            let norm = net.node("Add", &[&norm, &little], &[]);
            net.node("Div", &[features, &norm], &[])
        };
        let (a, b) = (unit(a), unit(b));
        let apart = net.node("Sub", &[&a, &b], &[]);
        let two = net.floats(&[], &[2.0]);
        let squares = net.node("Pow", &[&apart, &two], &[]);
        let count = usize::try_from(*channels).unwrap_or_default();
        let values: Vec<f32> = (0..count).map(|_| rng.f32()).collect();
        let weights = net.floats(&[1, *channels, 1, 1], &values);
        let weighed = net.node("Conv", &[&squares, &weights], &window(1, 1, 0));
        let mean = net.reduce("ReduceMean", &weighed, &[2, 3], true);
        total = Some(match total {
            None => mean,
            Some(total) => net.node("Add", &[&total, &mean], &[]),
        });
    }
    net.output(&total.unwrap_or_default(), &[1, 1, 1, 1]);
}

/// A network that compares the features of two pictures [1, 3, `side`, `side`].
fn network(opset: i64, side: i64, backbone: impl Fn(&mut Backbone<'_>)) -> Net {
    let mut net = Net::new(opset, &[1, 3, side, side]);
    let [a, b] = ["a", "b"].map(|picture| {
        let mut features = Backbone::new(&mut net, picture, 11);
        backbone(&mut features);
        features.compared
    });
    distance(&mut net, [&a, &b], 13);
    net
}

/// The channels of AlexNet's five convolutions.
pub const ALEXNET: [i64; 5] = [64, 192, 384, 256, 256];

/// AlexNet's LPIPS with its windows and these channels.
#[must_use]
pub fn alexnet(opset: i64, side: i64, channels: [i64; 5]) -> Net {
    network(opset, side, |features| {
        let moves = [[11, 4, 2], [5, 1, 2], [3, 1, 1], [3, 1, 1], [3, 1, 1]];
        for (at, (channels, moves)) in channels.into_iter().zip(moves).enumerate() {
            if at == 1 || at == 2 {
                features.pool(3, 0);
            }
            features.conv(channels, moves);
            features.compare();
        }
    })
}

/// VGG16's LPIPS: convolutions of 3 x 3 in five groups, of these channels.
#[must_use]
pub fn vgg(opset: i64, side: i64, channels: [i64; 5]) -> Net {
    network(opset, side, |features| {
        for (at, (channels, count)) in channels.into_iter().zip([2, 2, 3, 3, 3]).enumerate() {
            if at > 0 {
                features.pool(2, 0);
            }
            for _ in 0..count {
                features.conv(channels, [3, 1, 1]);
            }
            features.compare();
        }
    })
}

/// SqueezeNet's LPIPS, its channels divided by `thinner`.
#[must_use]
pub fn squeezenet(opset: i64, side: i64, thinner: i64) -> Net {
    network(opset, side, |features| {
        features.conv(64 / thinner, [3, 2, 0]);
        features.compare();
        features.pool(3, 1);
        let fires = [
            (16, 64),
            (16, 64),
            (32, 128),
            (32, 128),
            (48, 192),
            (48, 192),
            (64, 256),
            (64, 256),
        ];
        for (at, (few, each)) in fires.into_iter().enumerate() {
            if at == 2 || at == 4 {
                features.pool(3, 1);
            }
            features.fire(few / thinner, each / thinner);
            if [1, 3, 4, 5, 6, 7].contains(&at) {
                features.compare();
            }
        }
    })
}
