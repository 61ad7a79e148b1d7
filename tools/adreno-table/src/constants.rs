//! The specialisation constants that xr-renderer sets on this chip. It sets them by number; here they go by the name
//! they have in the shader, and a name this file does not know is an error, so that a new one is not forgotten.

use anyhow::bail;

/// The value of a shader's constant with subgroups of `subgroup`, or nothing where the renderer leaves the default.
pub(crate) fn value(shader: &str, constant: &str, subgroup: u32) -> anyhow::Result<Option<u32>> {
    Ok(match (shader, constant) {
        ("raster", "GROUP") => {
            // A 16x16 tile in blocks of 8x8, or of 16x8 where subgroups are wider than 64: see tiles.rs.
            let blocks_per_tile = if subgroup > 64 { 2 } else { 4 };
            Some(blocks_per_tile * subgroup)
        }
        ("bin_count" | "bin_emit", "GROUP") => Some(32),
        (_, "GROUP") => Some(64),
        (_, "SUBGROUP") => Some(subgroup),
        _ => bail!(
            "no value for the specialisation constant {constant}: say in tools/adreno-table/src/constants.rs what the renderer sets"
        ),
    })
}
