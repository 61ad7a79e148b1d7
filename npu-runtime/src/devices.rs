//! What ONNX Runtime finds on this machine for a provider.

use crate::ProviderKind;
use ort::environment::Environment;
use ort::ep::{ExecutionProvider, NNAPI, XNNPACK};

/// The devices that `provider` can run on here.
pub(crate) fn devices(
    environment: &Environment,
    provider: ProviderKind,
) -> impl Iterator<Item = ort::device::Device<'_>> {
    environment
        .devices()
        .filter(move |device| device.ep().is_ok_and(|name| name == provider.ort_name()))
}

/// Whether the library was built with the provider, for those that are part of it.
pub(crate) fn is_built_in(provider: ProviderKind) -> bool {
    let known = match provider {
        ProviderKind::Nnapi => NNAPI::is_available(),
        ProviderKind::Xnnpack => XNNPACK::is_available(),
        ProviderKind::Cpu => Ok(true),
        ProviderKind::Qnn => Ok(false),
    };
    known.unwrap_or(false)
}
