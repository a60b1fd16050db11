//! Test of the wait for a settled session before a picture of the page is taken.

use std::process::Command;

#[test]
fn pictures_of_the_page_wait_for_a_settled_session() {
    let tests = super::root().join("tests/browser/settled_test.py");
    let output = Command::new(super::figures::python()).arg(tests).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
}
