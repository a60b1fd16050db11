//! `[browser]`: the server of the browser page.

use super::StationError;
use super::accepts::{HOST_NAME, ORIGIN, TOKEN};
use super::values::Values;
use crate::settings::Origin;
use crate::sink::browser::Settings;

/// Settings from the table `[browser]`. An invalid address, token or name is an error.
pub(super) fn settings(values: &Values) -> Result<Settings, StationError> {
    let mut settings = Settings::default();
    values.set_group(&mut settings);
    values.set_address(&mut settings.address)?;
    if let Some(text) = values.text("token") {
        if !Settings::accepts_token(text) {
            // Keeps the token itself out of the error message, and thus out of logs.
            return Err(values.wrong_text("token", "...", TOKEN));
        }
        settings.token = Some(text.to_owned());
    }
    if let Some(text) = values.text("host_name") {
        let accepted = text.len() <= 253 && text.bytes().all(|b| b.is_ascii_alphanumeric() || b == b'-' || b == b'.');
        if !accepted {
            return Err(values.wrong_text("host_name", text, HOST_NAME));
        }
        settings.host_name = Some(text.to_owned());
    }
    for text in values.texts("origins").unwrap_or_default() {
        let origin: Origin = text.parse().map_err(|_| values.wrong_text("origins", text, ORIGIN))?;
        settings.origins.push(origin);
    }
    Ok(settings)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::station::tests::{assert_refused, parse};

    #[test]
    fn a_station_without_the_table_has_no_page() {
        assert_eq!(parse("").unwrap().browser, None);
        assert_eq!(parse("[browser]").unwrap().browser, Some(Settings::default()));
    }

    #[test]
    fn every_key_is_read() {
        let text = "[browser]\naddress = \"0.0.0.0\"\nport = 0\ntoken = \"0123456789abcdef\"\nhost_name = \"a.local\"\norigins = [\"https://A.local:9000/\", \"http://b\"]\nclients_max = 2";
        let settings = parse(text).unwrap().browser.unwrap();
        assert!(settings.address.is_unspecified());
        assert_eq!((settings.port, settings.clients_max), (0, 2));
        assert_eq!(settings.token.as_deref(), Some("0123456789abcdef"));
        assert_eq!(settings.host_name.as_deref(), Some("a.local"));
        let origins: Vec<_> = settings.origins.iter().map(ToString::to_string).collect();
        assert_eq!(origins, ["https://a.local:9000", "http://b"]);
    }

    #[test]
    fn mistakes_name_the_key_and_keep_tokens_secret() {
        let lines = [
            ("address = \"localhost\"", ["browser.address"]),
            ("port = 65536", ["browser.port"]),
            ("token = \"short secret\"", ["browser.token"]),
            ("host_name = \"http://a\"", ["browser.host_name"]),
            ("origins = \"https://a\"", ["browser.origins"]),
            ("origins = [\"https://a/page\"]", ["https://a/page"]),
            ("origins = [\"a.local:9000\"]", ["a.local:9000"]),
            ("origins = [\"https://*.local\"]", ["browser.origins"]),
            ("clients_max = 0", ["browser.clients_max"]),
            ("adress = \"::1\"", ["address"]),
        ];
        assert_refused("browser", &lines);
        let error = parse(&format!("[browser]\n{}", lines[2].0)).unwrap_err().to_string();
        assert!(!error.contains("secret"), "{error}");
    }
}
