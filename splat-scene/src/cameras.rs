//! The cameras a scene was trained from, in the `cameras.json` that 3DGS leaves beside it (`camera_to_JSON`): positions and
//! rotations in the scene's world, in COLMAP's axes, turned here into OpenXR's as the scene is.

use std::path::{Path, PathBuf};

use glam::{DMat3, DQuat, DVec3, Quat};
use serde::Deserialize;

use crate::frame::turned_rotation;
use crate::frame::turned_vector;
use crate::source::read_bounded;
use crate::{MAX_COORDINATE, SceneError};

/// A camera file is not read beyond this size; a camera takes half a kilobyte.
pub const MAX_CAMERAS_BYTES: u64 = 1 << 28;

/// One camera: a pinhole whose axis goes through the middle of the picture.
#[derive(Debug, Clone, PartialEq)]
pub struct SceneCamera {
    /// Its id in the file.
    pub id: i64,
    /// The photograph it took, without its folder and ending.
    pub name: String,
    /// Width of the photograph, pixels.
    pub width: u32,
    /// Height of the photograph, pixels.
    pub height: u32,
    /// Focal length in pixels, horizontally.
    pub fx: f32,
    /// Focal length in pixels, vertically.
    pub fy: f32,
    /// The eye, in the scene's units and frame (y up).
    pub position: [f32; 3],
    /// Turns the camera's axes (x right, y up, looking along -z) into the scene's.
    pub world_from_camera: Quat,
}

/// The cameras of one file, in its order.
#[derive(Debug, Clone, PartialEq)]
pub struct Cameras {
    name: String,
    list: Vec<SceneCamera>,
}

/// As the file has it.
#[derive(Deserialize)]
struct Entry {
    id: i64,
    #[serde(default)]
    img_name: String,
    width: u32,
    height: u32,
    position: [f64; 3],
    rotation: [[f64; 3]; 3],
    fx: f32,
    fy: f32,
}

impl Cameras {
    /// Reads a camera file.
    ///
    /// # Errors
    /// [`SceneError::Read`], [`SceneError::TooLarge`], and as [`Self::parse`].
    pub fn load(path: impl AsRef<Path>) -> Result<Self, SceneError> {
        let path = path.as_ref();
        let bytes = read_bounded(path, MAX_CAMERAS_BYTES)?;
        Self::parse(&bytes, &path.display().to_string())
    }

    /// The camera file of a scene's file where 3DGS leaves it: beside it, or two folders above
    /// `point_cloud/iteration_N/point_cloud.ply`. Nothing where there is none.
    pub fn beside(scene: &Path) -> Option<PathBuf> {
        let iteration = scene.parent()?;
        let trained = iteration
            .parent()
            .filter(|folder| folder.ends_with("point_cloud"))
            .and_then(Path::parent);
        [Some(iteration), trained]
            .into_iter()
            .flatten()
            .map(|folder| folder.join("cameras.json"))
            .find(|file| file.is_file())
    }

    /// Reads a camera file's content; `name` is what errors call it.
    ///
    /// # Errors
    /// [`SceneError::CameraList`] where it is no such list, [`SceneError::Camera`] for an invalid camera.
    pub fn parse(bytes: &[u8], name: &str) -> Result<Self, SceneError> {
        let entries: Vec<Entry> =
            serde_json::from_slice(bytes).map_err(|source| SceneError::CameraList {
                name: name.to_owned(),
                source,
            })?;
        let list = entries
            .into_iter()
            .map(|entry| {
                let id = entry.id;
                camera(entry).map_err(|what| SceneError::Camera {
                    name: name.to_owned(),
                    id,
                    what,
                })
            })
            .collect::<Result<_, _>>()?;
        Ok(Self {
            name: name.to_owned(),
            list,
        })
    }

    /// The cameras, in the file's order.
    pub fn all(&self) -> &[SceneCamera] {
        &self.list
    }

    /// The first camera of that id.
    ///
    /// # Errors
    /// [`SceneError::NoCamera`], which lists the ids there are.
    pub fn get(&self, id: i64) -> Result<&SceneCamera, SceneError> {
        self.list
            .iter()
            .find(|camera| camera.id == id)
            .ok_or_else(|| SceneError::NoCamera {
                name: self.name.clone(),
                id,
                known: self.ids(),
            })
    }

    /// The ids in words, ranges joined: `0 to 5, 7`.
    fn ids(&self) -> String {
        const SHOWN: usize = 20;
        let mut ids: Vec<i64> = self.list.iter().map(|camera| camera.id).collect();
        ids.sort_unstable();
        ids.dedup();
        let runs: Vec<String> = ids
            .chunk_by(|a, b| a.checked_add(1) == Some(*b))
            .map(|run| match run {
                [first, .., last] => format!("{first} to {last}"),
                _ => run.iter().map(i64::to_string).collect(),
            })
            .collect();
        match runs.get(..SHOWN) {
            Some(shown) if runs.len() > SHOWN => {
                format!("{} and more, {} in all", shown.join(", "), ids.len())
            }
            _ if runs.is_empty() => "none".to_owned(),
            _ => runs.join(", "),
        }
    }
}

fn camera(entry: Entry) -> Result<SceneCamera, String> {
    let Entry {
        id,
        img_name,
        width,
        height,
        position,
        rotation,
        fx,
        fy,
    } = entry;
    if width == 0 || height == 0 {
        return Err(format!("its picture is {width} x {height} pixels"));
    }
    if !(fx.is_finite() && fy.is_finite() && fx > 0.0 && fy > 0.0) {
        return Err(format!("its focal lengths are {fx} and {fy} pixels"));
    }
    if !position
        .iter()
        .all(|v| v.abs() <= f64::from(MAX_COORDINATE))
    {
        return Err(format!("its position is {position:?}"));
    }
    // The file has rows.
    let matrix = DMat3::from_cols_array_2d(&rotation).transpose();
    let off = matrix * matrix.transpose() - DMat3::IDENTITY;
    let largest = off
        .to_cols_array()
        .iter()
        .fold(0.0, |most, v| v.abs().max(most));
    if !matrix.is_finite() || largest > 1e-3 || matrix.determinant() < 0.0 {
        return Err("its rotation matrix is not one of a rotation".to_owned());
    }
    let rotation = DQuat::from_mat3(&matrix).as_quat().to_array();
    Ok(SceneCamera {
        id,
        name: img_name,
        width,
        height,
        fx,
        fy,
        position: turned_vector(DVec3::from_array(position).as_vec3().to_array()),
        world_from_camera: Quat::from_array(turned_rotation(rotation)).normalize(),
    })
}
