#!/usr/bin/env python3
"""Writes reference/NAME.bin, and operators.tflite: what LiteRT (Google's runtime of TensorFlow Lite) computes from a picture, which litert.rs makes as well. For
face_landmark_with_attention, whose custom operators LiteRT lacks, what MediaPipe computes.

    pip install ai-edge-litert==2.3.0 mediapipe==0.10.21
    ./run setup
    MON3TR_NETWORKS=.cache/networks python3 tools/tflite-to-onnx/tests/reference.py

A file holds, little-endian: the number of outputs (u32); of each, its length and step (u32), its least and largest value (f32), and every
step-th value (f32), from the first."""

import os
import struct
from pathlib import Path

import numpy as np
import operators

# Name, side of the picture, whether its values are -1 to 1, instead of 0 to 1.
NETWORKS = [
    ("pose_detection", 224, True),
    ("pose_landmark_full", 256, False),
    ("pose_landmark_heavy", 256, False),
    ("hand_recrop", 256, False),
    ("hand_landmark_full", 224, False),
    ("hand_landmark_lite", 224, False),
    ("palm_detection_full", 192, False),
    ("face_detection_short_range", 128, True),
    ("face_landmark_with_attention", 192, False),
    ("operators", 16, False),
]
# Most values that are kept of an output, if a network has few of them or many.
SAMPLES, SAMPLES_OF_MANY = 500, 100


def picture(side):
    """Smooth noise: bytes on a grid of 9 x 9, by a linear congruential generator, and between them bilinear, in integers."""
    state, grid = 1, np.zeros((9, 9, 3), np.int64)
    for k in range(grid.size):
        state = (state * 1664525 + 1013904223) % 2**32
        grid.flat[k] = state >> 24
    at = np.arange(side) * 2048 // side
    cell, part = at // 256, at % 256
    below = grid[cell] * (256 - part)[:, None, None] + grid[cell + 1] * part[:, None, None]
    across = below[:, cell] * (256 - part)[:, None] + below[:, cell + 1] * part[:, None]
    return (across // 65536).astype(np.uint8)


def by_litert(file, values):
    from ai_edge_litert.interpreter import Interpreter

    interpreter = Interpreter(str(file))
    interpreter.allocate_tensors()
    interpreter.set_tensor(interpreter.get_input_details()[0]["index"], values[None])
    interpreter.invoke()
    return [interpreter.get_tensor(one["index"]).reshape(-1) for one in interpreter.get_output_details()]


def by_mediapipe(file, bytes_, outputs=7):
    """The network alone, on the whole picture, in a graph of MediaPipe's calculators."""
    import mediapipe
    from mediapipe.python import packet_creator, packet_getter
    from mediapipe.python._framework_bindings import calculator_graph, image_frame, resource_util

    side = bytes_.shape[0]
    streams = " ".join(f'output_stream: "s{k}"' for k in range(outputs))
    ranges = " ".join(f"ranges {{ begin: {k} end: {k + 1} }}" for k in range(outputs))
    config = f"""
        input_stream: "image"
        node {{ calculator: "TfLiteCustomOpResolverCalculator" output_side_packet: "OP_RESOLVER:ops" }}
        node {{
            calculator: "ImageToTensorCalculator" input_stream: "IMAGE:image" output_stream: "TENSORS:in"
            options {{ [mediapipe.ImageToTensorCalculatorOptions.ext] {{
                output_tensor_width: {side} output_tensor_height: {side} output_tensor_float_range {{ min: 0 max: 1 }} }} }}
        }}
        node {{
            calculator: "InferenceCalculator" input_stream: "TENSORS:in" output_stream: "TENSORS:out" input_side_packet: "OP_RESOLVER:ops"
            options {{ [mediapipe.InferenceCalculatorOptions.ext] {{ model_path: "{file.name}" delegate {{ xnnpack {{}} }} }} }}
        }}
        node {{
            calculator: "SplitTensorVectorCalculator" input_stream: "out" {streams}
            options {{ [mediapipe.SplitVectorCalculatorOptions.ext] {{ {ranges} }} }}
        }}
    """
    for k in range(outputs):
        config += f'node {{ calculator: "TensorsToFloatsCalculator" input_stream: "TENSORS:s{k}" output_stream: "FLOATS:f{k}" }}\n'
    resource_util.set_resource_dir(str(file.parent.resolve()))
    graph = calculator_graph.CalculatorGraph(graph_config=config)
    found = [None] * outputs

    def keep(k):
        def observe(_, packet):
            found[k] = np.array(packet_getter.get_float_list(packet), np.float32)

        return observe

    for k in range(outputs):
        graph.observe_output_stream(f"f{k}", keep(k))
    graph.start_run()
    packet = packet_creator.create_image_frame(image_format=image_frame.ImageFormat.SRGB, data=bytes_)
    graph.add_packet_to_input_stream("image", packet.at(0))
    graph.close_all_packet_sources()
    graph.wait_until_done()
    return found


def write(file, outputs):
    parts = [struct.pack("<I", len(outputs))]
    for values in outputs:
        # Odd, so that it does not walk along one channel of an even number.
        step = max(1, len(values) // (SAMPLES if len(outputs) < 10 else SAMPLES_OF_MANY)) | 1
        parts.append(struct.pack("<IIff", len(values), step, values.min(), values.max()))
        parts.append(values[::step].astype("<f4").tobytes())
    file.write_bytes(b"".join(parts))
    print(file.name, file.stat().st_size, [len(values) for values in outputs], [(float(v.min()), float(v.max())) for v in outputs])


def main():
    folder = Path(os.environ["MON3TR_NETWORKS"])
    here = Path(__file__).parent / "reference"
    here.mkdir(exist_ok=True)
    operators.write(here / "operators.tflite")
    for name, side, signed in NETWORKS:
        file, bytes_ = (here if name == "operators" else folder) / f"{name}.tflite", picture(side)
        if name == "face_landmark_with_attention":
            outputs = by_mediapipe(file, bytes_)
        else:
            values = bytes_.astype(np.float32) / np.float32(127.5) - np.float32(1) if signed else bytes_.astype(np.float32) / np.float32(255)
            outputs = by_litert(file, values)
        write(here / f"{name}.bin", outputs)


main()
