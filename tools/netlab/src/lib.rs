//! A network of any quality on one machine.
