//! What a runtime does with the pointers that it is given: it trusts them, as the specification lets it.

#![allow(
    clippy::undocumented_unsafe_blocks,
    reason = "each rests on the same: callers of OpenXR give valid pointers, and structures' true types"
)]

use std::ffi::{CStr, c_char, c_void};
use std::fmt::Write as _;

use openxr::sys::{self, Result as XrResult, StructureType};

/// Reads the value.
pub(super) fn read<T: Copy>(from: *const T) -> T {
    unsafe { from.read() }
}

/// Reads so many values.
pub(super) fn read_all<T: Copy>(from: *const T, count: u32) -> Vec<T> {
    (0..count as usize)
        .map(|place| unsafe { from.add(place).read() })
        .collect()
}

/// Writes the value.
pub(super) fn give<T>(to: *mut T, value: T) -> XrResult {
    unsafe { to.write(value) };
    XrResult::SUCCESS
}

/// Changes the value in place.
pub(super) fn change<T>(at: *mut T, change: impl FnOnce(&mut T)) -> XrResult {
    change(unsafe { &mut *at });
    XrResult::SUCCESS
}

/// OpenXR's two calls for a list: its length, then its items, each put into its place.
pub(super) fn list<T, U>(
    capacity: u32,
    count: *mut u32,
    out: *mut T,
    items: &[U],
    put: impl Fn(*mut T, &U),
) -> XrResult {
    give(count, items.len() as u32);
    if capacity == 0 {
        return XrResult::SUCCESS;
    }
    if (capacity as usize) < items.len() {
        return XrResult::ERROR_SIZE_INSUFFICIENT;
    }
    for (place, item) in items.iter().enumerate() {
        put(unsafe { out.add(place) }, item);
    }
    XrResult::SUCCESS
}

/// [`list`] of plain values.
pub(super) fn values<T: Copy>(
    capacity: u32,
    count: *mut u32,
    out: *mut T,
    items: &[T],
) -> XrResult {
    list(capacity, count, out, items, |to, item| {
        give(to, *item);
    })
}

/// A text that ends with a zero.
pub(super) fn text(from: *const c_char) -> String {
    unsafe { CStr::from_ptr(from) }
        .to_string_lossy()
        .into_owned()
}

/// Fills a fixed array with a text and a zero.
pub(super) fn put_text(to: &mut [c_char], text: &str) {
    for (to, from) in to.iter_mut().zip(text.bytes().chain([0])) {
        *to = from as c_char;
    }
}

/// Goes through a chain of structures: each one's type and place.
pub(super) fn chained(next: *const c_void) -> Vec<(StructureType, *mut c_void)> {
    let mut found = Vec::new();
    let mut next = next;
    while !next.is_null() {
        let head: sys::BaseInStructure = read(next.cast());
        found.push((head.ty, next.cast_mut()));
        next = head.next.cast();
    }
    found
}

/// A chain as text: the structures' names, and what matters of those that we chain.
pub(super) fn describe(next: *const c_void) -> String {
    let mut text = String::new();
    for (ty, at) in chained(next) {
        let _ = write!(text, " + {ty:?}");
        match ty {
            StructureType::SWAPCHAIN_CREATE_INFO_FOVEATION_FB => {
                let it: sys::SwapchainCreateInfoFoveationFB = read(at.cast());
                let _ = write!(text, "({:?})", it.flags);
            }
            StructureType::FOVEATION_LEVEL_PROFILE_CREATE_INFO_FB => {
                let it: sys::FoveationLevelProfileCreateInfoFB = read(at.cast());
                let _ = write!(text, "({:?}, {:?})", it.level, it.dynamic);
            }
            StructureType::COMPOSITION_LAYER_DEPTH_INFO_KHR => {
                let it: sys::CompositionLayerDepthInfoKHR = read(at.cast());
                let _ = write!(
                    text,
                    "(layer {}, {}..{} m)",
                    it.sub_image.image_array_index, it.near_z, it.far_z
                );
            }
            _ => {}
        }
    }
    text
}

/// The layers of a frame, each as text: its type, its flags, its views with what is chained to them.
pub(super) fn layers(info: &sys::FrameEndInfo) -> Vec<String> {
    read_all(info.layers, info.layer_count)
        .into_iter()
        .map(|layer| {
            let header: sys::CompositionLayerBaseHeader = read(layer);
            let mut text = format!("{:?} {:?}", header.ty, header.layer_flags);
            if header.ty == StructureType::COMPOSITION_LAYER_PROJECTION {
                let layer: sys::CompositionLayerProjection = read(layer.cast());
                for view in read_all(layer.views, layer.view_count) {
                    let index = view.sub_image.image_array_index;
                    let _ = write!(text, "; layer {index}{}", describe(view.next));
                }
            }
            text + &describe(header.next)
        })
        .collect()
}

/// A queued event. It is sent between threads, so no structure may be chained to it.
pub(super) struct Event(pub(super) sys::EventDataBuffer);

unsafe impl Send for Event {}

/// An event as a runtime's buffer holds it.
pub(super) fn event<T: Copy>(event: &T) -> Event {
    assert!(
        size_of::<T>() <= size_of::<sys::EventDataBuffer>(),
        "an event"
    );
    let mut buffer = sys::EventDataBuffer {
        ty: sys::EventDataBuffer::TYPE,
        next: std::ptr::null(),
        varying: [0; 4000],
    };
    unsafe {
        std::ptr::from_mut(&mut buffer).cast::<T>().write(*event);
    }
    Event(buffer)
}
