#version 450
#pragma vulkan_1_2
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_basic : require
#extension GL_KHR_shader_subgroup_ballot : require
#extension GL_KHR_shader_subgroup_shuffle : require
#extension GL_KHR_shader_subgroup_vote : require
#define BROADCAST
#include "raster.glsl"

// Broadcasts from a lane that is no constant: SPIR-V 1.5, Vulkan 1.2's subgroupBroadcastDynamicId.
