//! `XR_FB_face_tracking2`: the strengths of 70 expressions of the wearer's face, seen by cameras or heard by the microphone.
//!
//! Without it the wearer's lips follow their voice. Raw calls, because `openxr` 0.22 has no wrapper.

use openxr::sys::{self, Handle as _};
use openxr::{Instance, Session, SystemId, Time, Vulkan, raw};

use super::{Absent, ask_system, outcome, refused, share};

const EXTENSION: &str = "XR_FB_face_tracking2";

/// Expressions of a face, in the order of `XrFaceExpression2FB`.
pub const FACE_EXPRESSIONS: usize = 70;

/// What a face is known from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FaceSource {
    /// Cameras.
    Seen,
    /// The microphone.
    Heard,
}

/// The wearer's face at one time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Face {
    /// Strengths in the order of `XrFaceExpression2FB`, 0..=1.
    pub weights: [f32; FACE_EXPRESSIONS],
    /// Of the lower and of the upper half, 0..=1.
    pub confidences: [f32; 2],
    /// Whether the strengths of `EYES_LOOK_...` tell where the eyes look.
    pub eyes_look: bool,
    /// What it is known from.
    pub source: FaceSource,
}

/// The tracker of one face.
pub(crate) struct FaceTracking {
    session: Session<Vulkan>,
    tracker: sys::FaceTracker2FB,
}

impl std::fmt::Debug for FaceTracking {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("FaceTracking").finish_non_exhaustive()
    }
}

impl FaceTracking {
    /// Starts tracking the face, by all sources that the headset has.
    ///
    /// # Errors
    /// [`Absent`] where the runtime or the headset cannot, or refuses to: it does so until the wearer gives leave.
    pub(crate) fn new(session: &Session<Vulkan>, system: SystemId) -> Result<Self, Absent> {
        let instance = session.instance();
        let fp = functions(instance)?;
        let (mut sources, count) = supported(instance, system)?;
        let info = sys::FaceTrackerCreateInfo2FB {
            ty: sys::FaceTrackerCreateInfo2FB::TYPE,
            next: std::ptr::null(),
            face_expression_set: sys::FaceExpressionSet2FB::DEFAULT,
            requested_data_source_count: count,
            requested_data_sources: sources.as_mut_ptr(),
        };
        let mut tracker = sys::FaceTracker2FB::NULL;
        // SAFETY: the session is alive, `info` is whole and `sources` has at least `count`.
        let result = unsafe { (fp.create_face_tracker2)(session.as_raw(), &info, &mut tracker) };
        outcome(result).map_err(refused("xrCreateFaceTracker2FB"))?;
        Ok(Self {
            session: session.clone(),
            tracker,
        })
    }

    /// The face at a time; nothing while it is not tracked.
    ///
    /// # Errors
    /// [`Absent::Refused`] with what the runtime says.
    pub(crate) fn read(&self, time: Time) -> Result<Option<Face>, Absent> {
        let fp = functions(self.session.instance())?;
        let info = sys::FaceExpressionInfo2FB {
            ty: sys::FaceExpressionInfo2FB::TYPE,
            next: std::ptr::null(),
            time,
        };
        let (mut weights, mut confidences) = ([0.0; FACE_EXPRESSIONS], [0.0; 2]);
        let mut read = sys::FaceExpressionWeights2FB {
            ty: sys::FaceExpressionWeights2FB::TYPE,
            next: std::ptr::null_mut(),
            weight_count: u32::try_from(weights.len()).unwrap_or(0),
            weights: weights.as_mut_ptr(),
            confidence_count: u32::try_from(confidences.len()).unwrap_or(0),
            confidences: confidences.as_mut_ptr(),
            is_valid: sys::FALSE,
            is_eye_following_blendshapes_valid: sys::FALSE,
            data_source: sys::FaceTrackingDataSource2FB::VISUAL,
            time,
        };
        // SAFETY: the tracker is alive; both arrays have the lengths that are named.
        let result = unsafe { (fp.get_face_expression_weights2)(self.tracker, &info, &mut read) };
        outcome(result).map_err(refused("xrGetFaceExpressionWeights2FB"))?;
        let eyes_look = read.is_eye_following_blendshapes_valid != sys::FALSE;
        let source = if read.data_source == sys::FaceTrackingDataSource2FB::AUDIO {
            FaceSource::Heard
        } else {
            FaceSource::Seen
        };
        Ok((read.is_valid != sys::FALSE).then(|| Face {
            weights: weights.map(share),
            confidences: confidences.map(share),
            eyes_look,
            source,
        }))
    }
}

impl Drop for FaceTracking {
    fn drop(&mut self) {
        if let Ok(fp) = functions(self.session.instance()) {
            // SAFETY: made by the session, which `self` keeps alive. What the runtime says is of no use any more.
            unsafe { (fp.destroy_face_tracker2)(self.tracker) };
        }
    }
}

fn functions(instance: &Instance) -> Result<&raw::FaceTracking2FB, Absent> {
    let functions = instance.exts().fb_face_tracking2.as_ref();
    functions.ok_or(Absent::NotGranted(EXTENSION))
}

/// The sources that the headset has, and how many; absent where it tracks no face.
fn supported(
    instance: &Instance,
    system: SystemId,
) -> Result<([sys::FaceTrackingDataSource2FB; 2], u32), Absent> {
    use sys::FaceTrackingDataSource2FB as Source;
    let mut face = sys::SystemFaceTrackingProperties2FB {
        ty: sys::SystemFaceTrackingProperties2FB::TYPE,
        next: std::ptr::null_mut(),
        supports_visual_face_tracking: sys::FALSE,
        supports_audio_face_tracking: sys::FALSE,
    };
    // SAFETY: it may be chained to the system's properties where the extension is enabled.
    unsafe { ask_system(instance, system, &mut face) }?;
    let seen = face.supports_visual_face_tracking != sys::FALSE;
    let heard = face.supports_audio_face_tracking != sys::FALSE;
    match (seen, heard) {
        (true, true) => Ok(([Source::VISUAL, Source::AUDIO], 2)),
        (true, false) => Ok(([Source::VISUAL; 2], 1)),
        (false, true) => Ok(([Source::AUDIO; 2], 1)),
        (false, false) => Err(Absent::NotBySystem(EXTENSION)),
    }
}
