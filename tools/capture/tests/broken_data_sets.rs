//! Folders of published data sets broken in many ways: each message names the file and, in a calibration, the field.

mod support;

use std::fs;
use std::path::Path;
use support::published::{actors_hq, avatar_rex, smpl, thuman};
use support::{Break, cut, edit, npz, png, refused, way};

/// Ways to break a calibration with OpenCV's fields, of two cameras of these names.
fn opencv<'a>(file: &'a str, first: &'a str, second: &'a str) -> Vec<Break<'a>> {
    let edited = |what, words: &[&str], from: &'a str, to: &'a str| {
        let words: Vec<&str> = [file].into_iter().chain(words.iter().copied()).collect();
        way(what, &words, move |f: &Path| edit(&f.join(file), from, to))
    };
    let of = |camera: &str, field: &str| format!("`{camera}.{field}`");
    vec![
        edited("no K", &[&of(first, "K"), "missing"], "\"K\"", "\"k\""),
        edited("no R", &[&of(first, "R"), "missing"], "\"R\"", "\"r\""),
        edited(
            "a T of two",
            &[&of(second, "T"), "3 are needed"],
            "[0.5, 0, 3]",
            "[0.5, 0]",
        ),
        edited(
            "no rotation",
            &[&of(first, "R"), "rotation"],
            "[1, 0, 0, 0, 1, 0, 0, 0, 1]",
            "[1, 0, 0, 0, 1, 0, 0, 0, 2]",
        ),
        edited(
            "a mirror",
            &[&of(first, "R"), "right-handed"],
            "[1, 0, 0, 0, 1, 0, 0, 0, 1]",
            "[1, 0, 0, 0, 1, 0, 0, 0, -1]",
        ),
        edited("skew", &[&of(first, "K"), "skew"], "[10, 0, 4", "[10, 3, 4"),
        edited(
            "no focal length",
            &[&of(first, "K"), "greater than 0"],
            "[10, 0, 4",
            "[0, 0, 4",
        ),
        edited(
            "a far centre",
            &[&of(first, "K"), "near the picture"],
            "[10, 0, 4",
            "[10, 0, 4e5",
        ),
        edited(
            "six coefficients",
            &[&of(first, "distCoeff"), "undistort"],
            "[0, 0, 0, 0, 0]",
            "[0, 0, 0, 0, 0, 1]",
        ),
        edited(
            "a giant coefficient",
            &[&of(first, "distCoeff"), "small numbers"],
            "[0, 0, 0, 0, 0]",
            "[0, 0, 1e9, 0, 0]",
        ),
        edited(
            "one side",
            &[&of(first, "imgSize"), "width and height"],
            "\"imgSize\": [8, 6]",
            "\"imgSize\": [8]",
        ),
        edited(
            "no width",
            &[&of(first, "imgSize[0]"), "is 0"],
            "\"imgSize\": [8, 6]",
            "\"imgSize\": [0, 6]",
        ),
        edited("NaN", &["line 1", "no JSON"], "\"T\": [0,", "\"T\": [NaN,"),
        edited(
            "a text",
            &[&of(first, "T[1]"), "a number"],
            "\"T\": [0, 0,",
            "\"T\": [0, \"0\",",
        ),
        edited(
            "millimetres",
            &[&of(first, "T"), "metres"],
            "\"T\": [0, 0, 3]",
            "\"T\": [0, 0, 3e6]",
        ),
        way("no camera", &[file, "0 cameras"], move |f: &Path| {
            fs::write(f.join(file), "{}").expect("written");
        }),
        way("cut short", &[file, "line 1"], move |f: &Path| {
            cut(&f.join(file), 70);
        }),
        way(
            "a name that leads elsewhere",
            &[file, "letters"],
            move |f: &Path| {
                edit(&f.join(file), &format!("\"{first}\""), "\"../a\"");
            },
        ),
    ]
}

