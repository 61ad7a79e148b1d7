#!/usr/bin/env python3
"""Writes reference/operators.tflite: a network of a picture of 16 x 16 pixels whose outputs are one operator each, in the forms that the
fetched networks do not have. reference.py calls it."""

import flatbuffers
import numpy as np
from ai_edge_litert import schema_py_generated as schema

SAME, VALID = 0, 1
RELU, RELU6 = 1, 3


class Network:
    def __init__(self):
        self.model, self.graph = schema.ModelT(), schema.SubGraphT()
        self.model.version = 3
        self.model.subgraphs, self.model.operatorCodes = [self.graph], []
        self.model.buffers = [schema.BufferT()]
        self.graph.tensors, self.graph.operators, self.graph.inputs, self.graph.outputs = [], [], [], []
        self.random = np.random.default_rng(1)

    def tensor(self, shape, kind=schema.TensorType.FLOAT32, buffer=0):
        tensor = schema.TensorT()
        tensor.shape, tensor.type, tensor.buffer, tensor.name = list(shape), kind, buffer, f"t{len(self.graph.tensors)}"
        tensor.hasRank = True
        self.graph.tensors.append(tensor)
        return len(self.graph.tensors) - 1

    def shape(self, tensor):
        return self.graph.tensors[tensor].shape

    def constant(self, values):
        values = np.asarray(values)
        values = values.astype(np.int32 if values.dtype.kind == "i" else np.float32)
        buffer = schema.BufferT()
        buffer.data = np.frombuffer(values.tobytes(), np.uint8)
        self.model.buffers.append(buffer)
        kind = schema.TensorType.INT32 if values.dtype == np.int32 else schema.TensorType.FLOAT32
        return self.tensor(values.shape, kind, len(self.model.buffers) - 1)

    def noise(self, *shape):
        return self.constant(self.random.uniform(-1, 1, shape))

    def op(self, name, inputs, shape, options=None, **fields):
        """An operator with one output of `shape`; `options` names its table of settings, if that is not by its own name."""
        code, operator = schema.OperatorCodeT(), schema.OperatorT()
        code.builtinCode = getattr(schema.BuiltinOperator, name)
        code.deprecatedBuiltinCode = min(code.builtinCode, 127)
        code.version = 1
        self.model.operatorCodes.append(code)
        operator.opcodeIndex = len(self.model.operatorCodes) - 1
        operator.inputs = inputs
        output = self.tensor(shape)
        operator.outputs = [output]
        if options:
            operator.builtinOptionsType = getattr(schema.BuiltinOptions, options)
            operator.builtinOptions = getattr(schema, options + "T")()
            for field, value in fields.items():
                assert hasattr(operator.builtinOptions, field), field
                setattr(operator.builtinOptions, field, value)
        self.graph.operators.append(operator)
        return output

    def out(self, *args, **fields):
        self.graph.outputs.append(self.op(*args, **fields))

    def write(self, file):
        builder = flatbuffers.Builder(1 << 16)
        builder.Finish(self.model.Pack(builder), b"TFL3")
        file.write_bytes(bytes(builder.Output()))


