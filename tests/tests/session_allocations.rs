//! Running the deform graph again and again must not allocate on our side: a lane does so sixty times a second.

use npu_runtime::{Outputs, Provider, Session};
use spmm3::ATTRIBUTES;
use spmm3::networks::GraphParts;
use synthetic_person::{Puppet, Random};
use test_support::allocations::{Counting, allocations};
use test_support::onnx::{runtime, whole_graph};

#[global_allocator]
static COUNTING: Counting = Counting;

#[test]
fn a_run_allocates_nothing_whatever_set_it_writes_into() {
    let Some(runtime) = runtime() else { return };
    let puppet = Puppet::small();
    let gaussians = puppet.gaussians.len();
    let (inputs, outputs) = whole_graph(puppet.template.vertices().len(), gaussians);
    let model = puppet
        .graph()
        .to_onnx(GraphParts::Whole)
        .expect("the networks fit");
    let provider = Provider::Cpu { threads: 1 };
    let mut session = Session::new(&runtime, &model, provider, &inputs, &outputs)
        .expect("ONNX Runtime takes the graph");
    let mut sets: Vec<Outputs> = (0..3)
        .map(|_| session.outputs().expect("memory for them"))
        .collect();
    assert!(sets[0].get(0).is_empty(), "nothing was computed yet");
    let motions: Vec<_> = (0..30).map(|seed| Random::new(seed).motion(0.6)).collect();
    let mut counts = Vec::with_capacity(motions.len());
    for (at, motion) in motions.iter().enumerate() {
        let before = allocations();
        session.input_mut(0).copy_from_slice(motion.values());
        session.run(&mut sets[at % 3]).expect("the graph runs");
        counts.push(allocations() - before);
    }
    assert!(allocations() > motions.len(), "the counter does not count");
    println!("Rust allocations of each run: {counts:?}");
    assert!(
        counts.iter().all(|count| *count == 0),
        "a run allocated: {counts:?}"
    );

    // Sets do not share memory: what one run wrote stays while others are written.
    let kept = sets[0].get(1).to_vec();
    assert_eq!(kept.len(), ATTRIBUTES * gaussians, "the whole output");
    session.run(&mut sets[1]).expect("the graph runs");
    assert!(sets[0].get(1) == kept, "another set's run changed this one");
    assert!(
        sets[1].get(1) != kept,
        "the next motion gives something else"
    );

    // Sets are handed to other threads.
    let moved = sets.swap_remove(0);
    let elsewhere = std::thread::spawn(move || moved.get(1).to_vec());
    assert!(
        elsewhere.join().expect("reading does not panic") == kept,
        "another thread reads the same"
    );
}