#[test]
fn avatar_rex_in_twenty_eight_broken_ways() {
    let mut ways = opencv("calibration_full.json", "22010708", "22010710");
    ways.extend([
        way("no camera's folder", &["22010710", "cannot read"], |f| {
            fs::remove_dir_all(f.join("22010710")).expect("gone");
        }),
        way("no picture of a camera", &["22010708", "no picture"], |f| {
            for frame in 0..4 {
                fs::remove_file(f.join(format!("22010708/{frame:08}.jpg"))).expect("gone");
            }
        }),
        way(
            "masks of no camera's frame",
            &["22010708/mask/pha", "no picture"],
            |f| {
                fs::remove_dir_all(f.join("22010708/mask/pha")).expect("gone");
                fs::create_dir(f.join("22010708/mask/pha")).expect("empty");
            },
        ),
        way("names of two kinds", &["22010708/1.jpg", "rename"], |f| {
            let name = |name: &str| f.join("22010708").join(name);
            fs::rename(name("00000001.jpg"), name("1.jpg")).expect("moved");
        }),
        way("another size", &["22010710/00000003.jpg", "5 x 6"], |f| {
            png(&f.join("22010710/00000003.jpg"), [5, 6], 1);
        }),
        way("a picture cut short", &["22010708/00000000.jpg"], |f| {
            cut(&f.join("22010708/00000000.jpg"), 60);
        }),
        way(
            "a mask cut short",
            &["22010708/mask/pha/00000000.jpg"],
            |f| {
                cut(&f.join("22010708/mask/pha/00000000.jpg"), 60);
            },
        ),
        way(
            "a motion of two frames",
            &["smpl_params.npz", "global_orient", "has 2 frames"],
            |f| {
                smpl(&f.join("smpl_params.npz"), 2);
            },
        ),
        way(
            "a motion without arms",
            &["smpl_params.npz", "`body_pose`", "missing"],
            |f| {
                npz(
                    &f.join("smpl_params.npz"),
                    &[("global_orient", &[4, 3], vec![0.0; 12])],
                );
            },
        ),
        way("a motion cut short", &["smpl_params.npz"], |f| {
            cut(&f.join("smpl_params.npz"), 60);
        }),
    ]);
    assert_eq!(ways.len(), 28, "as many");
    refused(avatar_rex, &ways);
}

#[test]
fn thuman_in_twenty_four_broken_ways() {
    let mut ways = opencv("calibration.json", "cam00", "cam01");
    ways.extend([
        way(
            "no camera's folder",
            &["images/cam01", "cannot read"],
            |f| {
                fs::remove_dir_all(f.join("images/cam01")).expect("gone");
            },
        ),
        way(
            "a mask of another size",
            &["masks/cam00/00000001.jpg", "3 x 3"],
            |f| {
                png(&f.join("masks/cam00/00000001.jpg"), [3, 3], 0);
            },
        ),
        way("a picture cut short", &["images/cam01/00000002.jpg"], |f| {
            cut(&f.join("images/cam01/00000002.jpg"), 50);
        }),
        way(
            "no frame of both cameras",
            &["no frame has a picture and a mask"],
            |f| {
                for (camera, frames) in [("cam00", 0..1), ("cam01", 1..3)] {
                    for frame in frames {
                        fs::remove_file(f.join(format!("images/{camera}/{frame:08}.jpg")))
                            .expect("gone");
                    }
                }
                fs::remove_dir_all(f.join("images/cam00")).expect("gone");
                png(&f.join("images/cam00/00000001.jpg"), [8, 6], 0);
            },
        ),
        way(
            "endings of two kinds",
            &["images/cam00/00000001.png", "rename"],
            |f| {
                let name = |name: &str| f.join("images/cam00").join(name);
                fs::rename(name("00000001.jpg"), name("00000001.png")).expect("moved");
            },
        ),
        way("a motion that is none", &["smpl_params.npz"], |f| {
            fs::write(f.join("smpl_params.npz"), "no archive").expect("written");
        }),
    ]);
    assert_eq!(ways.len(), 24, "as many");
    refused(thuman, &ways);
}

