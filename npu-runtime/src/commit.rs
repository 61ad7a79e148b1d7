//! Makes ONNX Runtime's session of a graph on a provider; on an NPU without any node on the CPU.

use crate::cache::Entry;
use crate::devices::devices;
use crate::landing::{Ear, Landing};
use crate::qnn::Plugin;
use crate::{Graph, Origin, Provider, ProviderKind, QnnTarget, Runtime, RuntimeError};
use ort::ep::{NNAPI, XNNPACK};
use ort::logging::LogLevel;
use ort::session::Session;
use ort::session::builder::{GraphOptimizationLevel, SessionBuilder};
use std::fs;
use std::num::NonZeroUsize;
use std::path::Path;
use std::sync::Arc;

/// Key of the note that QNN leaves in what it compiled.
const COMPATIBILITY: &str = "ep_compatibility_info.QNNExecutionProvider";

/// A session ready to run.
pub(crate) struct Committed {
    pub(crate) session: Session,
    pub(crate) landing: Landing,
    pub(crate) origin: Origin,
}

/// Makes the session.
pub(crate) fn commit(
    runtime: &Runtime,
    graph: &Graph<'_>,
    provider: Provider,
) -> Result<Committed, RuntimeError> {
    apart(|| commit_here(runtime, graph, provider))
}

/// Does `work` on a thread of its own: making a session switches its thread to flush denormal numbers (`with_flush_to_zero`),
/// and the caller may check a package's numbers bit by bit afterwards.
fn apart<T: Send>(work: impl FnOnce() -> T + Send) -> T {
    std::thread::scope(|scope| {
        let work = scope.spawn(work);
        work.join()
            .unwrap_or_else(|panic| std::panic::resume_unwind(panic))
    })
}

fn commit_here(
    runtime: &Runtime,
    graph: &Graph<'_>,
    provider: Provider,
) -> Result<Committed, RuntimeError> {
    match provider {
        Provider::Qnn { target } => qnn(runtime, graph, target),
        Provider::Nnapi | Provider::Xnnpack { .. } | Provider::Cpu { .. } => {
            if let Some(reason) = runtime.lacks(provider.kind()) {
                return Err(unavailable(provider.kind(), reason));
            }
            open(runtime, graph.onnx, provider, Origin::Plain, |builder| {
                Ok(builder)
            })
        }
    }
}

/// Compiles `onnx` for `target`, into a model of the kind that [`crate::Precompiled`] holds.
///
/// # Errors
/// If the plugin is not available, or refuses some of the graph.
pub fn compile(runtime: &Runtime, onnx: &[u8], target: QnnTarget) -> Result<Vec<u8>, RuntimeError> {
    let plugin = plugin(runtime)?;
    let folder = std::env::temp_dir();
    apart(|| Ok(compile_into(&folder, runtime, plugin, onnx, target)?.0))
}

fn qnn(runtime: &Runtime, graph: &Graph<'_>, target: QnnTarget) -> Result<Committed, RuntimeError> {
    let plugin = plugin(runtime)?;
    let others: Vec<&str> = graph.precompiled.iter().map(|p| p.target.name()).collect();
    match graph.precompiled.iter().find(|p| p.target == target) {
        Some(ours) => match load(runtime, ours.onnx, target, Origin::Precompiled) {
            Ok(committed) => return Ok(committed),
            // A cancelled load does not mean that the form is bad.
            Err(error @ RuntimeError::Cancelled) => return Err(error),
            Err(error) if graph.onnx.is_empty() => return Err(error),
            Err(error) => log::warn!(
                "the graph that came compiled for {target} is of no use here, so it is compiled: {}",
                causes(&error)
            ),
        },
        None if graph.onnx.is_empty() => {
            return Err(RuntimeError::Target {
                found: others.join(", "),
                wanted: target,
            });
        }
        None if !others.is_empty() => log::info!(
            "the graph came compiled for {}, not for {target}, so it is compiled",
            others.join(", ")
        ),
        None => {}
    }
    let Some(folder) = graph.cache.and_then(usable) else {
        return open_qnn(runtime, plugin, graph.onnx, target, Origin::Compiled);
    };
    let entry = Entry::new(
        folder,
        graph.onnx,
        target,
        runtime.version(),
        plugin.fingerprint(),
    );
    if let Some(compiled) = entry.load() {
        match load(runtime, &compiled, target, Origin::Cached) {
            Ok(committed) => return Ok(committed),
            Err(error @ RuntimeError::Cancelled) => return Err(error),
            Err(error) => entry.discard(&format!("does not load ({})", causes(&error))),
        }
    }
    log::info!("compiling the graph for {target}, once: this takes some seconds");
    let (compiled, committed) = compile_into(folder, runtime, plugin, graph.onnx, target)?;
    match entry.save(&compiled) {
        Ok(()) => log::info!("kept it as {}", entry.path().display()),
        // Costs the next start some seconds, not this one its NPU.
        Err(error) => log::warn!("{}", causes(&error)),
    }
    Ok(committed)
}

