//! What whoever shows people in a headset says of it.

use super::gaze::GazeListener;
use super::panel::PrivacySwitch;
use super::wearer::WearerSlot;
use renderer_splat::background::Background;
use renderer_splat::options::Filter;
use std::sync::Arc;

/// How people are shown in a headset.
#[derive(Debug, Clone, Default)]
pub struct PresentOptions {
    /// What stands around them, and how it is filtered; without it the viewer's own room, or a studio.
    pub scene: Option<(Arc<Background>, Filter)>,
    /// Whether eyes' pictures will be read back.
    pub read_back: bool,
    /// The display's rate that is asked for, and kept, Hz; without it 72, and more where frames keep up.
    pub display_hz: Option<f32>,
    /// Where the wearer's own head and hands are put in each frame, if somebody captures them.
    pub wearer: Option<WearerSlot>,
    /// Who is told where the wearer looks.
    pub gaze: Option<Arc<dyn GazeListener>>,
    /// Whether others hear and see the wearer, where there are others.
    pub privacy: Option<Arc<dyn PrivacySwitch>>,
}
