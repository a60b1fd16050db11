//! Parser of station files.

use std::collections::BTreeMap;
use std::path::Path;

use toml::{Table, Value};

use super::accepts::Accepts;
use super::keys::{PHYSICAL, tables};
use super::renamed::rename;
use super::values::{Values, optional, section, take, wrong_type};
use super::{Station, StationError, calibration};
use crate::anatomy::{Tissue, TissueTable};
use crate::files;
use crate::generator;
use crate::pose::Pose;
use crate::settings::{
    BackendSettings, Face, LookBase, LookSettings, PipelineSettings, Probe, ProbeKind, Samples, SettingsGroup,
};
use crate::suggest::did_you_mean;

pub(super) fn station(text: &str, dir: &Path) -> Result<Station, StationError> {
    let mut root: Table =
        text.parse().map_err(|e: toml::de::Error| StationError::Syntax { reason: files::toml_reason(text, &e) })?;
    let renamed_keys = rename(&mut root)?;
    let tables = tables();
    if let Some(table) = root.keys().find(|key| !tables.contains(&key.as_str())) {
        let suggestion = did_you_mean(table, tables.iter().copied());
        return Err(StationError::UnknownTable { table: table.clone(), suggestion, known: tables.join(", ") });
    }
    let tissues = tissues(take(&mut root, "tissues")?)?;
    let scene_values = section(&mut root, "scene")?;
    let scene = super::scene::source(&scene_values, dir)?;
    let background = scene_values.text("background").unwrap_or("gel").to_owned();
    let motion = super::scene::settings(&scene_values).motion;
    tissue_index(&tissues, &background)?;
    let probe = probe(&section(&mut root, "probe")?)?;
    let quality_values = section(&mut root, "quality")?;
    let mut settings = super::quality::settings(&section(&mut root, "image")?, &quality_values)?;
    if settings.coarse_samples && probe.samples != Samples::Auto {
        quality_values.refuse(
            &["coarse_samples"],
            "`probe.samples` is a number, and coarse samples are for \"auto\"; leave out one of them",
        )?;
    }
    settings.contact = group(&mut root, "contact")?;
    settings.receiver = group(&mut root, "receiver")?;
    let look_values = section(&mut root, "look")?;
    settings.look = look(&look_values);
    let frame_budget_ms = quality_values.number("frame_budget_ms");
    let angles_open = frame_budget_ms.is_some() && !look_values.has("angles") && !look_values.has("preset");
    let backend = group::<BackendSettings>(&mut root, "render")?.backend;
    settings.effects = super::effects::choices(&section(&mut root, "effects")?);
    let default_pose = pose(&mut root)?;
    let filter = group(&mut root, "filter")?;
    let calibration = calibration::source(&section(&mut root, "calibration")?, dir)?;
    let mut tracker = super::tracker_table::settings(&section(&mut root, "tracker")?, default_pose, dir)?;
    let needle =
        optional(&mut root, "needle")?.map(|values| super::needle_table::needle(&values, &mut tracker, default_pose));
    let needle = needle.transpose()?;
    settings.needle = needle.as_ref().map(|needle| needle.settings);
    let generator_values = section(&mut root, "generator")?;
    let mut generator = super::generator::settings(&generator_values, dir);
    if let Some(run_budget_ms) = frame_budget_ms.filter(|_| !generator_values.has("run_budget_ms")) {
        generator.run_budget_ms = run_budget_ms;
    }
    let openigtlink = optional(&mut root, "openigtlink")?.map(|v| super::openigtlink::settings(&v)).transpose()?;
    let browser = optional(&mut root, "browser")?.map(|values| super::browser::settings(&values)).transpose()?;
    let window = optional(&mut root, "window")?.map(|values| values.group());
    let pipeline = group(&mut root, "pipeline")?;
    check_hang(&pipeline, &generator)?;
    let exercise = optional(&mut root, "exercise")?.map(|values| super::exercise::exercise(&values)).transpose()?;
    let sinks = super::display::sinks(&section(&mut root, "display")?);
    let path = dir.to_owned();
    Ok(Station {
        scene,
        background,
        motion,
        probe,
        settings,
        backend,
        frame_budget_ms,
        angles_open,
        tissues,
        default_pose,
        filter,
        calibration,
        tracker,
        needle_pose: needle.and_then(|needle| needle.pose),
        generator,
        openigtlink,
        browser,
        window,
        pipeline,
        exercise,
        sinks,
        renamed_keys,
        path,
    })
}

