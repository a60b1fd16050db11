//! `[openigtlink]`: the server that sends images and transforms.

use super::StationError;
use super::accepts::AXES;
use super::values::Values;
use crate::sink::openigtlink::Settings;

/// Settings from the table `[openigtlink]`.
pub(super) fn settings(values: &Values) -> Result<Settings, StationError> {
    let mut settings = Settings::default();
    values.set_group(&mut settings);
    values.set_address(&mut settings.address)?;
    if let Some(text) = values.text("scene_axes") {
        settings.scene_axes = text.parse().map_err(|_| values.wrong_text("scene_axes", text, AXES))?;
    }
    Ok(settings)
}

#[cfg(test)]
mod tests {
    use std::net::IpAddr;

    use super::*;
    use crate::station::tests::{assert_refused, parse};

    #[test]
    fn the_table_switches_it_on() {
        assert_eq!(parse("").unwrap().openigtlink, None);
        assert_eq!(parse("[openigtlink]").unwrap().openigtlink, Some(Settings::default()));
        let table = "[openigtlink]\naddress = '0.0.0.0'\nport = 0\nscene_axes = 'LPS'\nslice_mm = 2\nclients_max = 3";
        let expected = Settings {
            address: IpAddr::from([0, 0, 0, 0]),
            port: 0,
            scene_axes: "LPS".parse().unwrap(),
            slice_mm: 2.0,
            clients_max: 3,
        };
        assert_eq!(parse(table).unwrap().openigtlink, Some(expected));
    }

    #[test]
    fn wrong_values_are_named() {
        let lines = [
            ("address = 'localhost'", ["openigtlink.address", "an IP address"]),
            ("scene_axes = 'LAS'", ["scene_axes", "right-handed"]),
        ];
        assert_refused("openigtlink", &lines);
    }
}
