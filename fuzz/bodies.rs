//! Fuzz targets, shared by `cargo fuzz` (coverage-guided) and `examples/fuzz.rs` (stable Rust).
//!
//! A body panics if a promise is broken. It returns a number that distinguishes outcomes, by which a fuzzer without
//! coverage recognises inputs worth keeping.

use std::collections::hash_map::DefaultHasher;
use std::hash::{Hash, Hasher};
use std::io::Cursor;
use std::path::Path;
use std::time::Duration;

use bytes::BytesMut;
use insonify::anatomy::{TissueTable, import};
use insonify::pose::Reading;
use insonify::recording::{RecordingReader, poses_of};
use insonify::segmentation::mesh_files;
use insonify::segmentation::volume::{NiftiForm, PatientAxes, ReadOptions, decode_nifti, decode_nrrd};
use insonify::settings::SettingsGroup as _;
use insonify::station::Station;
use insonify::tracker::driver::Driver;
use insonify::tracker::ndi::{self, NdiDriver, Options, ReplyFormat};
use insonify::tracker::openigtlink::message;
use insonify::tracker::{Decoder, Protocol, Record};

/// A fuzz target.
#[derive(Clone, Copy)]
pub struct Target {
    /// Name, also that of its file in `fuzz_targets`.
    pub name: &'static str,
    /// Function that accepts any bytes.
    pub body: fn(&[u8]) -> u64,
    /// Initial inputs.
    pub seeds: fn() -> Vec<Vec<u8>>,
}

/// All fuzz targets.
pub const TARGETS: [Target; 7] = [
    Target { name: "decoders", body: decoders, seeds: decoder_seeds },
    Target { name: "ndi_driver", body: ndi_driver, seeds: ndi_driver_seeds },
    Target { name: "recording", body: recording, seeds: recording_seeds },
    Target { name: "glb", body: glb, seeds: glb_seeds },
    Target { name: "station", body: station, seeds: station_seeds },
    Target { name: "mesh", body: mesh, seeds: mesh_seeds },
    Target { name: "volume", body: volume, seeds: volume_seeds },
];

/// Hashes the kind of a message: its first letters, without numbers.
fn kind(text: &str, hasher: &mut DefaultHasher) {
    text.chars().filter(|c| !c.is_ascii_digit()).take(60).for_each(|c| c.hash(hasher));
}

/// First byte: protocol. Second: split of the stream. Third: whether checksums are corrected. Then the stream.
pub fn decoders(data: &[u8]) -> u64 {
    let [protocol, cut, is_repaired, stream @ ..] = data else { return 0 };
    let by_letters = Protocol::ALL.into_iter().find(|known| letters(*known) == *protocol);
    let protocol = by_letters.unwrap_or(Protocol::ALL[usize::from(*protocol) % Protocol::ALL.len()]);
    let repaired = if is_repaired % 2 == 1 { repaired(protocol, stream) } else { None };
    let stream = repaired.as_deref().unwrap_or(stream);
    // A report or datagram is one message: splitting it makes different messages.
    let is_message = matches!(protocol, Protocol::SpaceMouse | Protocol::OpenTrack);
    let piece = 1 + usize::from(*cut);
    let (records, errors) = decode(protocol.decoder(), stream, piece);
    if !is_message {
        let (whole, whole_errors) = decode(protocol.decoder(), stream, stream.len().max(1));
        assert_eq!(format!("{records:?}"), format!("{whole:?}"), "{} depends on how it is cut", protocol.name());
        assert_eq!(errors, whole_errors, "errors of {} depend on how it is cut", protocol.name());
    }
    let mut hasher = DefaultHasher::new();
    protocol.name().hash(&mut hasher);
    records.len().min(8).hash(&mut hasher);
    errors.len().min(3).hash(&mut hasher);
    errors.last().iter().for_each(|error| kind(error, &mut hasher));
    hasher.finish()
}

/// Stable number of a protocol, so that kept inputs remain valid when protocols are added.
fn letters(protocol: Protocol) -> u8 {
    protocol.name().bytes().fold(0x35, |sum: u8, byte| sum.rotate_left(3) ^ byte)
}

