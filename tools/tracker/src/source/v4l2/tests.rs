use std::mem::{offset_of, size_of};

use super::devices::list;
use super::*;

/// As a C compiler prints them from `linux/videodev2.h` on a system of 64 bits.
#[test]
fn codes_and_layouts_are_the_kernels() {
    for (code, kernels) in [
        (QUERY_CAPABILITIES, 0x8068_5600),
        (LIST_FORMATS, 0xc040_5602),
        (SET_FORMAT, 0xc0d0_5605),
        (REQUEST_BUFFERS, 0xc014_5608),
        (QUERY_BUFFER, 0xc058_5609),
        (QUEUE, 0xc058_560f),
        (DEQUEUE, 0xc058_5611),
        (START, 0x4004_5612),
        (STOP, 0x4004_5613),
        (GET_PARAMETERS, 0xc0cc_5615),
        (SET_PARAMETERS, 0xc0cc_5616),
        (LIST_SIZES, 0xc02c_564a),
        (LIST_INTERVALS, 0xc034_564b),
    ] {
        assert_eq!(code, kernels, "{code:#x}");
    }
    assert_eq!(
        [
            offset_of!(Buffer, seconds),
            offset_of!(Buffer, sequence),
            offset_of!(Buffer, offset),
            offset_of!(Buffer, length),
            offset_of!(Format, pixels),
            offset_of!(PixelFormat, colours),
            offset_of!(PixelFormat, encoding),
            offset_of!(PixelFormat, quantization),
            offset_of!(StreamParameters, interval),
            offset_of!(FrameInterval, fractions),
            offset_of!(FrameSize, sizes),
            offset_of!(Capability, device_capabilities),
            offset_of!(FormatDescription, pixel_format),
        ],
        [24, 56, 64, 72, 8, 24, 36, 40, 12, 20, 12, 88, 44],
        "offsets"
    );
    assert_eq!(size_of::<Buffer>(), 88, "a buffer");
}

#[test]
fn what_is_no_camera_is_refused_with_a_reason() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("video0");
    std::fs::write(&file, "").expect("a file");
    let refused = |path: &Path| Device::open(path).expect_err("no camera").to_string();
    let missing = refused(Path::new("/dev/video99"));
    assert!(
        missing.starts_with("there is no camera /dev/video99: "),
        "{missing}"
    );
    assert!(
        refused(&file).contains("is not a camera: it is no device"),
        "{}",
        refused(&file)
    );
    let null = refused(Path::new("/dev/null"));
    assert!(
        null.contains("/dev/null is not a camera: it is no video device"),
        "{null}"
    );
}

#[test]
fn the_systems_refusals_say_what_to_do() {
    for (errno, word) in [
        (Errno::ACCESS, "usermod -aG video"),
        (Errno::BUSY, "in use"),
        (Errno::NXIO, "there is no camera"),
        (Errno::IO, "unplug"),
    ] {
        let message = refusal("/dev/video7", errno.into()).to_string();
        assert!(
            message.contains(word) && message.contains("/dev/video7"),
            "{message}"
        );
    }
}

#[test]
fn the_cameras_that_there_are_are_listed_in_order() {
    let folder = tempfile::tempdir().expect("a folder");
    let (devices, names) = (folder.path().join("dev"), folder.path().join("sys"));
    assert!(list(&devices, &names).contains("has none"), "none");
    std::fs::create_dir_all(names.join("video10")).expect("a folder");
    std::fs::create_dir_all(&devices).expect("a folder");
    std::fs::write(names.join("video10/name"), "Webcam C920\n").expect("a file");
    for file in ["video10", "video2", "null", "videox"] {
        std::fs::write(devices.join(file), "").expect("a file");
    }
    let shown = list(&devices, &names).replace(&devices.display().to_string(), "DEV");
    assert_eq!(
        shown, "there are DEV/video2, DEV/video10 (Webcam C920)",
        "list"
    );
}

#[test]
fn the_drivers_clock_is_ours() {
    // Between two readings of the one, the other's is between them; a loaded machine may stop anywhere, so they are ordered
    // by steps that no test waits for.
    let hour = 3600;
    let before = Instant::now();
    let clock = clock_gettime(ClockId::Monotonic);
    let at = instant_of(clock.tv_sec, clock.tv_nsec / 1000).expect("a time");
    assert!(
        at + Duration::from_millis(1) > before && at <= Instant::now(),
        "now"
    );
    // A machine that has not run for so long has no such time.
    if let Some(earlier) = instant_of(clock.tv_sec - hour, clock.tv_nsec / 1000) {
        let apart = at.duration_since(earlier).as_secs_f64();
        assert!((apart - 3600.0).abs() < 60.0, "{apart}");
    }
    assert!(
        instant_of(clock.tv_sec + 1000, 0).expect("a time") <= Instant::now(),
        "not after now"
    );
    assert_eq!(instant_of(-1, 0), None, "no time");
}

#[test]
fn a_range_of_sizes_gives_the_nearest_step() {
    for (wanted, expected) in [(1280, 1280), (1283, 1280), (10, 160), (5000, 1920)] {
        assert_eq!(nearest(wanted, 160, 1920, 16), expected, "{wanted}");
    }
    assert_eq!(nearest(7, 5, 0, 0), 0, "nonsense does not panic");
}

#[test]
fn a_drivers_colours_are_those_that_the_kernel_defines() {
    let pixels = |colours, encoding, quantization| {
        let layout = layout(
            &PixelFormat {
                pixel_format: u32::from_le_bytes(*b"YUYV"),
                colours,
                encoding,
                quantization,
                ..PixelFormat::default()
            },
            None,
        );
        assert_eq!(layout.format, *b"YUYV", "format");
        (layout.matrix, layout.range)
    };
    assert_eq!(
        pixels(8, 0, 0),
        (Matrix::Bt601, Range::Limited),
        "sRGB, as most webcams"
    );
    assert_eq!(pixels(3, 0, 0), (Matrix::Bt709, Range::Limited), "Rec. 709");
    assert_eq!(pixels(7, 0, 0), (Matrix::Bt601, Range::Full), "JPEG");
    assert_eq!(
        pixels(3, 1, 1),
        (Matrix::Bt601, Range::Full),
        "said by themselves"
    );
}
