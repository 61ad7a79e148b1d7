//! Sources of pictures against real files: made here by ffmpeg from its own test pictures, and a real clip.

use std::error::Error;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};

use tempfile::TempDir;
use tracker::source::{Picture, Source, SourceChoice, SourceError, open, open_live};

/// What takes so long has stopped: nothing here is expected to take a second.
const HANG: Duration = Duration::from_secs(60);

/// The program, and a folder for what it makes; or nothing where the machine lacks it.
struct Ffmpeg {
    program: PathBuf,
    folder: TempDir,
}

/// # Panics
/// With `CI=true`, where everything must be there.
fn skip(why: &str) {
    assert!(std::env::var("CI").as_deref() != Ok("true"), "{why}");
    println!("skipped: {why}");
}

impl Ffmpeg {
    fn find() -> Option<Self> {
        let program = std::env::var_os("MON3TR_FFMPEG")
            .map_or_else(|| PathBuf::from("ffmpeg"), PathBuf::from);
        if Command::new(&program).arg("-version").output().is_err() {
            skip("there is no ffmpeg: set MON3TR_FFMPEG (./run env)");
            return None;
        }
        let folder = tempfile::tempdir().expect("a folder");
        Some(Self { program, folder })
    }

    fn path(&self, file: &str) -> PathBuf {
        self.folder.path().join(file)
    }

    /// Makes a file of it and gives its path. Words are split at blanks.
    fn make(&self, arguments: &str, file: &str) -> PathBuf {
        let path = self.path(file);
        let made = Command::new(&self.program)
            .args(["-nostdin", "-y", "-v", "error", "-bitexact"])
            .args(arguments.split_ascii_whitespace())
            .arg(&path)
            .current_dir(self.folder.path())
            .output()
            .expect("ffmpeg starts");
        assert!(
            made.status.success(),
            "{arguments}: {}",
            String::from_utf8_lossy(&made.stderr)
        );
        path
    }
}

fn choice(path: &Path) -> SourceChoice {
    let Ok(choice) = path.to_str().expect("a plain path").parse();
    choice
}

fn opened(path: &Path) -> Result<Box<dyn Source>, SourceError> {
    open(&choice(path))
}

/// The error of a source that has no picture, at its opening or its first one.
fn refused(path: &Path) -> String {
    let first = opened(path).and_then(|mut source| source.next(&mut Picture::empty()));
    let why = first.expect_err("no picture");
    match why.source() {
        Some(cause) => format!("{why}: {cause}"),
        None => why.to_string(),
    }
}

/// All its pictures.
fn all(mut source: Box<dyn Source>) -> Vec<Picture> {
    let mut pictures = Vec::new();
    let mut one = Picture::empty();
    while source.next(&mut one).expect("no error") {
        assert_eq!(
            one.rgb.len(),
            3 * one.width as usize * one.height as usize,
            "bytes"
        );
        assert_eq!(
            (one.width, one.height),
            (source.info().width, source.info().height),
            "size"
        );
        assert_eq!(one.number, pictures.len() as u64, "number");
        pictures.push(one.clone());
    }
    assert!(
        !source.next(&mut one).expect("still the end"),
        "still the end"
    );
    pictures
}

fn mean_difference(a: &Picture, b: &Picture) -> f64 {
    assert_eq!((a.width, a.height), (b.width, b.height), "size");
    let sum: u64 = a
        .rgb
        .iter()
        .zip(&b.rgb)
        .map(|(a, b)| u64::from(a.abs_diff(*b)))
        .sum();
    sum as f64 / a.rgb.len() as f64
}

