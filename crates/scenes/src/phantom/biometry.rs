//! Fetal biometry: sizes by gestational age.

use glam::Vec3;

use insonify_core::anatomy::sdf::bisect;

/// Sizes of a fetus that determine every organ, mm.
///
/// [`Biometry::at_weeks`] names the source of each size.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Biometry {
    /// Biparietal diameter, outer to inner table of the skull.
    pub biparietal_mm: f32,
    /// Circumference of the skull's outer table in the transthalamic plane.
    pub head_circumference_mm: f32,
    /// Occipitofrontal diameter, outer to outer.
    pub occipitofrontal_mm: f32,
    /// Thickness of the skull.
    pub skull_thickness_mm: f32,
    /// Largest width of the cerebellum.
    pub cerebellum_mm: f32,
    /// Depth of the cisterna magna, from the vermis to the inner table.
    pub cisterna_magna_mm: f32,
    /// Width of a lateral ventricle's atrium.
    pub atrium_mm: f32,
    /// Distance between the outer borders of the eyes.
    pub binocular_mm: f32,
    /// Diameter of an eye.
    pub ocular_mm: f32,
    /// Circumference of the abdomen at the skin.
    pub abdominal_circumference_mm: f32,
    /// Length of the spine from C1 to S5 along the vertebral bodies.
    pub spine_mm: f32,
    /// Length of a kidney.
    pub kidney_mm: f32,
    /// Ossified length of the femur.
    pub femur_mm: f32,
    /// Ossified length of the tibia.
    pub tibia_mm: f32,
    /// Ossified length of the fibula.
    pub fibula_mm: f32,
    /// Ossified length of the humerus.
    pub humerus_mm: f32,
    /// Ossified length of the radius.
    pub radius_mm: f32,
    /// Ossified length of the ulna.
    pub ulna_mm: f32,
    /// Length of the foot, skin to skin.
    pub foot_mm: f32,
    /// Thickness of the fetal skin.
    pub skin_thickness_mm: f32,
}

/// Lengths of the long bones at every second week from 16 to 34, mm: humerus, radius, ulna, tibia, fibula. Medians
/// after Jeanty et al., "Estimation of gestational age from measurements of fetal long bones", J Ultrasound Med 3:75
/// (1984), rounded to a millimetre.
///
/// Unverified: the single values; the paper was not at hand.
const LONG_BONES_MM: [[f32; 10]; 5] = [
    [21.0, 27.0, 32.0, 36.0, 41.0, 45.0, 48.0, 51.0, 55.0, 58.0],
    [18.0, 22.0, 27.0, 31.0, 34.0, 37.0, 40.0, 43.0, 45.0, 47.0],
    [19.0, 24.0, 29.0, 33.0, 37.0, 41.0, 44.0, 47.0, 50.0, 53.0],
    [17.0, 22.0, 27.0, 32.0, 37.0, 42.0, 45.0, 48.0, 52.0, 55.0],
    [18.0, 23.0, 28.0, 33.0, 37.0, 42.0, 45.0, 48.0, 51.0, 53.0],
];

/// Width of the cerebellum at every second week from 16 to 34, mm: medians after Goldstein et al., "Cerebellar
/// measurements with ultrasonography in the evaluation of fetal growth and development", Am J Obstet Gynecol 156:1065
/// (1987).
///
/// Unverified: the single values. They agree with the means of 1236 fetuses: 18.1 ± 2.2 mm at 18 weeks and 26.4 ± 1.9
/// mm at 24 (Desdicioglu et al., J Fetal Med 6:177, 2019).
const CEREBELLUM_MM: [f32; 10] = [16.0, 18.0, 20.0, 23.0, 25.0, 29.0, 31.0, 35.0, 38.0, 40.0];

/// Distance between the outer borders of the eyes and diameter of an eye, at every second week from 16 to 34, mm: after
/// Jeanty et al., "The binocular distance: a new way to estimate fetal age", J Ultrasound Med 3:241 (1984), to about a
/// millimetre.
///
/// Unverified: the single values. Within 0.5 mm, the binocular distances lie between two lines: 2.59 + 1.42 w (Sukonpan
/// and Phupong, J Med Assoc Thai 91:1318, 2008) and 0.51 + 1.679 w (Suh et al., Korean J Obstet Gynecol 49:2096, 2006).
const EYES_MM: [[f32; 10]; 2] = [
    [25.0, 30.0, 34.0, 37.0, 41.0, 44.0, 47.0, 50.0, 52.0, 54.0],
    [7.0, 9.0, 10.0, 11.0, 12.0, 13.0, 13.5, 14.0, 14.5, 15.0],
];

/// Value at `weeks`, interpolated linearly in a table of every second week from 16 to 34.
fn at(table: &[f32; 10], weeks: f64) -> f32 {
    let position = ((weeks as f32 - 16.0) / 2.0).clamp(0.0, 9.0);
    let i = (position as usize).min(8);
    table[i] + (table[i + 1] - table[i]) * (position - i as f32)
}

