//! Small files that expand to much data are refused with exit code 2 in 4 GB of memory. The system never has to end the
//! program.

use std::path::Path;
use std::process::Output;

use crate::program::{refused, stderr};

/// Runs the program with these arguments in 4 GB of memory.
fn limited(arguments: &[&str]) -> Output {
    let mut command = std::process::Command::new("sh");
    command.args(["-c", "ulimit -v 4000000; exec \"$0\" \"$@\"", env!("CARGO_BIN_EXE_insonify")]);
    command.args(arguments).env_remove("RUST_LOG").output().unwrap()
}

fn written(folder: &Path, name: &str, bytes: &[u8]) -> String {
    let path = folder.join(name);
    std::fs::write(&path, bytes).unwrap();
    path.display().to_string()
}

/// An NRRD file that announces `size` voxels along each axis; its gzip data are only a few bytes.
fn nrrd(kind: &str, size: usize) -> Vec<u8> {
    let header = format!(
        "NRRD0004\ntype: {kind}\ndimension: 3\nspace: LPS\nsizes: {size} {size} {size}\nendian: little\nencoding: gzip\n\
         space directions: (1,0,0) (0,1,0) (0,0,1)\n\n"
    );
    // An empty gzip member: what follows the header isn't reached.
    [header.as_bytes(), b"\x1f\x8b\x08\0\0\0\0\0\0\x03\x03\0\0\0\0\0\0\0\0\0"].concat()
}

fn nifti(size: i16, datatype: i16) -> Vec<u8> {
    let mut header = vec![0u8; 352];
    let mut put = |at: usize, bytes: &[u8]| header[at..at + bytes.len()].copy_from_slice(bytes);
    put(0, &348i32.to_le_bytes());
    for (n, size) in [3, size, size, size, 1, 1, 1, 1].into_iter().enumerate() {
        put(40 + 2 * n, &size.to_le_bytes());
    }
    put(70, &datatype.to_le_bytes());
    put(108, &352f32.to_le_bytes());
    put(254, &1i16.to_le_bytes());
    for row in 0..3 {
        put(280 + 20 * row, &1f32.to_le_bytes());
    }
    put(344, b"n+1\0");
    header
}

#[test]
fn volumes_beyond_the_memory_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("x.glb").display().to_string();
    for (name, bytes) in [
        ("bytes.nrrd", nrrd("uchar", 1024)),
        ("floats.nrrd", nrrd("float", 1000)),
        ("bytes.nii", nifti(1024, 2)),
        ("long.nii", nifti(800, 1024)),
    ] {
        let labels = written(folder.path(), name, &bytes);
        let found = limited(&["scene", "from-labels", &labels, "--out", &out]);
        refused(&found, &[name, "of memory, more than there is: crop the volume"]);
    }
}

#[test]
fn layers_beyond_the_limit_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("x.glb").display().to_string();
    let header = "NRRD0004\ntype: uchar\ndimension: 4\nspace: LPS\nsizes: 8000 1 1 1\nencoding: raw\n\
                  space directions: none (1,0,0) (0,1,0) (0,0,1)\n\n";
    let labels = written(folder.path(), "liver.nrrd", &[header.as_bytes(), &[1u8; 8000][..]].concat());
    let found = limited(&["scene", "from-labels", &labels, "--out", &out]);
    refused(&found, &["liver.nrrd", "it has 8000 layers; at most 512 are read"]);
}

#[test]
fn polydata_beyond_the_memory_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("x.glb").display().to_string();
    // Blocks of 1 MiB that are promised in a few bytes each.
    let packed = |blocks: u32| -> Vec<u8> {
        let head = [blocks, 1 << 20, 0].into_iter().chain((0..blocks).map(|_| 4));
        head.flat_map(u32::to_le_bytes).chain((0..blocks * 4).map(|_| 0)).collect()
    };
    for (blocks, says) in [
        (1000, &["values, and at most 100000000 are read: decimate the mesh"][..]),
        // It is refused for its memory, or would fit; then it isn't zlib data.
        (380, &["of memory, more than there is: decimate the mesh", "is not zlib data"]),
    ] {
        let head = format!(
            "<?xml version=\"1.0\"?>\n<VTKFile type=\"PolyData\" byte_order=\"LittleEndian\" \
             compressor=\"vtkZLibDataCompressor\"><PolyData><Piece NumberOfPoints=\"{}\" NumberOfPolys=\"1\"><Points>\
             <DataArray type=\"Float32\" NumberOfComponents=\"3\" format=\"appended\" offset=\"0\"/></Points></Piece>\
             </PolyData><AppendedData encoding=\"raw\">_",
            blocks * ((1 << 20) / 12)
        );
        let bytes = [head.as_bytes(), &packed(blocks), b"</AppendedData></VTKFile>"].concat();
        let mesh = written(folder.path(), "x.vtp", &bytes);
        let found = limited(&[
            "scene",
            "from-meshes",
            &format!("{mesh}=liver"),
            "--units",
            "mm",
            "--axes",
            "lps",
            "--out",
            &out,
        ]);
        refused(&found, &["x.vtp"]);
        let message = stderr(&found);
        assert!(says.iter().any(|says| message.contains(says)), "{blocks} blocks: {message}");
    }
}

