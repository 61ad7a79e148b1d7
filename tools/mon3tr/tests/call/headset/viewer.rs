//! Somebody in a headset: `receive --display xr` where it finds a Monado.

use crate::house::{House, Program};
use crate::place::can_draw;
use serde_json::Value;
use test_support::monado::{Compositor, Driver, Head, Monado, Pose, Scripted};

/// Width and height of an eye's picture. Monado itself recommends 320 x 240.
pub(super) const EYE: [u32; 2] = [480, 360];

/// A runtime with a head that stands upright at the stage's origin; nothing, after a line that says why, where a component is missing.
pub(super) fn monado() -> Option<(Monado, Head)> {
    can_draw()?;
    let monado = Monado::start(Driver::Remote, Compositor::Null)?;
    let head = upright(&monado);
    Some((monado, head))
}

fn upright(monado: &Monado) -> Head {
    let mut head = monado.head();
    head.send(&Scripted::default());
    head
}

/// A head that looks to the side: people stand elsewhere in its pictures.
pub(super) fn turned() -> Scripted {
    let turn = glam::Quat::from_rotation_y(0.25);
    Scripted {
        stage_from_head: Pose::at(0.1, 1.6, 0.0).turned(turn),
        ..Scripted::default()
    }
}

/// Somebody with these links in a headset, and pictures in a folder of that name, which is also their cache's.
pub(super) fn viewer(
    house: &House,
    monado: &Monado,
    links: &[&str],
    name: &str,
    arguments: &[&str],
) -> Program {
    let size = format!("{}x{}", EYE[0], EYE[1]);
    let (out, json) = (house.path(name), house.new_report());
    let mut command = monado.client(env!("CARGO_BIN_EXE_mon3tr"));
    command
        .arg("receive")
        .args(links)
        .args(["--display", "xr", "--size", &size])
        .args(["--out", &out, "--json", &json])
        .args(arguments)
        // The call's events, the headset's, and the session's states.
        .env("RUST_LOG", "warn,link=info,app=info,renderer_vulkan=debug,renderer_splat=debug,renderer_openxr=debug");
    Program::start_as(house, out.as_ref(), &mut command)
}

/// Waits until the headset's session is in front for the so-manieth time: frames are being shown.
pub(super) fn is_focused(viewer: &mut Program, times: usize) {
    viewer.says("session: visible to focused", times);
}

/// The words in a list of a report.
pub(super) fn words(list: &Value) -> Vec<&str> {
    let list = list
        .as_array()
        .unwrap_or_else(|| panic!("{list} is no list"));
    list.iter().filter_map(Value::as_str).collect()
}
