//! Tests of station files, valid and wrong.

use std::path::Path;

use insonify::anatomy::TissueTable;
use insonify::phantom::PhantomOptions;
use insonify::pose::Pose;
use insonify::settings::{
    BackendSettings, ChoiceSettings, ContactSettings, FilterSettings, GeneratorSettings, ImageSettings, Kind,
    LookSettings, NeedleSettings, PipelineSettings, Probe, ProbeKind, Quality, ReceiverSettings, RenderSettings,
    Samples, SceneSettings, SettingsGroup, TrackerSettings, WindowSettings,
};
use insonify::station::{Accepts, KeyDoc, SceneSource, Station, keys, print_keys};
use proptest::prelude::*;

const SCENE: &str = "[scene]\npath = 'a.glb'\n";

fn parse(rest: &str) -> Result<Station, String> {
    Station::parse(&format!("{SCENE}{rest}"), Path::new("/stations")).map_err(|e| e.to_string())
}

fn error(rest: &str) -> String {
    parse(rest).unwrap_err()
}

#[test]
fn only_the_scene_is_required() {
    let station = parse("").unwrap();
    assert_eq!(station.scene, SceneSource::File("/stations/a.glb".into()));
    assert_eq!(station.probe, Probe::default());
    assert_eq!((station.settings.image, station.settings.quality), (ImageSettings::default(), Quality::LQ));
    assert_eq!((station.background.as_str(), station.default_pose), ("gel", None));
    assert_eq!(station.tissues, TissueTable::builtin().unwrap());

    let text = Station::parse("", Path::new("")).unwrap_err().to_string();
    assert_eq!(text, "`scene.path` is missing: give a glTF file, or `phantom = \"obstetric\"` in `[scene]`");
    let phantom = Station::parse("scene = { phantom = 'obstetric', phantom_scale = 0.25 }", Path::new("")).unwrap();
    assert_eq!(
        phantom.scene,
        SceneSource::ObstetricPhantom(PhantomOptions { scale: 0.25, ..PhantomOptions::default() })
    );
}

#[test]
fn values_have_their_effect() {
    let station = parse(
        "background = 'water'\n[probe]\nkind = 'linear'\nwidth_mm = 38\nfrequency_mhz = 7.5\nscanlines = 128\n\
         [image]\nheight = 500\ngain_db = -3\n[quality]\nrays = 32\nlayers = 3\nseed = 4294967295\n\
         [pose]\nposition_mm = [1, 2.5, -3]\nquaternion = [0, 0, 1, 0]\n\
         [tissues.liver]\nspeed_m_s = 1600\n\
         [tissues.granite]\nspeed_m_s = 3000\ndensity_kg_m3 = 2000\nattenuation_db_cm_mhz = 5\n\
         attenuation_exponent = 1\nroughness = 0.3",
    )
    .unwrap();
    assert_eq!(station.background, "water");
    assert_eq!(station.probe.kind, ProbeKind::Linear { width_mm: 38.0 });
    assert_eq!(
        (station.probe.frequency_mhz, station.probe.scanlines, station.probe.samples),
        (7.5, 128, Samples::Auto)
    );
    assert_eq!((station.settings.image.height, station.settings.image.gain_db), (500, -3.0));
    assert_eq!(station.settings.quality, Quality { rays: 32, layers: 3, seed: u32::MAX });
    let pose = Pose::from_components([1.0, 2.5, -3.0, 0.0, 0.0, 1.0, 0.0]).unwrap();
    assert_eq!(station.default_pose, Some(pose));
    let tissue = |name| &station.tissues.tissues()[station.tissues.index_of(name).unwrap()];
    let builtin = TissueTable::builtin().unwrap();
    let liver = &builtin.tissues()[builtin.index_of("liver").unwrap()];
    assert_eq!((tissue("liver").speed_m_s, tissue("liver").density_kg_m3), (1600.0, liver.density_kg_m3));
    assert_eq!((tissue("granite").roughness, tissue("granite").scatterer_density), (0.3, 0.0));
    assert_eq!(station.tissues.names().len(), builtin.names().len() + 1);
}

