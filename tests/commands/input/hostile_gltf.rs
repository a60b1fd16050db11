//! Tests of scenes that name files outside their folder, and of other things in place of a scene file.

use insonify::anatomy::{TissueTable, import};

use crate::input::builder::*;

#[test]
fn buffers_out_of_the_folder_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let own = folder.path().join("own");
    std::fs::create_dir(&own).unwrap();
    let tetrahedron = Builder::tetrahedron();
    std::fs::write(folder.path().join("secret.bin"), &tetrahedron.bin).unwrap();
    std::fs::write(own.join("a b.bin"), &tetrahedron.bin).unwrap();
    let load = |uri: &str| {
        let path = own.join("a.gltf");
        std::fs::write(&path, tetrahedron.json(Some(uri))).unwrap();
        let loaded = import::load(&path, &TissueTable::builtin().unwrap(), 0);
        let files = import::files_of(&path).len();
        loaded.map(|_| files).map_err(|error| format!("{error}; {files}"))
    };
    assert_eq!(load("a%20b.bin"), Ok(2));
    let absolute = folder.path().join("secret.bin").display().to_string();
    for uri in
        ["../secret.bin", "%2e%2e/secret.bin", "%2E%2E%2Fsecret.bin", "./../secret.bin", "..\\\\secret.bin", &absolute]
    {
        let error = load(uri).unwrap_err();
        // Only the scene itself counts as its file.
        assert!(error.contains("leads out of the folder; copy the file into it") && error.ends_with("; 1"), "{error}");
    }
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink(folder.path().join("secret.bin"), own.join("link.bin")).unwrap();
        assert!(load("link.bin").unwrap_err().contains("a link leads out of the folder"));
        nix::unistd::mkfifo(&own.join("pipe"), nix::sys::stat::Mode::S_IRWXU).unwrap();
        assert!(load("pipe").unwrap_err().contains("it is not a regular file"));
    }
}

#[test]
fn pointers_of_git_lfs_and_web_pages_are_named() {
    for (content, says) in [
        ("version https://git-lfs.github.com/spec/v1\noid sha256:4d7a\nsize 123\n", "run `git lfs pull`"),
        ("<!DOCTYPE html>\n<html></html>", "it is a web page (HTML), not the file itself"),
    ] {
        for name in ["a.glb", "a.gltf"] {
            let error = load_bytes(name, content.as_bytes()).err().unwrap().to_string();
            assert!(error.contains(says) && error.contains("cannot read the scene"), "{error}");
        }
    }
}