#[test]
fn actors_hq_in_twenty_two_broken_ways() {
    let file = "4x/calibration.csv";
    let edited = |what, words: &[&str], from: &'static str, to: &'static str| {
        let words: Vec<&str> = ["calibration.csv"]
            .into_iter()
            .chain(words.iter().copied())
            .collect();
        way(what, &words, move |f: &Path| edit(&f.join(file), from, to))
    };
    let ways = vec![
        edited("no column", &["`fy`", "missing"], ",fy", ",f"),
        edited("no names", &["`name`", "missing"], "name,", "camera,"),
        edited("NaN", &["`line 3 rx`", "nan"], "3.0,0,0", "nan,0,0"),
        edited(
            "infinite",
            &["`line 2 fx`", "inf"],
            "3,1.25,1.5",
            "3,inf,1.5",
        ),
        edited(
            "a text",
            &["`line 2 tz`", "three"],
            "0.5,1.25,3,",
            "0.5,1.25,three,",
        ),
        edited("one name twice", &["`line 3 name`"], "Cam002", "Cam001"),
        edited(
            "a name that leads elsewhere",
            &["`line 2 name`", "letters"],
            "Cam001,8",
            "../a,8",
        ),
        edited("no width", &["`line 2 w, h`"], "Cam001,8,6", "Cam001,0,6"),
        edited(
            "half a pixel",
            &["`line 2 h`", "6.5"],
            "Cam001,8,6",
            "Cam001,8,6.5",
        ),
        edited(
            "a giant",
            &["`line 2 w, h`", "8192"],
            "Cam001,8,6",
            "Cam001,80000,6",
        ),
        edited(
            "no focal length",
            &["`line 2 fx, fy`"],
            "3,1.25,1.5",
            "3,0,1.5",
        ),
        edited(
            "a far centre",
            &["`line 2 px, py`"],
            "0.5,0.55\nCam002",
            "50,0.55\nCam002",
        ),
        edited(
            "millimetres",
            &["`line 2 tx, ty, tz`", "metres"],
            "0.5,1.25,3,",
            "0.5,1.25,3e6,",
        ),
        edited(
            "a short line",
            &["`line 2 py`", "missing"],
            "0.5,0.55\nCam002",
            "0.5\nCam002",
        ),
        way(
            "no camera",
            &["calibration.csv", "`line 2`", "no camera"],
            |f| {
                fs::write(f.join(file), "name,w,h,rx,ry,rz,tx,ty,tz,fx,fy,px,py\n")
                    .expect("written");
            },
        ),
        way(
            "an empty file",
            &["calibration.csv", "line 1", "empty"],
            |f| {
                fs::write(f.join(file), "").expect("written");
            },
        ),
        way("no text", &["calibration.csv", "UTF-8"], |f| {
            fs::write(f.join(file), [0xff, 0xfe, 0x00]).expect("written");
        }),
        way(
            "no camera's pictures",
            &["4x/rgbs/Cam002", "cannot read"],
            |f| {
                fs::remove_dir_all(f.join("4x/rgbs/Cam002")).expect("gone");
            },
        ),
        way(
            "pictures of another name",
            &["4x/rgbs/Cam001", "Cam001_rgb<number>"],
            |f| {
                fs::rename(f.join("4x/rgbs/Cam001"), f.join("4x/rgbs/a")).expect("moved");
                fs::rename(f.join("4x/masks/Cam001"), f.join("4x/rgbs/Cam001")).expect("moved");
            },
        ),
        way(
            "a mask of another size",
            &["Cam001_mask000006.png", "3 x 3"],
            |f| {
                png(&f.join("4x/masks/Cam001/Cam001_mask000006.png"), [3, 3], 0);
            },
        ),
        way("a picture cut short", &["Cam002_rgb000007.jpg"], |f| {
            cut(&f.join("4x/rgbs/Cam002/Cam002_rgb000007.jpg"), 50);
        }),
        way(
            "a motion of two frames",
            &["smpl_params.npz", "has 2 frames", "number 5"],
            |f| {
                smpl(&f.join("smpl_params.npz"), 2);
            },
        ),
    ];
    assert_eq!(ways.len(), 22, "as many");
    refused(actors_hq, &ways);
}
