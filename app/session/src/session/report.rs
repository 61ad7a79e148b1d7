//! What is left of a session.

use crate::call::CallWatch;
use crate::display::Attendee;
use crate::participant::{CallReport, PersonSource};
use app_pipeline::error::ReceiverError;
use app_pipeline::lanes::{FinishedPerson, PausableSource, Skipped};
use app_pipeline::placement::PlacementReport;
use app_pipeline::profile::Collector;
use app_pipeline::quality::QualityFigures;
use renderer_splat::back_ends::BackEndTrial;
use renderer_splat::options::BackEnd;
use std::time::Instant;

/// What a session came to.
#[derive(Debug)]
pub struct SessionReport {
    /// Each person: those of the people who left before the end whose reports were kept, then those who were there, as they joined.
    pub people: Vec<PersonReport>,
    /// What was left out, of all people together.
    pub skipped: Skipped,
    /// What was given up to hold the display's rate.
    pub quality: QualityFigures,
    /// What drew ...
    pub back_end: BackEnd,
    /// ... and why.
    pub back_end_trial: Option<BackEndTrial>,
    /// When showing began ...
    pub began: Instant,
    /// ... and ended.
    pub ended: Instant,
}

/// What a session came to for one person.
#[derive(Debug)]
pub struct PersonReport {
    /// The call, where their motion came from one.
    pub call: Option<CallReport>,
    /// What ended a lane of theirs: from then on they were not shown.
    pub error: Option<ReceiverError>,
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
            watch,
            placement,
            collector: finished.collector,
        }
    }
}
