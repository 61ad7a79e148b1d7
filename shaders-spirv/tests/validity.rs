//! The Khronos validator accepts the compiled shaders for their Vulkan version.

use std::io::Write;
use std::process::{Command, Stdio};

/// What `spirv-val` finds wrong with a module; nothing if it is valid.
fn complaint(program: &str, words: &[u32]) -> std::io::Result<Option<String>> {
    // SPIR-V 1.5 came with Vulkan 1.2.
    let newer = words.get(1).is_some_and(|version| *version > 0x0001_0300);
    let target = if newer { "vulkan1.2" } else { "vulkan1.1" };
    let mut child = Command::new(program)
        .args(["--target-env", target, "-"])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()?;
    let bytes: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
    // Dropped at once, so that the program sees the end of its input.
    child
        .stdin
        .take()
        .expect("a pipe was asked for")
        .write_all(&bytes)?;
    let output = child.wait_with_output()?;
    let text = [output.stdout, output.stderr].concat();
    Ok((!output.status.success()).then(|| String::from_utf8_lossy(&text).into_owned()))
}

/// The validator's path, or nothing after a line that says why; on CI that is a failure.
fn spirv_val() -> Option<String> {
    let named = std::env::var("MON3TR_SPIRV_VAL");
    let program = named.clone().unwrap_or_else(|_| "spirv-val".to_owned());
    match Command::new(&program).arg("--version").output() {
        Ok(output) if output.status.success() => return Some(program),
        Ok(output) => panic!(
            "{program} does not run: {}",
            String::from_utf8_lossy(&output.stderr)
        ),
        Err(why) => {
            let why = format!("no SPIR-V validator: {program}: {why} (./run test fetches one)");
            assert!(
                named.is_err() && std::env::var("CI").as_deref() != Ok("true"),
                "{why}"
            );
            println!("skipped: {why}");
        }
    }
    None
}

#[test]
fn every_shader_is_valid() {
    let Some(program) = spirv_val() else { return };
    assert!(!shaders_spirv::ALL.is_empty(), "no shaders");
    for shader in shaders_spirv::ALL {
        let found = complaint(&program, shader.words).expect("the validator runs");
        assert_eq!(found, None, "what {program} says of {}", shader.name);
    }
}

#[test]
fn the_validator_refuses_a_broken_shader() {
    let Some(program) = spirv_val() else { return };
    let shader = shaders_spirv::ALL.first().expect("a shader");
    let mut words = shader.words.to_vec();
    // The bound: every number in the module must be below it.
    words[3] = 1;
    let found = complaint(&program, &words).expect("the validator runs");
    assert!(found.is_some(), "a module whose numbers are out of bounds");
}
