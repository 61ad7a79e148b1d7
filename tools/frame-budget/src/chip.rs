//! What a chip does in a second, and where that is known from.

use crate::estimate::Estimate;

/// The rates of a headset's chip, and what else runs on it.
///
/// An estimate's `likely` is what the model reckons with; `least` and `most` are the slowest and the fastest that is said or was measured on a relative.
#[derive(Debug, Clone, Copy)]
pub struct Chip {
    /// Its name.
    pub name: &'static str,
    /// Clock of the GPU, cycles a millisecond.
    pub gpu_clock: Estimate,
    /// Instructions of waves of 64 that the GPU issues in a cycle, all processors together, as a share of the possible.
    pub issues: Estimate,
    /// Memory, read or written by a stream, bytes a millisecond.
    pub memory: Estimate,
    /// Words of 4 bytes at scattered addresses, of a few megabytes, in a cycle.
    pub scattered: Estimate,
    /// From asking for a word of memory until it is there, ms.
    pub latency: Estimate,
    /// Fragments blended into half floats in tile memory, in a cycle.
    pub blended: Estimate,
    /// How much longer that takes with depth in an attachment of its own.
    pub with_depth: Estimate,
    /// Triangles in a cycle, each of them once to find the tiles it touches and once to draw it.
    pub triangles: Estimate,
    /// How often a vertex is shaded: to find its tiles, and again in each tile it touches.
    pub vertex_runs: Estimate,
    /// From the end of a dispatch to the start of one that waits for it, ms.
    pub barrier: Estimate,
    /// What the system's compositor takes of the GPU for each picture, ms.
    pub compositor: Estimate,
    /// Memory as all of an app's cores together read and write it, bytes a millisecond.
    pub cpu_memory: Estimate,
    /// Weights of networks as the NPU reads them, bytes a millisecond.
    pub npu_weights: Estimate,
    /// What a call of the NPU takes whatever it does, ms.
    pub npu_call: Estimate,
    /// Where each of these is from, in this order.
    pub sources: &'static [(&'static str, &'static str)],
}

/// Meta Quest 3: Snapdragon XR2 Gen 2 with an Adreno 740v3.
pub const QUEST_3: Chip = Chip {
    name: "Meta Quest 3",
    gpu_clock: Estimate::new(456e3, 456e3, 545e3),
    issues: Estimate::new(0.45 * 24.0, 0.8 * 24.0, 0.97 * 24.0),
    memory: Estimate::new(25e6, 33e6, 41e6),
    scattered: Estimate::new(0.2, 1.0, 4.0),
    latency: Estimate::new(0.2e-3, 0.4e-3, 0.9e-3),
    blended: Estimate::new(9.0, 14.0, 24.0),
    with_depth: Estimate::new(1.0, 1.25, 2.0),
    triangles: Estimate::new(1.0, 2.0, 2.0),
    vertex_runs: Estimate::new(2.0, 2.5, 4.0),
    barrier: Estimate::new(0.005, 0.02, 0.05),
    compositor: Estimate::new(0.8, 1.3, 2.5),
    cpu_memory: Estimate::new(8e6, 15e6, 25e6),
    npu_weights: Estimate::new(8e6, 10e6, 20e6),
    npu_call: Estimate::new(0.2, 0.5, 1.5),
    sources: &[
        (
            "GPU clock 456 MHz (to 545)",
            "published: with passthrough, as the app shows people unless a scene is given, Meta caps it at level 2; without, level 4 (545) is usual. The same steps are in Meta's kernel (anorak-gpu.dtsi)",
        ),
        (
            "24 waves of 64 issue in a cycle; 80 % of that is reached (45 to 97)",
            "Mesa (freedreno_devices.py: 6 shader processors), and Qualcomm's 1,536 ALUs of the X1-85, which Mesa gives the same row; the share: clpeak on an X1-45 and an A643, and an Adreno 660's measured third",
        ),
        (
            "memory 33 GB/s (25 to 41)",
            "published peak 51.1 (DDR table of Meta's kernel, 4 x 16 bits); the share was measured on an Adreno 660 with as fast a memory (35 GB/s)",
        ),
        (
            "a scattered word in a cycle (0.2 to 4), also an atomic addition",
            "a guess between an Adreno 660's measured 0.15 in a large picture and caches; nobody has published an atomic's rate",
        ),
        (
            "memory answers in 0.4 us (0.2 to 0.9)",
            "a guess from other Adrenos' caches and memory",
        ),
        (
            "14 fragments blended into half floats in a cycle (9 to 24)",
            "the peak is 48 of 8 bits (X1-85); an Adreno 660's measured blending scaled by its units gives 28; half floats at half rate is a guess",
        ),
        (
            "a second attachment, for depth, makes blending 1.25 times as long (1 to 2)",
            "a guess: it has a quarter of the colours' bytes",
        ),
        (
            "2 triangles in a cycle (1 to 2)",
            "published for the X1-85; Qualcomm's FAQ says 1 for older ones",
        ),
        (
            "a vertex is shaded 2.5 times (2 to 4)",
            "Qualcomm's guides: once to find tiles, once more in each tile that it touches",
        ),
        ("a barrier takes 0.02 ms (0.005 to 0.05)", "a guess"),
        (
            "the compositor takes 1.3 ms (0.8 to 2.5)",
            "Meta's examples of its log for older headsets; not published for this one",
        ),
        (
            "3 cores read and write 15 GB/s (8 to 25)",
            "a guess: Meta's kernel asks for less than the peak for the CPU alone",
        ),
        (
            "the NPU reads weights at 10 GB/s (8 to 20), and a call takes 0.5 ms (0.2 to 1.5)",
            "inferred from SqueezeMe's 5 ms and 0.45 ms for its decoder, and from Qualcomm AI Hub's least times on the same Hexagon (V69)",
        ),
    ],
};
