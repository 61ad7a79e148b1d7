#version 450
#extension GL_GOOGLE_include_directive : require
#include "quad_fragment.glsl"
