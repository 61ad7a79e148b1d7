//! Readings from files of Linux and Android: thermal zones, the CPU's clocks, and of an Adreno its clock, load and throttling.
//!
//! Android lets apps read some of them, and which differs between systems: what exists but cannot be read is reported as absent.

use super::{Absent, Channel, Quantity, Sampler};
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

/// Below a folder that looks like `/sys`.
#[derive(Debug)]
pub struct Sysfs {
    channels: Vec<Channel>,
    /// Of each channel.
    files: Vec<(PathBuf, Scale)>,
    absent: Vec<Absent>,
}

/// From a file's number to the channel's.
#[derive(Debug, Clone, Copy)]
enum Scale {
    Times(f64),
    /// Thermal zones count in thousandths of a degree; some drivers in tenths or whole ones.
    Degrees,
}

/// What an Adreno's driver tells: name, quantity, the files that may have it, and what to multiply with.
const ADRENO: [(&str, Quantity, &[&str], f64); 3] = [
    (
        "GPU clock",
        Quantity::GpuClock,
        &["gpuclk", "devfreq/cur_freq"],
        1e-6,
    ),
    (
        "GPU busy",
        Quantity::GpuBusy,
        &["gpu_busy_percentage", "devfreq/gpu_load"],
        1.0,
    ),
    (
        "GPU throttling level",
        Quantity::Level,
        &["thermal_pwrlevel"],
        1.0,
    ),
];

/// The possible temperatures of silicon: below is a sensor that is off, above one that measures something else.
const DEGREES: std::ops::RangeInclusive<f64> = -40.0..=200.0;

impl Sysfs {
    /// Finds the channels below `root`, which is `/sys` but for tests.
    #[must_use]
    pub fn new(root: &Path) -> Self {
        let mut found = Self {
            channels: Vec::new(),
            files: Vec::new(),
            absent: Vec::new(),
        };
        found.thermal_zones(&root.join("class/thermal"));
        found.cpu_clocks(&root.join("devices/system/cpu"));
        found.adreno(&root.join("class/kgsl/kgsl-3d0"));
        found
    }

    fn thermal_zones(&mut self, folder: &Path) {
        let zones = numbered(folder, "thermal_zone");
        let mut why = none_in(folder, &zones, "thermal zone");
        for zone in zones.unwrap_or_default() {
            let kind = fs::read_to_string(zone.join("type")).unwrap_or_default();
            let number = zone.file_name().unwrap_or_default().to_string_lossy();
            let number = number.trim_start_matches("thermal_zone");
            let kind = kind.trim();
            let kind = if kind.is_empty() { "zone" } else { kind };
            // Kinds are not unique: every core may be a "cpu-thermal".
            let name = format!("{kind} ({number})");
            match self.channel(
                name,
                Quantity::Temperature,
                zone.join("temp"),
                Scale::Degrees,
            ) {
                Ok(()) => why = None,
                // Zones that are off fail to be read: reported only if none is on.
                Err(error) => _ = why.get_or_insert(error),
            }
        }
        let some = |one: &Channel| one.quantity == Quantity::Temperature;
        self.note_absent(
            "temperatures",
            why.filter(|_| !self.channels.iter().any(some)),
        );
    }

    fn cpu_clocks(&mut self, folder: &Path) {
        let cpus = numbered(folder, "cpu");
        let mut why = none_in(folder, &cpus, "CPU");
        let mut seen: Vec<String> = Vec::new();
        for cpu in cpus.unwrap_or_default() {
            let of = cpu.join("cpufreq");
            let number = cpu.file_name().unwrap_or_default().to_string_lossy();
            let own = number.trim_start_matches("cpu").to_owned();
            // Cores that share a clock are reported once.
            let together = fs::read_to_string(of.join("related_cpus")).unwrap_or_default();
            let together = match together.split_whitespace().collect::<Vec<_>>().as_slice() {
                [] => own,
                [one] => (*one).to_owned(),
                [first, .., last] => format!("{first}-{last}"),
            };
            if seen.contains(&together) {
                continue;
            }
            let name = format!("CPU {together}");
            match self.channel(
                name,
                Quantity::CpuClock,
                of.join("scaling_cur_freq"),
                Scale::Times(1e-3),
            ) {
                Ok(()) => seen.push(together),
                Err(error) => _ = why.get_or_insert(error),
            }
        }
        self.note_absent("CPU clocks", why.filter(|_| seen.is_empty()));
    }

