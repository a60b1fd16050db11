//! Tests of reading tables and markups.

use proptest::prelude::*;

use super::*;

#[test]
fn pairs_have_names_or_numbers() {
    let text = "\u{feff}x,y,z,tx,ty,tz,name\r\n# belly\r\n1,2,3,4,5,6,\"navel\"\r\n\r\n-1.5, 2e1, 3,4,5,6\r\n7,8,9,1,2,3,left, upper\r\n";
    let found = pairs(text).unwrap();
    let names: Vec<_> = found.values.iter().map(|p| p.name.as_str()).collect();
    assert_eq!(names, ["navel", "2", "left, upper"]);
    assert_eq!(found.values[1].value.scene_mm, DVec3::new(-1.5, 20.0, 3.0));
    assert_eq!(found.values[0].value.tracker_mm, DVec3::new(4.0, 5.0, 6.0));
    assert!(!found.in_lps && found.notes.is_empty());
}

fn first_pair(text: &str) -> (DVec3, DVec3) {
    let found = pairs(text).unwrap().values.remove(0).value;
    (found.scene_mm, found.tracker_mm)
}

#[test]
fn columns_mean_what_their_names_say() {
    let (scene, tracker) = (DVec3::new(1.0, 2.0, 3.0), DVec3::new(40.0, 50.0, 60.0));
    for text in [
        "1,2,3,40,50,60",
        "tx,ty,tz,x,y,z\n40,50,60,1,2,3",
        "name;z;y;x;tz_cm;ty_m;tx_mm\nA;3;2;1;6;0.05;40",
        "sep=;\nX [mm];Y [mm];Z [mm];Tracker X;Tracker Y;Tracker Z\n1;2;3;40;50;60",
        "l\tp\ts\ttx\tty\ttz\n1\t2\t3\t40\t50\t60",
        "r,a,s,tx,ty,tz\n-1,-2,3,40,50,60",
        "s,a,r,tx,ty,tz\n3,-2,-1,40,50,60",
        "# r a s tx ty tz\n-1,-2,3,40,50,60",
        "# Touched on a phantom by me today\n1,2,3,40,50,60,A",
        "# \"belly\" landmarks\n1,2,3,40,50,60",
        "# tx,ty,tz,r_m,a_m,s_m\n40,50,60,-0.001,-0.002,0.003",
    ] {
        let (a, b) = first_pair(text);
        assert!(a.distance(scene) < 1e-12 && b.distance(tracker) < 1e-12, "{text}: {a} {b}");
    }
    let turned = pairs("r,a,s,tx,ty,tz\n-1,-2,3,40,50,60").unwrap();
    assert!(turned.in_lps && turned.notes[0].contains("x = −r, y = −a, z = s"), "{:?}", turned.notes);
}

#[test]
fn quaternions_are_taken_by_their_names_and_metres_by_theirs() {
    let half = std::f64::consts::FRAC_1_SQRT_2;
    for text in [
        format!("x,y,z,qw,qx,qy,qz\n1000,0,0,{half},{half},0,0"),
        format!("tx_m,ty_m,tz_m,qx,qy,qz,qw\n1,0,0,{half},0,0,{half}"),
        format!(
            "time_s,status,pose.orientation.w,pose.orientation.x,pose.orientation.y,pose.orientation.z,x_cm,y_cm,z_cm\n0,ok,{half},{half},0,0,100,0,0"
        ),
        format!("Q0,Qx,Qy,Qz,Tx,Ty,Tz\n{half},{half},0,0,1000,0,0"),
    ] {
        let pose = poses(&text).unwrap().values[0];
        assert!(pose.position_mm.distance(DVec3::X * 1000.0) < 1e-9, "{text}: {pose:?}");
        assert!((pose.orientation.w - half).abs() < 1e-9 && (pose.orientation.x - half).abs() < 1e-9, "{text}");
    }
}

#[test]
fn rows_of_a_lost_tracker_are_left_out_and_counted() {
    let text =
        "status,x,y,z,qw,qx,qy,qz\nok,1,2,3,1,0,0,0\nok,nan,NaN,,nan,nan,nan,nan\n,0,0,0,0,0,0,0\nINVALID,x,,,,,,\n";
    let found = poses(text).unwrap();
    assert_eq!((found.values.len(), found.notes.len()), (1, 1));
    assert!(found.notes[0].starts_with("3 rows without a pose"), "{:?}", found.notes);
}

