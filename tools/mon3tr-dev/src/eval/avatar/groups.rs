//! Which pictures of a capture are compared: the paper's training poses and novel poses, and novel views.

use capture::HeldOut;

/// Pictures of one kind.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Group {
    /// As the tables name it.
    pub(super) name: &'static str,
    /// Cameras and frames.
    pub(super) pictures: Vec<(usize, usize)>,
}

/// The three groups, at most `most` pictures of each, spread evenly over their cameras and frames: training poses (training cameras), novel
/// poses (held-out frames, training cameras), novel views (training frames, held-out cameras). A group may be empty.
pub(super) fn groups(cameras: usize, frames: usize, held_out: &HeldOut, most: usize) -> [Group; 3] {
    let training_cameras = held_out.kept_cameras(cameras);
    let training_frames = held_out.kept_frames(frames);
    [
        ("training poses", &training_cameras, &training_frames),
        ("novel poses", &training_cameras, &held_out.frames),
        ("novel views", &held_out.cameras, &training_frames),
    ]
    .map(|(name, cameras, frames)| Group {
        name,
        pictures: spread(cameras, frames, most),
    })
}

/// All pairs, or `most` of them: frames evenly spread, and each with another camera, so that every camera has its turn.
pub(super) fn spread(cameras: &[usize], frames: &[usize], most: usize) -> Vec<(usize, usize)> {
    let all = cameras.len() * frames.len();
    let count = all.min(most);
    if count == all {
        let of_frame = |frame: &usize| {
            let frame = *frame;
            cameras.iter().map(move |camera| (*camera, frame))
        };
        return frames.iter().flat_map(of_frame).collect();
    }
    (0..count)
        .map(|k| {
            // Picture k of `count` is number `at` of all, counted frame by frame.
            let at = (2 * k + 1) * all / (2 * count);
            let (frame, camera) = (at / cameras.len(), at % cameras.len());
            // Where the steps are a multiple of the cameras, the same one would come each time.
            let turned = (camera + k) % cameras.len();
            (cameras[turned], frames[frame])
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashSet;

    fn held_out() -> HeldOut {
        HeldOut {
            cameras: vec![1, 3],
            frames: (8..12).collect(),
        }
    }

    #[test]
    fn no_group_holds_anothers_pictures_and_together_they_hold_what_they_should() {
        let [training, poses, views] = groups(5, 12, &held_out(), usize::MAX);
        assert_eq!(training.pictures.len(), 3 * 8, "training");
        assert_eq!(poses.pictures.len(), 3 * 4, "novel poses");
        assert_eq!(views.pictures.len(), 2 * 8, "novel views");
        assert!(
            poses.pictures.iter().all(|(_, frame)| *frame >= 8),
            "frames"
        );
        assert!(
            views
                .pictures
                .iter()
                .all(|(camera, frame)| camera % 2 == 1 && *frame < 8),
            "cameras"
        );
        let all = [training, poses, views];
        let every: HashSet<_> = all.iter().flat_map(|group| &group.pictures).collect();
        assert_eq!(every.len(), 24 + 12 + 16, "one picture in two groups");
    }

    #[test]
    fn a_few_pictures_show_every_camera_and_the_whole_time() {
        let [training, ..] = groups(5, 12, &held_out(), 6);
        assert_eq!(training.pictures.len(), 6, "as many as were asked for");
        let cameras: HashSet<_> = training.pictures.iter().map(|(camera, _)| camera).collect();
        assert_eq!(cameras.len(), 3, "{:?}", training.pictures);
        let frames: HashSet<_> = training.pictures.iter().map(|(_, frame)| frame).collect();
        assert_eq!(frames.len(), 6, "{:?}", training.pictures);
    }
}