fn decode(mut decoder: Decoder, stream: &[u8], piece: usize) -> (Vec<Record>, Vec<String>) {
    let mut buffer = BytesMut::new();
    let (mut records, mut errors) = (Vec::new(), Vec::new());
    for piece in stream.chunks(piece) {
        buffer.extend_from_slice(piece);
        loop {
            let before = buffer.len();
            match decoder.decode(&mut buffer) {
                Ok(Some(record)) => {
                    check(&record);
                    records.push(record);
                }
                Ok(None) => break,
                Err(error) => errors.push(error.to_string()),
            }
            assert!(buffer.len() < before, "no byte was removed");
        }
    }
    if let Err(error) = decoder.finish(&mut buffer) {
        errors.push(error.to_string());
    }
    assert!(buffer.is_empty(), "the end leaves bytes");
    (records, errors)
}

/// Checks that a record contains only numbers that the pipeline can handle.
fn check(record: &Record) {
    match record.reading {
        Reading::Pose(pose) => {
            assert!(pose.position_mm.is_finite() && (pose.orientation.length() - 1.0).abs() < 1e-9, "{record:?}");
        }
        Reading::Orientation(q) => assert!((q.length() - 1.0).abs() < 1e-9, "{record:?}"),
        Reading::Rates { translation, rotation } => {
            assert!(translation.abs().max_element() <= 1.0 && rotation.abs().max_element() <= 1.0, "{record:?}");
        }
        Reading::OutOfView => {}
    }
}

/// The stream as one message with a correct checksum, so that the code behind the checksum is reached.
fn repaired(protocol: Protocol, stream: &[u8]) -> Option<Vec<u8>> {
    match protocol {
        Protocol::AsciiLine => {
            let line: Vec<u8> = stream.iter().copied().filter(|b| !b"*\n".contains(b)).collect();
            let sum = line.iter().fold(0, |sum, byte| sum ^ byte);
            Some([b"P", &line[..], format!("*{sum:02X}\n").as_bytes()].concat())
        }
        Protocol::Ndi => Some(match stream {
            [first, text @ ..] if first % 2 == 0 => {
                let text: String =
                    text.iter().map(|&b| char::from(b)).filter(|c| *c == '\n' || (' '..='~').contains(c)).collect();
                ndi::framed(&text).to_vec()
            }
            data => {
                let length = data.len().min(usize::from(u16::MAX)) as u16;
                let data = &data[..usize::from(length)];
                let mut bytes = vec![0xC4, 0xA5];
                bytes.extend(length.to_le_bytes());
                bytes.extend(ndi::crc16(&bytes).to_le_bytes());
                bytes.extend(data);
                bytes.extend(ndi::crc16(data).to_le_bytes());
                bytes
            }
        }),
        Protocol::Bno08x | Protocol::Bno08xRollFirst => {
            let mut bytes = stream.to_vec();
            for frame in bytes.chunks_exact_mut(19) {
                frame[..2].fill(0xAA);
                frame[18] = frame[2..18].iter().fold(0_u8, |sum, byte| sum.wrapping_add(*byte));
            }
            Some(bytes)
        }
        Protocol::OpenIgtLink => {
            let mut bytes = stream.to_vec();
            let body = bytes.get(message::HEAD..)?.to_vec();
            bytes[..2].copy_from_slice(&[0, 1 + body.len() as u8 % 2]);
            bytes[42..50].copy_from_slice(&(body.len() as u64).to_be_bytes());
            bytes[50..58].copy_from_slice(&message::crc64(&body).to_be_bytes());
            Some(bytes)
        }
        _ => None,
    }
}