#[test]
fn unknown_names_suggest_the_nearest() {
    for (rest, part) in [
        (
            "[probe]\ndepth = 100",
            "unknown key `depth` in `[probe]` (did you mean `depth_mm`?); its keys are kind, radius_mm",
        ),
        ("[prob]\ndepth_mm = 100", "unknown table `[prob]` (did you mean `probe`?); tables are scene, probe"),
        ("foo = 1", "unknown key `foo` in `[scene]`; its keys are path"),
        ("[tissues.liver]\nspeed = 1500", "unknown key `speed` in `[tissues.liver]` (did you mean `speed_m_s`?)"),
        ("background = 'liwer'", "`scene.background` names the unknown tissue `liwer` (did you mean `liver`?)"),
        (
            "[probe]\nkind = 'convexe'",
            "`probe.kind` is \"convexe\"; it must be one of \"convex\", \"linear\", \"phased\" (did you mean `convex`?)",
        ),
        (
            "[tissues.livr]\nspeed_m_s = 1500",
            "`[tissues.livr]` is not a built-in tissue (did you mean `liver`?), so it must give density_kg_m3, attenuation_db_cm_mhz, attenuation_exponent, too",
        ),
    ] {
        assert!(error(rest).contains(part), "{rest}: {}", error(rest));
    }
}

#[test]
fn wrong_types_and_values_name_the_key_the_value_and_the_range() {
    for (rest, expected) in [
        ("[probe]\ndepth_mm = nan", "`probe.depth_mm` is nan; it must be a number in 1..=500"),
        ("[probe]\ndepth_mm = -inf", "`probe.depth_mm` is -inf; it must be a number in 1..=500"),
        ("[probe]\ndepth_mm = 0", "`probe.depth_mm` is 0; it must be a number in 1..=500"),
        ("[probe]\nfrequency_mhz = 1e9", "`probe.frequency_mhz` is 1000000000.0; it must be a number in 0.5..=40"),
        ("[probe]\nscanlines = 0", "`probe.scanlines` is 0; it must be a whole number in 1..=1024"),
        ("[probe]\nscanlines = 256.0", "`probe.scanlines` is 256.0; it must be a whole number in 1..=1024"),
        ("[probe]\nkind = 3", "`probe.kind` is 3; it must be one of \"convex\", \"linear\", \"phased\""),
        ("[image]\nwidth = '1386'", "`image.width` is \"1386\"; it must be a whole number in 16..=4096"),
        ("[quality]\nseed = -1", "`quality.seed` is -1; it must be a whole number in 0..=4294967295"),
        ("[pose]\nposition_mm = [1, 2]", "`pose.position_mm` is [1, 2]; it must be [3 numbers within ±100000]"),
        (
            "[pose]\nposition_mm = [1, nan, 2]",
            "`pose.position_mm` is [1, nan, 2]; it must be [3 numbers within ±100000]",
        ),
        (
            "[pose]\nquaternion = [1, 0, 0, 0.1]",
            "[pose]: the pose's quaternion (qw,qx,qy,qz) has norm 1.004988; it must be 1 within 0.001",
        ),
        ("[tissues.liver]\nspeed_m_s = 0", "`tissues.liver.speed_m_s` is 0; it must be a number in 100..=10000"),
        ("[tissues]\nliver = 3", "`tissues.liver` is 3; it must be a table"),
        ("[[probe]]\n", "`probe` is [{}]; it must be a table"),
    ] {
        assert_eq!(error(rest), expected, "{rest}");
    }
    let text = Station::parse("[scene]\npath = ''", Path::new("")).unwrap_err().to_string();
    assert_eq!(text, "`scene.path` is \"\"; it must be a path in quotes");
}

#[test]
fn keys_that_do_not_apply_are_refused() {
    for (rest, expected) in [
        ("[probe]\nwidth_mm = 40", "`probe.width_mm` does not apply: a convex probe has `radius_mm` and `fov_deg`"),
        ("[probe]\nkind = 'linear'\nfov_deg = 40", "`probe.fov_deg` does not apply: a linear probe has `width_mm`"),
        ("[probe]\nkind = 'phased'\nradius_mm = 40", "`probe.radius_mm` does not apply: a phased probe has `fov_deg`"),
        ("phantom = 'obstetric'", "`scene.phantom` does not apply: `scene.path` is given, too; give one of the two"),
        (
            "phantom_scale = 1",
            "`scene.phantom_scale` does not apply: it scales a generated phantom; `scene.path` names a file",
        ),
    ] {
        assert_eq!(error(rest), expected, "{rest}");
    }
}