#[test]
fn a_real_clip_is_decoded_whole() {
    let Some(ffmpeg) = Ffmpeg::find() else { return };
    let Some(footage) = std::env::var_os("MON3TR_FOOTAGE") else {
        return skip("there is no footage: set MON3TR_FOOTAGE (./run env)");
    };
    let clip = Path::new(&footage).join("carphone/carphone_pristine.mp4");
    let source = opened(&clip).expect("a video");
    let info = source.info().clone();
    assert_eq!((info.width, info.height), (176, 144), "info");
    assert!((info.rate_hz.expect("a rate") - 29.97).abs() < 0.01, "rate");
    let pictures = all(source);
    assert_eq!(pictures.len(), 120, "pictures");
    for (number, picture) in pictures.iter().enumerate() {
        let expected = number as f64 * 1001.0 / 30000.0;
        assert!(
            (picture.seconds - expected).abs() < 1e-4,
            "{} of {expected}",
            picture.seconds
        );
    }
    // Our own conversion of its planes, against ffmpeg's of the same.
    let planes = ffmpeg.make(
        &format!("-i {} -pix_fmt yuv420p", clip.display()),
        "clip.y4m",
    );
    let ours = all(opened(&planes).expect("y4m"));
    assert_eq!(ours.len(), 120, "pictures");
    let worst = ours
        .iter()
        .zip(&pictures)
        .map(|(a, b)| mean_difference(a, b))
        .fold(0.0, f64::max);
    println!("y4m against ffmpeg's own RGB: {worst:.2} codes in the mean of the worst picture");
    assert!(worst < 3.0, "{worst}");
}

#[test]
fn a_variable_rate_keeps_its_times() {
    let Some(ffmpeg) = Ffmpeg::find() else { return };
    let path = ffmpeg.make(
        "-f lavfi -i testsrc=s=64x48:r=10:d=1 -vf settb=1/1000,setpts=N*N*20+500 -fps_mode passthrough -enc_time_base 1:1000 -c:v ffv1",
        "variable.mkv",
    );
    let pictures = all(opened(&path).expect("a video"));
    assert_eq!(pictures.len(), 10, "pictures");
    for (number, picture) in pictures.iter().enumerate() {
        let expected = (number * number) as f64 * 0.02;
        assert!(
            (picture.seconds - expected).abs() < 1.1e-3,
            "{} of {expected}",
            picture.seconds
        );
    }
}

#[test]
fn odd_sizes_and_ten_bits_are_decoded() {
    let Some(ffmpeg) = Ffmpeg::find() else { return };
    let path = ffmpeg.make(
        "-f lavfi -i testsrc=s=63x47:r=5:d=1 -pix_fmt yuv420p10le -c:v ffv1",
        "odd name, 100%.mkv",
    );
    let pictures = all(opened(&path).expect("a video"));
    assert_eq!(
        (pictures.len(), pictures[0].width, pictures[0].height),
        (5, 63, 47),
        "pictures"
    );
}

#[test]
fn every_layout_of_y4m_shows_what_ffmpeg_shows() {
    let Some(ffmpeg) = Ffmpeg::find() else { return };
    // Smooth colours: what is compared is the arithmetic, not how chroma is interpolated.
    for (size, range) in [("66x50", "tv"), ("67x49", "pc"), ("1280x32", "tv")] {
        let matrix = if size.starts_with("1280") {
            "bt709"
        } else {
            "smpte170m"
        };
        let scale = format!("scale=out_range={range}:out_color_matrix={matrix}");
        let tagged = format!("-color_range {range} -colorspace {matrix}");
        for format in [
            "yuv420p",
            "yuv422p",
            "yuv444p",
            "gray",
            "yuv420p10le",
            "yuv422p10le",
            "yuv444p10le",
            "yuv420p12le",
        ] {
            let filter = format!(
                "gradients=s={size}:r=2:d=1:seed=7:c0=red:c1=0x2040a0:speed=0.01,{scale},format={format}"
            );
            let planes = ffmpeg.make(&format!("-f lavfi -i {filter} -strict -1"), "planes.y4m");
            let video = ffmpeg.make(
                &format!("-f lavfi -i {filter} -c:v ffv1 {tagged}"),
                "planes.mkv",
            );
            let (ours, theirs) = (
                all(opened(&planes).expect("y4m")),
                all(opened(&video).expect("a video")),
            );
            assert_eq!((ours.len(), theirs.len()), (2, 2), "{format}");
            let mean = mean_difference(&ours[1], &theirs[1]);
            println!("{format} {size} {range}: {mean:.2} codes in the mean");
            // ffmpeg interpolates chroma. Another matrix, or another range, is four codes and more.
            let whole = format.contains("444") || format.contains("gray");
            assert!(
                mean < if whole { 0.6 } else { 2.5 },
                "{format} {size} {range}: {mean}"
            );
        }
    }
}

