//! A static scene behind and around the person, or by itself, and the cameras that were made for it.

use crate::ground;
use crate::place::Place;
use crate::size::Size;
use crate::up::{UpChoice, UpFigures};
use anyhow::{Context, ensure};
use glam::{Quat, Vec2, Vec3};
use renderer_splat::background::Background;
use renderer_splat::camera::{Camera, Fov};
use renderer_splat::options::Filter;
use serde::Serialize;
use splat_scene::cameras::{Cameras, SceneCamera};
use splat_scene::{Bounds, Placement, Scene};
use std::ffi::OsString;
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Options that choose a scene for the background.
#[derive(Debug, Clone, clap::Args)]
pub(crate) struct SceneryOptions {
    /// A Gaussian scene to draw behind and around the person: .ply (3DGS or compressed), .splat, .spz, .sog
    /// or a SOG scene's meta.json
    #[arg(long, value_name = "FILE")]
    pub background: Option<PathBuf>,
    /// Where the scene's origin goes, in metres from where the person first stands (x to their left, z ahead of them), how
    /// far it is turned, and how large its unit is. Its ground is put under the person's feet by itself; y raises it
    /// [default: 0,0,0,0,1]
    #[arg(
        long,
        value_name = "X,Y,Z[,DEGREES[,SCALE]]",
        requires = "background",
        allow_hyphen_values = true
    )]
    pub(crate) place: Option<Place>,
    /// The axis of the scene's file that points up: +x, -x, +y, -y, +z or -z; auto takes what the file states, what its
    /// cameras (--view, or the cameras.json beside it) or its ground show, else what is usual for the format: +y for
    /// .spz, -y for the others
    #[arg(
        long,
        value_name = "AXIS",
        default_value_t = UpChoice::Auto,
        requires = "background",
        allow_hyphen_values = true
    )]
    pub(crate) up: UpChoice,
}

impl SceneryOptions {
    /// The same choice as arguments for another process.
    pub(crate) fn arguments(&self) -> Vec<OsString> {
        let mut arguments = Vec::new();
        if let Some(file) = &self.background {
            arguments.extend(["--background".into(), file.into()]);
        }
        if let Some(place) = self.place {
            arguments.extend(["--place".into(), place.to_string().into()]);
        }
        if let UpChoice::Axis(axis) = self.up {
            arguments.push(format!("--up={axis}").into());
        }
        arguments
    }

    /// Refuses a scene file that is not there, before anything long begins.
    pub(crate) fn check(&self) -> anyhow::Result<()> {
        match &self.background {
            Some(file) => check_file(file).context("cannot use the background"),
            None => Ok(()),
        }
    }

    /// The scene around a person who first stands at `floor` and faces along `heading`; nothing if none was asked for. The
    /// scene's `cameras` may tell what is up.
    pub(crate) fn around(
        &self,
        cameras: Option<&Path>,
        floor: Vec3,
        heading: Quat,
    ) -> anyhow::Result<Option<Scenery>> {
        let Some(file) = &self.background else {
            return Ok(None);
        };
        let mut scene = load_drawable(file)?;
        let raised = self.up.raise(&mut scene, file, cameras)?;
        let mut figures = SceneFigures::of(file, &scene, raised.up)?;
        let place = self.place.unwrap_or_default();
        let mut world_from_scene = put(&mut scene, &place, floor, heading)?;
        world_from_scene.turn *= raised.turn;
        let background = Background::pack(&scene);
        figures.gpu_bytes = background.bytes();
        Ok(Some(Scenery {
            figures,
            background: Arc::new(background),
            bounds: scene.robust_bounds(),
            world_from_scene,
        }))
    }
}

/// Moves a scene around a person who first stands at `floor` and faces along `heading`, its ground below the feet. Returns
/// the move.
fn put(
    scene: &mut Scene,
    place: &Place,
    floor: Vec3,
    heading: Quat,
) -> anyhow::Result<WorldFromScene> {
    let turn = heading * place.turn();
    let moved = floor + heading * (Vec3::new(1.0, 0.0, 1.0) * place.offset);
    scene.place(&Placement::new(place.scale, turn, moved)?);
    // Only now is it known what lies below the person.
    let ground = ground::height(scene, floor).unwrap_or(floor.y);
    let up = Vec3::Y * (floor.y + place.offset.y - ground);
    scene.place(&Placement::new(1.0, Quat::IDENTITY, up)?);
    Ok(WorldFromScene {
        scale: place.scale,
        turn,
        moved: moved + up,
    })
}

/// Scaled, then turned, then moved, from where the scene's cameras are.
#[derive(Debug, Clone, Copy)]
struct WorldFromScene {
    scale: f32,
    turn: Quat,
    moved: Vec3,
}

impl WorldFromScene {
    const IDENTITY: Self = Self {
        scale: 1.0,
        turn: Quat::IDENTITY,
        moved: Vec3::ZERO,
    };