def write(file):
    n = Network()
    x = n.tensor([1, 16, 16, 3])
    n.graph.inputs = [x]
    full = [1, 16, 16, 3]
    # About -3 to 3.
    wide = n.op("MUL", [x, n.constant([6.0, 6.5, 7.0])], full, "MulOptions")
    y = n.op("SUB", [wide, n.constant(np.float32(3.0))], full, "SubOptions")
    for stride, padding, activation, side in [(2, SAME, 0, 8), (1, SAME, RELU, 16), (3, VALID, RELU6, 5)]:
        pool = dict(padding=padding, strideW=stride, strideH=stride, filterWidth=3, filterHeight=2 if padding == SAME else 3)
        for name in ["AVERAGE_POOL_2D", "MAX_POOL_2D"]:
            n.out(name, [y], [1, side, side, 3], "Pool2DOptions", fusedActivationFunction=activation, **pool)
    for name, options in [("RELU", None), ("RELU6", None), ("HARD_SWISH", "HardSwishOptions"), ("NEG", "NegOptions"), ("LOGISTIC", None)]:
        n.out(name, [y], full, options)
    positive = n.op("ADD", [x, n.constant([0.25])], full, "AddOptions")
    n.out("SQRT", [positive], full)
    n.out("RSQRT", [positive], full)
    # Operands of fewer dimensions, constant and not; a constant first; one with an activation.
    n.out("DIV", [y, n.constant([[[1.5, -2.0, 3.0]]])], full, "DivOptions")
    n.out("SUB", [n.constant([1.0, 2.0, 3.0]), y], full, "SubOptions", fusedActivationFunction=RELU)
    n.out("SQUARED_DIFFERENCE", [x, y], full, "SquaredDifferenceOptions")
    row = n.op("MEAN", [x, n.constant([0, 1])], [16, 3], "ReducerOptions", keepDims=False)
    n.out("ADD", [y, row], full, "AddOptions", fusedActivationFunction=RELU6)
    n.out("MUL", [y, n.noise(16, 1)], full, "MulOptions")
    for slopes in [n.constant([[[0.25, 1.0, -0.5]]]), n.constant([[[0.25, 1.5, -0.5]]])]:
        n.out("PRELU", [y, slopes], full)
    for axes, shape in [([1, 2], [1, 3]), ([3], [1, 16, 16]), ([1], [1, 16, 3]), ([-1, 1], [1, 16])]:
        n.out("SUM", [y, n.constant(axes)], shape, "ReducerOptions", keepDims=False)
        kept = [1 if k in [axis % 4 for axis in axes] else length for k, length in enumerate(full)]
        n.out("MEAN", [y, n.constant(axes)], kept, "ReducerOptions", keepDims=True)
    n.out("TRANSPOSE", [y, n.constant([0, 2, 1, 3])], full, "TransposeOptions")
    n.out("TRANSPOSE", [y, n.constant([0, 3, 1, 2])], [1, 3, 16, 16], "TransposeOptions")
    n.out("TRANSPOSE", [row, n.constant([1, 0])], [3, 16], "TransposeOptions")
    for shape in [[1, 8, 32, 3], [1, 256, 3], [1, 1, 1, 768], [1, 32, 24, 1], [768]]:
        n.out("RESHAPE", [y, n.constant(shape)], shape, "ReshapeOptions", newShape=shape)
    line = n.op("RESHAPE", [y, n.constant([1, 1, 1, 768])], [1, 1, 1, 768], "ReshapeOptions", newShape=[1, 1, 1, 768])
    n.out("RESHAPE", [line, n.constant(full)], full, "ReshapeOptions", newShape=full)
    masks = dict(beginMask=0, endMask=0, ellipsisMask=0, newAxisMask=0, shrinkAxisMask=0)
    cut = [n.constant(one) for one in ([0, 3, 2, 0], [1, 9, -2, 2], [1, 1, 3, 1])]
    n.out("STRIDED_SLICE", [y, *cut], [1, 6, 4, 2], "StridedSliceOptions", **masks)
    one = [n.constant(one) for one in ([0, -1, 2, 0], [1, 0, 14, 3], [1, 1, 2, 1])]
    n.out("STRIDED_SLICE", [y, *one], [1, 8, 3], "StridedSliceOptions", **{**masks, "beginMask": 4, "endMask": 12, "shrinkAxisMask": 2})
    n.out("CONCATENATION", [x, y], [1, 32, 16, 3], "ConcatenationOptions", axis=1)
    n.out("CONCATENATION", [x, n.noise(1, 16, 16, 2), y], [1, 16, 16, 8], "ConcatenationOptions", axis=-1)
    n.out("CONCATENATION", [row, row], [16, 6], "ConcatenationOptions", axis=1)
    n.out("PAD", [y, n.constant([[0, 0], [1, 2], [0, 3], [2, 1]])], [1, 19, 19, 6], "PadOptions")
    n.out("PAD", [row, n.constant([[1, 0], [0, 2]])], [17, 5], "PadOptions")
    for corners, centres in [(False, False), (True, False), (False, True)]:
        size, shape = n.constant([24, 40]), [1, 24, 40, 3]
        n.out("RESIZE_BILINEAR", [y, size], shape, "ResizeBilinearOptions", alignCorners=corners, halfPixelCenters=centres)
    n.out("RESIZE_BILINEAR", [y, n.constant([7, 5])], [1, 7, 5, 3], "ResizeBilinearOptions", alignCorners=False, halfPixelCenters=True)
    conv = dict(padding=SAME, strideW=1, strideH=1, dilationWFactor=1, dilationHFactor=1)
    deep = n.op("CONV_2D", [y, n.noise(8, 1, 1, 3), n.noise(8)], [1, 16, 16, 8], "Conv2DOptions", **conv)
    n.out("DEPTH_TO_SPACE", [deep], [1, 32, 32, 2], "DepthToSpaceOptions", blockSize=2)
    n.out("CONV_2D", [y, n.noise(5, 3, 2, 3), n.noise(5)], [1, 8, 6, 5], "Conv2DOptions", **{**conv, "strideH": 2, "strideW": 3, "fusedActivationFunction": RELU6})
    n.out("CONV_2D", [y, n.noise(5, 3, 3, 3), n.noise(5)], [1, 10, 12, 5], "Conv2DOptions", **{**conv, "padding": VALID, "dilationHFactor": 3, "dilationWFactor": 2})
    n.out("CONV_2D", [deep, n.noise(6, 3, 3, 4), n.noise(6)], [1, 16, 16, 6], "Conv2DOptions", **conv)
    n.out("DEPTHWISE_CONV_2D", [y, n.noise(1, 5, 3, 6), n.noise(6)], [1, 8, 8, 6], "DepthwiseConv2DOptions", depthMultiplier=2, **{**conv, "strideH": 2, "strideW": 2, "fusedActivationFunction": RELU})
    n.out("DEPTHWISE_CONV_2D", [y, n.noise(1, 3, 3, 3), n.noise(3)], full, "DepthwiseConv2DOptions", depthMultiplier=1, **{**conv, "dilationHFactor": 2, "dilationWFactor": 2})
    n.out("FULLY_CONNECTED", [y, n.noise(5, 3), n.noise(5)], [1, 16, 16, 5], "FullyConnectedOptions", keepNumDims=True)
    n.out("FULLY_CONNECTED", [row, n.noise(4, 3), -1], [16, 4], "FullyConnectedOptions", fusedActivationFunction=RELU)
    # Pictures as they come of five dimensions.
    five = n.op("RESHAPE", [y, n.constant([1, 8, 2, 16, 3])], [1, 8, 2, 16, 3], "ReshapeOptions", newShape=[1, 8, 2, 16, 3])
    for name, axis, shape in [("SUM", 2, [1, 8, 16, 3]), ("MEAN", -1, [1, 8, 2, 16])]:
        n.out(name, [five, n.constant([axis])], shape, "ReducerOptions", keepDims=False)
    pooled = n.op("MEAN", [five, n.constant([1])], [1, 2, 16, 3], "ReducerOptions", keepDims=False)
    n.out("AVERAGE_POOL_2D", [pooled], [1, 1, 8, 3], "Pool2DOptions", padding=VALID, strideW=2, strideH=2, filterWidth=2, filterHeight=2)
    n.write(file)
