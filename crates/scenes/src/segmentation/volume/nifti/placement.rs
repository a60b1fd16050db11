//! Placement of a NIfTI file's voxels by its sform or qform, and contradictions between these two forms.

use glam::{DAffine3, DMat3, DQuat, DVec3};

use super::super::geometry::{PatientAxes, lps_mm};
use super::super::{NiftiForm, ReadOptions, VolumeFault};
use super::header::Header;

/// Angle between corresponding axes of sform and qform, degrees, above which the forms contradict each other.
const TURN_DEGREES: f64 = 30.0;

/// Ratio of the forms' voxel volumes, or voxel edges, above which they differ by more than rounding.
const VOLUME_RATIO: f64 = 1.1;

/// Largest distance that counts as rounding, between a corner's positions by the two forms; in mm and in voxels.
const SHIFT_MM: f64 = 2.0;
const SHIFT_VOXELS: f64 = 1.0;

/// Transform from voxel index to LPS, mm: the sform if present, else the qform, else the assumed axes. Remarks say
/// where the two forms differ.
///
/// # Errors
/// No placement at all; impossible voxels; forms that contradict each other, unless `options` state a preference.
pub(super) fn placement(
    header: &Header,
    size: [u64; 3],
    options: ReadOptions,
) -> Result<(DAffine3, Vec<String>), VolumeFault> {
    let unit = unit(header.units)?;
    let place = |affine| lps_mm(affine, PatientAxes::Ras, unit);
    let sform = (header.sform_code > 0).then(|| place(sform(header)));
    let qform = (header.qform_code > 0).then(|| qform(header).and_then(place));
    let unusable = |form: &str, other: &str, fault: &VolumeFault| {
        vec![format!("its {form} can't be used ({fault}), so the {other} was taken")]
    };
    match (sform, qform) {
        (Some(sform), Some(qform)) => match (sform, qform, options.prefer) {
            (Ok(sform), Ok(qform), _) => chosen(&Forms { header, size, sform, qform }, options.prefer),
            (Err(fault), Ok(qform), Some(NiftiForm::Qform)) => Ok((qform, unusable("sform", "qform", &fault))),
            (Ok(_), Err(fault), Some(NiftiForm::Qform)) => Err(fault),
            (Ok(sform), Err(fault), _) => Ok((sform, unusable("qform", "sform", &fault))),
            (Err(fault), _, _) => Err(fault),
        },
        (Some(sform), None) => sform.map(|sform| (sform, other_spacing(header, &sform, unit.1))),
        (None, Some(qform)) => qform.map(|qform| (qform, Vec::new())),
        (None, None) => {
            let axes =
                options.assume_axes.ok_or(VolumeFault::NoAxes { found: "both qform_code and sform_code are 0" })?;
            Ok((lps_mm(DAffine3::from_scale(spacing(header)?), axes, unit)?, Vec::new()))
        }
    }
}

/// Distances between neighbouring voxels along i, j and k, in the header's unit.
fn spacing(header: &Header) -> Result<DVec3, VolumeFault> {
    let [_, spacing @ ..] = header.pixdim;
    let spacing = DVec3::from(spacing);
    if spacing.cmplt(DVec3::ZERO).any() {
        return Err(VolumeFault::Header(format!("pixdim has negative distances: {spacing}")));
    }
    Ok(spacing)
}

/// Transform from voxel index to RAS by the sform (method 3), in the header's unit.
fn sform(header: &Header) -> DAffine3 {
    let [x, y, z] = header.rows;
    let column = |n: usize| DVec3::new(x[n], y[n], z[n]);
    DAffine3::from_mat3_translation(DMat3::from_cols(column(0), column(1), column(2)), column(3))
}

/// Transform from voxel index to RAS by the qform (method 2), in the header's unit.
fn qform(header: &Header) -> Result<DAffine3, VolumeFault> {
    let scale = spacing(header)? * DVec3::new(1.0, 1.0, if header.pixdim[0] < 0.0 { -1.0 } else { 1.0 });
    let matrix = DMat3::from_quat(unit_quaternion(header.quaternion)) * DMat3::from_diagonal(scale);
    Ok(DAffine3::from_mat3_translation(matrix, header.offset.into()))
}

/// Unit quaternion with the components b, c and d, as nifti1.h defines it.
fn unit_quaternion([b, c, d]: [f64; 3]) -> DQuat {
    let rest = 1.0 - (b * b + c * c + d * d);
    if rest < 1e-7 {
        // The rotation is half a turn. Due to rounding, (b, c, d) may be longer than 1.
        let length = (b * b + c * c + d * d).sqrt();
        return DQuat::from_xyzw(b / length, c / length, d / length, 0.0);
    }
    DQuat::from_xyzw(b, c, d, rest.sqrt())
}

/// Name of the header's unit of length, and that unit in mm. Unknown units are taken as mm.
fn unit(code: i64) -> Result<(&'static str, f64), VolumeFault> {
    match code & 7 {
        0 => Ok(("none stated, mm assumed", 1.0)),
        1 => Ok(("metres", 1000.0)),
        2 => Ok(("mm", 1.0)),
        3 => Ok(("microns", 0.001)),
        other => Err(VolumeFault::Header(format!("the unit of length has code {other}; NIfTI defines 0 to 3"))),
    }
}

/// Placements of one file by its sform and by its qform, LPS, mm.
struct Forms<'a> {
    header: &'a Header,
    size: [u64; 3],
    sform: DAffine3,
    qform: DAffine3,
}

