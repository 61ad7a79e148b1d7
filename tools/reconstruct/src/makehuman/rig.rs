//! The rig: 163 bones, whose joints move with the morphed mesh.

use super::Model;
use crate::ReconstructError;
use glam::Vec3;

/// One bone.
#[derive(Debug, Clone, PartialEq)]
pub struct Bone {
    /// Name, e.g. `upperarm01.L`.
    pub name: String,
    /// Index of the parent, which comes earlier; `None` for the root.
    pub parent: Option<usize>,
    head: Vec<u32>,
    tail: Vec<u32>,
}

/// The bones in the file's order: parents before children.
#[derive(Debug, Clone)]
pub struct Rig {
    bones: Vec<Bone>,
}

impl Rig {
    /// Takes the rig out of the body's model.
    ///
    /// # Errors
    /// If the bone list does not list every bone as head and bone, a parent does not come first, or a joint has no
    /// vertices.
    pub fn new(body: &Model) -> Result<Self, ReconstructError> {
        let wrong = |what: String| ReconstructError::content(&body.path, what);
        let mut bones: Vec<Bone> = Vec::with_capacity(body.bones.len() / 2);
        for pair in body.bones.chunks(2) {
            let [head, bone] = pair else {
                return Err(wrong("the bone list has an odd length".into()));
            };
            if head.name.strip_suffix("____head") != Some(&bone.name) {
                return Err(wrong(format!("bone {} follows {}", bone.name, head.name)));
            }
            let parent = match usize::try_from(head.parent) {
                Err(_) => None,
                Ok(entry) if entry / 2 < bones.len() => Some(entry / 2),
                Ok(_) => return Err(wrong(format!("bone {} comes before its parent", bone.name))),
            };
            let joint = |end: &str| {
                let key = format!("{}____{end}", bone.name);
                body.joint_vertices
                    .get(&key)
                    .cloned()
                    .ok_or_else(|| wrong(format!("joint {key} is missing")))
            };
            bones.push(Bone {
                name: bone.name.clone(),
                parent,
                head: joint("head")?,
                tail: joint("tail")?,
            });
        }
        Ok(Self { bones })
    }

    /// The bones, parents first.
    #[must_use]
    pub fn bones(&self) -> &[Bone] {
        &self.bones
    }

    /// Index of a bone.
    #[must_use]
    pub fn find(&self, name: &str) -> Option<usize> {
        self.bones.iter().position(|b| b.name == name)
    }

    /// Where each bone begins on a morphed body, decimetres.
    #[must_use]
    pub fn heads(&self, body: &[Vec3]) -> Vec<Vec3> {
        self.bones.iter().map(|b| mean(body, &b.head)).collect()
    }

    /// Where each bone ends on a morphed body, decimetres.
    #[must_use]
    pub fn tails(&self, body: &[Vec3]) -> Vec<Vec3> {
        self.bones.iter().map(|b| mean(body, &b.tail)).collect()
    }
}

fn mean(body: &[Vec3], indices: &[u32]) -> Vec3 {
    let sum: Vec3 = indices
        .iter()
        .filter_map(|i| body.get(*i as usize))
        .copied()
        .sum();
    sum / indices.len().max(1) as f32
}
