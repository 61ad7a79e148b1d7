//! Scans of people who do not exist, whose joints are known: for tests and for `eval rig`.
