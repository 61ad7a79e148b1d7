//! One call over one network: a sender and a receiver, each a process, with the lab between them.

use super::Options;
use super::condition::{Condition, OUTAGE_AT};
use anyhow::{Context, anyhow};
use link_codec::Codec;
use link_http::Client;
use link_protocol::RoomLink;
use link_protocol::announcement::ChannelMode;
use mon3tr::children::{LocalServer, Output, Process};
use mon3tr::network::Network;
use netlab::report::{BitrateSeries, CallRow, Frames, LatencyMs, VoiceRow};
use netlab::{Lab, LabConfig};
use serde_json::Value;
use std::ffi::OsString;
use std::path::Path;
use std::time::Duration;

/// How long the two processes may take to meet and to end.
const BESIDES: Duration = Duration::from_secs(60);

/// How much longer than the call the receiver waits for its end.
const LONGER: Duration = Duration::from_secs(5);

/// What is tried.
#[derive(Debug, Clone, Copy)]
pub(super) struct Variant {
    pub(super) codec: Codec,
    pub(super) channel: ChannelMode,
}

impl std::fmt::Display for Variant {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} on the {} channel", self.codec, self.channel)
    }
}

/// What all calls share.
pub(super) struct Bench<'a> {
    pub(super) options: &'a Options,
    pub(super) network: &'a Network,
    pub(super) client: &'a Client,
    pub(super) server: &'a LocalServer,
    pub(super) folder: &'a Path,
}

impl Bench<'_> {
    /// Holds the call and returns what came of it.
    pub(super) fn call(
        &self,
        condition: &Condition,
        variant: Variant,
    ) -> anyhow::Result<(CallRow, BitrateSeries)> {
        let (sender_link, viewer_link) =
            self.network.block_on(self.server.open_room(self.client))?;
        let lab = self.network.block_on(Lab::start(LabConfig {
            seed: self.options.seed,
            down: condition.down.clone(),
            up: condition.up.clone(),
            ..LabConfig::new(self.server.address()?)
        }))?;
        let through_lab = viewer_link.at(format!("http://{}", lab.address()).parse()?);
        let sent = self.folder.join("sent.json");
        let received = self.folder.join("received.json");
        let seconds = condition.seconds(self.options.seconds);
        let sender = Process::start_sender(
            self.sender_arguments(&sender_link, variant, seconds, &sent),
            &self.server.owner_token,
        )?;
        let mut receiving = vec![
            OsString::from(through_lab.to_string()),
            "--display".into(),
            "none".into(),
            "--json".into(),
            received.clone().into(),
            // Where the sender's goodbye does not come through.
            "--seconds".into(),
            (seconds + LONGER).as_secs_f64().to_string().into(),
        ];
        if self.options.voice.is_some() {
            // So that it is played.
            receiving.extend(["--sound".into(), self.folder.join("heard.wav").into()]);
        }
        let receiver = Process::start("receive", receiving, Output::Dropped)?;
        if let Some(outage) = condition.outage {
            self.wait_for_traffic(&lab);
            std::thread::sleep(OUTAGE_AT);
            lab.cut(outage);
        }
        receiver.finish(Some(seconds + BESIDES))?;
        sender.finish(Some(BESIDES))?;
        let statistics = self.network.block_on(lab.stop());
        let call = &read(&received)?["call"];
        let sent = &read(&sent)?;
        let live = number(call, "live_seconds")?.max(1e-3);
        let kbit_s = |bytes: u64| bytes as f64 * 8e-3 / live;
        let latency = &call["latency"];
        let voice = self.options.voice.as_ref().map(|_| voice(call));
        let recover_s = condition.outage.map(|outage| recovery(call, outage));
        let row = CallRow {
            codec: variant.codec.to_string(),
            channel: variant.channel.to_string(),
            condition: condition.name.clone(),
            down_kbit_s: kbit_s(statistics.down.offered.bytes),
            up_kbit_s: kbit_s(statistics.up.offered.bytes),
            latency_ms: percentiles(&latency["added"])?,
            frames: Frames {
                sent: count(sent, "captured")?,
                shown: count(call, "released")?,
            },
            recover_s: recover_s.flatten(),
            voice: voice.transpose()?,
        };
        let name = format!("{}, {}", variant.codec, variant.channel);
        Ok((row, BitrateSeries::offered(&name, &statistics.down)))
    }

    fn sender_arguments(
        &self,
        link: &RoomLink,
        variant: Variant,
        seconds: Duration,
        json: &Path,
    ) -> Vec<OsString> {
        let options = self.options;
        let mut arguments: Vec<OsString> = [
            "--room",
            &link.to_string(),
            "--rate",
            &options.rate.to_string(),
            "--codec",
            &variant.codec.to_string(),
            "--channel",
            &variant.channel.to_string(),
            "--seconds",
            &seconds.as_secs_f64().to_string(),
        ]
        .map(OsString::from)
        .to_vec();
        arguments.extend(options.motion.arguments());
        if let Some(avatar) = &options.avatar {
            arguments.extend(["--avatar".into(), avatar.into()]);
        }
        if let Some(voice) = &options.voice {
            arguments.extend(["--voice".into(), voice.clone().into()]);
        }
        arguments.extend(["--json".into(), json.into()]);
        arguments
    }

    /// Until the sender's frames come through the lab.
    fn wait_for_traffic(&self, lab: &Lab) {
        let enough = || lab.statistics().down.delivered.packets > 10;
        for _ in 0..BESIDES.as_millis() / 20 {
            if enough() {
                return;
            }
            std::thread::sleep(Duration::from_millis(20));
        }
    }
}