#[test]
fn surfaces_that_share_one_accessor_are_counted_as_often_as_they_use_it() {
    let folder = tempfile::tempdir().unwrap();
    let (count, bytes) = (2_000_000, 24_000_000);
    written(folder.path(), "x.bin", &vec![0; bytes]);
    let nodes: Vec<String> = (0..200).map(|n| format!("{{\"mesh\":0,\"name\":\"liver.{n:03}\"}}")).collect();
    let roots: Vec<String> = (0..200).map(|n| n.to_string()).collect();
    let gltf = format!(
        "{{\"asset\":{{\"version\":\"2.0\"}},\"scenes\":[{{\"nodes\":[{}]}}],\"nodes\":[{}],\"meshes\":[{{\"primitives\":[{{\
         \"attributes\":{{\"POSITION\":0}}}}]}}],\"buffers\":[{{\"uri\":\"x.bin\",\"byteLength\":{bytes}}}],\
         \"bufferViews\":[{{\"buffer\":0,\"byteLength\":{bytes}}}],\
         \"accessors\":[{{\"bufferView\":0,\"componentType\":5126,\"count\":{count},\
         \"type\":\"VEC3\",\"min\":[0,0,0],\"max\":[0,0,0]}}]}}",
        roots.join(","),
        nodes.join(",")
    );
    let scene = written(folder.path(), "x.gltf", gltf.as_bytes());
    let says = ["x.gltf", "of memory, more than there is", "200 surfaces", "decimate"];
    let out = folder.path().join("x.glb").display().to_string();
    refused(&limited(&["scene", "from-meshes", &format!("{scene}=liver"), "--out", &out]), &says);
    let found = limited(&["doctor", &scene]);
    assert!(matches!(found.status.code(), Some(1 | 2)), "{found:?}");
}

#[test]
fn sequences_and_recordings_with_wrong_lengths_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("x.mcap").display().to_string();
    // Many short fields: each takes more memory than its line.
    let mut head = "ObjectType = Image\nNDims = 3\nDimSize = 16000 16000 999999\nElementType = MET_UCHAR\n".to_owned();
    for n in 0..200_000 {
        head.push_str(&format!("Seq_Frame{n:04}_T = 1\n"));
    }
    head.push_str("CompressedData = True\nElementDataFile = LOCAL\n");
    let sequence = written(folder.path(), "x.igs.mha", head.as_bytes());
    refused(&limited(&["import", &sequence, "--out", &out]), &["x.igs.mha", "DimSize says 999999 images"]);
    let nrrd = written(folder.path(), "x.igs.nrrd", b"NRRD0004\n");
    refused(&limited(&["import", &nrrd, "--out", &out]), &["x.igs.nrrd", "EditSequenceFile", ".mha"]);
    // An MCAP chunk of 2^60 bytes, and one that says that it becomes 2^40 bytes.
    let magic = b"\x89MCAP0\r\n";
    for (name, chunk) in [
        ("long.mcap", [&[6u8][..], &(1u64 << 60).to_le_bytes(), &[0; 64]].concat()),
        ("packed.mcap", {
            let mut data = [0u64.to_le_bytes(), 1u64.to_le_bytes(), (1u64 << 40).to_le_bytes()].concat();
            data.extend(0u32.to_le_bytes());
            data.extend([4, 0, 0, 0]);
            data.extend(b"zstd");
            data.extend(8u64.to_le_bytes());
            data.extend([0x28, 0xb5, 0x2f, 0xfd, 0, 0, 0, 0]);
            [&[6u8][..], &(data.len() as u64).to_le_bytes(), &data].concat()
        }),
    ] {
        let recording = written(folder.path(), name, &[&magic[..], &chunk].concat());
        let found = limited(&["inspect", &recording]);
        refused(&found, &[name]);
    }
}
