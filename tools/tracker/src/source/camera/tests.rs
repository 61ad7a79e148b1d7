use std::collections::VecDeque;
use std::io;
use std::sync::{Arc, Mutex};

use super::super::colour::{Matrix, Range};
use super::super::driver::FourCc;
use super::*;

/// A driver that plays what the test wrote down.
#[derive(Debug, Default)]
struct Script {
    modes: Vec<Mode>,
    layout: Option<Layout>,
    memory: Vec<Vec<u8>>,
    /// Filled already.
    ready: VecDeque<Filled>,
    /// Each comes when there is a wait for it.
    later: VecDeque<Filled>,
    /// Indices in the order in which they came back.
    returned: Vec<usize>,
    fails: Option<io::ErrorKind>,
    /// When a picture's bytes were last asked for.
    asked: Option<Instant>,
}

#[derive(Debug, Clone)]
struct Fake(Arc<Mutex<Script>>, Vec<Vec<u8>>);

impl Fake {
    fn new(script: Script) -> Self {
        let memory = script.memory.clone();
        Self(Arc::new(Mutex::new(script)), memory)
    }

    fn with<T>(&self, what: impl FnOnce(&mut Script) -> T) -> T {
        what(&mut self.0.lock().expect("no panic"))
    }
}

impl Driver for Fake {
    fn modes(&mut self, _size: (u32, u32)) -> io::Result<Vec<Mode>> {
        self.with(|script| {
            script
                .fails
                .map_or_else(|| Ok(script.modes.clone()), |kind| Err(kind.into()))
        })
    }

    fn start(&mut self, mode: Mode, rate_hz: f64) -> io::Result<Layout> {
        let given = Layout {
            format: mode.format,
            width: mode.width,
            height: mode.height,
            stride: mode.width as usize * if mode.format == YUYV { 2 } else { 3 },
            matrix: Matrix::Bt601,
            range: Range::Limited,
            rate_hz: Some(rate_hz),
        };
        Ok(self.with(|script| script.layout.unwrap_or(given)))
    }

    fn buffers(&self) -> usize {
        4
    }

    fn dequeue(&mut self, patience: Duration) -> io::Result<Option<Filled>> {
        self.with(|script| {
            if let Some(filled) = script.ready.pop_front() {
                return Ok(Some(filled));
            }
            if patience.is_zero() {
                return Ok(None);
            }
            script
                .fails
                .map_or_else(|| Ok(script.later.pop_front()), |kind| Err(kind.into()))
        })
    }

    fn bytes(&self, filled: &Filled) -> &[u8] {
        self.with(|script| script.asked = Some(Instant::now()));
        self.1.get(filled.index).map_or(&[], Vec::as_slice)
    }

    fn requeue(&mut self, filled: Filled) -> io::Result<()> {
        self.with(|script| script.returned.push(filled.index));
        Ok(())
    }
}

fn mode(format: FourCc, width: u32, height: u32, fastest_hz: f64) -> Mode {
    Mode {
        format,
        width,
        height,
        fastest_hz: Some(fastest_hz),
    }
}

/// Taken `ms` after `begun`; its contents are those of buffer `index`.
fn filled(begun: Instant, index: usize, ms: u64, sequence: u32) -> Filled {
    Filled {
        index,
        bytes: 12,
        at: Some(begun + Duration::from_millis(ms)),
        sequence,
        damaged: false,
    }
}

/// Pictures of 2 x 2 in RGB, each of its buffer's index.
fn small(ready: Vec<Filled>, later: Vec<Filled>) -> (Fake, Camera<Fake>) {
    let fake = Fake::new(Script {
        modes: vec![mode(RGB3, 2, 2, 30.0)],
        memory: (0u8..4).map(|index| vec![index; 12]).collect(),
        layout: Some(Layout {
            stride: 6,
            format: RGB3,
            width: 2,
            height: 2,
            matrix: Matrix::Bt601,
            range: Range::Full,
            rate_hz: Some(30.0),
        }),
        ready: ready.into(),
        later: later.into(),
        ..Script::default()
    });
    let camera =
        Camera::start("/dev/video7", "a camera".to_owned(), fake.clone()).expect("a camera");
    (fake, camera)
}