    fn point(&self, scene: [f32; 3]) -> Vec3 {
        self.turn * (self.scale * Vec3::from_array(scene)) + self.moved
    }
}

/// A scene, packed for the renderer.
#[derive(Debug)]
pub struct Scenery {
    /// As the renderer takes it.
    pub background: Arc<Background>,
    /// What is told of it.
    pub figures: SceneFigures,
    /// The box that most of it lies in, in the world.
    bounds: Option<Bounds>,
    world_from_scene: WorldFromScene,
}

/// What a scene file holds.
#[derive(Debug, Clone, Serialize)]
pub struct SceneFigures {
    pub(crate) file: PathBuf,
    pub(crate) file_bytes: u64,
    pub(crate) format: String,
    /// Those that are drawn.
    pub gaussians: usize,
    pub(crate) sh_degree: u8,
    /// Corners of the box around all centres, in the scene's units, y up.
    pub(crate) bounds: Option<[[f32; 3]; 2]>,
    /// The same without the first and the last hundredth on each axis.
    pub(crate) robust_bounds: Option<[[f32; 3]; 2]>,
    /// As `bounds`, in the file's own axes: those of `rig --box`.
    bounds_in_file: Option<[[f32; 3]; 2]>,
    pub(crate) dropped: DroppedFigures,
    /// The same in words.
    #[serde(skip)]
    left_out: String,
    /// Whether the file says that the scene was trained with an anti-aliasing filter.
    pub(crate) antialiased: bool,
    #[serde(flatten)]
    pub(crate) up: UpFigures,
    /// What the packed scene takes on the device.
    pub(crate) gpu_bytes: u64,
}

/// Gaussians left out, by reason.
#[derive(Debug, Clone, Serialize)]
pub(crate) struct DroppedFigures {
    pub(crate) position: usize,
    pub(crate) rotation: usize,
    pub(crate) scale: usize,
    pub(crate) opacity: usize,
    pub(crate) colour: usize,
}

impl SceneFigures {
    /// Of a scene that was turned up and is not placed or packed yet.
    fn of(file: &Path, scene: &Scene, up: UpFigures) -> anyhow::Result<Self> {
        let corners = |bounds: Bounds| [bounds.min, bounds.max];
        let dropped = scene.dropped();
        Ok(Self {
            file: file.to_path_buf(),
            file_bytes: std::fs::metadata(file)
                .with_context(|| format!("cannot read {}", file.display()))?
                .len(),
            format: scene.format().to_string(),
            gaussians: scene.len(),
            sh_degree: scene.sh_degree(),
            bounds: scene.bounds().map(corners),
            robust_bounds: scene.robust_bounds().map(corners),
            bounds_in_file: scene.bounds().map(|bounds| {
                let ends = corners(bounds).map(|end| scene.point_in_file(Vec3::from(end)));
                [
                    ends[0].min(ends[1]).to_array(),
                    ends[0].max(ends[1]).to_array(),
                ]
            }),
            dropped: DroppedFigures {
                position: dropped.position,
                rotation: dropped.rotation,
                scale: dropped.scale,
                opacity: dropped.opacity,
                colour: dropped.colour,
            },
            left_out: dropped.to_string(),
            antialiased: scene.antialiased(),
            up,
            gpu_bytes: 0,
        })
    }
}

impl SceneFigures {
    /// Prints them, one in a line.
    pub(crate) fn print(&self) {
        println!("scene        {} ({})", self.file.display(), self.format);
        println!("file         {} bytes", self.file_bytes);
        println!("Gaussians    {}", self.gaussians);
        println!("SH degree    {}", self.sh_degree);
        println!("up           {} ({})", self.up.up, self.up.up_from);
        for (name, corners, axes_of) in [
            ("bounds", self.bounds, "y up"),
            ("1 to 99 %", self.robust_bounds, "y up"),
            ("in the file", self.bounds_in_file, "its own axes"),
        ] {
            let Some([low, high]) = corners else {
                continue;
            };
            let axes = ["x", "y", "z"].into_iter().zip(low.into_iter().zip(high));
            let axes: Vec<String> = axes
                .map(|(axis, (low, high))| format!("{axis} {low:.2} to {high:.2}"))
                .collect();
            println!("{name:<12} {} ({axes_of})", axes.join(", "));
        }
        println!("left out     {}", self.left_out);
        println!(
            "antialiased  {}",
            if self.antialiased { "yes" } else { "not said" }
        );
        println!("on the GPU   {} bytes", self.gpu_bytes);
    }
}

impl Scenery {
    /// The scene by itself, turned up and else where it lies in its file; it may be empty.
    pub(crate) fn alone(file: &Path, up: UpChoice, cameras: Option<&Path>) -> anyhow::Result<Self> {
        Self::of(file, load(file)?, up, cameras)
    }