/// Makes the folder; nothing if that fails, which is logged.
fn usable(folder: &Path) -> Option<&Path> {
    fs::create_dir_all(folder)
        .map_err(|e| {
            log::warn!(
                "compiled graphs are not kept: cannot make the folder {}: {e}",
                folder.display()
            );
        })
        .ok()
        .map(|()| folder)
}

/// Loads a compiled graph, which must be wholly QNN's and for `target`.
fn load(
    runtime: &Runtime,
    compiled: &[u8],
    target: QnnTarget,
    origin: Origin,
) -> Result<Committed, RuntimeError> {
    let committed = open_qnn(runtime, plugin(runtime)?, compiled, target, origin)?;
    let note = committed
        .session
        .metadata()
        .ok()
        .and_then(|metadata| metadata.custom(COMPATIBILITY));
    match note.as_deref().and_then(parse_compatibility) {
        Some((arch, soc)) if (arch, soc) != (target.htp_arch(), target.soc_model()) => {
            Err(RuntimeError::Target {
                found: format!("chip {soc} (Hexagon V{arch})"),
                wanted: target,
            })
        }
        _ => Ok(committed),
    }
}

/// Hexagon architecture and chip from QNN's note, `v2:BACKEND:SDK:BLOB:ARCH:SOC:...`; nothing from other versions of it.
fn parse_compatibility(note: &str) -> Option<(u32, u32)> {
    let fields: Vec<&str> = note.split(':').collect();
    match fields[..] {
        ["v2", _, _, _, arch, soc, ..] => Some((arch.parse().ok()?, soc.parse().ok()?)),
        _ => None,
    }
}

/// Compiles in a temporary folder below `folder`: ONNX Runtime writes to a path that must be new.
fn compile_into(
    folder: &Path,
    runtime: &Runtime,
    plugin: &Plugin,
    onnx: &[u8],
    target: QnnTarget,
) -> Result<(Vec<u8>, Committed), RuntimeError> {
    let failed = |path: &Path| {
        let path = path.to_path_buf();
        move |source| RuntimeError::Cache { path, source }
    };
    let mut desk = tempfile::Builder::new();
    desk.prefix(".compiling-");
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        // ONNX Runtime's file gets the process's default permissions, so nobody else may come to it.
        desk.permissions(fs::Permissions::from_mode(0o700));
    }
    let desk = desk.tempdir_in(folder).map_err(failed(folder))?;
    let path = desk.path().join("context.onnx");
    let provider = Provider::Qnn { target };
    let committed = open(runtime, onnx, provider, Origin::Compiled, |builder| {
        Ok(plugin
            .configure(&runtime.environment, builder, target)?
            .with_config_entry("ep.context_enable", "1")?
            .with_config_entry("ep.context_embed_mode", "1")?
            .with_config_entry("ep.context_file_path", path.to_string_lossy())?)
    })?;
    let compiled = fs::read(&path).map_err(failed(&path))?;
    Ok((compiled, committed))
}

fn open_qnn(
    runtime: &Runtime,
    plugin: &Plugin,
    onnx: &[u8],
    target: QnnTarget,
    origin: Origin,
) -> Result<Committed, RuntimeError> {
    let provider = Provider::Qnn { target };
    open(runtime, onnx, provider, origin, |builder| {
        plugin.configure(&runtime.environment, builder, target)
    })
}

