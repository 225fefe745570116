//! The same scene gives the same bytes, whatever the threads and the parts; stopping keeps what is there.

mod common;

use std::collections::BTreeMap;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Duration;

use common::{folder, succeeds};
use exr::prelude::{FlatSamples, ReadChannels, ReadLayers, read};

/// Bits of every channel of an EXR, row by row, with its width.
fn pixels(path: &Path) -> (usize, BTreeMap<String, Vec<u32>>) {
    let image = read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .first_valid_layer()
        .all_attributes()
        .non_parallel()
        .from_file(path)
        .unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    let channels = image.layer_data.channel_data.list.into_iter().map(|channel| {
        let bits = match channel.sample_data {
            FlatSamples::F16(v) => v.into_iter().map(|v| u32::from(v.to_bits())).collect(),
            FlatSamples::F32(v) => v.into_iter().map(f32::to_bits).collect(),
            FlatSamples::U32(v) => v,
        };
        (channel.name.to_string(), bits)
    });
    (image.layer_data.size.width(), channels.collect())
}

/// Two pictures of equal height side by side.
fn beside(
    (left_width, left): (usize, BTreeMap<String, Vec<u32>>),
    (right_width, right): (usize, BTreeMap<String, Vec<u32>>),
) -> (usize, BTreeMap<String, Vec<u32>>) {
    let join = |name: &str, a: &[u32]| {
        let rows = a.chunks(left_width).zip(right[name].chunks(right_width));
        rows.flat_map(|(a, b)| a.iter().chain(b).copied()).collect()
    };
    (left_width + right_width, left.iter().map(|(name, a)| (name.clone(), join(name, a))).collect())
}

#[test]
fn threads_and_crops_give_the_same_bytes() {
    let dir = folder();
    for integrator in ["path", "raytrace"] {
        let render = |name: &str, extra: &[&str]| {
            let always = ["render", "scene.toml", "--spp", "5", "--integrator", integrator, "-o", name];
            succeeds(&dir, &[&always[..], extra].concat());
            pixels(&dir.path().join(name))
        };
        let one = render("one.exr", &["-t", "1"]);
        for name in [
            "R",
            "direct.G",
            "indirect.B",
            "variance.R",
            "albedo.R",
            "N.Z",
            "Z",
            "uv.U",
            "petal_id",
            "samples",
        ] {
            assert_eq!(one.1.get(name).map(Vec::len), Some(16 * 12), "{name} of {:?}", one.1.keys());
        }
        assert!(one.1["samples"].iter().all(|&n| n == 5));
        assert!(one == render("two.exr", &["-t", "2"]), "{integrator}: threads");
        let left = render("left.exr", &["--crop", "0,0.4,0,1", "-t", "2"]);
        let right = render("right.exr", &["--crop", "0.4,1,0,1", "-t", "1"]);
        assert!(left.0 > 0 && right.0 > 0);
        assert!(one == beside(left, right), "{integrator}: crops");
        assert!(one != render("other.exr", &["--seed", "1"]), "{integrator}: the seed changes nothing");
    }
}

/// Whichever denoiser this machine has: the EXR keeps the noisy light.
#[test]
fn denoised_pictures_keep_the_noisy_light() {
    let dir = folder();
    succeeds(&dir, &["render", "scene.toml", "-o", "noisy.exr"]);
    succeeds(
        &dir,
        &["render", "scene.toml", "-D", "render.denoise=true", "-o", "clean.exr", "-o", "clean.png"],
    );
    let (_, noisy) = pixels(&dir.path().join("noisy.exr"));
    let (_, clean) = pixels(&dir.path().join("clean.exr"));
    assert_eq!(clean["noisy.R"], noisy["R"]);
    assert_eq!(clean["noisy_variance.G"], noisy["variance.G"]);
    assert_ne!(clean["R"], noisy["R"]);
    assert!(clean["R"].iter().all(|bits| f32::from_bits(*bits).is_finite()));
    // The flag has the last word.
    succeeds(&dir, &["render", "scene.toml", "-D", "render.denoise=true", "--no-denoise", "-o", "again.exr"]);
    let (_, again) = pixels(&dir.path().join("again.exr"));
    assert!(again == noisy);
}

#[cfg(unix)]
#[test]
fn ctrl_c_writes_what_is_there() {
    let dir = folder();
    let mut child = Command::new(env!("CARGO_BIN_EXE_rosarium"))
        .args(["render", "scene.toml", "-o", "part.exr", "-o", "part.png", "--spp", "100000000", "-v"])
        .current_dir(dir.path())
        .stderr(Stdio::piped())
        .spawn()
        .expect("it runs");
    let mut lines = BufReader::new(child.stderr.take().expect("piped")).lines().map_while(Result::ok);
    assert!(lines.any(|l| l.contains("scene ready")));
    std::thread::sleep(Duration::from_millis(700));
    interrupt(&child);
    let status = child.wait().expect("it ends");
    let rest: Vec<String> = lines.collect();
    assert_eq!(status.code(), Some(130), "{rest:?}");
    assert!(rest.iter().any(|l| l.contains("stopped at")), "{rest:?}");
    let (_, channels) = pixels(&dir.path().join("part.exr"));
    let samples = &channels["samples"];
    assert!(samples.iter().all(|&n| n < 100_000_000) && samples.iter().any(|&n| n > 0), "{samples:?}");
    assert!(dir.path().join("part.png").exists());
}

#[cfg(unix)]
fn interrupt(child: &std::process::Child) {
    let kill = Command::new("kill").args(["-INT", &child.id().to_string()]).status().expect("kill runs");
    assert!(kill.success());
}

#[cfg(unix)]
#[test]
fn a_stopped_measurement_writes_nothing() {
    let dir = folder();
    let mut child = Command::new(env!("CARGO_BIN_EXE_rosarium"))
        .args(["measure", "thesis", "--rays", "1e13", "-o", "t.csv", "--json", "-v"])
        .current_dir(dir.path())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("it runs");
    let mut lines = BufReader::new(child.stderr.take().expect("piped")).lines().map_while(Result::ok);
    assert!(lines.any(|l| l.contains("sample ready")));
    std::thread::sleep(Duration::from_millis(300));
    interrupt(&child);
    let output = child.wait_with_output().expect("it ends");
    let rest: Vec<String> = lines.collect();
    assert_eq!(output.status.code(), Some(130), "{rest:?}");
    assert!(rest.iter().any(|l| l.contains("nothing was written")), "{rest:?}");
    assert!(output.stdout.is_empty() && !dir.path().join("t.csv").exists());
}
