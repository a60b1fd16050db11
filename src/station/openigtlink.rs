//! `[openigtlink]`: where images and transforms are served.

use super::StationError;
use super::accepts::AXES;
use super::values::Values;
use crate::sink::openigtlink::Settings;

/// Settings from the table `[openigtlink]`.
pub(super) fn settings(values: &Values) -> Result<Settings, StationError> {
    let mut settings = Settings::default();
    values.set_server(&mut settings.address, &mut settings.port)?;
    if let Some(text) = values.text("scene_axes") {
        settings.scene_axes = text.parse().map_err(|_| values.wrong_text("scene_axes", text, AXES))?;
    }
    values.set("slice_mm", &mut settings.slice_mm);
    if let Some(clients) = values.integer("clients_max") {
        settings.clients_max = clients as usize;
    }
    Ok(settings)
}

#[cfg(test)]
mod tests {
    use std::net::IpAddr;
    use std::path::Path;

    use super::*;
    use crate::station::Station;

    fn parse(table: &str) -> Result<Option<Settings>, String> {
        let text = format!("[scene]\nphantom = 'obstetric'\n{table}");
        Station::parse(&text, Path::new(".")).map(|station| station.openigtlink).map_err(|e| e.to_string())
    }

    #[test]
    fn the_table_switches_it_on() {
        assert_eq!(parse(""), Ok(None));
        assert_eq!(parse("[openigtlink]"), Ok(Some(Settings::default())));
        let found =
            parse("[openigtlink]\naddress = '0.0.0.0'\nport = 0\nscene_axes = 'LPS'\nslice_mm = 2\nclients_max = 3");
        let expected = Settings {
            address: IpAddr::from([0, 0, 0, 0]),
            port: 0,
            scene_axes: "LPS".parse().unwrap(),
            slice_mm: 2.0,
            clients_max: 3,
        };
        assert_eq!(found, Ok(Some(expected)));
    }

    #[test]
    fn wrong_values_are_named() {
        let error = parse("[openigtlink]\naddress = 'localhost'").unwrap_err();
        assert!(error.contains("openigtlink.address") && error.contains("an IP address"), "{error}");
        let error = parse("[openigtlink]\nscene_axes = 'LAS'").unwrap_err();
        assert!(error.contains("scene_axes") && error.contains("right-handed"), "{error}");
    }
}
