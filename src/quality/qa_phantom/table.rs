//! Measurements of the QA phantom as tables.

use std::fmt;

use super::{QaMeasurements, RESOLVED_DIP_DB, SEEN_DB};

impl fmt::Display for QaMeasurements {
    /// Writes tables in Markdown, which is readable on a terminal, too.
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            out,
            "## Distances\n\n| direction | depth, mm | true, mm | measured, mm | off |\n|---|---|---|---|---|"
        )?;
        for d in &self.distances {
            let off = 100.0 * (d.measured_mm / d.true_mm - 1.0);
            let (direction, depth, want, got) = (d.direction, d.depth_mm, d.true_mm, d.measured_mm);
            writeln!(out, "| {direction} | {depth:.0} | {want:.1} | {got:.2} | {off:+.2} % |")?;
        }
        writeln!(out, "\n## Resolution\n\nFull widths at half the amplitude of the wires of the vertical group.\n")?;
        writeln!(
            out,
            "| depth, mm | lateral, mm | beam and wire, mm | axial, mm | pulse and wire, mm |\n|---|---|---|---|---|"
        )?;
        for w in &self.widths {
            writeln!(
                out,
                "| {:.0} | {:.2} | {:.2} | {:.2} | {:.2} |",
                w.depth_mm, w.lateral_mm, w.lateral_expected_mm, w.axial_mm, w.axial_expected_mm
            )?;
        }
        writeln!(out, "\nPairs of wires, seen as two where the level dips by {RESOLVED_DIP_DB} dB between them.\n")?;
        writeln!(out, "| direction | depth, mm | apart, mm | dip, dB | seen as |\n|---|---|---|---|---|")?;
        for p in &self.pairs {
            let seen = if p.is_resolved() { "two" } else { "one" };
            writeln!(out, "| {} | {:.0} | {:.2} | {:.1} | {seen} |", p.direction, p.depth_mm, p.apart_mm, p.dip_db)?;
        }
        writeln!(out, "\n## Contrast\n\n| target, dB | measured, dB | off, dB |\n|---|---|---|")?;
        for c in &self.contrast {
            writeln!(out, "| {:+.0} | {:+.2} | {:+.2} |", c.true_db, c.measured_db, c.measured_db - c.true_db)?;
        }
        writeln!(
            out,
            "\n## Anechoic cylinders\n\n| diameter, mm | depth, mm | below the background, dB |\n|---|---|---|"
        )?;
        for c in &self.cysts {
            writeln!(out, "| {:.1} | {:.0} | {:.1} |", c.diameter_mm, c.depth_mm, c.void_db)?;
        }
        let p = &self.penetration;
        let end = if p.whole_depth { "the bottom of the image" } else { "below that it is lost in black" };
        writeln!(
            out,
            "\n## Penetration\n\nThe background stays {SEEN_DB} dB above black down to {:.0} mm ({end}). Its level changes by \
         {:+.2} dB a cm.\n",
            p.seen_mm, p.slope_db_cm
        )?;
        writeln!(out, "| depth, mm | level above black, dB |\n|---|---|")?;
        p.levels
            .iter()
            .filter(|(depth, _)| depth % 10.0 == 0.0)
            .try_for_each(|(d, db)| writeln!(out, "| {d:.0} | {db:.1} |"))
    }
}