    /// The same of a scene that is to be drawn.
    pub fn drawable(file: &Path, up: UpChoice, cameras: Option<&Path>) -> anyhow::Result<Self> {
        Self::of(file, load_drawable(file)?, up, cameras)
    }

    fn of(
        file: &Path,
        mut scene: Scene,
        up: UpChoice,
        cameras: Option<&Path>,
    ) -> anyhow::Result<Self> {
        let raised = up.raise(&mut scene, file, cameras)?;
        let mut figures = SceneFigures::of(file, &scene, raised.up)?;
        let background = Background::pack(&scene);
        figures.gpu_bytes = background.bytes();
        Ok(Self {
            figures,
            background: Arc::new(background),
            bounds: scene.robust_bounds(),
            world_from_scene: WorldFromScene {
                turn: raised.turn,
                ..WorldFromScene::IDENTITY
            },
        })
    }

    /// The filter that the scene was trained for, as far as its file tells.
    pub(crate) fn filter(&self) -> Filter {
        if self.figures.antialiased {
            Filter::Mip
        } else {
            Filter::Dilation
        }
    }

    /// A camera that belongs to the scene, in the world.
    pub fn camera(&self, chosen: &SceneCamera, Size { width, height }: Size) -> Camera {
        let mut placed = chosen.clone();
        placed.position = self.world_from_scene.point(chosen.position).to_array();
        placed.world_from_camera = self.world_from_scene.turn * chosen.world_from_camera;
        camera(&placed, width, height)
    }

    /// A camera that sees most of the scene, looking along `direction` with a field of view of `fov_degrees` (vertical).
    pub fn overview(
        &self,
        direction: Vec3,
        fov_degrees: f32,
        Size { width, height }: Size,
    ) -> Camera {
        /// Room around the scene, as a share of the distance.
        const ROOM: f32 = 1.1;
        let (low, high) = self.bounds.map_or((Vec3::NEG_ONE, Vec3::ONE), |bounds| {
            (Vec3::from_array(bounds.min), Vec3::from_array(bounds.max))
        });
        let fov = fov_degrees.to_radians();
        let target = 0.5 * (low + high);
        let look_from = |distance: f32| {
            let eye = target - direction.normalize_or(Vec3::NEG_Z) * distance;
            Camera::look_at(eye, target, Vec3::Y, fov, width, height)
        };
        // Each corner of the box asks for a distance at which it lies within the picture.
        let turn = look_from(1.0).camera_from_world.matrix3;
        let slope = (0.5 * fov).tan();
        let slopes = Vec2::new(slope * width as f32 / height as f32, slope);
        let distance = (0..8u8)
            .map(|corner| {
                let pick = |axis: u8| f32::from((corner >> axis) & 1);
                let share = Vec3::new(pick(0), pick(1), pick(2));
                let arm = turn * (low + share * (high - low) - target);
                (Vec2::new(arm.x, arm.y).abs() / slopes).max_element() + arm.z
            })
            .fold(0.01, f32::max);
        look_from(ROOM * distance)
    }
}

/// Says of a path what it is, if it is no file with anything in it.
pub(crate) fn check_file(file: &Path) -> anyhow::Result<()> {
    let name = file.display();
    let about = std::fs::metadata(file)
        .with_context(|| format!("cannot read {name}: check the path and its permissions"))?;
    ensure!(!about.is_dir(), "{name} is a folder; name a file");
    ensure!(about.len() > 0, "{name} is empty; fetch or write it again");
    Ok(())
}

/// Whether a file is to be read as a scene: by its first bytes, and by its ending where they tell nothing, as in a .splat. A
/// file that cannot be read is none.
pub(crate) fn is_scene(file: &Path) -> bool {
    let start = first_bytes(file);
    let by_content = match &start.unwrap_or_default() {
        b"PK\x03\x04" => Some(splat_scene::is_sog(file)),
        b"ply\n" | b"ply\r" | b"NGSP" | [0x1F, 0x8B, ..] => Some(true),
        _ => None,
    };
    let ending = file.extension().unwrap_or_default();
    start.is_some() && by_content.unwrap_or(!ending.eq_ignore_ascii_case("m3a"))
}

/// Reads a scene file that is to be drawn, and so must not be empty.
pub(crate) fn load_drawable(file: &Path) -> anyhow::Result<Scene> {
    ensure!(
        !is_zip(file) || splat_scene::is_sog(file),
        "{} looks like an avatar package, which is no scan or scene: ./run render shows it",
        file.display()
    );
    let scene = load(file)?;
    ensure!(
        !scene.is_empty(),
        "{} has no Gaussian that can be drawn (left out: {}); export it again",
        file.display(),
        scene.dropped()
    );
    Ok(scene)
}