#[test]
fn lists_of_3d_slicer_are_read_in_their_coordinate_system() {
    let list = |system: &str| {
        format!(
            "# Markups fiducial file version = 5.6\n{system}# columns = id,x,y,z,ow,ox,oy,oz,vis,sel,lock,label,desc,associatedNodeID\n\
             1,10.5,-98.25,3.5,0,0,0,1,1,1,0,\"XIPHOID, lower\",,,2,0\n2,99.5,1.25,4.5,0,0,0,1,1,1,0,LATER,,,0,0\n\
             vtkMRMLMarkupsFiducialNode_3,1,2,3,0,0,0,1,1,1,0,LEFT,,\n"
        )
    };
    let lps = points(&list("# CoordinateSystem = LPS\n")).unwrap();
    let names: Vec<_> = lps.values.iter().map(|p| p.name.as_str()).collect();
    assert_eq!(names, ["XIPHOID, lower", "LEFT"]);
    assert_eq!(lps.values[0].value, DVec3::new(10.5, -98.25, 3.5));
    assert!(lps.in_lps && lps.notes[0].contains("LATER"), "{:?}", lps.notes);
    for system in ["RAS", "0"] {
        let ras = points(&list(&format!("# CoordinateSystem = {system}\n"))).unwrap();
        assert_eq!(ras.values[0].value, DVec3::new(-10.5, 98.25, 3.5));
        assert!(ras.notes[0].contains("RAS"), "{:?}", ras.notes);
    }
    let error = |system: &str| points(&list(system)).unwrap_err().to_string();
    assert!(error("# CoordinateSystem = IJK\n").contains("coordinate system is `IJK`"));
    assert!(error("").contains("add a line `# CoordinateSystem = LPS`"));
    let table = "label,r,a,s,defined,selected,visible,locked,description\nA,-1,-2,3,1,1,1,0,\nB,0,0,0,0,1,1,0,\n";
    let exported = points(table).unwrap();
    assert_eq!(exported.values, [Named { name: "A".to_owned(), value: DVec3::new(1.0, 2.0, 3.0) }]);
    assert_eq!(points(&table.replace(',', "\t")).unwrap().values, exported.values);
    let json = "{\"markups\": [{\"type\": \"Fiducial\", \"coordinateSystem\": \"RAS\", \"controlPoints\": [{\"label\": \"A\", \"position\": [-1, -2, 3]}]}]}";
    assert_eq!(points(json).unwrap().values, exported.values);
    assert!(pairs(json).unwrap_err().to_string().contains("--points"));
    assert!(poses(json).unwrap_err().to_string().contains("hold points, not poses"));
}

/// Comment lines at the top of a list of 3D Slicer.
const VERSION: &str = "# Markups fiducial file version = 5.6\n";
const LPS: &str = "# CoordinateSystem = LPS\n";
const COLUMNS: &str = "# columns = id,x,y,z,ow,ox,oy,oz,vis,sel,lock,label,desc,associatedNodeID\n";

#[test]
fn lists_of_3d_slicer_with_decimal_commas_are_refused() {
    let error = |columns: &str, row: &str| points(&format!("{VERSION}{LPS}{columns}{row}\n")).unwrap_err().to_string();
    for (columns, row, part) in [
        (
            COLUMNS,
            "1,10,5,-98,25,3,5,0,0,0,1,1,1,0,XIPHOID,,,2,0",
            "line 4: 19 fields; the head has 14: are its numbers",
        ),
        (COLUMNS, "1,10,5,-98,25,3,0,0,0,1,1,1,0,XIPHOID,,", "line 4: 16 fields; the head has 14: are its numbers"),
        (COLUMNS, "1,10,5,-98,3,0,0,0,1,1,1,0,XIPHOID,,,2,0", "line 4: 17 fields; the head has 14: are its numbers"),
        ("", "1,10,5,-98,25,3,5,0,0,0,1,1,1,0,XIPHOID,,,2,0", "line 3: 19 fields; the head has 14: are its numbers"),
        ("", "10.5,-98.25,3.5,XIPHOID", "line 3: 4 fields; the head has 14: without a line `# columns`"),
        ("# columns = x,y,z,label\n", "10,5,-98,2,2,A", "line 4: 6 fields; the head has 4: are its numbers"),
    ] {
        let error = error(columns, row);
        assert!(error.contains(part), "`{part}` is not in: {error}");
    }
    let row = "1,10.5,-98.25,3.5,0,0,0,1,1,1,0,XIPHOID,,,2,0";
    let xiphoid = Named { name: "XIPHOID".to_owned(), value: DVec3::new(10.5, -98.25, 3.5) };
    for columns in [COLUMNS, ""] {
        assert_eq!(points(&format!("{VERSION}{LPS}{columns}{row}\n")).unwrap().values, std::slice::from_ref(&xiphoid));
    }
}