#[test]
fn a_video_is_turned_as_its_file_says() {
    let Some(ffmpeg) = Ffmpeg::find() else { return };
    ffmpeg.make(
        "-f lavfi -i testsrc=s=96x64:r=5:d=1 -c:v mpeg4",
        "lying.mp4",
    );
    let turned = ffmpeg.make("-display_rotation 90 -i lying.mp4 -c copy", "turned.mp4");
    let pictures = all(opened(&turned).expect("a video"));
    assert_eq!(
        (pictures.len(), pictures[0].width, pictures[0].height),
        (5, 64, 96),
        "upright"
    );
}

#[test]
fn files_that_are_no_videos_say_why() {
    let Some(ffmpeg) = Ffmpeg::find() else { return };
    let sound = ffmpeg.make("-f lavfi -i sine=d=0.2", "sound.wav");
    let message = refused(&sound);
    assert!(
        message.contains("sound.wav") && message.contains("matches no streams"),
        "{message}"
    );

    let empty = ffmpeg.path("empty.mp4");
    std::fs::write(&empty, "").expect("a file");
    let message = refused(&empty);
    assert!(
        message.contains("empty.mp4") && message.contains("is empty"),
        "{message}"
    );

    let text = ffmpeg.path("text.mp4");
    std::fs::write(&text, "no video at all\n".repeat(100)).expect("a file");
    let message = refused(&text);
    assert!(
        message.contains("text.mp4 is no video that ffmpeg reads")
            && message.matches("Invalid data").count() == 1
            && message.contains("give a video file"),
        "{message}"
    );

    let message = refused(&ffmpeg.path("missing.mp4"));
    assert!(
        message.starts_with("there is no file or folder ") && message.contains("missing.mp4"),
        "{message}"
    );

    let huge = ffmpeg.make("-f lavfi -i color=s=8194x16:r=1:d=1 -c:v ffv1", "huge.mkv");
    let message = refused(&huge);
    assert!(
        message.contains("8194 x 16") && message.contains("at most 8192"),
        "{message}"
    );

    // A GIF of one pixel on a canvas of 8200 x 8200, which no memory is taken for.
    let canvas = ffmpeg.path("canvas.gif");
    let mut gif = b"GIF89a\x08\x20\x08\x20\x80\0\0".to_vec();
    gif.extend(b"\0\0\0\xff\xff\xff\x2c\0\0\0\0\x01\0\x01\0\0\x02\x02\x44\x01\0\x3b");
    std::fs::write(&canvas, gif).expect("a file");
    let message = refused(&canvas);
    println!("on a large canvas: {message}");
    assert!(
        message.contains("canvas.gif") && !message.contains("at most 8192"),
        "{message}"
    );

    let nothing = ffmpeg.make(
        "-f lavfi -i testsrc=s=64x48:d=1 -frames:v 0 -c:v rawvideo -f nut",
        "nothing.nut",
    );
    let message = refused(&nothing);
    assert!(message.contains("nothing.nut"), "{message}");
    println!("without a picture: {message}");
}

#[test]
fn a_video_that_breaks_off_gives_what_it_has() {
    let Some(ffmpeg) = Ffmpeg::find() else { return };
    let path = ffmpeg.make(
        "-f lavfi -i testsrc=s=320x240:r=10:d=3 -c:v ffv1",
        "whole.mkv",
    );
    let bytes = std::fs::read(&path).expect("the file");
    let cut = ffmpeg.path("cut.mkv");
    std::fs::write(&cut, &bytes[..bytes.len() / 2]).expect("a file");
    let count = all(opened(&cut).expect("a video")).len();
    assert!((5..30).contains(&count), "{count} pictures of 30");
    // Without its index at the end, an MP4 is nothing.
    let path = ffmpeg.make(
        "-f lavfi -i testsrc=s=320x240:r=10:d=1 -c:v mpeg4",
        "whole.mp4",
    );
    let bytes = std::fs::read(&path).expect("the file");
    let cut = ffmpeg.path("cut.mp4");
    std::fs::write(&cut, &bytes[..bytes.len() / 2]).expect("a file");
    let message = refused(&cut);
    assert!(
        message.contains("the file is cut off") && message.contains("moov"),
        "{message}"
    );
}

