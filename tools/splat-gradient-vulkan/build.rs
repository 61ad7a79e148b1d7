//! Compiles `shaders/*.comp` to SPIR-V 1.3, for Vulkan 1.1, and writes a Rust constant for each: as `shaders-spirv` does with the renderer's. `TILE` is
//! written as well, for Rust to compare.

use glslang::include::{IncludeHandler, IncludeResult, IncludeType};
use glslang::{
    Compiler, CompilerOptions, Shader, ShaderInput, ShaderMessage, ShaderSource, ShaderStage,
    SourceLanguage, SpirvVersion, Target, VulkanVersion,
};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::{env, fs, process};

const FOLDER: &str = "shaders";

fn main() {
    println!("cargo:rerun-if-changed={FOLDER}");
    if let Err(message) = build() {
        eprintln!("{message}");
        process::exit(1);
    }
}

fn build() -> Result<(), String> {
    let broken = |why: std::io::Error| format!("{FOLDER}: {why}");
    let files = fs::read_dir(FOLDER).map_err(broken)?;
    let paths = files.map(|entry| entry.map(|entry| entry.path()));
    let mut paths: Vec<PathBuf> = paths.collect::<Result<_, _>>().map_err(broken)?;
    paths.retain(|path| path.extension().is_some_and(|name| name == "comp"));
    paths.sort();
    let mut generated = String::new();
    for path in &paths {
        let words = compile(path)?;
        let name = path.file_stem().unwrap_or_default().to_string_lossy();
        writeln!(
            generated,
            "/// `{}`.\npub(crate) const {}: &[u32] = &{words:?};",
            path.display(),
            name.to_uppercase()
        )
        .map_err(|why| why.to_string())?;
    }
    let tile = tile()?;
    writeln!(
        generated,
        "/// `TILE` in `shaders/numbers.glsl`.\npub(crate) const TILE: u32 = {tile};"
    )
    .map_err(|why| why.to_string())?;
    let out = env::var_os("OUT_DIR").ok_or("cargo sets OUT_DIR for build scripts")?;
    let out = Path::new(&out).join("shaders.rs");
    fs::write(&out, generated).map_err(|why| format!("{}: {why}", out.display()))
}

/// Pixels along a tile's sides, as the shaders have it.
fn tile() -> Result<u32, String> {
    let path = Path::new(FOLDER).join("numbers.glsl");
    let text = fs::read_to_string(&path).map_err(|why| format!("{}: {why}", path.display()))?;
    let lines = text.lines();
    let number = lines
        .filter_map(|line| line.strip_prefix("const uint TILE = "))
        .find_map(|rest| rest.split_once("u;")?.0.parse().ok());
    number.ok_or_else(|| {
        format!(
            "{}: it has no line `const uint TILE = 16u;`",
            path.display()
        )
    })
}

fn compile(path: &Path) -> Result<Vec<u32>, String> {
    let said = |why: String| format!("{}: {why}", path.display());
    let text = fs::read_to_string(path).map_err(|why| said(why.to_string()))?;
    let compiler = Compiler::acquire().ok_or("glslang did not start")?;
    let source = ShaderSource::from(text);
    let options = CompilerOptions {
        source_language: SourceLanguage::GLSL,
        target: Target::Vulkan {
            version: VulkanVersion::Vulkan1_1,
            spirv_version: SpirvVersion::SPIRV1_3,
        },
        version_profile: None,
        messages: ShaderMessage::DEFAULT,
    };
    let mut includes = Includes;
    let stage = ShaderStage::Compute;
    let input = ShaderInput::new(&source, stage, &options, None, Some(&mut includes))
        .map_err(|why| said(why.to_string()))?;
    Shader::new(compiler, input)
        .parse()
        .and_then(|shader| shader.compile())
        .map_err(|why| said(why.to_string()))
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
