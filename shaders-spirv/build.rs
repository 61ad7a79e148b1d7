//! Compiles `shaders/*.comp|.vert|.frag` to SPIR-V 1.3 (1.5 where a shader says so) and writes one Rust constant for each.
//!
//! The compiler is glslang's own C++ source, built by `cc`: a C++ compiler is the only prerequisite.
//! A shader that does not compile stops the build with `FILE:LINE: message`.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::{env, fs, process};

use glslang::include::{IncludeHandler, IncludeResult, IncludeType};
use glslang::{
    Compiler, CompilerOptions, Shader, ShaderInput, ShaderMessage, ShaderSource, ShaderStage,
    SourceLanguage, SpirvVersion, Target, VulkanVersion,
};

include!("src/shared.rs");

const FOLDER: &str = "shaders";
/// In a shader that Vulkan 1.1 cannot run.
const VULKAN_1_2: &str = "#pragma vulkan_1_2";

fn main() {
    println!("cargo:rerun-if-changed={FOLDER}");
    println!("cargo:rerun-if-changed=src/shared.rs");
    match build() {
        Ok(()) => {}
        Err(message) => {
            eprintln!("{message}");
            process::exit(1);
        }
    }
}

fn build() -> Result<(), String> {
    let mut paths: Vec<PathBuf> = fs::read_dir(FOLDER)
        .map_err(|why| format!("{FOLDER}: {why}"))?
        .map(|entry| entry.map(|entry| entry.path()))
        .collect::<Result<_, _>>()
        .map_err(|why| format!("{FOLDER}: {why}"))?;
    paths.sort();

    let mut generated = String::new();
    let mut constants = Vec::new();
    for path in &paths {
        let stage = match path.extension().and_then(|extension| extension.to_str()) {
            Some("comp") => ShaderStage::Compute,
            Some("vert") => ShaderStage::Vertex,
            Some("frag") => ShaderStage::Fragment,
            _ => continue,
        };
        let words = compile(path, stage)?;
        let name = path
            .file_stem()
            .and_then(|stem| stem.to_str())
            .unwrap_or_default();
        // The two halves of a drawing shader share a file name; a compute shader stands alone.
        let constant = match stage {
            ShaderStage::Vertex => format!("{name}_vert").to_uppercase(),
            ShaderStage::Fragment => format!("{name}_frag").to_uppercase(),
            _ => name.to_uppercase(),
        };
        let file = path.display();
        writeln!(
            generated,
            "/// `{file}`.\npub const {constant}: Shader = Shader {{ name: {name:?}, words: &{words:?} }};"
        )
        .map_err(|why| why.to_string())?;
        constants.push(constant);
    }
    writeln!(
        generated,
        "/// Every shader there is, by file name.\npub const ALL: &[Shader] = &[{}];",
        constants.join(", ")
    )
    .map_err(|why| why.to_string())?;
    let out = env::var_os("OUT_DIR").ok_or("cargo sets OUT_DIR for build scripts")?;
    let out = Path::new(&out).join("shaders.rs");
    fs::write(&out, generated).map_err(|why| format!("{}: {why}", out.display()))
}

fn compile(path: &Path, stage: ShaderStage) -> Result<Vec<u32>, String> {
    let text = fs::read_to_string(path).map_err(|why| format!("{}: {why}", path.display()))?;
    let compiler = Compiler::acquire().ok_or("glslang did not start")?;
    let (version, spirv_version) = if text.contains(VULKAN_1_2) {
        (VulkanVersion::Vulkan1_2, SpirvVersion::SPIRV1_5)
    } else {
        (VulkanVersion::Vulkan1_1, SpirvVersion::SPIRV1_3)
    };
    let source = ShaderSource::from(text);
    let options = CompilerOptions {
        source_language: SourceLanguage::GLSL,
        target: Target::Vulkan {
            version,
            spirv_version,
        },
        version_profile: None,
        messages: ShaderMessage::DEFAULT,
    };
    let mut includes = Includes;
    let cut = format!("{ALPHA_CUT:?}");
    let log2_cut = format!("({:?})", f64::from(ALPHA_CUT).log2());
    let slack = format!("{TEST_SLACK:?}");
    let whole = [TILE_PIXELS, CLOSE_LOOK, SCAN_BLOCK, CROWDED, ITEMS_PER_PART];
    let [tile, close_look, scan_block, crowded, items_per_part] =
        whole.map(|number| format!("{number}u"));
    let tile_rows = MOST_TILE_ROWS.to_string();
    let definitions = [
        ("ALPHA_CUT", Some(cut.as_str())),
        ("LOG2_ALPHA_CUT", Some(log2_cut.as_str())),
        ("TILE", Some(tile.as_str())),
        ("TEST_SLACK", Some(slack.as_str())),
        ("CLOSE_LOOK", Some(close_look.as_str())),
        ("MOST_TILE_ROWS", Some(tile_rows.as_str())),
        ("SCAN_BLOCK", Some(scan_block.as_str())),
        ("CROWDED", Some(crowded.as_str())),
        ("ITEMS_PER_PART", Some(items_per_part.as_str())),
    ];
    let input = ShaderInput::new(
        &source,
        stage,
        &options,
        Some(&definitions[..]),
        Some(&mut includes),
    )
    .map_err(|why| format!("{}: {why}", path.display()))?;
    Shader::new(compiler, input)
        .parse()
        .and_then(|shader| shader.compile())
        .map_err(|why| located(path, &why.to_string()))
}

/// Turns glslang's `ERROR: 0:12: message` (the file) and `ERROR: name.glsl:12: message` (an include)
/// into `shaders-spirv/shaders/FILE:12: message`, which editors and people can follow.
fn located(path: &Path, log: &str) -> String {
    let shader = path
        .file_name()
        .and_then(|name| name.to_str())
        .unwrap_or_default();
    let mut lines = String::new();
    for line in log.lines() {
        let Some(rest) = line.find("ERROR: ").map(|at| &line[at + "ERROR: ".len()..]) else {
            continue;
        };
        let line = match rest.split_once(':') {
            Some(("0", rest)) => format!("shaders-spirv/{FOLDER}/{shader}:{rest}\n"),
            Some((file, rest)) if file.contains(".glsl") => {
                format!("shaders-spirv/{FOLDER}/{file}:{rest} (included from {shader})\n")
            }
            _ => format!("shaders-spirv/{FOLDER}/{shader}: {rest}\n"),
        };
        lines.push_str(&line);
    }
    if lines.is_empty() {
        format!("{}: {log}", path.display())
    } else {
        lines
    }
}

/// Reads `#include "NAME"` from the shader folder.
struct Includes;

impl IncludeHandler for Includes {
    fn include(
        &mut self,
        _kind: IncludeType,
        name: &str,
        _from: &str,
        depth: usize,
    ) -> Option<IncludeResult> {
        if depth > 8 {
            return None;
        }
        let data = fs::read_to_string(Path::new(FOLDER).join(name)).ok()?;
        Some(IncludeResult {
            name: name.to_owned(),
            data,
        })
    }
}