fn decoder_seeds() -> Vec<Vec<u8>> {
    const POSE: [f64; 7] = [10.0, 20.0, 30.0, 0.8, 0.6, 0.0, 0.0];
    let rotation = glam::DMat3::from_rotation_x(0.5);
    let position = glam::DVec3::new(1.0, 2.0, 3.0);
    let mut igtl = BytesMut::new();
    message::put_transform(&mut igtl, "Probe", 1_790_000_000_000_000_000, rotation, position);
    message::put(&mut igtl, "TDATA", "Tracker", 0, |body| {
        body.extend_from_slice(&message::field::<20>("Stylus"));
        body.extend_from_slice(&[1, 0]);
        message::put_matrix(body, rotation, position);
    });
    message::put(&mut igtl, "POSITION", "Needle", 0, |body| {
        [1.0_f32, 2.0, 3.0, 0.0, 0.6, 0.0, 0.8].iter().for_each(|v| body.extend_from_slice(&v.to_be_bytes()));
    });
    message::put_status(&mut igtl, "Tracking", 0, message::STATUS_OK, "GOOD", "");

    let mut data = vec![2, 1, 1];
    [0.8_f32, 0.6, 0.0, 0.0, 1.0, 2.0, 3.0, 0.1].iter().for_each(|v| data.extend(v.to_le_bytes()));
    data.extend([0x33, 0, 0, 0, 9, 0, 0, 0, 2, 2, 0x31, 0, 0, 0, 9, 0, 0, 0, 0, 0]);
    let text =
        "0201+08000+06000+00000+00000+001234-056789-123456+000120000003300001A2B\n02MISSING0000003100001A2B\n0000";
    let bno = [
        0xAA, 0xAA, 0xDE, 0x01, 0x00, 0x92, 0xFF, 0x25, 0x08, 0x8D, 0xFE, 0xEC, 0xFF, 0xD1, 0x03, 0x00, 0x00, 0x00,
        0xE7,
    ];
    let pose = insonify::pose::Pose::from_components(POSE);
    let line = pose.map(|pose| insonify::tracker::ascii_line::encode(7, 1000, &pose)).unwrap_or_default();
    let bytes_of = |protocol: Protocol| -> Vec<Vec<u8>> {
        match protocol {
            Protocol::AsciiLine => vec![line.clone().into_bytes()],
            Protocol::Ndi => vec![
                repaired(protocol, &[&[1], &data[1..]].concat()).unwrap_or_default(),
                ndi::framed(text).to_vec(),
                [ndi::framed("OKAY"), ndi::framed("ERROR0C"), ndi::framed("RESET")].concat(),
                data.clone(),
                [b"\0", text.as_bytes()].concat(),
            ],
            Protocol::Bno08x | Protocol::Bno08xRollFirst => vec![bno.repeat(3)],
            Protocol::OpenIgtLink => vec![igtl.to_vec(), igtl[..106].to_vec(), igtl[106..234].to_vec()],
            Protocol::OpenTrack => vec![POSE[..6].iter().flat_map(|v| v.to_le_bytes()).collect()],
            Protocol::SpaceMouse => {
                vec![vec![1, 9, 0, 8, 0, 7, 0], vec![2; 7], vec![3, 1], vec![1, 9, 0, 8, 0, 7, 0, 1, 0, 2, 0, 3, 0]]
            }
            #[allow(unreachable_patterns)]
            _ => vec![b"01 0.0 0.0 0.0".to_vec()],
        }
    };
    let mut seeds = Vec::new();
    for protocol in Protocol::ALL {
        let same = Protocol::ALL.into_iter().filter(|other| letters(*other) == letters(protocol)).count();
        assert_eq!(same, 1, "{} has the number of another protocol", protocol.name());
        for stream in bytes_of(protocol) {
            for is_repaired in [0, 1] {
                seeds.push([&[letters(protocol), 6, is_repaired], &stream[..]].concat());
            }
        }
    }
    seeds
}