/// Index of the background tissue `name` in `tissues`.
pub(super) fn tissue_index(tissues: &TissueTable, name: &str) -> Result<usize, StationError> {
    tissues.index_of(name).ok_or_else(|| {
        let suggestion = did_you_mean(name, tissues.names().iter().map(String::as_str));
        StationError::UnknownTissue { tissue: name.to_owned(), suggestion }
    })
}

/// Settings group from the table `name`.
fn group<G: SettingsGroup + Default>(root: &mut Table, name: &str) -> Result<G, StationError> {
    Ok(section(root, name)?.group())
}

/// Refuses a `hang_ms` that would end runs within their time budget.
fn check_hang(pipeline: &PipelineSettings, generator: &generator::Settings) -> Result<(), StationError> {
    let (hang_ms, run_budget_ms) = (pipeline.hang_ms, generator.run_budget_ms);
    if generator.models.is_empty() || !generator.enabled || hang_ms > run_budget_ms {
        return Ok(());
    }
    let default_ms = PipelineSettings::default().hang_ms;
    let reason = format!(
        "a run counts as hanging after {hang_ms} ms ({default_ms} by default), but may take {run_budget_ms} ms by \
         `generator.run_budget_ms` (`quality.frame_budget_ms` by default); make it more, or the budget less"
    );
    Err(StationError::Text { key: "pipeline.hang_ms".to_owned(), reason })
}

/// A preset of post-processing by name, with the changes that the table's other keys make.
fn look(values: &Values) -> LookSettings {
    let mut look = values.group::<LookBase>().preset.settings();
    values.set_group(&mut look);
    look
}

fn probe(values: &Values) -> Result<Probe, StationError> {
    let mut face = Face::default();
    values.set_group(&mut face);
    let Face { radius_mm, fov_deg, width_mm } = face;
    let kind = match values.text("kind") {
        Some("linear") => {
            values.refuse(&["radius_mm", "fov_deg"], "a linear probe has `width_mm`")?;
            ProbeKind::Linear { width_mm }
        }
        Some("phased") => {
            values.refuse(&["radius_mm", "width_mm"], "a phased probe has `fov_deg`")?;
            ProbeKind::Phased { fov_deg }
        }
        _ => {
            values.refuse(&["width_mm"], "a convex probe has `radius_mm` and `fov_deg`")?;
            ProbeKind::Convex { radius_mm, fov_deg }
        }
    };
    let mut probe = Probe { kind, ..Probe::default() };
    values.set_group(&mut probe);
    Ok(probe)
}

fn pose(root: &mut Table) -> Result<Option<Pose>, StationError> {
    let pose = optional(root, "pose")?.map(|values| values.pose("position_mm", "quaternion"));
    Ok(pose.transpose()?)
}

/// Built-in tissues, with the station's changes and additions.
fn tissues(tables: Option<Table>) -> Result<TissueTable, StationError> {
    let builtin = TissueTable::builtin()?;
    let Some(tables) = tables else { return Ok(builtin) };
    let names = builtin.names().iter().cloned();
    let mut all: BTreeMap<String, Tissue> = names.zip(builtin.tissues().iter().cloned()).collect();
    for (name, value) in tables {
        let table = format!("tissues.{name}");
        let Value::Table(values) = value else { return Err(wrong_type(table, &value, Accepts::Table)) };
        let values = Values::check(&table, values)?;
        if !all.contains_key(&name) {
            check_new_tissue(&name, &values, &builtin)?;
        }
        values.set_group(all.entry(name).or_default());
    }
    Ok(TissueTable::new(all)?)
}

/// Refuses a new tissue without all physical properties. Its name is probably misspelt.
fn check_new_tissue(name: &str, values: &Values, builtin: &TissueTable) -> Result<(), StationError> {
    let missing: Vec<_> = PHYSICAL.into_iter().filter(|key| !values.has(key)).collect();
    if missing.is_empty() {
        return Ok(());
    }
    let suggestion = did_you_mean(name, builtin.names().iter().map(String::as_str));
    Err(StationError::IncompleteTissue { tissue: name.to_owned(), suggestion, missing: missing.join(", ") })
}