#[test]
fn unreadable_files_are_named() {
    let text = Station::load(Path::new("/no/such.toml")).unwrap_err().to_string();
    assert!(text.starts_with("cannot read the station file /no/such.toml: No such file"), "{text}");
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("s.toml");
    std::fs::write(&path, "[scene]\npath = 'a.glb'\n[probe\n").unwrap();
    let text = Station::load(&path).unwrap_err().to_string();
    assert!(
        text.starts_with(&format!("station file {}: not valid TOML: TOML parse error at line 3", path.display())),
        "{text}"
    );
    std::fs::write(&path, [0xff, 0xfe]).unwrap();
    assert!(Station::load(&path).unwrap_err().to_string().starts_with("cannot read the station file"));
    std::fs::write(&path, SCENE).unwrap();
    let station = Station::load(&path).unwrap();
    assert_eq!(station.scene_file(), Some(dir.path().join("a.glb").as_path()));
    let text = station.load_scene_from(station.scene_file().unwrap()).unwrap_err().to_string();
    assert!(text.starts_with("cannot read the scene"), "{text}");
}

/// Further keys of `[tracker]` that must be present for `key` with `value` to apply.
fn tracker_needs(key: &str, value: &str) -> &'static str {
    const SERIAL: &str = "transport = 'serial'\nprotocol = 'ascii-line'\nport = '/dev/x'\n";
    match (key, value.trim_matches(['\'', '"'])) {
        ("transport", "serial") => "protocol = 'ascii-line'\nport = '/dev/x'\n",
        ("transport", "tcp") => "protocol = 'ascii-line'\naddress = 'localhost:1'\n",
        ("transport", "udp") => "protocol = 'opentrack'\n",
        ("transport", "recording") => "recording = '/x.mcap'\n",
        ("protocol", "spacemouse") => "transport = 'hid'\n",
        ("protocol", "opentrack") => "transport = 'udp'\n",
        ("protocol", _) => "transport = 'tcp'\naddress = 'localhost:1'\n",
        ("baud", _) => SERIAL,
        ("sensor" | "silence_ms" | "reset_delay_ms" | "hemisphere", _) => {
            "transport = 'tcp'\nprotocol = 'fastrak-binary'\naddress = 'localhost:1'\n"
        }
        ("ndi_reply" | "ndi_roms" | "ndi_out_of_volume", _) => {
            "transport = 'tcp'\nprotocol = 'ndi'\naddress = 'localhost:1'\n"
        }
        ("axis_map" | "puck_range", _) => "transport = 'hid'\n",
        ("speed" | "repeat", _) => "transport = 'recording'\nrecording = '/x.mcap'\n",
        ("schedule" | "rate_hz" | "seed", _) => "transport = 'mock'\n",
        _ => "",
    }
}

/// Key of `[needle]` that a station without a tracker needs.
const NEEDLE: &str = "position_mm = [0.0, 0.0, 50.0]\n";

/// Further keys of `[exercise]` that must be present for `key` to apply.
fn exercise_needs(key: &str) -> &'static str {
    match key {
        "target" => "",
        "target_mm" => "radius_mm = 5.0\n",
        "radius_mm" => "target_mm = [0.0, 0.0, 50.0]\n",
        "entry_mm" => "target = 'a'\nentry_radius_mm = 5.0\n",
        "entry_radius_mm" => "target = 'a'\nentry_mm = [0.0, 0.0, 0.0]\n",
        _ => "target = 'a'\n",
    }
}

fn with_key(doc: &KeyDoc, value: &str) -> String {
    let needs = match doc.key {
        _ if doc.table == "tracker" => tracker_needs(doc.key, value),
        key if doc.table == "needle" && key != "position_mm" => NEEDLE,
        key if doc.table == "exercise" => exercise_needs(key),
        "path" | "phantom" => return format!("[scene]\n{} = {value}", doc.key),
        key if key.starts_with("phantom_") => return format!("[scene]\nphantom = 'obstetric'\n{key} = {value}"),
        "width_mm" => "kind = 'linear'\n",
        _ => "",
    };
    let table = doc.table.replace("NAME", "liver");
    if table == "scene" {
        return format!("{SCENE}{} = {value}", doc.key);
    }
    format!("{SCENE}[{table}]\n{needs}{} = {value}", doc.key)
}

fn accepted(doc: &KeyDoc, value: &str) -> Result<Station, String> {
    Station::parse(&with_key(doc, value), Path::new("")).map_err(|e| e.to_string())
}

