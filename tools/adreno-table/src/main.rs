//! What every shader costs on the Quest 3's GPU, without a Quest: Mesa's turnip compiles them for an Adreno 740 that a shim
//! pretends to be, and reports its statistics. Nothing is executed, so there are no milliseconds here.
//!
//! It is Mesa's compiler, not the headset's: good for spills, occupancy and comparing two versions of a shader.

mod constants;
mod device;
mod loops;
mod module;
mod pipeline;
mod rules;
mod table;

use std::path::{Path, PathBuf};

use anyhow::{Context, ensure};
use clap::Parser;

use constants::Setting;
use device::Device;
use module::{Module, Stage};
use table::Row;

/// Prints a Markdown table of what every shader costs on an Adreno 740 (start it with android/adreno.sh).
#[derive(Debug, Parser)]
struct Arguments {
    /// Only shaders whose name begins so.
    #[arg(default_value = "")]
    name: String,
    /// Give a specialisation constant another value than the renderer or the shader does.
    #[arg(long, value_name = "NAME=VALUE")]
    set: Vec<Setting>,
    /// Write the compiler's stages and the machine code of every shader into this folder.
    #[arg(long, value_name = "FOLDER")]
    code: Option<PathBuf>,
    /// Instead of printing it, fail where a shader breaks a rule (see reasons.txt) or the committed table is out of date.
    #[arg(long, conflicts_with_all = ["name", "set", "renew"])]
    check: bool,
    /// Instead of printing it, renew the committed table.
    #[arg(long, conflicts_with_all = ["name", "set"])]
    renew: bool,
}

/// The committed table, and the reasons why some shaders run in fewer waves than fit.
const TABLE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/table.md");
const REASONS: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/reasons.txt");

/// The subgroup sizes of the chip; a headset's driver chooses one.
const SUBGROUPS: [u32; 2] = [64, 128];

fn main() -> anyhow::Result<()> {
    let arguments = Arguments::parse();
    let device = Device::open()?;
    let modules = shaders_spirv::ALL
        .iter()
        .filter(|shader| shader.name.starts_with(&arguments.name))
        .map(|shader| Module::read(*shader))
        .collect::<anyhow::Result<Vec<_>>>()?;
    ensure!(
        !modules.is_empty(),
        "there is no shader whose name begins with {}",
        arguments.name
    );

    let mut rows = Vec::new();
    for module in &modules {
        let name = module.shader.name;
        let mut compile = |stages: &[&Module], subgroup| -> anyhow::Result<()> {
            let compiled = pipeline::compile(&device, stages, subgroup, &arguments.set)
                .with_context(|| format!("shader {name} at subgroups of {subgroup}"))?;
            for one in compiled {
                // For a pair of shaders the driver may make more than two programs.
                let stage = stages
                    .iter()
                    .find(|module| pipeline::stage_name(module.stage.flag()) == one.stage);
                let name = stage.map_or(name, |module| module.shader.name);
                if let Some(folder) = &arguments.code {
                    write_code(folder, name, &one)?;
                }
                let row = Row::new(name, &one);
                // Workgroups that fill no wider subgroup are compiled for the narrower one again.
                if rows.iter().all(|other: &Row| other.key() != row.key()) {
                    rows.push(row);
                }
            }
            Ok(())
        };
        match module.stage {
            Stage::Compute => {
                for subgroup in SUBGROUPS {
                    compile(&[module], subgroup)?;
                }
            }
            // With a fragment shader, without which there is no pipeline.
            Stage::Vertex => {}
            Stage::Fragment => {
                let vertex = modules
                    .iter()
                    .find(|other| {
                        other.stage == Stage::Vertex && name.starts_with(other.shader.name)
                    })
                    .with_context(|| {
                        format!("{name}.frag has no .vert whose name begins its own")
                    })?;
                compile(&[vertex, module], SUBGROUPS[0])?;
            }
        }
    }
    let text = text(&device, &rows, &modules, &arguments.set);
    if arguments.renew {
        return std::fs::write(TABLE, text).with_context(|| format!("cannot write {TABLE}"));
    }
    if arguments.check {
        let reasons = rules::reasons(&read(REASONS)?).context(REASONS)?;
        rules::check(&rows, &reasons).context("on the Quest 3's GPU, by Mesa's compiler")?;
        return rules::check_table(&read(TABLE)?, &text);
    }
    print!("{text}");
    Ok(())
}

/// The compiler's name, the table, and the constants at their defaults.
fn text(device: &Device, rows: &[Row], modules: &[Module], settings: &[Setting]) -> String {
    let mut text = format!(
        "{}, {}\n\n{}",
        device.name,
        device.driver,
        table::markdown(rows)
    );
    let mut is_first = true;
    for module in modules {
        for constant in constants::open(module, settings) {
            if std::mem::take(&mut is_first) {
                text.push('\n');
            }
            let name = module.shader.name;
            text += &format!(
                "- {name} has {constant} as the shader says; another: --set {constant}=VALUE\n"
            );
        }
    }
    text
}

fn read(path: &str) -> anyhow::Result<String> {
    std::fs::read_to_string(path).with_context(|| format!("cannot read {path}"))
}

fn write_code(folder: &Path, name: &str, compiled: &pipeline::Compiled) -> anyhow::Result<()> {
    let path = folder.join(format!(
        "{name}.{}.{}.txt",
        compiled.stage, compiled.subgroup
    ));
    std::fs::create_dir_all(folder)
        .and_then(|()| std::fs::write(&path, &compiled.code))
        .with_context(|| format!("could not write {}", path.display()))
}