#[test]
fn the_newest_picture_comes_with_the_drivers_time() {
    let begun = Instant::now();
    let (fake, mut camera) = small(
        vec![filled(begun, 0, 0, 100)],
        vec![filled(begun, 1, 33, 101), filled(begun, 2, 66, 102)],
    );
    let mut picture = Picture::empty();
    assert!(camera.next(&mut picture).expect("a picture"), "no end");
    assert_eq!(
        (picture.number, picture.at, picture.rgb[0]),
        (0, begun, 0),
        "the first"
    );
    // Two came meanwhile.
    fake.with(|script| {
        let two: Vec<Filled> = script.later.drain(..).collect();
        script.ready.extend(two);
    });
    assert!(camera.next(&mut picture).expect("a picture"), "no end");
    assert_eq!((picture.number, picture.rgb[0]), (2, 2), "the newest");
    assert_eq!(picture.at, begun + Duration::from_millis(66), "its time");
    assert!(
        (picture.seconds - 0.066).abs() < 1e-9,
        "{}",
        picture.seconds
    );
    assert_eq!(
        fake.with(|script| script.returned.clone()),
        [0, 1, 2],
        "every buffer goes back"
    );
}

#[test]
fn pictures_that_the_driver_lost_are_counted() {
    let begun = Instant::now();
    let (_, mut camera) = small(
        vec![],
        vec![
            filled(begun, 0, 0, u32::MAX),
            filled(begun, 1, 99, 2),
            filled(begun, 1, 120, 2),
        ],
    );
    let mut picture = Picture::empty();
    for number in [0, 3, 4] {
        assert!(camera.next(&mut picture).expect("a picture"), "no end");
        assert_eq!(
            picture.number, number,
            "the counter runs over, and one that stands still is helped"
        );
    }
}

#[test]
fn a_caller_that_let_all_buffers_fill_gets_a_fresh_picture() {
    let begun = Instant::now();
    let full = (0..4)
        .map(|index| {
            filled(
                begun,
                index,
                33 * index as u64,
                u32::try_from(index).expect("few"),
            )
        })
        .collect();
    let (fake, mut camera) = small(full, vec![filled(begun, 1, 900, 27)]);
    let mut picture = Picture::empty();
    assert!(camera.next(&mut picture).expect("a picture"), "no end");
    assert_eq!(
        (picture.number, picture.at),
        (27, begun + Duration::from_millis(900)),
        "the fresh one"
    );
    assert_eq!(
        fake.with(|script| script.returned.clone()),
        [0, 1, 2, 3, 1],
        "every buffer goes back"
    );
}

#[test]
fn damaged_pictures_are_passed_over() {
    let begun = Instant::now();
    let mut marked = filled(begun, 0, 0, 0);
    marked.damaged = true;
    let mut short = filled(begun, 1, 33, 1);
    short.bytes = 11;
    let mut alien = filled(begun, 99, 66, 2);
    alien.bytes = usize::MAX;
    let (fake, mut camera) = small(vec![], vec![marked, short, alien, filled(begun, 2, 99, 3)]);
    let mut picture = Picture::empty();
    assert!(camera.next(&mut picture).expect("a picture"), "no end");
    assert_eq!((picture.number, picture.rgb[0]), (3, 2), "the whole one");
    assert_eq!(
        fake.with(|script| script.returned.clone()),
        [0, 1, 99, 2],
        "every buffer goes back"
    );
}

#[test]
fn a_picture_without_a_time_has_that_of_its_reading_not_of_its_conversion() {
    let mut unknown = filled(Instant::now(), 0, 0, 0);
    unknown.at = None;
    let (fake, mut camera) = small(vec![unknown], vec![]);
    let mut picture = Picture::empty();
    let begun = Instant::now();
    assert!(camera.next(&mut picture).expect("a picture"), "no end");
    let asked = fake.with(|script| script.asked).expect("its bytes");
    assert!(begun <= picture.at && picture.at <= asked, "time");
}

#[test]
fn a_camera_that_gives_only_damage_or_nothing_fails() {
    let begun = Instant::now();
    let short = || Filled {
        bytes: 3,
        ..filled(begun, 0, 0, 0)
    };
    let all = std::iter::repeat_with(short).take(200).collect();
    let (_, mut camera) = small(vec![], all);
    let message = camera
        .next(&mut Picture::empty())
        .expect_err("damage")
        .to_string();
    assert!(
        message.contains("2 x 2") && message.contains("3 bytes"),
        "{message}"
    );
    let (_, mut camera) = small(vec![], vec![]);
    let message = camera
        .next(&mut Picture::empty())
        .expect_err("silence")
        .to_string();
    assert!(message.contains("no picture for 5 seconds"), "{message}");
}

