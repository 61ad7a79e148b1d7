//! Gradients as ONNX Runtime computes them, against finite differences of a reference in f64.

mod hostile;
mod networks;
mod operators;
mod reference;
mod tried;
