//! The lanes at work on a puppet: what is shown, what fails on the way, what is allocated.

mod compiled;
mod costly;
mod faults;
mod headset;
mod overload;
mod people;
mod pictures;
mod placing;
mod pose_range;
mod slow;
mod stage;
mod steady;

use test_support::allocations::Counting;

#[global_allocator]
static COUNTING: Counting = Counting;
