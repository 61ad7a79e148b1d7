// Makes a headset compositor's picture of an eye's premultiplied one: over its surroundings, as linear light, and its depth
// in the compositor's range. Mirrors `EyeParams` in src/eye.rs.

const uint TRANSPARENT = 0u; // the room itself is seen (passthrough)
const uint STUDIO = 1u;      // a floor at y = 0 that melts into a wall
const uint DUSK = 2u;        // darkness, around a scene

struct EyeView {
    vec4 world_from_eye[3]; // rows of the rigid transform; the eye looks along its -z, y up
    vec4 slopes;            // x/-z of the left edge, y/-z of the upper edge, their steps from pixel to pixel
};

layout(set = 0, binding = 0, std140) uniform EyeParams {
    EyeView views[2];
    uint width;
    uint height;
    uint depth_stride;      // halves in a row of the depths' buffer; 0 without depth
    uint surround;
    uint swaps_red;         // 1 for BGRA
    uint linear;            // 1 where the compositor takes the bytes for linear light
    float near;             // depth 0 and 1 for the compositor, metres
    float far;
    uint strip_rows;        // rows of tiles that one strip of the picture has
    uvec4 visible_rows[MOST_TILE_ROWS]; // as in frame.glsl
} eye;

// First and last column of a row's tiles that anyone sees, as in frame.glsl.
uvec2 visible_columns(uint view, uint row) {
    uvec4 columns = eye.visible_rows[row];
    return view == 0u ? columns.xy : columns.zw;
}

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

// A picture's pixel, within 0 to 1, over what is behind it, in display values; and how far that is along the eye's axis. `at` is
// the pixel's centre.
vec4 surrounded(vec4 picture, vec2 at, uint view, out float behind_depth) {
    behind_depth = eye.far;
    if (eye.surround == TRANSPARENT) return picture;
    vec4 row_x = eye.views[view].world_from_eye[0];
    vec4 row_y = eye.views[view].world_from_eye[1];
    vec4 row_z = eye.views[view].world_from_eye[2];
    vec4 slopes = eye.views[view].slopes;
    vec3 toward = vec3(slopes.xy + at * slopes.zw, -1.0);
    mat3 rows = mat3(row_x.xyz, row_y.xyz, row_z.xyz);
    vec3 origin = vec3(row_x.w, row_y.w, row_z.w);
    vec3 ray = normalize(toward * rows);
    vec3 behind;
    if (eye.surround == STUDIO) {
        behind = studio(origin, ray, vec3(0.0, 0.0, -1.0) * rows, behind_depth);
    } else {
        behind = mix(vec3(0.13, 0.14, 0.16), vec3(0.03, 0.035, 0.05), clamp(0.5 + ray.y, 0.0, 1.0));
    }
    return vec4(min(picture.rgb + (1.0 - picture.a) * behind, 1.0), 1.0);
}

// Light times alpha of a premultiplied display colour: the compositor blends light.
vec3 light_of(vec4 shown) {
    if (shown.a <= 0.0 || shown.a >= 1.0) return decoded(shown.rgb);
    return decoded(min(shown.rgb / shown.a, 1.0)) * shown.a;
}

// The compositor's depth of a pixel that has `weighted` (metres times alpha) and lies before `behind`, metres: the mean depth of
// what it shows, or of what is behind where the person hardly shows.
float compositor_depth(float weighted, float alpha, float behind) {
    float depth = clamp(alpha > 0.5 ? weighted / alpha : behind, eye.near, eye.far);
    return eye.far * (depth - eye.near) / (depth * (eye.far - eye.near));
}
