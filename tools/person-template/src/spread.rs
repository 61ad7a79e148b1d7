//! The first Gaussians' places on the template: as many as are asked for, spread by area, denser where people look.

use glam::DVec3;
use scan_rig::body::BodyPart;

/// Where Gaussians are.
#[derive(Debug, Clone, Default)]
pub(crate) struct Places {
    /// `[N_g]` the face of each.
    pub(crate) faces: Vec<u32>,
    /// `[N_g]` barycentric weights of the face's second and third corner.
    pub(crate) barycentrics: Vec<[f32; 2]>,
    /// `[N_g]` the square root of the area that each covers, metres.
    pub(crate) spacing: Vec<f64>,
}

/// How many times more Gaussians an area of a part gets than plain skin or cloth.
fn density(part: BodyPart) -> f64 {
    match part {
        BodyPart::Skin => 1.0,
        BodyPart::Face => 4.0,
        BodyPart::Head => 1.5,
        // A finger is as wide as two Gaussians of plain skin.
        BodyPart::Hand => 5.0,
        BodyPart::Eyes => 3.0,
        BodyPart::InnerMouth | BodyPart::EyeSocket => 0.4,
        BodyPart::Teeth | BodyPart::Tongue => 0.8,
    }
}

/// Spreads `count` Gaussians over the faces: evenly along the list of faces by area times density, within a face by a low-discrepancy sequence (Roberts'
/// R2), so that the result depends on its arguments alone.
pub(crate) fn spread(
    vertices: &[DVec3],
    faces: &[[u32; 3]],
    parts: &[BodyPart],
    count: usize,
) -> Places {
    let shares: Vec<f64> = (faces.iter().zip(parts))
        .map(|(face, part)| {
            let [a, b, c] = face.map(|v| vertices[v as usize]);
            0.5 * (b - a).cross(c - a).length() * density(*part)
        })
        .collect();
    let total: f64 = shares.iter().sum();
    let mut places = Places::default();
    if total <= 0.0 || count == 0 {
        return places;
    }
    let step = total / count as f64;
    let (mut passed, mut next) = (0.0, 0_usize);
    for (face, (share, part)) in (0_u32..).zip(shares.iter().zip(parts)) {
        passed += share;
        while next < count && (next as f64 + 0.5) * step <= passed {
            // The plastic number's powers: the most irrational pair.
            let along = |ratio: f64| (0.5 + ratio * next as f64).fract();
            let (mut v, mut w) = (
                along(0.754_877_666_246_692_8),
                along(0.569_840_290_998_053_2),
            );
            if v + w > 1.0 {
                (v, w) = (1.0 - v, 1.0 - w);
            }
            places.faces.push(face);
            #[expect(clippy::cast_possible_truncation, reason = "shares of 1")]
            places.barycentrics.push([v as f32, w as f32]);
            places.spacing.push((step / density(*part)).sqrt());
            next += 1;
        }
    }
    places
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn areas_get_their_share_and_faces_four_times_as_many() {
        // Two squares of the same size, one of cloth and one of a face.
        let square = |x: f64| [0.0, 1.0].map(|u| [0.0, 1.0].map(|v| DVec3::new(x + u, v, 0.0)));
        let vertices: Vec<DVec3> = [square(0.0), square(2.0)]
            .into_iter()
            .flatten()
            .flatten()
            .collect();
        let faces = [[0, 2, 3], [0, 3, 1], [4, 6, 7], [4, 7, 5]];
        let parts = [
            BodyPart::Skin,
            BodyPart::Skin,
            BodyPart::Face,
            BodyPart::Face,
        ];
        let places = spread(&vertices, &faces, &parts, 1000);
        assert_eq!(places.faces.len(), 1000, "as many as asked for");
        let on = |face: u32| places.faces.iter().filter(|f| **f == face).count();
        let counts = [on(0), on(1), on(2), on(3)];
        assert_eq!(counts, [100, 100, 400, 400], "by area and density");
        assert!(
            (places.barycentrics.iter()).all(|[v, w]| *v >= 0.0 && *w >= 0.0 && v + w <= 1.0),
            "outside of a face"
        );
        let [first, last] = [places.spacing[0], places.spacing[999]];
        assert!((first / last - 2.0).abs() < 1e-9, "{first} and {last}");
        assert!(
            spread(&vertices, &faces, &parts, 0).faces.is_empty(),
            "none"
        );
    }
}
