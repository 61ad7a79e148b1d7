//! The receiver: an avatar and motion parameters in, pictures and per-stage times out.
//!
//! A call's frames go through [`Lanes`], a thread for each unit; stills go the same way step by step through a [`Receiver`].
//! Which unit does what is decided in `placement/`, what each step took is told to a [`Collector`]. Where people stand in a
//! viewer's room is [`presence`]'s.

mod bridge;
mod call;
mod control;
mod deform;
mod error;
pub mod headset;
pub mod hold;
mod interpolate;
mod kernels;
mod lanes;
mod overlay;
mod placement;
mod pool;
mod posing;
pub mod presence;
mod profile;
mod receiver;
mod stage;
mod state;
pub mod visit;

pub use bridge::{Bridge, BridgeState};
pub use call::{Call, CallCounts, CallEnd, CallFigures, CallWatch, Gap, LatencyFigures};
pub use control::{Attended, Control, Step};
pub use deform::Deformer;
pub use error::ReceiverError;
pub use interpolate::{LatencyMode, Timeline};
pub use kernels::{Attributes, Blend, Detail, MOST_ALPHA, PoseInputs, Poser, Skinner};
pub use lanes::{
    Bell, DisplayClock, Drawn, Giver, LaneOptions, Lanes, MotionSource, Next, Pose, Skipped, Taker,
    Tick, hand_over,
};
pub use overlay::{
    FrameTime, NOTICE_LETTERS, NOTICE_LINES, NOTICE_WIDTH_METRES, Notice, OVERLAY_WIDTH_METRES,
    Overlay, OverlayFigures, OverlayLatency, OverlayPainter, OverlayWatch, Panel, UnitLoad,
};
pub use placement::{
    Alternative, Fault, Inference, Offer, Placed, PlacementReport, PlacementRequest, Plan,
    ProviderChange, ProviderChanges, StageCosts, choose, place, place_first, predicted_picture_ms,
    unit_of,
};
pub use pool::in_own_pool;
pub use posing::bound_mesh;
pub use profile::{
    Busy, Collector, Event, LatencyBreakdown, Occupancy, Overlap, Part, PartLatency, Percentiles,
    PictureFigures, PictureLatency, PictureTimes, Profile, Quality, Recorder, Recording, Since,
    Span, StageSummary, StateTimes, Summary, Terms, nanoseconds,
};
pub use receiver::Receiver;
pub use stage::{Lane, Stage, Unit};
pub use state::{GaussianState, STATE_PLANES, StateChange, plane};