/// From the end of an outage to the next frame: what the longest gap has beyond it.
fn recovery(call: &Value, outage: Duration) -> Option<f64> {
    let gaps = call["gaps"].as_array()?;
    let gaps = gaps.iter().filter_map(|gap| gap["ms"].as_f64());
    // What is not as long as the outage is something else; none that is means that the call did not come back.
    let after = gaps.map(|ms| ms / 1e3 - outage.as_secs_f64());
    after.filter(|after| *after >= 0.0).reduce(f64::max)
}

/// What became of the voice.
fn voice(call: &Value) -> anyhow::Result<VoiceRow> {
    let (latency, counts) = (&call["latency"], &call["voice"]);
    Ok(VoiceRow {
        mouth_to_ear_ms: percentiles(&latency["mouth_to_ear"])?,
        apart_ms: percentiles(&latency["voice_apart"])?,
        heard: count(counts, "decoded")?,
        recovered: count(counts, "recovered")?,
        concealed: count(counts, "concealed")?,
        longest_gap_ms: count(counts, "longest_gap")? * 20,
    })
}

/// Percentiles of a report; nothing where there was nothing to measure.
fn percentiles(times: &Value) -> anyhow::Result<Option<LatencyMs>> {
    if times.is_null() {
        return Ok(None);
    }
    Ok(Some(LatencyMs {
        p50: number(times, "p50_ms")?,
        p95: number(times, "p95_ms")?,
        p99: number(times, "p99_ms")?,
    }))
}

fn read(file: &Path) -> anyhow::Result<Value> {
    let text = std::fs::read(file).with_context(|| format!("cannot read {}", file.display()))?;
    std::fs::remove_file(file).with_context(|| format!("cannot remove {}", file.display()))?;
    serde_json::from_slice(&text).with_context(|| format!("cannot read {}", file.display()))
}

fn number(value: &Value, key: &str) -> anyhow::Result<f64> {
    value[key]
        .as_f64()
        .ok_or_else(|| anyhow!("there is no figure {key}"))
}

fn count(value: &Value, key: &str) -> anyhow::Result<u64> {
    value[key]
        .as_u64()
        .ok_or_else(|| anyhow!("there is no figure {key}"))
}
