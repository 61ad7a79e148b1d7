//! `renderer-openxr` on a real runtime: Monado on the machine's Vulkan, started by each test for itself. The program under
//! test is `headset-frames`, a process of its own, because a runtime is found by the environment.

mod hands;
mod lenses;
mod life;
mod losses;
mod missing;
mod pace;
mod pictures;
mod program;
mod stereo;
mod studio;
mod wearer;