#[test]
fn documented_ranges_equal_the_parsers() {
    // The numbers of a needle's sensor depend on the protocol: src/station/needle_table.rs tests them.
    for doc in keys().iter().filter(|doc| (doc.table, doc.key) != ("needle", "sensor")) {
        let (inside, outside) = match doc.range {
            Accepts::Number { min, max } => {
                (vec![format!("{min:?}"), format!("{max:?}")], vec![min.next_down(), max.next_up()])
            }
            Accepts::Integer { min, max } => {
                (vec![min.to_string(), max.to_string()], vec![(min - 1) as f64, (max + 1) as f64])
            }
            Accepts::OneOf(words) => (words.iter().map(|w| format!("'{w}'")).collect(), vec![]),
            _ => continue,
        };
        for value in inside {
            accepted(doc, &value).unwrap_or_else(|e| panic!("{}.{}: {e}", doc.table, doc.key));
        }
        for value in outside {
            let text = match doc.range {
                Accepts::Integer { .. } => format!("{value:.0}"),
                _ => format!("{value:?}"),
            };
            let error = accepted(doc, &text).unwrap_err();
            assert!(error.contains(doc.key) && error.contains(&doc.range.to_string()), "{error}");
        }
    }
}

#[test]
fn field_types_are_no_wider_than_the_ranges() {
    let mut checked = 0;
    for doc in keys() {
        let (below, above) = match doc.range {
            Accepts::Number { min, max } => (min.next_down(), max.next_up()),
            Accepts::Integer { min, max } => (min as f64 - 1.0, max as f64 + 1.0),
            _ => continue,
        };
        for value in [below, above] {
            let refused = match doc.table {
                "probe" => refused(&mut probe_with(doc.key), doc.key, value),
                "image" | "quality" => refused(&mut RenderSettings::default(), doc.key, value),
                "filter" => refused(&mut FilterSettings::default(), doc.key, value),
                "pipeline" => refused(&mut PipelineSettings::default(), doc.key, value),
                "tissues.NAME" => Some(refused_tissue(doc.key, value)),
                _ => None,
            };
            if let Some(refused) = refused {
                assert!(refused, "{}.{} = {value}", doc.table, doc.key);
                checked += 1;
            }
        }
    }
    assert!(checked >= 2 * (12 + 7 + 14 + 7 + 9), "{checked}");
}

/// A probe of a kind that has the key `key`.
fn probe_with(key: &str) -> Probe {
    let kind = match key {
        "width_mm" => ProbeKind::Linear { width_mm: 40.0 },
        _ => ProbeKind::default(),
    };
    Probe { kind, ..Probe::default() }
}

/// Whether the group refuses `value`; `None` if it has no such setting, or the setting's type can't hold the value.
fn refused(group: &mut impl SettingsGroup, key: &str, value: f64) -> Option<bool> {
    let stored = group.stored_mut(key)?;
    stored.set(0, value);
    (stored.get(0) == value).then(|| group.validate().is_err())
}

#[test]
fn documented_keys_are_those_of_the_settings() {
    let groups = [
        Probe::settings(),
        ProbeKind::settings(),
        ImageSettings::settings(),
        Quality::settings(),
        RenderSettings::settings(),
        ContactSettings::settings(),
        ReceiverSettings::settings(),
        LookSettings::settings(),
        FilterSettings::settings(),
        PipelineSettings::settings(),
        ChoiceSettings::settings(),
        SceneSettings::settings(),
        TrackerSettings::settings(),
        BackendSettings::settings(),
        WindowSettings::settings(),
        GeneratorSettings::settings(),
        NeedleSettings::settings(),
    ];
    for setting in groups.into_iter().flatten() {
        let mut of_key = keys().iter().filter(|doc| (doc.table, doc.key) == (setting.table, setting.key));
        let doc = of_key.next().unwrap_or_else(|| panic!("{} is not documented", setting.path));
        assert!(of_key.next().is_none(), "{} is documented twice", setting.path);
        assert_eq!((doc.unit, &*doc.default), (setting.unit, &*setting.default_toml()), "{}", setting.path);
        (0..setting.count()).for_each(|_| setting.check(setting.default).unwrap());
        // Read from a station file, the value arrives in its field.
        if setting.count() == 1 {
            let text = match setting.kind {
                Kind::Word(words) => format!("{:?}", words[0]),
                Kind::Switch => "false".to_owned(),
                _ => format!("{:?}", setting.min),
            };
            let whole = matches!(setting.kind, Kind::Whole | Kind::WholeOrAuto);
            let station = accepted(doc, if whole { text.trim_end_matches(".0") } else { &text }).unwrap();
            let stored = match setting.table {
                "probe" => station.probe.stored(setting.key),
                "filter" => station.filter.stored(setting.key),
                "pipeline" => station.pipeline.stored(setting.key),
                "generator" => station.generator.stored(setting.key),
                "needle" => station.settings.needle.as_ref().and_then(|needle| needle.stored(setting.key)),
                // The parser makes others of these: `documented_defaults_equal_the_parsers`.
                "scene" | "tracker" | "render" | "window" => continue,
                _ => station.settings.stored(setting.key),
            };
            assert_eq!(stored.unwrap().get(0), setting.min, "{}", setting.path);
        }
    }
}