#[test]
fn a_drivers_refusal_says_what_to_do() {
    for (kind, word) in [
        (io::ErrorKind::ResourceBusy, "in use"),
        (io::ErrorKind::PermissionDenied, "group"),
        (io::ErrorKind::BrokenPipe, "unplug"),
    ] {
        let (fake, mut camera) = small(vec![], vec![]);
        fake.with(|script| script.fails = Some(kind));
        let message = camera
            .next(&mut Picture::empty())
            .expect_err(word)
            .to_string();
        assert!(
            message.contains(word) && message.contains("/dev/video7"),
            "{message}"
        );
        let refused = Camera::start("/dev/video7", String::new(), fake);
        let message = refused.expect_err(word).to_string();
        assert!(message.contains(word), "{message}");
    }
}

#[test]
fn formats_that_are_not_read_are_listed() {
    let fake = Fake::new(Script {
        modes: vec![
            mode(*b"H264", 64, 48, 30.0),
            mode(*b"BA81", 64, 48, 30.0),
            mode(*b"H264", 32, 24, 30.0),
        ],
        ..Script::default()
    });
    let message = Camera::start("/dev/video7", String::new(), fake)
        .expect_err("no format")
        .to_string();
    assert!(message.contains("it has BA81, H264;"), "{message}");
}

#[test]
fn the_mode_is_the_nearest_that_is_fast_enough() {
    let webcam = [
        mode(YUYV, 640, 480, 30.0),
        mode(YUYV, 1280, 720, 10.0),
        mode(YUYV, 320, 240, 30.0),
        mode(MJPG, 640, 480, 30.0),
        mode(MJPG, 1280, 720, 30.0),
        mode(MJPG, 1920, 1080, 30.0),
        mode(*b"H264", 1280, 720, 60.0),
    ];
    let chosen = |size, rate_hz| choose(&webcam, size, rate_hz).expect("a mode");
    assert_eq!(
        chosen((1280, 720), 30.0),
        webcam[4],
        "compressed, where plain pixels are slow"
    );
    assert_eq!(
        chosen((640, 480), 30.0),
        webcam[0],
        "plain pixels, where they are fast"
    );
    assert_eq!(chosen((1280, 720), 10.0), webcam[1], "slow is enough");
    assert_eq!(chosen((1900, 1100), 30.0), webcam[5], "nearest size");
    assert_eq!(
        chosen((1280, 720), 60.0),
        webcam[4],
        "nothing is fast enough"
    );
    assert_eq!(
        choose(&webcam[..2], (1280, 720), 30.0),
        Some(webcam[0]),
        "a third of the rate is worse than half the size"
    );
    assert_eq!(choose(&[], (1, 1), 30.0), None, "no mode");
}

#[test]
fn each_format_of_pixels_is_converted_with_its_stride() {
    // 2 x 2 with padding: white, black, and two of red, whose BT.601 codes are 81, 90, 240.
    let yuyv = vec![235, 128, 16, 128, 9, 9, 81, 90, 81, 240, 9, 9];
    let expected = [255, 255, 255, 0, 0, 0, 254, 0, 0, 254, 0, 0];
    let nv12 = vec![235, 16, 9, 235, 16, 9, 128, 128, 9];
    let nv12_expected = [255, 255, 255, 0, 0, 0, 255, 255, 255, 0, 0, 0];
    let jpeg = crate::source::jpeg::tests::grey(true, false);
    for (format, stride, side, bytes, expected) in [
        (YUYV, 6, 2, yuyv, expected.to_vec()),
        (NV12, 3, 2, nv12, nv12_expected.to_vec()),
        (
            RGB3,
            7,
            2,
            (0..14).collect(),
            vec![0, 1, 2, 3, 4, 5, 7, 8, 9, 10, 11, 12],
        ),
        (MJPG, 0, 8, jpeg, vec![144; 192]),
    ] {
        let mut one = filled(Instant::now(), 0, 0, 0);
        one.bytes = bytes.len();
        let fake = Fake::new(Script {
            modes: vec![mode(format, side, side, 30.0)],
            memory: vec![bytes],
            layout: Some(Layout {
                format,
                width: side,
                height: side,
                stride,
                matrix: Matrix::Bt601,
                range: Range::Limited,
                rate_hz: None,
            }),
            later: vec![one].into(),
            ..Script::default()
        });
        let mut camera = Camera::start("/dev/video7", String::new(), fake).expect("a camera");
        let mut picture = Picture::empty();
        assert!(camera.next(&mut picture).expect("a picture"), "no end");
        let worst = picture
            .rgb
            .iter()
            .zip(&expected)
            .map(|(a, b)| a.abs_diff(*b))
            .max();
        assert!(
            picture.rgb.len() == expected.len() && worst <= Some(1),
            "{}: {:?}",
            format.escape_ascii(),
            picture.rgb
        );
    }
}
