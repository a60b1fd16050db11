//! Tests of `insonify calibrate landmarks --tracker`: landmarks touched with an emulated tracker, prompts answered
//! through a pipe.

use std::io::{BufRead, BufReader, Write};
use std::net::TcpListener;
use std::path::Path;
use std::process::{Child, ChildStderr, ChildStdin, Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::Duration;

use glam::{DQuat, DVec3};
use insonify::phantom;
use insonify::pose::csv::Named;
use insonify::pose::{Calibration, Fitted, Pose};
use insonify::tracker::ascii_line;

/// Tip of the stylus in its sensor's frame, mm.
const TIP_MM: DVec3 = DVec3::new(2.0, -1.0, 140.0);

fn scene_from_tracker() -> Pose {
    Pose {
        position_mm: DVec3::new(300.0, -40.0, 120.0),
        orientation: DQuat::from_rotation_z(2.0) * DQuat::from_rotation_x(0.4),
    }
}

/// Sensor pose in the tracker's frame while the stylus tip is at a point of the scene, with tilt number `n`.
fn touching(scene_mm: DVec3, n: usize) -> Pose {
    let tip_mm = scene_from_tracker().inverse().transform_point(scene_mm);
    let orientation = DQuat::from_rotation_x(0.3 * n as f64) * DQuat::from_rotation_y(0.2);
    Pose { position_mm: tip_mm - orientation * TIP_MM, orientation }
}

/// Behaviour of the simulated hand.
#[derive(Clone, Copy)]
pub(super) enum Hand {
    Still(Pose),
    /// Moves the sensor through poses, given by their number.
    Along(fn(u32) -> Pose),
    /// Slides continuously from this pose.
    Moving(Pose),
    /// Out of the tracker's view.
    Gone,
}

/// An emulated tracker behind TCP.
pub(super) struct Tracker {
    address: String,
    hand: Arc<Mutex<Hand>>,
    over: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Tracker {
    pub(super) fn start() -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        listener.set_nonblocking(true).unwrap();
        let address = listener.local_addr().unwrap().to_string();
        let (hand, over) = (Arc::new(Mutex::new(Hand::Gone)), Arc::<AtomicBool>::default());
        let (its_hand, its_over) = (hand.clone(), over.clone());
        let thread = std::thread::spawn(move || {
            let (mut stream, mut n) = (None, 0_u32);
            while !its_over.load(Ordering::SeqCst) {
                std::thread::sleep(Duration::from_millis(2));
                stream = stream.or_else(|| listener.accept().ok());
                let Some((stream, _)) = &mut stream else { continue };
                n += 1;
                let pose = match *its_hand.lock().unwrap() {
                    Hand::Still(pose) => pose,
                    Hand::Along(pose) => pose(n),
                    Hand::Moving(pose) => Pose { position_mm: pose.position_mm + DVec3::X * f64::from(n), ..pose },
                    Hand::Gone => continue,
                };
                let _ = stream.write_all(ascii_line::encode(n, u64::from(n) * 2000, &pose).as_bytes());
            }
        });
        Self { address, hand, over, thread: Some(thread) }
    }

    pub(super) fn does(&self, hand: Hand) {
        *self.hand.lock().unwrap() = hand;
    }
}

impl Drop for Tracker {
    fn drop(&mut self) {
        self.over.store(true, Ordering::SeqCst);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

/// The program that asks for touches or steps, with a station in `dir` whose stylus is known.
pub(super) struct Asked {
    child: Child,
    input: Option<ChildStdin>,
    said: BufReader<ChildStderr>,
}

impl Asked {
    fn start(dir: &Path, tracker: &Tracker, more: &[&str]) -> Self {
        Self::calibrating(dir, tracker, &[&["landmarks", "--samples", "20"][..], more].concat())
    }

    /// Starts `insonify calibrate` with these arguments and the station.
    pub(super) fn calibrating(dir: &Path, tracker: &Tracker, args: &[&str]) -> Self {
        let calibration = Calibration { stylus_tip_mm: Some(Fitted::known(TIP_MM)), ..Calibration::default() };
        std::fs::write(dir.join("cal.toml"), calibration.to_toml()).unwrap();
        let station = dir.join("station.toml");
        let text = format!(
            "[scene]\nphantom = 'obstetric'\n[calibration]\npath = 'cal.toml'\n\
             [tracker]\ntransport = 'tcp'\nprotocol = 'ascii-line'\naddress = '{}'\n",
            tracker.address
        );
        std::fs::write(&station, text).unwrap();
        let mut child = Command::new(env!("CARGO_BIN_EXE_insonify"))
            .arg("calibrate")
            .args(args)
            .args(["--tracker", station.to_str().unwrap()])
            .env_remove("RUST_LOG")
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let (input, said) = (child.stdin.take(), BufReader::new(child.stderr.take().unwrap()));
        Self { child, input, said }
    }

    /// Reads the program's messages up to a line that contains `part`.
    #[track_caller]
    pub(super) fn until(&mut self, part: &str) -> String {
        let mut all = String::new();
        loop {
            let mut line = String::new();
            assert!(self.said.read_line(&mut line).unwrap() > 0, "`{part}` is not said: {all}");
            if line.contains(part) {
                return line;
            }
            all += &line;
        }
    }

    pub(super) fn answer(&mut self, line: &str) {
        writeln!(self.input.as_mut().unwrap(), "{line}").unwrap();
    }

    /// Answers the request for `point` by touching the position `at_mm` with tilt number `n`.
    #[track_caller]
    fn take(&mut self, tracker: &Tracker, point: &Named<DVec3>, at_mm: DVec3, n: usize) {
        self.until(&format!("touch {} with the tip of the stylus", point.name));
        tracker.does(Hand::Still(touching(at_mm, n)));
        loop {
            self.answer("");
            let said = self.until("   ");
            if said.contains(&point.name) && said.contains("spread") {
                return;
            }
            // Poses of the place before were still under way.
            assert!(said.contains("is not taken"), "{said}");
        }
    }

    /// Closes the program's input; returns its exit code, stdout, and the remaining stderr.
    pub(super) fn end(mut self) -> (Option<i32>, String, String) {
        drop(self.input.take());
        let mut said = String::new();
        while self.said.read_line(&mut said).unwrap() > 0 {}
        let output = self.child.wait_with_output().unwrap();
        (output.status.code(), String::from_utf8(output.stdout).unwrap(), said)
    }
}

#[test]
fn landmarks_are_touched_one_by_one_and_the_calibration_file_is_written() {
    let (dir, tracker) = (tempfile::tempdir().unwrap(), Tracker::start());
    let mut asked = Asked::start(dir.path(), &tracker, &["--json"]);
    let points = phantom::fiducials(&Default::default());
    // First the hand slides, and then the tracker is lost: neither gives a landmark.
    asked.until(&points[0].name);
    tracker.does(Hand::Moving(touching(points[0].value, 0)));
    asked.answer("");
    let said = asked.until("is not taken");
    assert!(said.contains("hold it within 1 mm for 20 poses"), "{said}");
    tracker.does(Hand::Gone);
    let said = loop {
        asked.answer("");
        let said = asked.until("is not taken");
        // Poses of the moving hand may still be under way.
        if !said.contains("hold it within 1 mm") {
            break said;
        }
    };
    assert!(said.contains("the tracker gave") && said.contains("poses only"), "{said}");
    for (n, point) in points.iter().enumerate() {
        asked.take(&tracker, point, point.value, n);
    }
    let (code, report, said) = asked.end();
    assert_eq!(code, Some(0), "{said}");
    let report: serde_json::Value = serde_json::from_str(&report).unwrap();
    assert!(report["rms_mm"].as_f64().unwrap() < 0.01 && report["coplanar"] == false, "{report}");
    assert_eq!(report["landmarks"][5]["name"], "LEFT_ILIAC");
    let found = Calibration::load(&dir.path().join("cal.toml")).unwrap();
    let fitted = found.scene_from_tracker.unwrap().value;
    assert!(fitted.position_mm.distance(scene_from_tracker().position_mm) < 0.01, "{fitted:?}");
    assert_eq!(found.stylus_tip_mm, Some(Fitted::known(TIP_MM)), "what else is in the file stays");
}

#[test]
fn wrong_landmarks_leave_the_file_unchanged() {
    type Place = fn(DVec3) -> DVec3;
    let cases: [(usize, Place, &str); 4] = [
        (2, |p| p, "2 landmarks are too few"),
        (7, |p| DVec3::new(-p.x, p.y, p.z), "mirror image"),
        (7, |_| DVec3::Z * 80.0, "within 0.00 mm (RMS) of one point"),
        (7, |p| if p.y > 50.0 { p + DVec3::X * 60.0 } else { p }, "the worst is `UPPER_MIDLINE`"),
    ];
    for (count, place, message) in cases {
        let (dir, tracker) = (tempfile::tempdir().unwrap(), Tracker::start());
        let mut asked = Asked::start(dir.path(), &tracker, &[]);
        let points = phantom::fiducials(&Default::default());
        for (n, point) in points.iter().take(count).enumerate() {
            asked.take(&tracker, point, place(point.value), n);
        }
        points[count..].iter().for_each(|_| asked.answer("skip"));
        let (code, _, said) = asked.end();
        assert_eq!(code, Some(2), "{said}");
        assert!(said.contains(message), "{message}: {said}");
        assert_eq!(Calibration::load(&dir.path().join("cal.toml")).unwrap().scene_from_tracker, None);
    }
}

#[test]
fn an_early_end_of_input_is_named() {
    let (dir, tracker) = (tempfile::tempdir().unwrap(), Tracker::start());
    let points = dir.path().join("points.csv");
    std::fs::write(&points, "x,y,z,name\n0,0,80,NAVEL\n100,0,20,LEFT\n-100,0,20,RIGHT\n").unwrap();
    let mut asked = Asked::start(dir.path(), &tracker, &["--points", points.to_str().unwrap()]);
    let point = |name: &str| Named { name: name.to_owned(), value: DVec3::ZERO };
    asked.take(&tracker, &point("NAVEL"), DVec3::Z * 80.0, 0);
    let (code, _, said) = asked.end();
    assert_eq!(code, Some(2), "{said}");
    assert!(
        said.contains("the input ended before `LEFT` was taken, with 1 of 3 landmarks; nothing was written"),
        "{said}"
    );
}

#[test]
fn exchanged_touches_are_named_before_the_end_and_taken_again() {
    let (dir, tracker) = (tempfile::tempdir().unwrap(), Tracker::start());
    let mut asked = Asked::start(dir.path(), &tracker, &["--json"]);
    let points = phantom::fiducials(&Default::default());
    for (n, at) in [0, 1, 2, 4, 3].into_iter().enumerate() {
        asked.take(&tracker, &points[n], points[at].value, n);
    }
    let said = asked.until("touched in each other's turn");
    assert!(said.contains("`LEFT_FLANK` and `RIGHT_FLANK`"), "{said}");
    for n in [3, 4] {
        asked.answer(&format!("again {}", points[n].name));
        asked.take(&tracker, &points[n], points[n].value, n);
    }
    for n in [5, 6] {
        asked.take(&tracker, &points[n], points[n].value, n);
        asked.until("residuals BELLY_TOP");
    }
    // After the last one a touch can still be taken back.
    asked.until("7 landmarks are taken: Enter finishes");
    asked.answer("back");
    asked.take(&tracker, &points[6], points[6].value, 6);
    asked.until("Enter finishes");
    asked.answer("");
    let (code, report, said) = asked.end();
    assert_eq!(code, Some(0), "{said}");
    let report: serde_json::Value = serde_json::from_str(&report).unwrap();
    assert!(report["rms_mm"].as_f64().unwrap() < 0.01, "{report}");
}

#[test]
fn points_of_3d_slicer_are_touched_in_the_axes_of_the_scene() {
    let (dir, tracker) = (tempfile::tempdir().unwrap(), Tracker::start());
    let points = dir.path().join("points.fcsv");
    let list = "# Markups fiducial file version = 5.6\n# CoordinateSystem = RAS\n\
                # columns = id,x,y,z,ow,ox,oy,oz,vis,sel,lock,label,desc,associatedNodeID\n\
                1,-10.5,20,30,0,0,0,1,1,1,0,XIPHOID,,,2,0\n2,40,20,30,0,0,0,1,1,1,0,RIGHT,,,2,0\n";
    std::fs::write(&points, list).unwrap();
    let mut asked = Asked::start(dir.path(), &tracker, &["--points", points.to_str().unwrap()]);
    // The phantom's y is cranial, its z anterior.
    let said = asked.until("1 of 2: touch XIPHOID with");
    assert!(said.contains("(at 10.50, 30.00, 20.00 mm in the scene)"), "{said}");
    asked.answer("quit");
    assert_eq!(asked.end().0, Some(2));
}
