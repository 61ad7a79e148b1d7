//! A package from its parts, signed, in one file.

use std::fs::File;
use std::path::{Path, PathBuf};

use tempfile::Builder;

use crate::ApkError;
use crate::archive::{Archive, Member, STORED, Source, Storage};
use crate::binary_xml::compile;
use crate::manifest::{check_manifest, check_metadata};
use crate::resources::Resources;
use crate::signing::{Signer, sign};
use crate::string_pool::Encoding;
use crate::text::Xml;

/// The processor that libraries are for.
pub const ABI: &str = "arm64-v8a";
/// Where libraries start in the package: at the largest page that Android has, so that they can be mapped as they lie.
pub const LIBRARY_ALIGNMENT: u16 = 16 * 1024;

/// What goes into a package.
#[derive(Clone, Debug, Default)]
pub struct Contents {
    /// The text of `AndroidManifest.xml`. It decides whether Android unpacks the libraries at installation
    /// (`android:extractNativeLibs`); here they are stored and aligned either way.
    pub manifest: String,
    /// The folder `res/`: `values`, `mipmap` and `drawable`, with qualifiers of language, density and version.
    pub resources: Option<PathBuf>,
    /// Shared libraries for [`ABI`].
    pub libraries: Vec<Library>,
    /// Files below `assets/`.
    pub assets: Vec<Asset>,
    /// Names and strings that stand as `<meta-data>` in `<application>`, besides those in the manifest's text.
    pub metadata: Vec<(String, String)>,
}

/// A shared library.
#[derive(Clone, Debug)]
pub struct Library {
    /// `libNAME.so`: Android unpacks and finds no others.
    pub name: String,
    /// The ELF file.
    pub source: Source,
}

/// A file that the application reads through Android's asset manager.
#[derive(Clone, Debug)]
pub struct Asset {
    /// Its path below `assets/`.
    pub name: String,
    /// Its bytes.
    pub source: Source,
    /// Whether it is deflated; what is not can be mapped into memory.
    pub compressed: bool,
}

/// What was written.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Report {
    /// The file's bytes.
    pub size: u64,
    /// The application's name for Android, from the manifest.
    pub package: String,
    /// The members, in the file's order.
    pub members: Vec<Member>,
    /// The SHA-256 of the signer's certificate in hexadecimal, as `apksigner verify --print-certs` prints it.
    pub certificate_sha256: String,
}

/// Writes a signed package to `path`. Equal contents give equal bytes up to the signatures, and equal files if the key is an RSA
/// key, whose signatures (PKCS #1 v1.5) hold nothing random. An older package of that name is replaced once the new one is complete.
///
/// # Errors
/// [`ApkError`] says what of the contents cannot be packaged, or what could not be read, signed or written.
pub fn write(contents: &Contents, signer: &Signer, path: &Path) -> Result<Report, ApkError> {
    let resources = contents
        .resources
        .as_deref()
        .map(Resources::read)
        .transpose()?;
    let xml = Xml::parse("AndroidManifest.xml", &contents.manifest)?;
    let package = check_manifest(&xml)?;
    let resolve = |kind: &str, name: &str| {
        resources
            .as_ref()
            .and_then(|resources| resources.id(kind, name))
    };
    check_metadata(&contents.metadata)?;
    let manifest = compile(&xml, &resolve, &contents.metadata, Encoding::Utf16)?;

    let folder = path
        .parent()
        .filter(|folder| !folder.as_os_str().is_empty())
        .unwrap_or(Path::new("."));
    let file = unfinished()
        .tempfile_in(folder)
        .map_err(ApkError::io("could not create a file in", folder))?;
    let mut archive = Archive::new(
        file.reopen()
            .map_err(ApkError::io("could not write", path))?,
    );
    archive.add(
        "AndroidManifest.xml",
        &Source::Bytes(manifest),
        Storage::Deflated,
    )?;
    if let Some(resources) = &resources {
        archive.add(
            "resources.arsc",
            &Source::Bytes(resources.table(package)?),
            STORED,
        )?;
        for (name, bytes) in resources.packaged_files()? {
            let storage = if name.ends_with(".png") {
                STORED
            } else {
                Storage::Deflated
            };
            archive.add(&name, &Source::Bytes(bytes), storage)?;
        }
    }
    add_assets(&mut archive, &contents.assets)?;
    add_libraries(&mut archive, &contents.libraries)?;
    let (zip, members) = archive.finish()?;
    let size = sign(zip, signer, path)?;
    file.persist(path).map_err(|error| ApkError::Io {
        what: "could not write",
        path: path.to_owned(),
        source: error.error,
    })?;
    Ok(Report {
        size,
        package: package.to_owned(),
        members,
        certificate_sha256: signer.certificate_sha256(),
    })
}

fn add_assets(archive: &mut Archive<File>, assets: &[Asset]) -> Result<(), ApkError> {
    let mut assets: Vec<&Asset> = assets.iter().collect();
    assets.sort_by(|a, b| a.name.cmp(&b.name));
    for asset in assets {
        let storage = if asset.compressed {
            Storage::Deflated
        } else {
            STORED
        };
        archive.add(&format!("assets/{}", asset.name), &asset.source, storage)?;
    }
    Ok(())
}

fn add_libraries(archive: &mut Archive<File>, libraries: &[Library]) -> Result<(), ApkError> {
    let mut libraries: Vec<&Library> = libraries.iter().collect();
    libraries.sort_by(|a, b| a.name.cmp(&b.name));
    for library in libraries {
        let name = &library.name;
        if !name.starts_with("lib") || !name.ends_with(".so") || name.contains('/') {
            return Err(ApkError::Member {
                name: name.clone(),
                why: "Android finds only libraries called libNAME.so".into(),
            });
        }
        archive.add(
            &format!("lib/{ABI}/{name}"),
            &library.source,
            Storage::Stored {
                alignment: LIBRARY_ALIGNMENT,
            },
        )?;
    }
    Ok(())
}

/// A file that goes away unless it is kept, and that others may read when it is.
fn unfinished() -> Builder<'static, 'static> {
    #[cfg_attr(not(unix), expect(unused_mut, reason = "only Unix has modes"))]
    let mut builder = Builder::new();
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    builder
}
