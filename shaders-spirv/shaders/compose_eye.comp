#version 450

// An eye's premultiplied picture as a headset's compositor takes it: over what surrounds the person, 8 bits a channel in the
// sRGB curve, and its depth in the compositor's range.

layout(constant_id = 0) const uint GROUP = 64u;
layout(local_size_x_id = 0) in;

const uint TRANSPARENT = 0u; // the room itself is seen (passthrough)
const uint STUDIO = 1u;      // a floor at y = 0 that melts into a wall
const uint DUSK = 2u;        // darkness, around a scene

layout(push_constant) uniform EyeParams {
    vec4 world_from_eye[3]; // rows of the rigid transform; the eye looks along its -z, y up
    vec4 slopes;            // x/-z of the left edge, y/-z of the upper edge, their steps from pixel to pixel
    uvec2 size;
    uint first_pixel;       // where the view starts in the picture's buffer, and in the one written
    uint first_depth;       // where it starts in the depths', in halves
    uint depth_stride;      // halves in a row; 0 without depth
    uint surround;
    uint swaps_red;         // 1 for BGRA
    uint linear;            // 1 where the compositor takes the bytes for linear light
    float near;             // depth 0 and 1 for the compositor, metres
    float far;
} eye;

layout(set = 0, binding = 0, std430) readonly buffer Picture { uvec2 picture[]; };
layout(set = 0, binding = 1, std430) readonly buffer Depths { uint depths[]; };
layout(set = 0, binding = 2, std430) writeonly buffer Eye { uint pixels[]; };
layout(set = 0, binding = 3, std430) writeonly buffer EyeDepth { float eye_depths[]; };

vec3 decoded(vec3 display) {
    return mix(display / 12.92, pow((display + 0.055) / 1.055, vec3(2.4)), greaterThan(display, vec3(0.04045)));
}

vec3 encoded(vec3 light) {
    return mix(light * 12.92, 1.055 * pow(light, vec3(1.0 / 2.4)) - 0.055, greaterThan(light, vec3(0.0031308)));
}

// Colour along a ray, and how far along the eye's axis it is met; as tools/mon3tr/src/backdrop.rs has it on the desktop.
vec3 studio(vec3 origin, vec3 ray, vec3 axis, out float depth) {
    const vec3 SKY = vec3(0.80, 0.83, 0.87);
    const vec3 HORIZON = vec3(0.90, 0.91, 0.92);
    const vec3 FLOOR = vec3(0.70, 0.71, 0.73);
    depth = eye.far;
    vec3 wall = mix(HORIZON, SKY, clamp(ray.y * 1.6, 0.0, 1.0));
    if (ray.y >= -1e-4 || origin.y <= 0.0) return wall;
    float way = origin.y / -ray.y;
    depth = min(way * dot(ray, axis), eye.far);
    return mix(FLOOR, HORIZON, sqrt(clamp(way / 14.0, 0.0, 1.0)));
}

void main() {
    uvec2 at = gl_GlobalInvocationID.xy;
    if (at.x >= eye.size.x) return;
    uint index = at.y * eye.size.x + at.x;
    uvec2 halves = picture[eye.first_pixel + index];
    vec2 red_green = unpackHalf2x16(halves.x);
    vec2 blue_alpha = unpackHalf2x16(halves.y);
    float alpha = clamp(blue_alpha.y, 0.0, 1.0);
    vec3 colour = clamp(vec3(red_green, blue_alpha.x), 0.0, 1.0);

    float behind_depth = eye.far;
    if (eye.surround == TRANSPARENT) {
        // The compositor blends light, and so has to find light times alpha once it has decoded this.
        if (alpha > 0.0 && alpha < 1.0) {
            vec3 light = decoded(min(colour / alpha, 1.0)) * alpha;
            colour = eye.linear == 1u ? light : encoded(light);
        } else if (eye.linear == 1u) {
            colour = decoded(colour);
        }
    } else {
        vec3 toward = vec3(eye.slopes.x + (float(at.x) + 0.5) * eye.slopes.z, eye.slopes.y + (float(at.y) + 0.5) * eye.slopes.w, -1.0);
        mat3 rows = mat3(eye.world_from_eye[0].xyz, eye.world_from_eye[1].xyz, eye.world_from_eye[2].xyz);
        vec3 origin = vec3(eye.world_from_eye[0].w, eye.world_from_eye[1].w, eye.world_from_eye[2].w);
        vec3 ray = normalize(toward * rows);
        vec3 behind;
        if (eye.surround == STUDIO) {
            behind = studio(origin, ray, vec3(0.0, 0.0, -1.0) * rows, behind_depth);
        } else {
            behind = mix(vec3(0.13, 0.14, 0.16), vec3(0.03, 0.035, 0.05), clamp(0.5 + ray.y, 0.0, 1.0));
        }
        colour = min(colour + (1.0 - alpha) * behind, 1.0);
        alpha = 1.0;
        if (eye.linear == 1u) colour = decoded(colour);
    }
    pixels[eye.first_pixel + index] = packUnorm4x8(vec4(eye.swaps_red == 1u ? colour.bgr : colour, alpha));

    if (eye.depth_stride > 0u) {
        uint place = eye.first_depth + at.y * eye.depth_stride + at.x;
        vec2 pair = unpackHalf2x16(depths[place / 2u]);
        float weighted = (place & 1u) == 0u ? pair.x : pair.y;
        float covered = clamp(blue_alpha.y, 0.0, 1.0);
        // The mean depth of what the pixel shows; of what is behind where the person hardly shows.
        float depth = covered > 0.5 ? weighted / covered : behind_depth;
        depth = clamp(depth, eye.near, eye.far);
        eye_depths[eye.first_pixel + index] = eye.far * (depth - eye.near) / (depth * (eye.far - eye.near));
    }
}
