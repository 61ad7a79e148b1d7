//! What lenses hide is not drawn, on the stand-in runtime with the machine's own Vulkan.

use std::sync::Arc;

use openxr::sys::Result as XrResult;
use renderer_splat::drawing::{Drawing, Foreground, Part};
use renderer_splat::options::{BackEnd, RendererOptions};
use renderer_splat::renderer::SplatRenderer;

use super::pictures::{DIRECT, Made, QUADS, SIZE, Seen, cloud, only_copied, show};
use super::*;
use crate::eyes::{EyePicture, RenderPath, Surround};
use crate::fake::{Lens, World};

const TILES: Made = Made {
    back_end: BackEnd::Tiles,
    ..QUADS
};

/// An ellipse that hides the four corners of an eye's picture, as tangents: of 24 sides, 1.06 times as large as the one that fits into it.
fn ellipse(world: &World, eye: usize) -> Vec<[f32; 2]> {
    let fov = world.eyes[eye].1;
    let tangents = [
        fov.angle_left,
        fov.angle_right,
        fov.angle_down,
        fov.angle_up,
    ];
    let [left, right, down, up] = tangents.map(f32::tan);
    (0u8..24)
        .map(|index| {
            let angle = f32::from(index) * std::f32::consts::TAU / 24.0;
            [
                (left + right + 1.06 * (right - left) * angle.cos()) / 2.0,
                (down + up + 1.06 * (up - down) * angle.sin()) / 2.0,
            ]
        })
        .collect()
}

fn put_lenses(world: &mut World) {
    world.lenses = [0, 1].map(|eye| Lens::around(&ellipse(world, eye)));
}

/// Whether the ellipse of [`ellipse`] shows a pixel's centre: in f64, of the pixel's place alone, for its sides are chords.
fn is_shown(size: [u32; 2], x: u32, y: u32) -> bool {
    let across = (f64::from(x) + 0.5) / f64::from(size[0]) * 2.0 - 1.0;
    let down = (f64::from(y) + 0.5) / f64::from(size[1]) * 2.0 - 1.0;
    let step = std::f64::consts::TAU / 24.0;
    let apothem = 1.06 * (step / 2.0).cos();
    (0..24).all(|side| {
        let angle = (f64::from(side) + 0.5) * step;
        across * angle.cos() + down * angle.sin() <= apothem
    })
}

/// Compares an eye's picture behind a lens with the one without. Returns how many pixels the lens left clear.
fn assert_only_the_hidden_is_clear(open: &EyePicture, behind: &EyePicture) -> usize {
    let size = [open.width, open.height];
    assert_eq!(size, [behind.width, behind.height], "as large");
    let pixels = open.rgba.chunks_exact(4).zip(behind.rgba.chunks_exact(4));
    let mut clear = 0;
    for (place, (open, behind)) in (0u32..).zip(pixels) {
        let (x, y) = (place % size[0], place / size[0]);
        let cleared = behind == [0; 4] && open != [0; 4];
        assert!(open == behind || cleared, "pixel {x}, {y}: {behind:?}");
        assert!(!(cleared && is_shown(size, x, y)), "pixel {x}, {y} is seen");
        clear += usize::from(cleared);
    }
    clear
}

fn corner_is_clear(eye: &EyePicture) -> bool {
    eye.rgba[..4] == [0; 4]
}

#[test]
fn behind_lenses_each_path_leaves_the_hidden_corners_clear_and_draws_the_rest_as_ever() {
    let cloud = cloud();
    let plain: fn(&mut World) = |_| {};
    for (change, made, way) in [
        (plain, QUADS, DIRECT),
        (only_copied, QUADS, RenderPath::Copied),
        (plain, TILES, RenderPath::Copied),
    ] {
        for share in [1.0, 0.7] {
            let made = Made {
                surround: Surround::Studio,
                share,
                ..made
            };
            let Some(open) = show(change, made, &cloud) else {
                return;
            };
            let masked = |world: &mut World| {
                change(world);
                put_lenses(world);
            };
            let behind = show(masked, made, &cloud).expect("Vulkan is there");
            assert_eq!((open.way, behind.way), (way, way), "ways");
            for (eye, (open, behind)) in open.eyes.iter().zip(&behind.eyes).enumerate() {
                let clear = assert_only_the_hidden_is_clear(open, behind);
                let all = (open.width * open.height) as usize;
                println!("{way}, at {share}, eye {eye}: {clear} of {all} pixels");
                assert!(corner_is_clear(behind), "the corner");
                assert!(clear > all / 50, "{clear} of {all} pixels are clear");
            }
            let far = |seen: &Seen| {
                let depths = seen.depths.as_ref().expect("depths");
                depths.first().copied().expect("a corner")
            };
            assert!(far(&behind) == 1.0, "the hidden corner's depth");
        }
    }
}

#[test]
fn before_the_room_the_same_person_is_seen_through_lenses() {
    let cloud = cloud();
    for made in [QUADS, TILES] {
        let Some(open) = show(|_| {}, made, &cloud) else {
            return;
        };
        let behind = show(put_lenses, made, &cloud).expect("Vulkan is there");
        for (open, behind) in open.eyes.iter().zip(&behind.eyes) {
            assert_only_the_hidden_is_clear(open, behind);
            let drawn = behind.rgba.chunks_exact(4).filter(|pixel| pixel[3] > 0);
            assert!(drawn.count() > 5_000, "a cloud");
        }
    }
}

/// A session that shows a studio through whatever lenses its runtime has.
struct Shown {
    renderer: SplatRenderer,
    session: Session,
    headset: Headset,
}

