//! The structs in Rust lie in memory as the compiled shaders say they do.

use std::collections::BTreeMap;
use std::mem::{offset_of, size_of};

use shaders_spirv::{
    EyeParams, EyeView, FrameParams, PackedGaussian, PartParams, Shader, SortState, Splat,
    ViewParams,
};

const OP_NAME: u32 = 5;
const OP_MEMBER_NAME: u32 = 6;
const OP_DECORATE: u32 = 71;
const OP_MEMBER_DECORATE: u32 = 72;
const OP_TYPE_RUNTIME_ARRAY: u32 = 29;
const OFFSET: u32 = 35;
const ARRAY_STRIDE: u32 = 6;

/// A module's description of one named struct: offsets by member name, and the stride of a runtime array of it.
struct Layout {
    offsets: BTreeMap<String, u32>,
    stride: Option<u32>,
}

fn text(words: &[u32]) -> String {
    let bytes: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
    let end = bytes
        .iter()
        .position(|byte| *byte == 0)
        .unwrap_or(bytes.len());
    String::from_utf8_lossy(&bytes[..end]).into_owned()
}

fn layout(shader: Shader, name: &str) -> Layout {
    let mut names = BTreeMap::new();
    let mut members = BTreeMap::new();
    let mut offsets = BTreeMap::new();
    let mut strides = BTreeMap::new();
    let mut runtime_arrays = BTreeMap::new();
    let mut rest = &shader.words[5..];
    while let [head, ..] = rest {
        let length = (head >> 16) as usize;
        let operands = &rest[1..length];
        match head & 0xFFFF {
            OP_NAME => _ = names.insert(operands[0], text(&operands[1..])),
            OP_MEMBER_NAME => _ = members.insert((operands[0], operands[1]), text(&operands[2..])),
            OP_MEMBER_DECORATE if operands[2] == OFFSET => {
                offsets.insert((operands[0], operands[1]), operands[3]);
            }
            OP_DECORATE if operands[1] == ARRAY_STRIDE => {
                strides.insert(operands[0], operands[2]);
            }
            OP_TYPE_RUNTIME_ARRAY => _ = runtime_arrays.insert(operands[0], operands[1]),
            _ => {}
        }
        rest = &rest[length..];
    }
    // glslang keeps an undecorated twin of a struct that also lives in registers: take the laid-out one.
    let id = names
        .iter()
        .find(|(id, found)| *found == name && offsets.contains_key(&(**id, 0)))
        .map(|(id, _)| *id)
        .unwrap_or_else(|| panic!("{}: no laid-out struct {name}", shader.name));
    Layout {
        offsets: offsets
            .iter()
            .filter(|((owner, _), _)| *owner == id)
            .map(|(member, offset)| (members[member].clone(), *offset))
            .collect(),
        stride: runtime_arrays
            .iter()
            .find(|(_, element)| **element == id)
            .and_then(|(array, _)| strides.get(array).copied()),
    }
}

macro_rules! assert_layout {
    ($shader:expr, $struct:ident { $($member:ident: $field:ident),+ $(,)? }) => {{
        let layout = layout($shader, stringify!($struct));
        let rust = BTreeMap::from([$((stringify!($member).to_owned(),
            u32::try_from(offset_of!($struct, $field)).expect("a small struct"))),+]);
        assert_eq!(layout.offsets, rust, "offsets of {}", stringify!($struct));
        layout.stride
    }};
}

#[test]
fn frame_parameters_lie_as_the_shader_reads_them() {
    for shader in [
        shaders_spirv::PROJECT_FOREGROUND,
        shaders_spirv::PROJECT_BACKGROUND,
        shaders_spirv::BIN_EMIT,
        shaders_spirv::RASTER,
        shaders_spirv::QUAD_VERT,
    ] {
        assert_layout!(
            shader,
            FrameParams {
                views: views,
                depth_plane: depth_plane,
                foreground_count: foreground_count,
                total_count: total_count,
                view_count: view_count,
                width: width,
                height: height,
                tiles_x: tiles_x,
                tiles_y: tiles_y,
                lane_count: lane_count,
                pair_capacity: pair_capacity,
                sorts: sorts,
                guard_turn: guard_turn,
                guard_move: guard_move,
                whole_first: whole_first,
                whole_last: whole_last,
                visible_rows: visible_rows,
            }
        );
    }
    assert_layout!(
        shaders_spirv::PROJECT_FOREGROUND,
        ViewParams {
            image_from_world: image_from_world,
            intrinsics: intrinsics,
            slope_limits: slope_limits,
            clip: clip,
        }
    );
    assert_eq!(
        size_of::<ViewParams>(),
        96,
        "two of them stand in an array of stride 96"
    );
}

