//! SMPL-X's 55 joints: names, order and parents.

/// Number of joints of the SMPL-X skeleton.
pub const JOINTS: usize = 55;

macro_rules! joints {
    ($($name:ident = $text:literal < $parent:expr;)*) => {
        /// A joint of the SMPL-X skeleton, in SMPL-X's order.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
        #[repr(u8)]
        #[allow(missing_docs, reason = "the names are SMPL-X's own and say it")]
        pub enum Joint { $($name,)* }

        impl Joint {
            /// All joints in SMPL-X's order.
            pub const ALL: [Self; JOINTS] = [$(Self::$name,)*];
            const NAMES: [&'static str; JOINTS] = [$($text,)*];
            const PARENTS: [Option<Self>; JOINTS] = { use Joint::*; [$($parent,)*] };
        }
    };
}

joints! {
    Pelvis = "pelvis" < None;
    LeftHip = "left_hip" < Some(Pelvis);
    RightHip = "right_hip" < Some(Pelvis);
    Spine1 = "spine1" < Some(Pelvis);
    LeftKnee = "left_knee" < Some(LeftHip);
    RightKnee = "right_knee" < Some(RightHip);
    Spine2 = "spine2" < Some(Spine1);
    LeftAnkle = "left_ankle" < Some(LeftKnee);
    RightAnkle = "right_ankle" < Some(RightKnee);
    Spine3 = "spine3" < Some(Spine2);
    LeftFoot = "left_foot" < Some(LeftAnkle);
    RightFoot = "right_foot" < Some(RightAnkle);
    Neck = "neck" < Some(Spine3);
    LeftCollar = "left_collar" < Some(Spine3);
    RightCollar = "right_collar" < Some(Spine3);
    Head = "head" < Some(Neck);
    LeftShoulder = "left_shoulder" < Some(LeftCollar);
    RightShoulder = "right_shoulder" < Some(RightCollar);
    LeftElbow = "left_elbow" < Some(LeftShoulder);
    RightElbow = "right_elbow" < Some(RightShoulder);
    LeftWrist = "left_wrist" < Some(LeftElbow);
    RightWrist = "right_wrist" < Some(RightElbow);
    Jaw = "jaw" < Some(Head);
    LeftEye = "left_eye_smplhf" < Some(Head);
    RightEye = "right_eye_smplhf" < Some(Head);
    LeftIndex1 = "left_index1" < Some(LeftWrist);
    LeftIndex2 = "left_index2" < Some(LeftIndex1);
    LeftIndex3 = "left_index3" < Some(LeftIndex2);
    LeftMiddle1 = "left_middle1" < Some(LeftWrist);
    LeftMiddle2 = "left_middle2" < Some(LeftMiddle1);
    LeftMiddle3 = "left_middle3" < Some(LeftMiddle2);
    LeftPinky1 = "left_pinky1" < Some(LeftWrist);
    LeftPinky2 = "left_pinky2" < Some(LeftPinky1);
    LeftPinky3 = "left_pinky3" < Some(LeftPinky2);
    LeftRing1 = "left_ring1" < Some(LeftWrist);
    LeftRing2 = "left_ring2" < Some(LeftRing1);
    LeftRing3 = "left_ring3" < Some(LeftRing2);
    LeftThumb1 = "left_thumb1" < Some(LeftWrist);
    LeftThumb2 = "left_thumb2" < Some(LeftThumb1);
    LeftThumb3 = "left_thumb3" < Some(LeftThumb2);
    RightIndex1 = "right_index1" < Some(RightWrist);
    RightIndex2 = "right_index2" < Some(RightIndex1);
    RightIndex3 = "right_index3" < Some(RightIndex2);
    RightMiddle1 = "right_middle1" < Some(RightWrist);
    RightMiddle2 = "right_middle2" < Some(RightMiddle1);
    RightMiddle3 = "right_middle3" < Some(RightMiddle2);
    RightPinky1 = "right_pinky1" < Some(RightWrist);
    RightPinky2 = "right_pinky2" < Some(RightPinky1);
    RightPinky3 = "right_pinky3" < Some(RightPinky2);
    RightRing1 = "right_ring1" < Some(RightWrist);
    RightRing2 = "right_ring2" < Some(RightRing1);
    RightRing3 = "right_ring3" < Some(RightRing2);
    RightThumb1 = "right_thumb1" < Some(RightWrist);
    RightThumb2 = "right_thumb2" < Some(RightThumb1);
    RightThumb3 = "right_thumb3" < Some(RightThumb2);
}

impl Joint {
    /// Position in SMPL-X's order, 0..55.
    #[must_use]
    pub const fn index(self) -> usize {
        self as usize
    }

    /// SMPL-X's name for the joint, e.g. `left_knee`.
    #[must_use]
    pub const fn name(self) -> &'static str {
        Self::NAMES[self.index()]
    }

    /// The parent joint; `None` for the pelvis. A parent always comes before its children.
    #[must_use]
    pub const fn parent(self) -> Option<Self> {
        Self::PARENTS[self.index()]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parents_come_before_their_children() {
        for joint in Joint::ALL {
            assert_eq!(Joint::ALL[joint.index()], joint, "{}", joint.name());
            if let Some(parent) = joint.parent() {
                assert!(parent < joint, "the parent of {} comes later", joint.name());
            }
        }
    }

    #[test]
    fn the_parent_table_is_smplx_kintree() {
        // kintree_table[0] of the published SMPL-X model.
        let expected: [i32; JOINTS] = [
            -1, 0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 9, 9, 12, 13, 14, 16, 17, 18, 19, 15, 15, 15,
            20, 25, 26, 20, 28, 29, 20, 31, 32, 20, 34, 35, 20, 37, 38, 21, 40, 41, 21, 43, 44, 21,
            46, 47, 21, 49, 50, 21, 52, 53,
        ];
        for (joint, parent) in Joint::ALL.into_iter().zip(expected) {
            assert_eq!(
                joint.parent().map_or(-1, |p| i32::from(p as u8)),
                parent,
                "{}",
                joint.name()
            );
        }
    }
}
