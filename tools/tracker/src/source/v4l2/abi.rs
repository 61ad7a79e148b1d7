//! The numbers and structures of `linux/videodev2.h`, on systems of 64 bits.

use rustix::ioctl::{Opcode, opcode};

pub(super) const VIDEO_CAPTURE: u32 = 1;
pub(super) const MAPPED: u32 = 1;

pub(super) const CAN_CAPTURE: u32 = 1;
pub(super) const CAN_CAPTURE_IN_PLANES: u32 = 0x1000;
pub(super) const CAN_STREAM: u32 = 0x0400_0000;
pub(super) const HAS_DEVICE_CAPABILITIES: u32 = 0x8000_0000;

pub(super) const DAMAGED: u32 = 0x40;
pub(super) const CLOCK_MASK: u32 = 0xe000;
pub(super) const CLOCK_MONOTONIC: u32 = 0x2000;

pub(super) const DISCRETE: u32 = 1;
pub(super) const ENCODING_709: u32 = 2;
pub(super) const COLOURS_709: u32 = 3;
pub(super) const COLOURS_JPEG: u32 = 7;
pub(super) const FULL_RANGE: u32 = 1;
pub(super) const CAN_SET_RATE: u32 = 0x1000;

#[repr(C)]
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Capability {
    pub(super) driver: [u8; 16],
    pub(super) card: [u8; 32],
    pub(super) bus: [u8; 32],
    pub(super) version: u32,
    pub(super) capabilities: u32,
    pub(super) device_capabilities: u32,
    pub(super) reserved: [u32; 3],
}

#[repr(C)]
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct FormatDescription {
    pub(super) index: u32,
    pub(super) kind: u32,
    pub(super) flags: u32,
    pub(super) description: [u8; 32],
    pub(super) pixel_format: u32,
    pub(super) bus_code: u32,
    pub(super) reserved: [u32; 3],
}

#[repr(C)]
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct FrameSize {
    pub(super) index: u32,
    pub(super) pixel_format: u32,
    pub(super) kind: u32,
    /// Discrete: width, height. Else: least, most and step of width, then of height.
    pub(super) sizes: [u32; 6],
    pub(super) reserved: [u32; 2],
}

#[repr(C)]
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct FrameInterval {
    pub(super) index: u32,
    pub(super) pixel_format: u32,
    pub(super) width: u32,
    pub(super) height: u32,
    pub(super) kind: u32,
    /// Discrete: one fraction of a second. Else: least, most and step.
    pub(super) fractions: [u32; 6],
    pub(super) reserved: [u32; 2],
}

#[repr(C)]
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct PixelFormat {
    pub(super) width: u32,
    pub(super) height: u32,
    pub(super) pixel_format: u32,
    pub(super) field: u32,
    pub(super) bytes_per_line: u32,
    pub(super) size: u32,
    pub(super) colours: u32,
    pub(super) private: u32,
    pub(super) flags: u32,
    pub(super) encoding: u32,
    pub(super) quantization: u32,
    pub(super) transfer: u32,
}

/// Aligned as the pointers in the union's other members are.
#[repr(C, align(8))]
#[derive(Debug, Clone, Copy)]
pub(super) struct Format {
    pub(super) kind: u32,
    pub(super) padding: u32,
    pub(super) pixels: PixelFormat,
    pub(super) rest: [u8; 152],
}

#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub(super) struct StreamParameters {
    pub(super) kind: u32,
    pub(super) capability: u32,
    pub(super) mode: u32,
    /// Seconds a picture: numerator, denominator.
    pub(super) interval: [u32; 2],
    pub(super) rest: [u8; 184],
}

#[repr(C)]
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct RequestBuffers {
    pub(super) count: u32,
    pub(super) kind: u32,
    pub(super) memory: u32,
    pub(super) capabilities: u32,
    pub(super) flags: [u8; 4],
}

#[repr(C)]
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Buffer {
    pub(super) index: u32,
    pub(super) kind: u32,
    pub(super) bytes_used: u32,
    pub(super) flags: u32,
    pub(super) field: u32,
    pub(super) seconds: i64,
    pub(super) microseconds: i64,
    pub(super) timecode: [u32; 4],
    pub(super) sequence: u32,
    pub(super) memory: u32,
    /// The lower half is the offset, on both orders of bytes in memory, because the union starts with it.
    pub(super) offset: u32,
    pub(super) offset_rest: u32,
    pub(super) length: u32,
    pub(super) reserved: u32,
    pub(super) request: i32,
}

pub(super) const QUERY_CAPABILITIES: Opcode = opcode::read::<Capability>(b'V', 0);
pub(super) const LIST_FORMATS: Opcode = opcode::read_write::<FormatDescription>(b'V', 2);
pub(super) const SET_FORMAT: Opcode = opcode::read_write::<Format>(b'V', 5);
pub(super) const REQUEST_BUFFERS: Opcode = opcode::read_write::<RequestBuffers>(b'V', 8);
pub(super) const QUERY_BUFFER: Opcode = opcode::read_write::<Buffer>(b'V', 9);
pub(super) const QUEUE: Opcode = opcode::read_write::<Buffer>(b'V', 15);
pub(super) const DEQUEUE: Opcode = opcode::read_write::<Buffer>(b'V', 17);
pub(super) const START: Opcode = opcode::write::<u32>(b'V', 18);
pub(super) const STOP: Opcode = opcode::write::<u32>(b'V', 19);
pub(super) const GET_PARAMETERS: Opcode = opcode::read_write::<StreamParameters>(b'V', 21);
pub(super) const SET_PARAMETERS: Opcode = opcode::read_write::<StreamParameters>(b'V', 22);
pub(super) const LIST_SIZES: Opcode = opcode::read_write::<FrameSize>(b'V', 74);
pub(super) const LIST_INTERVALS: Opcode = opcode::read_write::<FrameInterval>(b'V', 75);

/// As the driver wants it: mapped, of pictures.
pub(super) fn empty(index: u32) -> Buffer {
    Buffer {
        index,
        kind: VIDEO_CAPTURE,
        memory: MAPPED,
        ..Buffer::default()
    }
}