fn is_zip(file: &Path) -> bool {
    first_bytes(file) == Some(*b"PK\x03\x04")
}

fn first_bytes(file: &Path) -> Option<[u8; 4]> {
    let mut start = [0; 4];
    let mut file = File::open(file).ok()?;
    file.read_exact(&mut start).ok().map(|()| start)
}

/// Reads a scene file.
fn load(file: &Path) -> anyhow::Result<Scene> {
    let scene = Scene::load(file).context("cannot read the Gaussian splats")?;
    if scene.dropped().total() > 0 {
        log::warn!(
            "{}: Gaussians left out: {}",
            file.display(),
            scene.dropped()
        );
    }
    Ok(scene)
}

/// A camera of a cameras.json: that with the number `id`, else the first.
pub fn load_camera(file: &Path, id: Option<i64>) -> anyhow::Result<SceneCamera> {
    let cameras = Cameras::load(file)?;
    let chosen = match id {
        Some(id) => cameras.get(id)?,
        None => cameras.all().first().with_context(|| {
            format!(
                "{} has no cameras; give the scene's own cameras.json",
                file.display()
            )
        })?,
    };
    Ok(chosen.clone())
}

/// A scene's camera for pictures of another size: the field of view stays, as in 3DGS.
pub fn camera(camera: &SceneCamera, width: u32, height: u32) -> Camera {
    let half = |pixels: u32, focal: f32| (0.5 * pixels as f32 / focal).atan();
    let right = half(camera.width, camera.fx);
    let up = half(camera.height, camera.fy);
    let fov = Fov {
        left: -right,
        right,
        up,
        down: -up,
    };
    let position = Vec3::from_array(camera.position);
    Camera::from_fov(position, camera.world_from_camera, fov, width, height)
}

#[cfg(test)]
mod tests {
    use super::*;
    use splat_scene::{SceneBuilder, Splat};

    /// A floor of 4 x 4 units at a height of -1, and a lamp above it.
    fn room() -> Scene {
        let floor = (0..400u16).map(|k| {
            let (column, row) = (f32::from(k % 20), f32::from(k / 20));
            [0.2 * column - 1.9, -1.0, 0.2 * row - 1.9]
        });
        let mut builder = SceneBuilder::new(0).expect("degree 0");
        for position in floor.chain([[0.5, 0.8, 0.0]]) {
            let splat = Splat {
                position,
                rotation: [0.0, 0.0, 0.0, 1.0],
                log_scale: [-3.0; 3],
                opacity: 0.9,
                colour: [0.5; 3],
            };
            builder.push(&splat, &[]).expect("a splat fits");
        }
        builder.finish()
    }

    #[test]
    fn a_scene_is_put_with_its_ground_below_the_persons_feet() {
        let mut scene = room();
        let place: Place = "1,0.25,-0.5,90,2".parse().expect("a place");
        let (floor, heading) = (Vec3::new(3.0, 0.0, 4.0), Quat::from_rotation_y(0.5));
        let moved = put(&mut scene, &place, floor, heading).expect("a placed scene");
        for (from, to) in room().positions().iter().zip(scene.positions()) {
            let to = Vec3::from_array(*to);
            assert!(moved.point(*from).abs_diff_eq(to, 1e-4), "{from:?} at {to}");
        }
        let [_, height, _] = scene.positions()[0];
        assert!((height - 0.25).abs() < 1e-4, "ground at {height} m");
        let origin = moved.point([0.0, -1.0, 0.0]);
        let expected = floor + heading * Vec3::new(1.0, 0.25, -0.5);
        assert!(
            origin.abs_diff_eq(expected, 1e-4),
            "{origin} for {expected}"
        );
    }

    #[test]
    fn an_overview_has_the_whole_scene_in_the_picture_and_hardly_more() {
        let scene = room();
        let scenery = Scenery {
            background: Arc::new(Background::pack(&scene)),
            figures: SceneFigures::of(
                Path::new(env!("CARGO_MANIFEST_PATH")),
                &scene,
                UpFigures::default(),
            )
            .expect("the manifest stands in for a file"),
            bounds: scene.bounds(),
            world_from_scene: WorldFromScene::IDENTITY,
        };
        let size = Size {
            width: 300,
            height: 200,
        };
        let camera = scenery.overview(Vec3::new(-1.0, -0.5, -2.0), 40.0, size);
        let farthest = scene.positions().iter().map(|position| {
            let p = camera
                .camera_from_world
                .transform_point3(Vec3::from_array(*position));
            let x = camera.fx * p.x / -p.z / 150.0;
            let y = camera.fy * p.y / -p.z / 100.0;
            x.abs().max(y.abs())
        });
        let farthest = farthest.fold(0.0, f32::max);
        assert!(
            (0.7..1.0).contains(&farthest),
            "{farthest} of the way to the edge"
        );
    }
}