/// Placement by the preferred form, else by the sform, and remarks on the differences of the other form.
fn chosen(forms: &Forms<'_>, prefer: Option<NiftiForm>) -> Result<(DAffine3, Vec<String>), VolumeFault> {
    let taken = prefer.unwrap_or(NiftiForm::Sform);
    let affine = if taken == NiftiForm::Sform { forms.sform } else { forms.qform };
    let name = taken.name();
    match (forms.contradiction(), prefer) {
        (Some(what), None) => Err(VolumeFault::Forms { what }),
        (Some(what), Some(_)) => {
            Ok((affine, vec![format!("its sform and qform contradict each other ({what}): the {name} was taken")]))
        }
        (None, _) => {
            let remark = forms.distance().map(|what| format!("{what}: the {name} was taken"));
            Ok((affine, remark.into_iter().collect()))
        }
    }
}

impl Forms<'_> {
    /// Description of a contradiction between the forms: in sides, directions or voxel sizes. `None` if they agree.
    fn contradiction(&self) -> Option<String> {
        let (s, q) = (self.sform.matrix3, self.qform.matrix3);
        let axis = (0..3).map(|n| (n, s.col(n).angle_between(q.col(n)).to_degrees()));
        let (n, degrees) = axis.max_by(|a, b| a.1.total_cmp(&b.1))?;
        let mirrored = s.determinant().signum() != q.determinant().signum();
        if mirrored || degrees > TURN_DEGREES {
            let (sform, qform) = (self.named("sform"), self.named("qform"));
            let (by_s, by_q) = (direction(s.col(n)), direction(q.col(n)));
            let way = if by_s == by_q { format!("{degrees:.0}° away from there") } else { format!("to {by_q}") };
            let mirror = if mirrored { "; one is the mirror image of the other" } else { "" };
            return Some(format!(
                "axis {} runs to {by_s} by the {sform}, and {way} by the {qform}{mirror}",
                ["i", "j", "k"][n]
            ));
        }
        let ratio = (s.determinant() / q.determinant()).abs();
        let lengths = |m: DMat3| [m.x_axis, m.y_axis, m.z_axis].map(|axis| format!("{:.3}", axis.length())).join(" × ");
        let alike = (1.0 / VOLUME_RATIO..=VOLUME_RATIO).contains(&ratio);
        (!alike).then(|| {
            format!("voxels have {} mm by the {}, {} mm by pixdim", lengths(s), self.named("sform"), lengths(q))
        })
    }

    /// Description of the distance between the forms' placements; `None` for a distance within rounding.
    fn distance(&self) -> Option<String> {
        let corner = |n: usize| -> DVec3 {
            let ends = self.size.map(|size| size.saturating_sub(1) as f64);
            DVec3::from_array(std::array::from_fn(|axis| if n >> axis & 1 == 1 { ends[axis] } else { 0.0 }))
        };
        let apart = |n: usize| self.sform.transform_point3(corner(n)).distance(self.qform.transform_point3(corner(n)));
        let far_mm = (0..8).map(apart).fold(0.0, f64::max);
        let matrix = self.sform.matrix3;
        let voxel_mm = matrix.x_axis.length().max(matrix.y_axis.length()).max(matrix.z_axis.length());
        if far_mm <= SHIFT_MM.max(SHIFT_VOXELS * voxel_mm) {
            return None;
        }
        let centre = |affine: &DAffine3| {
            let at = affine.transform_point3(corner(7) / 2.0);
            format!("({:.0}, {:.0}, {:.0})", at.x, at.y, at.z)
        };
        Some(format!(
            "its {} and {} place it up to {far_mm:.0} mm apart, its centre at {} and at {} mm (LPS)",
            self.named("sform"),
            self.named("qform"),
            centre(&self.sform),
            centre(&self.qform)
        ))
    }

    /// Name of a form, with the name of its code.
    fn named(&self, form: &'static str) -> String {
        let code = if form == "sform" { self.header.sform_code } else { self.header.qform_code };
        let space = match code {
            1 => ", scanner",
            2 => ", aligned",
            3 => ", Talairach",
            4 => ", MNI",
            _ => "",
        };
        format!("{form} (code {code}{space})")
    }
}

/// Name of the side of the patient to which a direction mostly points.
fn direction(lps: DVec3) -> &'static str {
    let axis = (0..3).max_by(|a, b| lps[*a].abs().total_cmp(&lps[*b].abs())).unwrap_or(0);
    let sides = [["the patient's left", "the patient's right"], ["the back", "the front"], ["the head", "the feet"]];
    sides[axis][usize::from(lps[axis] < 0.0)]
}

/// Remark if there is no qform and the voxel spacings in `pixdim` differ from those of the sform.
fn other_spacing(header: &Header, sform: &DAffine3, unit_mm: f64) -> Vec<String> {
    let [_, spacing @ ..] = header.pixdim;
    let columns = [0, 1, 2].map(|n| sform.matrix3.col(n).length());
    let differs = |(by_sform, by_pixdim): (f64, f64)| {
        by_pixdim > 0.0 && !(1.0 / VOLUME_RATIO..=VOLUME_RATIO).contains(&(by_sform / by_pixdim))
    };
    let stated = spacing.map(|step| step * unit_mm);
    if !columns.into_iter().zip(stated).any(differs) {
        return Vec::new();
    }
    let text = |lengths: [f64; 3]| lengths.map(|length| format!("{length:.3}")).join(" × ");
    let (by_sform, by_pixdim) = (text(columns), text(stated));
    vec![format!("its voxels have {by_sform} mm by the sform, {by_pixdim} mm by pixdim: the sform was taken")]
}