#[test]
fn joined_lists_of_3d_slicer_have_one_coordinate_system_and_the_same_columns() {
    let first = format!("{VERSION}{LPS}{COLUMNS}1,1,2,3,0,0,0,1,1,1,0,A,,,2,0\n");
    let joined = |system: &str, columns: &str| {
        points(&format!("{first}{VERSION}{system}{columns}2,4,5,6,0,0,0,1,1,1,0,B,,,2,0\n"))
    };
    assert_eq!(joined("# CoordinateSystem = 1\n", COLUMNS).unwrap().values.len(), 2);
    let error = joined("# CoordinateSystem = RAS\n", COLUMNS).unwrap_err().to_string();
    assert!(error.starts_with("line 6: the coordinate system is RAS here and LPS above"), "{error}");
    let error = joined(LPS, "# columns = id,y,x,z\n").unwrap_err().to_string();
    assert!(error.starts_with("line 7: `# columns` differs from the columns above: `id,y,x,z`"), "{error}");
}

#[test]
fn rows_without_any_value_are_counted() {
    let pose = "x,y,z,qw,qx,qy,qz\nnan,nan,nan,nan,nan,nan,nan\n0,0,0,0,0,0,0\n";
    assert!(
        poses(pose).unwrap_err().to_string().starts_with("none of its 2 rows has a pose: all are empty, NaN or zero")
    );
    let list = "name,x,y,z,defined\nA,1,2,3,0\nB,1,2,3,0\nC,1,2,3,0\n";
    assert!(points(list).unwrap_err().to_string().starts_with("none of its 3 rows has a position"));
}

#[test]
fn coordinates_have_one_frame_each_and_all_or_no_units() {
    let pair = |text: &str| pairs(text).unwrap_err().to_string();
    let point = |text: &str| points(text).unwrap_err().to_string();
    let pose = |text: &str| poses(text).unwrap_err().to_string();
    for (error, part) in [
        (
            pair("x_m,y,z,tx,ty,tz\n1,2,3,4,5,6"),
            "column `y` is not read: it has no unit, but `x_m` has one; give each of the three its unit",
        ),
        (pair("x,y,z,tx,ty,tz_cm\n1,2,3,4,5,6"), "column `tx` is not read: it has no unit, but `tz_cm` has one"),
        (point("r,a,s_mm\n1,2,3"), "column `r` is not read: it has no unit, but `s_mm` has one"),
        (pose("x_mm,y_mm,z,qw,qx,qy,qz\n1,2,3,1,0,0,0"), "column `z` is not read: it has no unit, but `x_mm` has one"),
        (pair("sx,sy,sz,tx,ty,tz\n1,2,3,4,5,6"), "column `sx` is not read: it doesn't say whose axis it is; name the"),
        (pair("px_m,py_m,pz_m,x,y,z\n1,2,3,4,5,6"), "column `px_m` is not read: it doesn't say whose axis it is"),
        (point("i,x,y,z,name\n1,2,3,4,A"), "column `i` is not read: it is an axis of the patient"),
        (pose("i,x,y,z,qw,qx,qy,qz\n1,2,3,4,1,0,0,0"), "name a row's number `id`"),
    ] {
        assert!(error.contains(part), "`{part}` is not in: {error}");
    }
    let (scene, tracker) = first_pair("x_m,y_mm,z_cm,tx,ty,tz\n0.001,2,0.3,4,5,6");
    assert!(scene.distance(DVec3::new(1.0, 2.0, 3.0)) < 1e-12 && tracker == DVec3::new(4.0, 5.0, 6.0));
    let with_id = points("id,x,y,z,name\n1,2,3,4,A").unwrap();
    assert_eq!(with_id.values[0].value, DVec3::new(2.0, 3.0, 4.0));
}

