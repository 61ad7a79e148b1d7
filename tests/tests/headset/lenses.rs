//! What Monado says that lenses hide is not drawn.

use test_support::headset_reference::numbers;
use test_support::monado::{Compositor, Driver, Monado};
use test_support::service::attended;

use crate::program::Program;

const SIZE: [u32; 2] = [1024, 1024];

/// Its simulated headset's masks hide a small triangle in each corner.
fn corners_are_hidden(back_end: &str) {
    let Some(monado) = Monado::start(Driver::Simulated, Compositor::Null) else {
        return;
    };
    let mut program = Program::in_studio(&monado, back_end, SIZE);
    let (told, pictures) = program.read("lenses");
    let shares = numbers(&told["lenses_show"]);
    for (eye, (picture, share)) in pictures.iter().zip(&shares).enumerate() {
        let clear = picture.pixels().filter(|pixel| pixel.0 == [0; 4]).count();
        let opaque = picture.pixels().filter(|pixel| pixel.0[3] == 255).count();
        let all = (SIZE[0] * SIZE[1]) as usize;
        println!(
            "eye {eye}: {:.1} % of the tiles are seen, {clear} of {all} pixels are clear",
            100.0 * share
        );
        assert_eq!(clear + opaque, all, "hidden or seen wholly");
        // 1024 is a multiple of a tile's side.
        let most = (1.0 - share) * f64::from(SIZE[0] * SIZE[1]) + 0.5;
        let hidden = f64::from(u32::try_from(clear).expect("a picture's pixels"));
        assert!(clear > 0 && hidden <= most, "{clear} pixels of {most}");
        let [width, height] = SIZE;
        for (x, y) in [
            (0, 0),
            (width - 1, 0),
            (0, height - 1),
            (width - 1, height - 1),
        ] {
            assert_eq!(picture.get_pixel(x, y).0, [0; 4], "the corner at {x}, {y}");
        }
        let middle = picture.get_pixel(width / 2, height / 2).0;
        assert_eq!(middle[3], 255, "the middle is seen");
    }
    program.end();
    program.ended_well();
}

#[test]
fn behind_monados_lenses_the_corners_are_clear_in_pictures_by_tiles() {
    attended(|| corners_are_hidden("tiles"));
}

#[test]
fn behind_monados_lenses_the_corners_are_clear_in_pictures_by_quads() {
    attended(|| corners_are_hidden("quads"));
}
