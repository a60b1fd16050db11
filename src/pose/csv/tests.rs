//! Reading of tables and markups.

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
        (pose("nan,2,3,1,0,0,0"), "component `x` is NaN"),
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