    fn adreno(&mut self, folder: &Path) {
        if !folder.exists() {
            let why = format!(
                "there is no {}: the GPU is no Adreno with Qualcomm's driver",
                folder.display()
            );
            self.note_absent("the GPU's clock and load", Some(why));
            return;
        }
        for (name, quantity, files, factor) in ADRENO {
            let mut why = None;
            for file in files {
                let file = folder.join(file);
                match self.channel(name.to_owned(), quantity, file, Scale::Times(factor)) {
                    Ok(()) => {
                        why = None;
                        break;
                    }
                    Err(error) => _ = why.get_or_insert(error),
                }
            }
            self.note_absent(name, why);
        }
    }

    /// Adds a channel whose file can be read now.
    fn channel(
        &mut self,
        name: String,
        quantity: Quantity,
        file: PathBuf,
        scale: Scale,
    ) -> Result<(), String> {
        read(&file, scale)?;
        self.channels.push(Channel { name, quantity });
        self.files.push((file, scale));
        Ok(())
    }

    fn note_absent(&mut self, what: &str, why: Option<String>) {
        self.absent.extend(why.map(|why| Absent {
            what: what.to_owned(),
            why,
        }));
    }
}

impl Sampler for Sysfs {
    fn channels(&self) -> &[Channel] {
        &self.channels
    }

    fn absent(&self) -> &[Absent] {
        &self.absent
    }

    fn sample(&mut self, values: &mut Vec<Option<f64>>) {
        let now = self
            .files
            .iter()
            .map(|(file, scale)| read(file, *scale).ok());
        values.extend(now);
    }
}

/// Folders `NAME0`, `NAME1`, ... in order of their numbers.
fn numbered(folder: &Path, name: &str) -> io::Result<Vec<PathBuf>> {
    let mut found: Vec<(u32, PathBuf)> = fs::read_dir(folder)?
        .filter_map(|entry| {
            let entry = entry.ok()?;
            let number = entry
                .file_name()
                .to_str()?
                .strip_prefix(name)?
                .parse()
                .ok()?;
            Some((number, entry.path()))
        })
        .collect();
    found.sort();
    Ok(found.into_iter().map(|(_, path)| path).collect())
}

fn none_in(folder: &Path, found: &io::Result<Vec<PathBuf>>, what: &str) -> Option<String> {
    match found {
        Err(why) => Some(format!("cannot read {}: {why}", folder.display())),
        Ok(found) if found.is_empty() => {
            Some(format!("there is no {what} in {}", folder.display()))
        }
        Ok(_) => None,
    }
}