fn refused_tissue(key: &str, value: f64) -> bool {
    let table = TissueTable::builtin().unwrap();
    let mut liver = table.tissues()[table.index_of("liver").unwrap()].clone();
    liver.stored_mut(key).unwrap().set(0, value);
    TissueTable::new([("liver".to_owned(), liver)]).is_err()
}

#[test]
fn documented_defaults_equal_the_parsers() {
    let default = parse("").unwrap();
    // Words instead of a value describe the behaviour without the key.
    let is_value = |doc: &&KeyDoc| !["required", "none", "built-in"].iter().any(|word| doc.default.starts_with(word));
    for doc in keys().iter().filter(is_value) {
        let found = accepted(doc, &doc.default).unwrap_or_else(|e| panic!("{}.{}: {e}", doc.table, doc.key));
        match (doc.table, doc.key) {
            ("scene", key) if key.starts_with("phantom_") => {
                assert_eq!(found.scene, SceneSource::ObstetricPhantom(PhantomOptions::default()), "{key}");
            }
            ("probe", "width_mm") => assert_eq!(found.probe, parse("[probe]\nkind = 'linear'").unwrap().probe),
            ("openigtlink", _) => assert_eq!(found.openigtlink, parse("[openigtlink]").unwrap().openigtlink),
            ("tracker", key) => {
                let without = format!("[tracker]\n{}", tracker_needs(key, &doc.default));
                assert_eq!(found.tracker, parse(&without).unwrap().tracker, "{key}");
            }
            ("browser", _) => assert_eq!(found.browser, parse("[browser]").unwrap().browser),
            ("window", _) => assert_eq!(found.window, parse("[window]").unwrap().window),
            ("needle", key) => {
                let without = parse(&format!("[needle]\n{NEEDLE}")).unwrap();
                let of = |station: &Station| (station.settings.needle, station.needle_pose);
                assert_eq!(of(&found), of(&without), "{key}");
            }
            ("exercise", key) => {
                let without = format!("[exercise]\n{}", exercise_needs(key));
                assert_eq!(found.exercise, parse(&without).unwrap().exercise, "{key}");
            }
            ("pose", _) => assert_eq!(found.default_pose, parse("[pose]").unwrap().default_pose),
            _ => assert_eq!(found, Station { path: found.path.clone(), scene: found.scene.clone(), ..default.clone() }),
        }
    }
}

#[test]
fn every_key_is_printed() {
    let mut text = String::new();
    print_keys(&mut text).unwrap();
    for doc in keys() {
        assert!(text.contains(doc.key) && text.contains(&*doc.meaning), "{}", doc.key);
    }
    assert!(text.contains("[tissues.NAME]") && text.contains("a number in 0.5..=40; default: 8.0"), "{text}");
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 4 * ProptestConfig::default().cases, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn no_text_panics(text in "(\\[|\\]|=|\"|[a-z_.]{1,8}|[0-9.eE+-]{1,6}|\n| |scene|probe|tissues|path|nan|inf){0,30}") {
        let _ = Station::parse(&text, Path::new(""));
    }

    #[test]
    fn no_number_panics(index in 0..keys().len(), number in any::<f64>(), whole in any::<i64>(), is_whole in any::<bool>()) {
        let text = if is_whole { whole.to_string() } else { format!("{number:?}").to_lowercase() };
        if let Ok(station) = accepted(&keys()[index], &text) {
            prop_assert!(station.probe.validate().is_ok() && station.settings.validate().is_ok());
        }
    }
}
