//! Avatars with a part switched off, to see what it is worth.

use anyhow::Context;
use clap::ValueEnum;
use spmm3::networks::{
    AttributeNetwork, DeformGraph, GraphParts, MeshNetwork, QuantisedBases, QuantisedDecoder,
};
use spmm3::{ATTRIBUTES, Avatar, Controllers, NEIGHBOURS};

/// A part that may be left out.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, ValueEnum)]
pub(super) enum Part {
    /// F_attr: every residual is 0
    Attributes,
    /// F_mesh: every vertex offset is 0, those of the face's expression as well
    Mesh,
}

/// What is switched off.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(super) struct Ablation {
    /// Parts that are left out.
    pub(super) without: Vec<Part>,
    /// Each Gaussian follows its strongest controller alone, not three by their masses (the paper's "w/o weighted interpolation").
    pub(super) nearest_controller: bool,
}

impl Ablation {
    /// Whether nothing is.
    pub(super) fn is_none(&self) -> bool {
        *self == Self::default()
    }

    /// The rows of a table: the full avatar, what is switched off one by one, and all of it together where that is more than one.
    pub(super) fn rows(&self) -> Vec<Self> {
        let mut parts = self.without.clone();
        parts.sort_unstable();
        parts.dedup();
        let mut rows = vec![Self::default()];
        rows.extend(parts.iter().map(|part| Self {
            without: vec![*part],
            nearest_controller: false,
        }));
        if self.nearest_controller {
            rows.push(Self {
                without: Vec::new(),
                nearest_controller: true,
            });
        }
        if rows.len() > 2 {
            rows.push(self.clone());
        }
        rows
    }

    /// In words, as the paper's table names its rows.
    pub(super) fn name(&self) -> String {
        let mut names = Vec::new();
        if self.without.contains(&Part::Mesh) {
            names.push("w/o F_mesh");
        }
        if self.without.contains(&Part::Attributes) {
            names.push("w/o F_attr");
        }
        if self.nearest_controller {
            names.push("w/o weighted interpolation");
        }
        if names.is_empty() {
            "full".to_owned()
        } else {
            names.join(", ")
        }
    }

    /// The avatar without what is switched off.
    pub(super) fn of(&self, avatar: Avatar) -> anyhow::Result<Avatar> {
        if self.is_none() {
            return Ok(avatar);
        }
        let unreadable = "cannot switch parts of this avatar off: its networks are not in our form";
        let mut mesh =
            MeshNetwork::read(&avatar.deform_graph, &avatar.template).context(unreadable)?;
        let mut attributes = AttributeNetwork::read(&avatar.deform_graph, &avatar.controllers)
            .context(unreadable)?;
        let mut controllers = avatar.controllers.clone();
        if self.without.contains(&Part::Mesh) {
            let columns = mesh.decoder.mean().len();
            let rank = mesh.decoder.rank();
            let fields = vec![0.0; rank * columns];
            mesh.decoder = QuantisedDecoder::quantise(rank, &fields, vec![0.0; columns])?;
        }
        if self.without.contains(&Part::Attributes) {
            let (bases, gaussians) = (attributes.bases.bases(), attributes.bases.gaussians());
            let none = vec![0.0; ATTRIBUTES * bases * gaussians];
            attributes.bases = QuantisedBases::quantise(bases, gaussians, &none)?;
        }
        if self.nearest_controller {
            let masses = (controllers.masses().iter()).map(strongest_alone).collect();
            controllers = Controllers::new(
                &avatar.template,
                controllers.vertices().to_vec(),
                controllers.neighbours().to_vec(),
                masses,
            )?;
        }
        let graph = DeformGraph {
            template: &avatar.template,
            controllers: &controllers,
            mesh: &mesh,
            attributes: &attributes,
        };
        Ok(Avatar {
            deform_graph: graph.to_onnx(GraphParts::Whole)?,
            // What was compiled holds the parts that are off.
            compiled: Vec::new(),
            signer: None,
            controllers,
            ..avatar
        })
    }
}

/// All mass at the strongest neighbour, of equal ones the first.
fn strongest_alone(masses: &[f32; NEIGHBOURS]) -> [f32; NEIGHBOURS] {
    let mut strongest = 0;
    for k in 1..NEIGHBOURS {
        if masses[k] > masses[strongest] {
            strongest = k;
        }
    }
    let mut alone = [0.0; NEIGHBOURS];
    alone[strongest] = 1.0;
    alone
}

#[cfg(test)]
mod tests {
    use super::*;
    use synthetic_person::Puppet;

    #[test]
    fn parts_are_switched_off_one_by_one_and_then_together() {
        let names = |without: &[Part], nearest_controller| -> Vec<String> {
            let ablation = Ablation {
                without: without.to_vec(),
                nearest_controller,
            };
            ablation.rows().iter().map(Ablation::name).collect()
        };
        assert_eq!(names(&[], false), ["full"], "nothing is off");
        assert_eq!(
            names(&[Part::Mesh], false),
            ["full", "w/o F_mesh"],
            "one part"
        );
        assert_eq!(
            names(&[Part::Mesh, Part::Attributes, Part::Mesh], false),
            ["full", "w/o F_attr", "w/o F_mesh", "w/o F_mesh, w/o F_attr"],
            "two parts, one of them twice"
        );
        assert_eq!(
            names(&[Part::Attributes], true).len(),
            4,
            "with the nearest controller"
        );
    }

    #[test]
    fn what_is_switched_off_gives_zero_and_the_rest_stays() {
        let avatar = Puppet::small().avatar();
        let off = |without: &[Part], nearest_controller| {
            let ablation = Ablation {
                without: without.to_vec(),
                nearest_controller,
            };
            ablation.of(avatar.clone()).expect("our own networks")
        };
        assert_eq!(off(&[], false), avatar, "nothing is off");
        let whole = AttributeNetwork::read(&avatar.deform_graph, &avatar.controllers)
            .expect("our own networks");
        let bare = off(&[Part::Attributes], false);
        let attributes =
            AttributeNetwork::read(&bare.deform_graph, &bare.controllers).expect("it is whole");
        assert!(
            attributes
                .bases
                .dequantise()
                .iter()
                .all(|value| *value == 0.0),
            "a residual is left"
        );
        assert_eq!(attributes.first, whole.first, "the layers stay");
        let stiff = off(&[Part::Mesh], false);
        let mesh = MeshNetwork::read(&stiff.deform_graph, &stiff.template).expect("it is whole");
        let fields = mesh.decoder.dequantise();
        let offsets = fields.iter().chain(mesh.decoder.mean());
        assert!(
            offsets.clone().all(|value| value.abs() < 1e-6),
            "an offset is left"
        );
        let nearest = off(&[], true);
        for (before, after) in
            (avatar.controllers.masses().iter()).zip(nearest.controllers.masses())
        {
            let strongest = before.iter().copied().fold(0.0, f32::max);
            let kept = after
                .iter()
                .position(|mass| *mass == 1.0)
                .expect("one is 1");
            assert_eq!(before[kept], strongest, "{before:?} became {after:?}");
            assert_eq!(after.iter().sum::<f32>(), 1.0, "{after:?}");
        }
    }
}