#[test]
fn a_parts_push_constants_lie_as_the_shader_reads_them() {
    assert_layout!(
        shaders_spirv::PROJECT_FOREGROUND,
        PartParams {
            world_from_part: world_from_part,
            first: first,
            count: count,
            source: source,
            number: number,
        }
    );
    assert_eq!(size_of::<PartParams>(), 64, "bytes pushed");
}

#[test]
fn a_headsets_eye_parameters_lie_as_the_shaders_read_them() {
    for shader in [
        shaders_spirv::COMPOSE_EYE,
        shaders_spirv::SHOW_EYE_FRAG,
        shaders_spirv::SHOW_EYE_DEPTH_FRAG,
        shaders_spirv::SHOW_EYE_VERT,
    ] {
        assert_layout!(
            shader,
            EyeParams {
                views: views,
                width: width,
                height: height,
                depth_stride: depth_stride,
                surround: surround,
                swaps_red: swaps_red,
                linear: linear,
                near: near,
                far: far,
                strip_rows: strip_rows,
                visible_rows: visible_rows,
            }
        );
        assert_layout!(
            shader,
            EyeView {
                world_from_eye: world_from_eye,
                slopes: slopes,
            }
        );
    }
    assert_eq!(
        size_of::<EyeView>(),
        64,
        "two of them stand in an array of stride 64"
    );
}

#[test]
fn gaussians_lie_as_the_shader_reads_them() {
    let layout = layout(shaders_spirv::PROJECT_FOREGROUND, "PackedGaussian");
    assert_eq!(layout.stride, Some(32), "array stride in the shader");
    assert_eq!(size_of::<PackedGaussian>(), 32, "size in Rust");
}

#[test]
fn the_sort_state_lies_as_the_shaders_read_it() {
    // The block's name, which Rust's type spells out.
    type State = SortState;
    for shader in [
        shaders_spirv::PROJECT_FOREGROUND,
        shaders_spirv::SORT_PLAN,
        shaders_spirv::SORT_RANK,
        shaders_spirv::WEIGH,
        shaders_spirv::QUAD_VERT,
    ] {
        assert_layout!(
            shader,
            State {
                count: count,
                least: least,
                greatest: greatest,
                fine_least: fine_least,
                fine_greatest: fine_greatest,
                linear_start: linear_start,
                linear_keys: linear_keys,
                linear_scale: linear_scale,
                log_shift: log_shift,
                items_groups: items_groups,
                crowded_groups: crowded_groups,
                part_items_groups: part_items_groups,
                parts_groups: parts_groups,
                merge_groups: merge_groups,
                draw: draw,
                refused: refused,
            }
        );
    }
}

#[test]
fn splats_lie_as_the_shader_reads_them() {
    for shader in [
        shaders_spirv::PROJECT_FOREGROUND,
        shaders_spirv::PROJECT_BACKGROUND,
        shaders_spirv::RASTER,
        shaders_spirv::QUAD_VERT,
    ] {
        let stride = assert_layout!(
            shader,
            Splat {
                mean_x: mean_x,
                mean_y: mean_y,
                ux: ux,
                uy: uy,
                wy: wy,
                log2_opacity: log2_opacity,
                red_green: red_green,
                blue_depth: blue_depth,
            }
        );
        assert_eq!(stride, Some(32), "array stride in {}", shader.name);
    }
    assert_eq!(size_of::<Splat>(), 32, "size in Rust");
}