/// First byte: options. Then a script: a byte of time, and a byte that selects the device's reply (one of its usual
/// replies, or that many bytes of the script).
pub fn ndi_driver(data: &[u8]) -> u64 {
    const REPLIES: [&str; 10] =
        ["OKAY", "RESET", "00", "0101001", "0201001002001", "ERROR0C", "ERROR01", "0A", "000000", "ERROR10"];
    let [options, script @ ..] = data else { return 0 };
    let format = if options & 1 == 0 { ReplyFormat::Binary } else { ReplyFormat::Text };
    let roms = if options & 4 == 0 { Vec::new() } else { vec![vec![7; ndi::ROM_BYTES]] };
    let baud = (options & 2 != 0).then_some(115_200);
    let mut driver = NdiDriver::new(Options { format, roms, baud, ..Options::default() });
    let (mut now, mut buffer, mut hasher) = (Duration::ZERO, BytesMut::new(), DefaultHasher::new());
    let mut last = String::new();
    driver.start(now, u32::from(options >> 4));
    let mut script = script.iter().copied();
    while let Some(time) = script.next() {
        let reply = script.next().unwrap_or(0);
        match REPLIES.get(usize::from(reply)) {
            Some(text) => buffer.extend_from_slice(&ndi::framed(text)),
            None => buffer.extend(script.by_ref().take(usize::from(reply) - REPLIES.len())),
        }
        // From a millisecond to longer than any timeout, in steps of a factor.
        now += Duration::from_micros(1000 << (time % 16));
        let mut turns = 0;
        loop {
            turns += 1;
            assert!(turns < 10_000, "the exchange never rests");
            let before = buffer.len();
            match driver.decode(now, &mut buffer) {
                Ok(Some(record)) => check(&record),
                Ok(None) => break,
                Err(error) => last = error.to_string(),
            }
            assert!(buffer.len() <= before);
        }
        let mut sent = 0;
        while driver.line(now).is_some() {}
        while driver.transmit(now).is_some() {
            sent += 1;
            assert!(sent <= 1, "more than one question at a time");
        }
        assert!(driver.wake_at().is_some_and(|at| at > now || driver.line(now).is_some()), "it would spin");
        assert!(driver.silence_limit() >= Duration::from_secs(1));
    }
    kind(&last, &mut hasher);
    driver.is_tracking().hash(&mut hasher);
    hasher.finish()
}

fn ndi_driver_seeds() -> Vec<Vec<u8>> {
    // INIT, PHSR:01, PHSR:02, PINIT, PHSR:02, PHSR:03, PENA, TSTART, polls.
    let bring_up = [2, 200, 2, 0, 2, 2, 2, 3, 2, 0, 2, 2, 2, 3, 2, 0, 2, 0, 3, 8, 3, 5, 3, 0];
    (0..8).map(|options| [&[options], &bring_up[2..]].concat()).collect()
}

/// The bytes of an MCAP file.
pub fn recording(data: &[u8]) -> u64 {
    let path = Path::new("fuzz.mcap");
    let mut hasher = DefaultHasher::new();
    match RecordingReader::from_source(Cursor::new(data), path).and_then(|reader| poses_of(reader, path)) {
        Ok((poses, summary)) => {
            assert!(!poses.is_empty() && poses.is_sorted_by_key(|pose| pose.host_time_ns));
            assert!(poses.iter().all(|timed| timed.pose.position_mm.is_finite()));
            summary.damage.truncated.is_some().hash(&mut hasher);
            summary.damage.damaged.min(3).hash(&mut hasher);
            kind(&summary.to_string(), &mut hasher);
        }
        Err(error) => kind(&error.to_string(), &mut hasher),
    }
    hasher.finish()
}

fn recording_seeds() -> Vec<Vec<u8>> {
    use insonify::recording::{Event, RecordingInfo, RecordingWriter};
    let write = |messages: u32| -> Option<Vec<u8>> {
        let dir = tempfile::tempdir().ok()?;
        let path = dir.path().join("seed.mcap");
        let info = RecordingInfo {
            protocol: Protocol::AsciiLine,
            device: "d".into(),
            scene: "s".into(),
            start_time_ns: 1_790_000_000_000_000_000,
            sensor: None,
            needle: None,
        };
        let mut writer = RecordingWriter::create(&path, &info).ok()?;
        for n in 0..messages {
            let time_ns = info.start_time_ns + u64::from(n) * 300_000_000;
            let pose = insonify::pose::Pose::from_components([f64::from(n), 2.0, 3.0, 1.0, 0.0, 0.0, 0.0]).ok()?;
            writer.raw(time_ns, insonify::tracker::ascii_line::encode(n, 1, &pose).as_bytes()).ok()?;
        }
        writer.event(&Event::new(info.start_time_ns, "e")).ok()?;
        writer.finish().ok()?;
        std::fs::read(path).ok()
    };
    [1, 12].into_iter().filter_map(write).collect()
}

