//! TensorFlow Lite models as ONNX graphs: what the camera's networks need.