#[test]
fn motion_jpeg_and_folders_show_the_same() {
    let Some(ffmpeg) = Ffmpeg::find() else { return };
    let pattern = "-f lavfi -i testsrc=s=64x48:r=12:d=1";
    let stream = ffmpeg.make(&format!("{pattern} -q:v 2 -f mjpeg"), "stream.mjpeg");
    for folder in ["png", "jpg"] {
        std::fs::create_dir(ffmpeg.path(folder)).expect("a folder");
    }
    ffmpeg.make(&format!("{pattern} -start_number 1"), "png/picture %d.png");
    ffmpeg.make(&format!("{pattern} -q:v 2 -start_number 1"), "jpg/%d.JPG");
    let [stream, png, jpg] = [stream, ffmpeg.path("png"), ffmpeg.path("jpg")].map(|path| {
        let source = opened(&path).expect("pictures");
        assert_eq!(source.info().rate_hz, Some(30.0), "rate");
        all(source)
    });
    assert_eq!([stream.len(), png.len(), jpg.len()], [12; 3], "pictures");
    for ((stream, png), jpg) in stream.iter().zip(&png).zip(&jpg) {
        assert!(
            (stream.seconds - stream.number as f64 / 30.0).abs() < 1e-9,
            "time"
        );
        assert!(stream.rgb == jpg.rgb, "the same JPEG");
        let difference = mean_difference(stream, png);
        assert!(difference < 8.0, "{difference}");
    }
    std::fs::write(ffmpeg.path("png/picture 0.png"), b"no picture").expect("a file");
    let message = refused(&ffmpeg.path("png"));
    assert!(
        message.contains("picture 0.png") && message.contains("no PNG or JPEG"),
        "{message}"
    );
    // Not the first one: what comes before it is shown.
    std::fs::rename(
        ffmpeg.path("png/picture 0.png"),
        ffmpeg.path("png/picture 13.png"),
    )
    .expect("another name");
    let before = all(opened(&ffmpeg.path("png")).expect("pictures"));
    assert_eq!(before.len(), 12, "pictures before the one that is none");
    let message = refused(ffmpeg.folder.path());
    assert!(message.contains("no .png, .jpg or .jpeg file"), "{message}");
}

#[test]
fn pictures_of_one_folder_must_be_of_one_size() {
    let folder = tempfile::tempdir().expect("a folder");
    for (file, side) in [("1.png", 4), ("2.png", 4), ("3.png", 5)] {
        image::RgbImage::from_pixel(side, 4, image::Rgb([1, 2, 3]))
            .save(folder.path().join(file))
            .expect("a picture");
    }
    let mut source = opened(folder.path()).expect("pictures");
    assert_eq!(source.info().frames, Some(3), "count");
    let mut picture = Picture::empty();
    for _ in 0..2 {
        assert!(source.next(&mut picture).expect("a picture"), "no end");
        assert_eq!(picture.rgb, [1, 2, 3].repeat(16), "pixels");
    }
    let message = source
        .next(&mut picture)
        .expect_err("another size")
        .to_string();
    assert!(
        message.contains("picture 2") && message.contains("5 x 4"),
        "{message}"
    );
}

/// Processes whose command line has the words.
fn running(words: &str) -> usize {
    let processes = std::fs::read_dir("/proc").into_iter().flatten().flatten();
    processes
        .filter(|process| {
            let line = std::fs::read(process.path().join("cmdline")).unwrap_or_default();
            String::from_utf8_lossy(&line).contains(words)
        })
        .count()
}