/// The bytes of a `.glb` or `.gltf` file.
pub fn glb(data: &[u8]) -> u64 {
    let mut hasher = DefaultHasher::new();
    // The importer opens files: external buffers are part of what it does.
    let Ok(dir) = tempfile::tempdir_in(if Path::new("/dev/shm").is_dir() { "/dev/shm" } else { "/tmp" }) else {
        return 0;
    };
    let path = dir.path().join(if data.starts_with(b"glTF") { "fuzz.glb" } else { "fuzz.gltf" });
    if std::fs::write(&path, data).is_err() {
        return 0;
    }
    let Ok(tissues) = TissueTable::builtin() else { return 0 };
    match import::load(&path, &tissues, 0) {
        Ok(_) => "scene".hash(&mut hasher),
        Err(error) => {
            let text = error.to_string().replace(&path.display().to_string(), "");
            kind(&text, &mut hasher);
        }
    }
    hasher.finish()
}

fn glb_seeds() -> Vec<Vec<u8>> {
    let scenes = Path::new(env!("CARGO_MANIFEST_DIR"));
    let scenes = if scenes.ends_with("fuzz") { scenes.join("../assets/scenes") } else { scenes.join("assets/scenes") };
    ["bone_plate.glb", "slabs.glb", "speckle_block.glb"]
        .iter()
        .filter_map(|f| std::fs::read(scenes.join(f)).ok())
        .collect()
}

/// The text of a station file.
pub fn station(data: &[u8]) -> u64 {
    let Ok(text) = std::str::from_utf8(data) else { return 0 };
    let mut hasher = DefaultHasher::new();
    match Station::parse(text, Path::new("/stations")) {
        Ok(station) => {
            assert!(station.probe.validate().is_ok() && station.settings.validate().is_ok());
            "station".hash(&mut hasher);
        }
        // The rest of the message is the station's own text.
        Err(error) => kind(error.to_string().get(..24).unwrap_or_default(), &mut hasher),
    }
    hasher.finish()
}

fn station_seeds() -> Vec<Vec<u8>> {
    let mut all = String::from("[scene]\nphantom = 'obstetric'\n");
    let mut table = "scene";
    for doc in insonify::station::keys().iter().filter(|doc| doc.table != "scene" && !doc.default.contains(' ')) {
        if doc.table != table {
            table = doc.table;
            all.push_str(&format!("[{table}]\n"));
        }
        all.push_str(&format!("{} = {}\n", doc.key, doc.default));
    }
    vec![
        all.into_bytes(),
        b"[scene]\npath = 'a.glb'\n[probe]\nkind = 'linear'\nwidth_mm = 38\n".to_vec(),
        b"scene.phantom = 'obstetric'\n[tissues.liver]\nspeed_m_s = 1600\n[openigtlink]\nscene_axes = 'LPS'\n".to_vec(),
    ]
}

/// First byte: format and options. Then a file; the header of an NRRD ends at its first empty line.
pub fn volume(data: &[u8]) -> u64 {
    let [choice, file @ ..] = data else { return 0 };
    let prefer = (choice & 4 != 0).then_some(NiftiForm::Qform);
    let options = ReadOptions { assume_axes: (choice & 2 != 0).then_some(PatientAxes::Ras), prefer };
    let read = if choice & 1 == 0 {
        decode_nifti(file, None, options)
    } else {
        let end = file.windows(2).position(|pair| pair == b"\n\n").map_or(file.len(), |at| at + 2);
        decode_nrrd(&file[..end], &file[end..], options)
    };
    let mut hasher = DefaultHasher::new();
    choice.hash(&mut hasher);
    match read.and_then(|raw| raw.into_labels(Path::new("a"))) {
        Ok(map) => {
            let voxels: usize = map.size.iter().product();
            assert!(map.layers.iter().all(|layer| layer.len() == voxels), "a layer has another size");
            assert!(map.lps_from_voxel.is_finite(), "an affine that is not finite");
            assert!(map.segments.iter().all(|s| s.layer < map.layers.len() && s.value > 0), "a segment of no layer");
            (map.layers.len().min(3), map.segments.len().min(4)).hash(&mut hasher);
        }
        Err(fault) => kind(&fault.to_string(), &mut hasher),
    }
    hasher.finish()
}