impl Shown {
    fn new(fake: &FakeRuntime) -> Option<Self> {
        let headset = open_sized(fake, SIZE)?;
        let options = SessionOptions {
            room: false,
            read_back: true,
            display_hz: None,
        };
        let mut session = Session::new(&headset, options).expect("a session");
        session.poll().expect("polled");
        let options = RendererOptions {
            back_end: Some(BackEnd::Tiles),
            ..RendererOptions::new(1, SIZE[0], SIZE[1], 2)
        };
        let renderer = SplatRenderer::new(Arc::clone(headset.gpu()), &options).expect("renderer");
        Some(Self {
            renderer,
            session,
            headset,
        })
    }

    /// Whether the corner of each eye's next picture is left out.
    fn corners(&mut self) -> [bool; 2] {
        self.session.poll().expect("polled");
        let frame = self.session.wait().expect("waited");
        let eyes = self
            .session
            .locate_views(&frame)
            .expect("looked")
            .expect("eyes");
        let parts = [Part::here(Foreground::Set)];
        let drawing = Drawing::new(&eyes.cameras, &parts);
        let mut canvas = (self.session.canvas(&eyes, Surround::Studio, true)).expect("canvas");
        self.renderer
            .draw_onto(&drawing, &mut canvas)
            .expect("drawn");
        let seen = self.session.show(frame).expect("shown").expect("pictures");
        assert_eq!(self.headset.gpu().validation_messages(), 0, "validation");
        seen.each_ref().map(corner_is_clear)
    }
}

#[test]
fn a_lens_is_asked_for_once_and_anew_when_the_runtime_says_that_it_changed() {
    let fake = everything();
    let Some(mut shown) = Shown::new(&fake) else {
        return;
    };
    let asked = || fake.calls("xrGetVisibilityMaskKHR").len();
    assert_eq!(asked(), 2, "each eye once: there is no mask to fetch");
    assert_eq!(shown.corners(), [false; 2], "no lenses");
    let lens = fake.set(|world| Lens::around(&ellipse(world, 1)));
    fake.queue_lens(1, lens.clone());
    assert_eq!(shown.corners(), [false, true], "of the right eye");
    assert_eq!(asked(), 4, "its size, then itself");
    assert_eq!(shown.corners(), [false, true], "it stays");
    assert_eq!(asked(), 4, "and is not asked for again");
    fake.queue_lens(1, Lens::default());
    assert_eq!(shown.corners(), [false; 2], "it is gone");
    // Of no view that there is.
    fake.queue(sys::EventDataVisibilityMaskChangedKHR {
        ty: sys::EventDataVisibilityMaskChangedKHR::TYPE,
        next: std::ptr::null(),
        session: sys::Handle::NULL,
        view_configuration_type: openxr::ViewConfigurationType::PRIMARY_STEREO,
        view_index: 7,
    });
    let before = asked();
    assert_eq!(shown.corners(), [false; 2], "nothing changed");
    assert_eq!(asked(), before, "nothing was asked for");
}

#[test]
fn a_mask_that_cannot_be_right_hides_nothing() {
    let fake = everything();
    let Some(mut shown) = Shown::new(&fake) else {
        return;
    };
    let right = fake.set(|world| Lens::around(&ellipse(world, 0)));
    let with = |change: fn(&mut Lens)| {
        let mut lens = right.clone();
        change(&mut lens);
        lens
    };
    let most = Lens::rectangle([-2.0, -2.0], [0.2, 2.0]);
    // Less than half of the picture, and all around the axis.
    let upper = Lens::rectangle([-2.0, -0.08], [2.0, 2.0]);
    let millions = Some([3_000_000, u32::MAX]);
    let wrong: [(&str, Lens); 9] = [
        ("no such corner", with(|lens| lens.indices[5] = 48)),
        ("no number", with(|lens| lens.corners[3][0] = f32::NAN)),
        ("infinite", with(|lens| lens.corners[3][1] = f32::INFINITY)),
        ("no triangles", with(|lens| lens.indices.truncate(70))),
        (
            "millions",
            Lens {
                says: millions,
                ..right.clone()
            },
        ),
        ("fewer than it has", with(|lens| lens.says = Some([3, 3]))),
        ("no indices", with(|lens| lens.indices.clear())),
        ("more than half", most),
        ("the middle", upper),
    ];
    for (what, lens) in wrong {
        fake.queue_lens(0, right.clone());
        assert_eq!(shown.corners(), [true, false], "a lens, before {what}");
        fake.forget_calls();
        fake.queue_lens(0, lens);
        assert_eq!(shown.corners(), [false; 2], "{what}");
        let asked = fake.calls("xrGetVisibilityMaskKHR").len();
        let sized = !["millions", "no indices"].contains(&what);
        assert_eq!(asked, 1 + usize::from(sized), "calls for {what}");
    }
    fake.fail("xrGetVisibilityMaskKHR", XrResult::ERROR_RUNTIME_FAILURE);
    fake.queue_lens(0, right.clone());
    assert_eq!(shown.corners(), [false; 2], "a call that fails");
    fake.heal("xrGetVisibilityMaskKHR");
    fake.queue_lens(0, right);
    assert_eq!(shown.corners(), [true, false], "and works again");
}

#[test]
fn a_runtime_without_the_extension_is_not_asked() {
    let fake = everything();
    fake.set(|world| {
        world
            .extensions
            .retain(|name| *name != "XR_KHR_visibility_mask");
    });
    fake.set(put_lenses);
    let Some(mut shown) = Shown::new(&fake) else {
        return;
    };
    assert_eq!(shown.corners(), [false; 2], "all is drawn");
    assert!(fake.calls("xrGetVisibilityMaskKHR").is_empty(), "no call");
}
