//! From where graphs that are compiled for an NPU are taken.
//!
//! A compiled graph is code of the NPU's vendor that nobody here can check: whoever made it has the vendor's driver run what they want. So a package's is
//! taken only where the package is signed by a key that is trusted for that; anyone else's plain graph, which is checked, is compiled here.

use identity::PublicKey;
use npu_runtime::{Precompiled, Provider, ProviderKind};
use spmm3::Avatar;
use spmm3::networks::{CompiledGraph, GraphParts};
use std::path::PathBuf;

/// From where compiled graphs are taken; by default from nowhere.
#[derive(Debug, Clone, Default)]
pub struct CompiledSources {
    /// The folder for what is compiled on this machine; without it, a provider compiles for every session.
    pub cache: Option<PathBuf>,
    /// Whose packages may bring compiled graphs: one's own key and those that one trusts.
    pub trusted: Vec<PublicKey>,
}

impl CompiledSources {
    /// The compiled forms of `graph` in the avatar's package that `provider` may run, of chips that are known here. Says in the log why there are none,
    /// where the package brings some.
    pub(crate) fn of_package<'a>(
        &self,
        avatar: &'a Avatar,
        graph: GraphParts,
        provider: Provider,
    ) -> Vec<Precompiled<'a>> {
        // Packages bring the whole graph only.
        if graph != GraphParts::Whole || provider.kind() != ProviderKind::Qnn {
            return Vec::new();
        }
        let known = self.trusted_of(avatar).iter().filter_map(|one| {
            let target = one.target.parse();
            let target = target.inspect_err(|e| log::info!("a compiled graph is of no use: {e}"));
            Some(Precompiled {
                target: target.ok()?,
                onnx: &one.onnx,
            })
        });
        known.collect()
    }

    fn trusted_of<'a>(&self, avatar: &'a Avatar) -> &'a [CompiledGraph] {
        let brought = &avatar.compiled[..];
        match avatar.signer {
            _ if brought.is_empty() => {}
            Some(signer) if self.trusted.contains(&signer) => return brought,
            Some(signer) => log::warn!(
                "the package's compiled graph is not used, since {}, which signed the package, is not trusted to bring one (`mon3tr keys trust {signer}` \
                 would): the plain graph is compiled here",
                signer.fingerprint()
            ),
            None => log::warn!(
                "the package's compiled graph is not used, since nobody signed the package: the plain graph is compiled here"
            ),
        }
        &[]
    }
}