/// Circumference of an ellipse with the diameters `a` and `b` (Ramanujan's first approximation).
fn ellipse_circumference(a: f32, b: f32) -> f32 {
    0.5 * std::f32::consts::PI * (3.0 * (a + b) - ((3.0 * a + b) * (a + 3.0 * b)).sqrt())
}

impl Biometry {
    /// Biometry of a fetus of `weeks` menstrual weeks, within [`WEEKS_RANGE`](super::parameters::WEEKS_RANGE).
    ///
    /// - Biparietal diameter, head and abdominal circumference and femur: the growth curves of Hadlock et al.,
    ///   "Estimating fetal age: computer-assisted analysis of multiple fetal growth parameters", Radiology 152:497
    ///   (1984), in cm of w weeks: BPD = −3.08 + 0.41 w − 0.000061 w³; HC = −11.48 + 1.56 w − 0.0002548 w³;
    ///   AC = −13.3 + 1.61 w − 0.00998 w²; FL = −3.91 + 0.427 w − 0.0034 w². Unverified: the coefficients in the paper
    ///   itself. The paper's widely used formulas for the age return the weeks within 0.6. Exception: the head
    ///   circumference gives 1.4 weeks too many at 34 (a test).
    /// - Other long bones: Jeanty 1984. The foot is as long as the femur (unverified: Campbell et al., J Ultrasound Med
    ///   7:187, 1988).
    /// - Cerebellum: Goldstein 1987. Cisterna magna 5 mm (mean; Mahony et al., Radiology 153:773, 1984; 4.3 at 18 to
    ///   5.6 at 24 weeks in 3862 fetuses, Childs Nerv Syst, doi 10.1007/s00381-013-2298-y). Atrium 7.0 mm at all ages
    ///   (unverified: mean 7.6, below 10; Cardoza et al., Radiology 169:711, 1988, whose callipers include the walls).
    ///   Eyes: Jeanty 1984.
    /// - Assumed: the occipitofrontal diameter, such that the head's ellipse has its circumference; the skull's
    ///   thickness (3.4 % of the biparietal diameter); the spine (grows as the mean of head and abdomen); the skin's
    ///   thickness.
    /// - Also assumed: the kidney, 12.3 % of the abdominal circumference. The circumferences of kidney and abdomen keep
    ///   their ratio (unverified: Grannum et al., Am J Obstet Gynecol 136:249, 1980). At 24 weeks it is 24.1 mm,
    ///   compared with 23.2 of Bharatnur et al., Int J Reprod Contracept Obstet Gynecol.
    pub fn at_weeks(weeks: f64) -> Self {
        let w = weeks as f32;
        let biparietal_mm = 10.0 * (-3.08 + 0.41 * w - 0.000_061 * w.powi(3));
        let head_circumference_mm = 10.0 * (-11.48 + 1.56 * w - 0.000_254_8 * w.powi(3));
        let abdominal_circumference_mm = 10.0 * (-13.3 + 1.61 * w - 0.009_98 * w * w);
        let femur_mm = 10.0 * (-3.91 + 0.427 * w - 0.003_4 * w * w);
        let skull_thickness_mm = 0.034 * biparietal_mm;
        let [humerus_mm, radius_mm, ulna_mm, tibia_mm, fibula_mm] =
            LONG_BONES_MM.each_ref().map(|bone| at(bone, weeks));
        let [binocular_mm, ocular_mm] = EYES_MM.each_ref().map(|eyes| at(eyes, weeks));
        Self {
            biparietal_mm,
            head_circumference_mm,
            occipitofrontal_mm: occipitofrontal_mm(biparietal_mm + skull_thickness_mm, head_circumference_mm),
            skull_thickness_mm,
            cerebellum_mm: at(&CEREBELLUM_MM, weeks),
            cisterna_magna_mm: 5.0,
            atrium_mm: 7.0,
            binocular_mm,
            ocular_mm,
            abdominal_circumference_mm,
            spine_mm: 112.0 * 0.5 * (head_circumference_mm / 200.0 + abdominal_circumference_mm / 175.0),
            kidney_mm: 0.123 * abdominal_circumference_mm,
            femur_mm,
            tibia_mm,
            fibula_mm,
            humerus_mm,
            radius_mm,
            ulna_mm,
            foot_mm: femur_mm,
            skin_thickness_mm: 1.5 * (abdominal_circumference_mm / 175.0).sqrt(),
        }
    }

    /// Radius of the abdomen at the skin, mm.
    pub(crate) fn abdominal_radius_mm(&self) -> f32 {
        self.abdominal_circumference_mm / std::f32::consts::TAU
    }

    /// Semi-axes of the skull's outer table, mm: lateral, vertical, fore and aft.
    pub(crate) fn skull_semi_mm(&self) -> Vec3 {
        // The biparietal diameter runs from outer to inner table, so it excludes the thickness of one side.
        let lateral = 0.5 * (self.biparietal_mm + self.skull_thickness_mm);
        let long = 0.5 * self.occipitofrontal_mm;
        Vec3::new(lateral, 0.85 * long, long)
    }