fn volume_seeds() -> Vec<Vec<u8>> {
    let mut nifti = vec![0u8; 352];
    nifti[..4].copy_from_slice(&348i32.to_le_bytes());
    for (n, size) in [3i16, 2, 2, 2, 1, 1, 1, 1].into_iter().enumerate() {
        nifti[40 + 2 * n..42 + 2 * n].copy_from_slice(&size.to_le_bytes());
    }
    nifti[70..74].copy_from_slice(&[2, 0, 8, 0]);
    for n in 0..4 {
        nifti[76 + 4 * n..80 + 4 * n].copy_from_slice(&1f32.to_le_bytes());
    }
    nifti[108..112].copy_from_slice(&352f32.to_le_bytes());
    nifti[123] = 2;
    nifti[254] = 1;
    for row in 0..3 {
        nifti[280 + 20 * row..284 + 20 * row].copy_from_slice(&1.5f32.to_le_bytes());
    }
    nifti[344..348].copy_from_slice(b"n+1\0");
    nifti.extend([0, 1, 2, 3, 0, 1, 2, 3]);
    let nrrd = b"NRRD0004\ntype: uint8\ndimension: 3\nspace: left-posterior-superior\nsizes: 2 2 2\n\
        space directions: (1,0,0) (0,1,0) (0,0,1)\nkinds: domain domain domain\nencoding: raw\n\
        space origin: (0,0,0)\nSegment0_ID:=a\nSegment0_LabelValue:=1\nSegment0_Layer:=0\nSegment0_Name:=liver\n\n\
        \x00\x01\x02\x03\x00\x01\x02\x03";
    let with = |choice: u8, file: &[u8]| [&[choice], file].concat();
    vec![with(0, &nifti), with(2, &nifti), with(1, nrrd), with(3, nrrd)]
}

/// First byte: extension of the name. Then a mesh file.
pub fn mesh(data: &[u8]) -> u64 {
    let [choice, file @ ..] = data else { return 0 };
    let extensions = mesh_files::EXTENSIONS;
    let name = format!("a.{}", extensions[usize::from(*choice) % extensions.len()]);
    let mut hasher = DefaultHasher::new();
    choice.hash(&mut hasher);
    match mesh_files::decode(file, Path::new(&name)) {
        Ok(read) => {
            for mesh in &read.meshes {
                let count = mesh.vertices.len();
                assert!(!mesh.triangles.is_empty(), "a mesh without triangles");
                assert!(mesh.triangles.iter().flatten().all(|&i| (i as usize) < count), "a vertex beyond the last");
                assert!(mesh.vertices.iter().all(|v| v.is_finite()), "a vertex that is not finite");
            }
            (read.meshes.len().min(3), read.hints.axes.is_some()).hash(&mut hasher);
        }
        Err(error) => kind(&error.to_string(), &mut hasher),
    }
    hasher.finish()
}

fn mesh_seeds() -> Vec<Vec<u8>> {
    let with = |choice: u8, file: &[u8]| [&[choice], file].concat();
    let facet = [[0f32, 0.0, 1.0], [0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let facet: Vec<u8> = facet.iter().flatten().flat_map(|v| v.to_le_bytes()).chain([0, 0]).collect();
    let stl = [&[32u8; 80][..], &1u32.to_le_bytes(), &facet].concat();
    let obj = b"# a\no box\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nf 1 2 4 3\nf -4/1 -3/2/1 -2//1\n";
    let ply = b"ply\nformat ascii 1.0\ncomment SPACE=RAS\nelement vertex 3\nproperty float x\nproperty float y\n\
        property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
    let vtk = b"# vtk DataFile Version 4.2\na\nASCII\nDATASET POLYDATA\nPOINTS 3 float\n0 0 0 1 0 0 0 1 0\n\
        POLYGONS 1 4\n3 0 1 2\n";
    let vtp = b"<VTKFile type=\"PolyData\" byte_order=\"LittleEndian\"><PolyData><Piece NumberOfPoints=\"3\" NumberOfPolys=\"1\">\
        <Points><DataArray type=\"Float32\" NumberOfComponents=\"3\" format=\"ascii\">0 0 0 1 0 0 0 1 0</DataArray></Points>\
        <Polys><DataArray type=\"Int32\" Name=\"connectivity\" format=\"ascii\">0 1 2</DataArray>\
        <DataArray type=\"Int32\" Name=\"offsets\" format=\"ascii\">3</DataArray></Polys></Piece></PolyData></VTKFile>";
    vec![with(0, &stl), with(1, obj), with(2, ply), with(3, vtk), with(4, vtp)]
}
