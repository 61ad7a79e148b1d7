#version 450
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_multiview : require
#define DRAWS_DEPTH
#include "show_eye_fragment.glsl"
