//! What is told of a picture once it is drawn: its way to the display, what the device did for it, and what it cost.

use super::person::{Person, Supply};
use super::{Lanes, MotionSource, Next};
use crate::profile::PictureTimes;
use crate::quality::{PictureCost, Quality};
use crate::stage::Stage;
use std::time::{Duration, Instant};

impl<S: MotionSource> Lanes<S> {
    /// Takes note of when the picture is displayed: the end of its way, which is recorded for each person in it. The next one is begun
    /// then.
    pub fn displayed(&mut self, at: Instant) {
        if self.record_displayed(at) {
            for person in self.people.iter_mut() {
                person.reschedule_earlier(at, None);
            }
        }
    }

    /// The same, of a display whose pictures are begun at times of its own.
    pub fn displayed_before(&mut self, at: Instant, next: Next) {
        if self.record_displayed(at) {
            for person in self.people.iter_mut() {
                person.reschedule_earlier(next.begins, Some(next.displayed));
            }
        }
    }

    /// Whether there was a picture on its way.
    fn record_displayed(&mut self, at: Instant) -> bool {
        let Some(progress) = self.drawing.take() else {
            return false;
        };
        let Quality {
            level,
            resolution_scale,
            ..
        } = self.quality;
        let scenery = self.scenery.len();
        let people = self.people.iter_mut();
        let gaussians = people.fold(scenery, |sum, person| {
            sum.saturating_add(person.gaussians(&self.renderer, level))
        });
        let number = self.number;
        for person in self.people.iter_mut() {
            let repeated = person.repeated;
            let Some(view) = person.view() else {
                continue;
            };
            let [from, to] = view.states;
            let picture = PictureTimes {
                number,
                from,
                to,
                alpha: view.alpha,
                interpolated_for: view.number,
                interpolation: view.interpolation,
                begun: progress.begun,
                sorted: progress.sorted,
                drawn: progress.drawn,
                displayed: at,
                predicted: progress.tick.predicted,
                repeated,
                gaussians,
                scale: resolution_scale,
            };
            person.recorder.picture(picture);
        }
        let views = || self.people.iter().filter_map(Person::view);
        // A person with another level's Gaussians says nothing about this one.
        if views().next().is_some() && views().all(|view| view.level == level) {
            self.update_quality(at, progress.tick.period);
        }
        true
    }

    /// Tells the controller of quality what the picture took.
    fn update_quality(&mut self, at: Instant, period: Duration) {
        let periods = self.displayed.replace(at).map_or(1.0, |last| {
            at.saturating_duration_since(last).as_secs_f64() / period.as_secs_f64().max(1e-6)
        });
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a count of vertical blanks; what is beyond is held at the end"
        )]
        let late_periods = (periods.round() as u32).saturating_sub(1);
        let times = self.renderer.stage_times();
        self.controller.set_period(period);
        let next = self.controller.picture(&PictureCost {
            step: self.quality.step,
            pixels_ms: times.raster,
            gaussians_ms: times.upload
                + times.attributes
                + times.interpolate
                + times.project
                + times.bin,
            fixed_ms: times.networks + times.skin,
            sort_ms: times.sort,
            late_periods,
        });
        if next.step != self.quality.step {
            log::info!("to hold the display's rate from now on: {next}");
        }
    }

    /// Records, for each person, what the device did for the picture just drawn with all of them.
    pub(super) fn record_stages(&mut self) {
        let (Some(progress), Some(time)) = (&mut self.drawing, self.renderer.picture_time()) else {
            return;
        };
        progress.drawn = time.finished;
        progress.sorted = time.submitted;
        let Some(spans) = time.stages else {
            return;
        };
        progress.sorted = spans.sort[1];
        let number = self.number;
        for person in self.people.iter_mut().filter(|person| !person.is_gone) {
            if let (Supply::Device(posing), Some(view)) = (&person.supply, &mut person.view) {
                view.interpolation = spans.interpolate;
                let state = view.states[1].number;
                let networks =
                    (posing.runs_networks()).then_some((Stage::Inference, spans.networks));
                for (stage, [begin, end]) in networks
                    .into_iter()
                    .chain([(Stage::Skin, spans.skin), (Stage::Bind, spans.attributes)])
                {
                    if end > begin {
                        person.recorder.span(stage, state, begin, end);
                    }
                }
            }
            for (stage, [begin, end]) in [
                (Stage::Upload, spans.upload),
                (Stage::Interpolate, spans.interpolate),
                (Stage::Project, spans.project),
                (Stage::Sort, spans.sort),
                (Stage::Bin, spans.bin),
                (Stage::Raster, spans.raster),
            ] {
                if end > begin {
                    person.recorder.span(stage, number, begin, end);
                }
            }
        }
    }
}