    /// Scale of the head relative to the model as drawn, whose head circumference is 200 mm (22 weeks).
    pub fn head_scale(&self) -> f32 {
        self.head_circumference_mm / 200.0
    }

    /// Scale of the trunk relative to the model as drawn, whose abdominal circumference is 175 mm (22 weeks).
    pub fn trunk_scale(&self) -> f32 {
        self.abdominal_circumference_mm / 175.0
    }

    /// Scale of the legs relative to the model as drawn, whose femur is 39 mm long (22 weeks).
    pub(crate) fn leg_scale(&self) -> f32 {
        self.femur_mm / 39.0
    }

    /// Scale of the arms relative to the model as drawn, whose humerus is 37 mm long (22 weeks).
    pub(crate) fn arm_scale(&self) -> f32 {
        self.humerus_mm / 37.0
    }
}

/// Occipitofrontal diameter, mm, of a head of width `width_mm` and circumference `circumference_mm`. Its outline is an
/// ellipse that the brow lengthens by the factor [`BROW`].
fn occipitofrontal_mm(width_mm: f32, circumference_mm: f32) -> f32 {
    const BROW: f32 = 1.012;
    bisect(width_mm, 2.0 * width_mm, 30, |long| BROW * ellipse_circumference(width_mm, long) < circumference_mm)
}

impl Default for Biometry {
    fn default() -> Self {
        Self::at_weeks(22.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_at_22_weeks_match_the_tables() {
        let b = Biometry::at_weeks(22.0);
        let near = |found: f32, table: f32| (found / table - 1.0).abs() < 0.03;
        assert!(
            near(b.biparietal_mm, 54.0) && near(b.abdominal_circumference_mm, 175.0) && near(b.femur_mm, 39.0),
            "{b:?}"
        );
        assert!(near(b.head_circumference_mm, 200.0), "{b:?}");
        // The cephalic index is 78 ± 9 (two standard deviations; Hadlock et al., Am J Roentgenol 137:83, 1981).
        for weeks in 16..=34 {
            let b = Biometry::at_weeks(f64::from(weeks));
            let index = (b.biparietal_mm + b.skull_thickness_mm) / b.occipitofrontal_mm;
            assert!((0.69..0.87).contains(&index), "{index} at {weeks} weeks");
            assert!(b.atrium_mm < 10.0);
        }
    }

    /// Age from a size, by the regressions of Hadlock et al., Radiology 152:497 (1984): weeks as a function of cm.
    /// Both sets of curves were fitted separately, so they are only nearly inverse; the head circumference at 34 weeks
    /// deviates most.
    #[test]
    fn sizes_return_their_age() {
        for weeks in 16..=34 {
            let b = Biometry::at_weeks(f64::from(weeks));
            let cm = |mm: f32| f64::from(mm) / 10.0;
            let (bpd, hc) = (cm(b.biparietal_mm), cm(b.head_circumference_mm));
            let (ac, fl) = (cm(b.abdominal_circumference_mm), cm(b.femur_mm));
            for (what, age, within) in [
                ("BPD", 9.54 + 1.482 * bpd + 0.1676 * bpd * bpd, 0.6),
                ("HC", 8.96 + 0.540 * hc + 0.0003 * hc.powi(3), 1.5),
                ("AC", 8.14 + 0.753 * ac + 0.0036 * ac * ac, 0.6),
                ("FL", 10.35 + 2.460 * fl + 0.170 * fl * fl, 0.6),
            ] {
                assert!((age - f64::from(weeks)).abs() < within, "{what} at {weeks} weeks gives {age}");
            }
            // Femur over abdomen is 22 ± 2 % from 21 weeks on (Hadlock et al., Am J Roentgenol 141:979, 1983).
            assert!(weeks < 21 || (20.0..24.0).contains(&(100.0 * fl / ac)), "{weeks}");
        }
    }

    #[test]
    fn growing_sizes_grow_every_week() {
        for weeks in 16..34 {
            let [a, b] = [weeks, weeks + 1].map(|w| Biometry::at_weeks(f64::from(w)));
            let sizes = |b: &Biometry| {
                [
                    b.biparietal_mm,
                    b.head_circumference_mm,
                    b.occipitofrontal_mm,
                    b.cerebellum_mm,
                    b.binocular_mm,
                    b.ocular_mm,
                    b.abdominal_circumference_mm,
                    b.spine_mm,
                    b.femur_mm,
                    b.tibia_mm,
                    b.fibula_mm,
                    b.humerus_mm,
                    b.radius_mm,
                    b.ulna_mm,
                ]
            };
            assert!(sizes(&a).iter().zip(sizes(&b)).all(|(&a, b)| b > a), "from week {weeks}");
        }
    }
}
