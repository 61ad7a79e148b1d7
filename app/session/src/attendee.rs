//! The people of a session while it is shown, and what it came to for each.

use crate::call::CallWatch;
use crate::participant::{CallReport, PersonSource};
use app_pipeline::error::ReceiverError;
use app_pipeline::lanes::{FinishedPerson, LeftOut, PausableSource};
use app_pipeline::placement::PlacementReport;
use app_pipeline::profile::Collector;
use link_voice::VoiceQueue;
use spmm3::Avatar;
use std::sync::Arc;

/// A person of a session while it is shown.
#[derive(Debug)]
pub struct Attendee {
    /// What they look like.
    pub avatar: Arc<Avatar>,
    /// What runs where.
    pub placement: PlacementReport,
    /// What is counted and told of the call with them, if their motion comes from one.
    pub watch: Option<CallWatch>,
    /// What they say, if anything.
    pub(crate) voice: Option<VoiceQueue>,
}

/// What a session came to for one person.
#[derive(Debug)]
pub struct PersonReport {
    /// The call, where their motion came from one.
    pub call: Option<CallReport>,
    /// What ended a lane of theirs: from then on they were not shown.
    pub error: Option<ReceiverError>,
    /// Why pictures were drawn without them, if any were.
    pub left_out: Option<LeftOut>,
    /// What was counted and told of the call, which tells whose report this is.
    pub watch: Option<CallWatch>,
    /// What ran where.
    pub placement: PlacementReport,
    /// What the person's lanes recorded, and the GPU's of pictures with them.
    pub collector: Collector,
}

impl PersonReport {
    /// Says goodbye to a person whose lanes were stopped.
    pub(crate) fn of(finished: FinishedPerson<PersonSource>, attendee: Attendee) -> Self {
        let Attendee {
            mut placement,
            watch,
            ..
        } = attendee;
        placement.follow(finished.provider_changes);
        let motion = |source: PersonSource| PausableSource::into_source(source).into_source();
        Self {
            call: (finished.source).and_then(|source| motion(source).end()),
            error: finished.error,
            left_out: finished.left_out,
            watch,
            placement,
            collector: finished.collector,
        }
    }
}