/// The number a file begins with, scaled.
fn read(file: &Path, scale: Scale) -> Result<f64, String> {
    let text =
        fs::read_to_string(file).map_err(|why| format!("cannot read {}: {why}", file.display()))?;
    let first = text
        .split([' ', '%', '\n', '\t'])
        .find(|word| !word.is_empty());
    let number: f64 = first
        .and_then(|word| word.parse().ok())
        .filter(|number: &f64| number.is_finite())
        .ok_or_else(|| format!("{} says no number", file.display()))?;
    match scale {
        Scale::Times(factor) => Ok(number * factor),
        Scale::Degrees => {
            let degrees = if number.abs() >= 1000.0 {
                number / 1e3
            } else {
                number
            };
            if DEGREES.contains(&degrees) {
                Ok(degrees)
            } else {
                Err(format!("{} says {degrees} degrees", file.display()))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A tree of files as Linux has them: paths and what they say.
    fn tree(files: &[(&str, &str)]) -> tempfile::TempDir {
        let root = tempfile::tempdir().expect("a temporary folder");
        for (file, text) in files {
            let file = root.path().join(file);
            fs::create_dir_all(file.parent().expect("it has a folder")).expect("a folder");
            fs::write(file, text).expect("a file");
        }
        root
    }

    fn reported(sampler: &mut Sysfs) -> Vec<(String, Option<f64>)> {
        let mut values = Vec::new();
        sampler.sample(&mut values);
        assert_eq!(values.len(), sampler.channels().len(), "one value each");
        let names = sampler.channels().iter().map(|one| one.name.clone());
        names.zip(values).collect()
    }

    /// As a Quest 3 has it, with fewer cores and zones.
    const QUEST: [(&str, &str); 17] = [
        ("class/thermal/thermal_zone0/type", "cpu-0-0\n"),
        ("class/thermal/thermal_zone0/temp", "48300\n"),
        ("class/thermal/thermal_zone10/type", "skin-therm\n"),
        ("class/thermal/thermal_zone10/temp", "36\n"),
        ("class/thermal/thermal_zone2/type", "modem\n"),
        ("class/thermal/thermal_zone2/temp", "-273000\n"),
        ("class/thermal/cooling_device0/type", "gpu\n"),
        ("devices/system/cpu/cpu0/cpufreq/related_cpus", "0 1 2\n"),
        (
            "devices/system/cpu/cpu0/cpufreq/scaling_cur_freq",
            "2016000\n",
        ),
        ("devices/system/cpu/cpu1/cpufreq/related_cpus", "0 1 2\n"),
        (
            "devices/system/cpu/cpu1/cpufreq/scaling_cur_freq",
            "2016000\n",
        ),
        ("devices/system/cpu/cpu5/cpufreq/related_cpus", "5\n"),
        (
            "devices/system/cpu/cpu5/cpufreq/scaling_cur_freq",
            "3187200\n",
        ),
        ("devices/system/cpu/cpuidle/current_driver", "none\n"),
        ("class/kgsl/kgsl-3d0/devfreq/cur_freq", "492000000\n"),
        ("class/kgsl/kgsl-3d0/gpu_busy_percentage", "71 %\n"),
        ("class/kgsl/kgsl-3d0/thermal_pwrlevel", "3\n"),
    ];

    #[test]
    fn a_headsets_files_become_degrees_megahertz_and_percent() {
        let root = tree(&QUEST);
        let mut sampler = Sysfs::new(root.path());
        let wanted = [
            ("cpu-0-0 (0)", 48.3),
            ("skin-therm (10)", 36.0),
            ("CPU 0-2", 2016.0),
            ("CPU 5", 3187.2),
            ("GPU clock", 492.0),
            ("GPU busy", 71.0),
            ("GPU throttling level", 3.0),
        ];
        let got = reported(&mut sampler);
        assert_eq!(got.len(), wanted.len(), "{got:?}");
        for ((name, value), (wanted_name, wanted)) in got.iter().zip(wanted) {
            assert_eq!(name, wanted_name, "in order");
            assert!(
                value.is_some_and(|value| (value - wanted).abs() < 1e-6),
                "{name}: {value:?}"
            );
        }
        assert_eq!(sampler.absent(), [], "a sensor that is off is not missed");
    }

    #[test]
    fn quantities_that_a_machine_lacks_are_reported_as_absent() {
        let root = tree(&[]);
        let mut sampler = Sysfs::new(root.path());
        assert_eq!(reported(&mut sampler), [], "nothing is there");
        let absent: Vec<&str> = sampler
            .absent()
            .iter()
            .map(|one| one.what.as_str())
            .collect();
        assert_eq!(
            absent,
            ["temperatures", "CPU clocks", "the GPU's clock and load"],
            "each is missed once"
        );
    }

    #[test]
    fn a_clock_that_may_not_be_read_is_absent_with_its_file_named() {
        let mut files = QUEST.to_vec();
        files.retain(|(file, _)| !file.ends_with("cur_freq"));
        files.push(("class/kgsl/kgsl-3d0/gpuclk", "secret\n"));
        let root = tree(&files);
        let sampler = Sysfs::new(root.path());
        let [cpu, gpu] = sampler.absent() else {
            panic!("{:?}", sampler.absent());
        };
        assert_eq!(cpu.what, "CPU clocks", "{cpu:?}");
        assert!(cpu.why.contains("cpu0/cpufreq/scaling_cur_freq"), "{cpu:?}");
        assert_eq!(gpu.what, "GPU clock", "{gpu:?}");
        assert!(gpu.why.contains("gpuclk says no number"), "{gpu:?}");
    }

    #[test]
    fn a_file_that_goes_while_it_is_watched_leaves_a_gap() {
        let root = tree(&QUEST);
        let mut sampler = Sysfs::new(root.path());
        fs::remove_file(root.path().join(QUEST[1].0)).expect("it was there");
        let got = reported(&mut sampler);
        assert_eq!(got[0].1, None, "cpu-0-0 is gone");
        assert!(got[1..].iter().all(|(_, value)| value.is_some()), "{got:?}");
    }
}
