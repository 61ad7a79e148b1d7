#version 450
#extension GL_GOOGLE_include_directive : require
#define DRAWS_DEPTH
#include "quad_fragment.glsl"