#[test]
fn dropping_a_source_ends_its_ffmpeg() {
    let Some(ffmpeg) = Ffmpeg::find() else { return };
    let path = ffmpeg.make(
        "-f lavfi -i testsrc=s=320x240:r=30:d=20 -c:v mpeg4",
        "long clip to drop.mp4",
    );
    let words = path.display().to_string();
    for taken in [0, 3] {
        let mut source = opened(&path).expect("a video");
        for _ in 0..taken {
            assert!(
                source.next(&mut Picture::empty()).expect("a picture"),
                "no end"
            );
        }
        assert_eq!(running(&words), 1, "it runs");
        let begun = Instant::now();
        drop(source);
        assert_eq!(running(&words), 0, "it is gone, and waited for");
        assert!(begun.elapsed() < HANG, "it hangs");
    }
}

#[test]
fn a_file_in_a_cameras_place_plays_in_real_time() {
    let Some(ffmpeg) = Ffmpeg::find() else { return };
    let path = ffmpeg.make(
        "-f lavfi -i testsrc=s=64x48:r=20:d=1 -c:v mpeg4",
        "short.mp4",
    );
    let mut source = open_live(&choice(&path), false).expect("a video");
    let mut picture = Picture::empty();
    let mut ats = Vec::new();
    while source.next(&mut picture).expect("no error") {
        ats.push((picture.at, picture.seconds, picture.number));
    }
    let (first, last) = (ats[0], ats[ats.len() - 1]);
    let (wall, own) = ((last.0 - first.0).as_secs_f64(), last.1 - first.1);
    // A loaded machine may be late, and leave out the last ones; none may be early.
    assert!(
        wall > own - 1e-3 && wall < HANG.as_secs_f64(),
        "{wall} s for {own} s"
    );
    assert!(
        ats.is_sorted_by(|a, b| a.2 < b.2) && last.2 < 20,
        "each is counted once"
    );
    // Over and over, its times rise on.
    let mut source = open_live(&choice(&path), true).expect("a video");
    let begun = Instant::now();
    while picture.seconds < 1.5 || begun.elapsed() < Duration::from_secs(1) {
        assert!(source.next(&mut picture).expect("no error"), "no end");
    }
}

#[test]
fn a_live_address_gives_the_newest_picture() {
    let Some(ffmpeg) = Ffmpeg::find() else { return };
    // A port that nothing uses now.
    let port = std::net::UdpSocket::bind("127.0.0.1:0")
        .and_then(|socket| socket.local_addr())
        .expect("a port")
        .port();
    let url = format!("udp://127.0.0.1:{port}");
    let mut sender = Command::new(&ffmpeg.program)
        .args([
            "-nostdin",
            "-v",
            "error",
            "-re",
            "-f",
            "lavfi",
            "-i",
            "testsrc=s=64x48:r=25:d=60",
        ])
        .args(["-c:v", "mpeg2video", "-g", "5", "-f", "mpegts", &url])
        .spawn()
        .expect("ffmpeg starts");
    let Ok(choice) = url.parse();
    let opened = open(&choice);
    let outcome = opened.and_then(|mut source| {
        let mut picture = Picture::empty();
        source.next(&mut picture)?;
        let before = picture.number;
        // In which twelve come.
        std::thread::sleep(Duration::from_millis(500));
        let asked = Instant::now();
        source.next(&mut picture)?;
        let age = asked.saturating_duration_since(picture.at);
        Ok((picture.number - before - 1, age))
    });
    sender.kill().expect("it runs");
    sender.wait().expect("it ends");
    let (left_out, age) = outcome.expect("pictures");
    assert!(left_out >= 3, "{left_out} were left out");
    println!(
        "the newest picture was {:.0} ms old, {left_out} were left out",
        age.as_secs_f64() * 1000.0
    );
}

#[test]
fn a_camera_that_is_not_there_says_which_are() {
    let Ok(choice) = "99".parse();
    let message = open(&choice).err().expect("no camera").to_string();
    assert!(message.contains("/dev/video99"), "{message}");
}