#[test]
fn malformed_lines_and_columns_are_named_with_the_way_out() {
    let pair = |text: &str| pairs(text).unwrap_err().to_string();
    let point = |text: &str| points(text).unwrap_err().to_string();
    let pose = |text: &str| poses(text).unwrap_err().to_string();
    for (error, part) in [
        (pair("1,2,3,4,5,6\n1,2,3\n"), "line 2: expected `x,y,z,tx,ty,tz`"),
        (pair("1,2,3,4,5,six"), "line 1: `tz` is `six`; it must be a decimal number"),
        (pair("x,y\nx,y\n"), "line 1: column `z` is missing"),
        (pair("# nothing\n\n"), "there is no line with `x,y,z,tx,ty,tz`"),
        (pair("r,a,s,x,y,z\n1,2,3,4,5,6"), "column `r` is not read: the table has `x`, too"),
        (pair("x,y,z,tx,ty,tz,qw,qx,qy,qz\n1,2,3,4,5,6,1,0,0,0"), "column `qw` is not read: it doesn't belong"),
        (pair("x,y,z,u,v,w\n1,2,3,4,5,6"), "unknown column `u`"),
        (
            pair("x;y;z;tx;ty;tz\n1,5;2;3;4;5;6"),
            "line 2: `x` is `1,5`; it must be a decimal number with a decimal point instead of the decimal comma: 1.5",
        ),
        (pair("1,5;2;3;4;5;6"), "line 1: `x` is `1,5`"),
        (pair("x,y,z,tx,ty,tz\r1,2,3,4,5,6\r"), "carriage returns only"),
        (
            point("x,y,z,name\n10,5,-98,25,3,5,XIPHOID\n"),
            "line 2: 7 fields; the head has 4: are its numbers written with decimal commas?",
        ),
        (point("10,5,-98,25,3,5,XIPHOID\n"), "line 1: expected `x,y,z` and perhaps `,name`"),
        (point("1,10.5,-98.25,3.5\n"), "line 1: expected `x,y,z`"),
        (point("x,y,z,tx,ty,tz\n1,2,3,4,5,6"), "column `tx` is not read"),
        (point("i,j,k\n1,2,3"), "voxel indices"),
        (point("r,a\n1,2"), "column `s` is missing"),
        (pose("x,y,z,qw,qx,qy,qz\n1,2,3,2,0,0,0"), "line 2: the pose's quaternion"),
        (pose("1,2,3"), "line 1: expected `x,y,z,qw,qx,qy,qz`"),
        (pose("nan,2,3,1,0,0,0"), "line 1: `x` is `nan`, but other numbers of the pose are there"),
        (pose("x,y,z,qw,qx,qy,qz\n1,2,3,1,,0,0"), "line 2: `qx` is ``, but other numbers of the pose are there"),
        (pose("inf,2,3,1,0,0,0"), "line 1: pose component `x` is inf"),
        (point("x,y,z,name\n1,2,3,A\n4,nan,6,B\n"), "line 3: `y` is `nan`; it must be a decimal number that is finite"),
        (pair("1,2,3,4,5,inf"), "line 1: `tz` is `inf`; it must be a decimal number that is finite"),
        (pair("1 2 3 4 5 6\n"), "line 1: spaces separate the fields of `1 2 3 4 5 6`; separate fields by commas"),
        (pose("x y z qw qx qy qz\n1 2 3 1 0 0 0\n"), "line 1: spaces separate the fields of `x y z qw"),
        (pair("x,y,z,tx,ty,tz\n1 2 3 4 5 6"), "line 2: 1 fields; the head has 6: separate fields by commas"),
        (pose("x,y,z,q0,q1,q2,q3\n1,2,3,1,0,0,0"), "column `q1` is not read: whether the scalar part is the first"),
        (
            pose("x,y,z,roll_deg,pitch_deg,yaw_deg\n1,2,3,0,0,0"),
            "column `roll_deg` is not read: the order and the axes of angles",
        ),
        (pose("r,a,s,qw,qx,qy,qz\n1,2,3,1,0,0,0"), "column `r` is not read"),
        (pose("x,y,z,tx,ty,tz,qw,qx,qy,qz\n1,2,3,1,2,3,1,0,0,0"), "a pose has one position"),
        (pose("x,x_m,y,z,qw,qx,qy,qz\n1,2,3,4,1,0,0,0"), "column `x_m` is there twice: `x` means the same"),
        (pose("x,y,z\n1,2,3"), "column `qw` is missing"),
        (pose("status,x,y,z,qw,qx,qy,qz\nfine,1,2,3,1,0,0,0"), "`status` is `fine`"),
    ] {
        assert!(error.contains(part), "`{part}` is not in: {error}");
    }
    assert_eq!(poses("1,2,3,1,0,0,0\n").unwrap().values[0].position_mm, DVec3::new(1.0, 2.0, 3.0));
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn no_text_panics(text in "([0-9.,;\t-]{0,20}|\n|,|name|#|# columns = |x,y,z|é|\"|nan|inf|\\{| ){0,30}") {
        let _ = (points(&text), pairs(&text), poses(&text));
    }
}