/// Makes a session of `onnx` on `provider`, with what `more` adds to its options, and reads from its log where the nodes run.
fn open(
    runtime: &Runtime,
    onnx: &[u8],
    provider: Provider,
    origin: Origin,
    more: impl FnOnce(SessionBuilder) -> Result<SessionBuilder, ort::Error>,
) -> Result<Committed, RuntimeError> {
    let (ear, logger) = Ear::new();
    let session = builder(runtime, provider)
        .and_then(|builder| Ok(builder.with_logger(logger)?))
        .and_then(|builder| Ok(builder.with_log_level(LogLevel::Verbose)?))
        .and_then(more)
        .and_then(|mut builder| {
            let _load = runtime.cancel.begin(builder.canceler());
            builder.commit_from_memory(onnx)
        });
    match session {
        Ok(session) => Ok(Committed {
            session,
            landing: ear.landing(),
            origin,
        }),
        Err(_) if runtime.cancel.is_cancelled() => Err(RuntimeError::Cancelled),
        Err(source) => Err(explain(provider.kind(), &ear, source)),
    }
}

fn explain(provider: ProviderKind, ear: &Arc<Ear>, source: ort::Error) -> RuntimeError {
    let nodes = ear.refused();
    if nodes.is_empty() && !source.to_string().contains("fallback to CPU EP") {
        return RuntimeError::Graph(source);
    }
    let nodes = match &nodes[..] {
        [] => "it does not say which nodes".into(),
        nodes => nodes.join(", "),
    };
    RuntimeError::Refused {
        provider,
        nodes,
        source,
    }
}

fn builder(runtime: &Runtime, provider: Provider) -> Result<SessionBuilder, ort::Error> {
    let builder = Session::builder(&runtime.environment)?
        .with_optimization_level(GraphOptimizationLevel::Level3)?
        // Spinning would take the cores that sorting, interpolation and a software GPU need between frames.
        .with_intra_op_spinning(false)?
        // Numbers far below any visible effect must not take the slow path of denormal arithmetic.
        .with_flush_to_zero()?;
    Ok(match provider {
        // By name: left to itself, ort lets ONNX Runtime choose among all registered plugins.
        Provider::Cpu { threads } => builder
            .with_intra_threads(threads.max(1))?
            .with_devices(devices(&runtime.environment, ProviderKind::Cpu), None)?,
        Provider::Qnn { .. } => builder.with_intra_threads(1)?,
        Provider::Nnapi => builder
            .with_intra_threads(1)?
            .with_disable_cpu_fallback()?
            .with_execution_providers([NNAPI::default()
                .with_fp16(true)
                .with_disable_cpu(true)
                .build()
                .error_on_failure()])?,
        // XNNPACK has threads of its own; nodes it lacks run on one of ours.
        Provider::Xnnpack { threads } => {
            builder
                .with_intra_threads(1)?
                .with_execution_providers([XNNPACK::default()
                    .with_intra_op_num_threads(
                        NonZeroUsize::new(threads).unwrap_or(NonZeroUsize::MIN),
                    )
                    .build()
                    .error_on_failure()])?
        }
    })
}

fn plugin(runtime: &Runtime) -> Result<&Plugin, RuntimeError> {
    runtime
        .qnn()
        .map_err(|reason| unavailable(ProviderKind::Qnn, reason.to_owned()))
}

fn unavailable(provider: ProviderKind, reason: String) -> RuntimeError {
    RuntimeError::Unavailable { provider, reason }
}

/// An error with its causes in one line.
fn causes(error: &RuntimeError) -> String {
    let mut text = error.to_string();
    let mut next = std::error::Error::source(error);
    while let Some(cause) = next {
        text.push_str(&format!(": {cause}"));
        next = cause.source();
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn chip_and_architecture_are_read_from_the_compilers_note() {
        let note = "v2:6:2.51.0:5.51.0:69:53:0:0";
        assert_eq!(
            parse_compatibility(note),
            Some((69, 53)),
            "as QNN writes it"
        );
        for other in [
            "",
            "v3:6:2.51.0:5.51.0:69:53",
            "v2:6:2.51.0",
            "v2:a:b:c:d:e",
        ] {
            assert_eq!(parse_compatibility(other), None, "{other:?}");
        }
    }
}
